//! Text as cells: what `present.wgsl` writes over the picture.

use embedded_graphics::{
    Drawable,
    draw_target::DrawTarget,
    geometry::{OriginDimensions, Size},
    mono_font::{MonoTextStyle, ascii::FONT_7X13},
    pixelcolor::BinaryColor,
    prelude::{Pixel, Point},
    text::{Baseline, Text},
};

/// Pixels of a character.
pub(super) const GLYPH: [u32; 2] = [7, 13];

/// The first character of the font, and how many there are.
const FIRST: u8 = b' ';
const GLYPHS: u8 = 95;

/// Pixels between a panel's text and its border, and between panels and the window.
const MARGIN: u32 = 6;

/// Colours of text; `present.wgsl` has the same in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ink {
    Plain,
    Faint,
    Warn,
}

/// Where a panel stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Corner {
    TopLeft,
    TopRight,
    BottomLeft,
    BottomRight,
    Middle,
}

/// A rectangle of cells: the twin of `Panel` in `present.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Panel {
    /// Its upper left corner in pixels of the window.
    pub(super) at: [i32; 2],
    /// Its size in cells.
    pub(super) cells: [u32; 2],
    /// Where its cells begin.
    pub(super) first: u32,
    /// Pixels of the window a pixel of the font.
    pub(super) zoom: u32,
    pub(super) margin: u32,
    pad: u32,
}

/// Lines of text with colours and bars.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines(Vec<Vec<u32>>);

/// Panels and their cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Page {
    pub(super) panels: Vec<Panel>,
    /// A character in bits 0 to 7, its ink in 8 to 15, and in 16 to 23 how many sixteenths of the
    /// cell a bar covers.
    pub(super) cells: Vec<u32>,
}

impl Lines {
    /// Begins a line.
    pub(super) fn line(&mut self) -> &mut Self {
        self.0.push(Vec::new());
        self
    }

    /// Writes on the last line. What is not ASCII becomes a question mark.
    pub(super) fn write(&mut self, text: &str, ink: Ink) -> &mut Self {
        let cell = |c: char| {
            let printable = c.is_ascii() && !c.is_ascii_control();
            u32::from(if printable { c } else { '?' }) | (ink as u32) << 8
        };
        if let Some(line) = self.0.last_mut() {
            line.extend(text.chars().map(cell));
        }
        self
    }

    /// Draws a bar on the last line, a share of so many cells long.
    pub(super) fn bar(&mut self, share: f64, cells: u32) {
        let Some(line) = self.0.last_mut() else { return };
        let all = f64::from(16 * cells);
        #[expect(clippy::cast_possible_truncation, reason = "at most 16 a cell")]
        #[expect(clippy::cast_sign_loss, reason = "clamped")]
        let mut left = (share * all).ceil().clamp(1.0, all) as u32;
        while left > 0 {
            let covered = left.min(16);
            line.push(u32::from(b' ') | covered << 16);
            left -= covered;
        }
    }

    /// True without a line.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Page {
    /// Puts lines into a corner of a window.
    pub(super) fn put(&mut self, lines: &Lines, corner: Corner, window: [u32; 2], zoom: u32) {
        let columns = lines.0.iter().map(Vec::len).max().unwrap_or(0);
        let cells = [niwaki_core::to_u32(columns), niwaki_core::to_u32(lines.0.len())];
        if cells.contains(&0) {
            return;
        }
        let size: [i32; 2] = std::array::from_fn(|k| {
            let pixels = (cells[k] * GLYPH[k] + 2 * MARGIN).saturating_mul(zoom);
            i32::try_from(pixels).unwrap_or(i32::MAX)
        });
        let margin = i32::try_from(MARGIN * zoom).unwrap_or(0);
        let window = window.map(|side| i32::try_from(side).unwrap_or(i32::MAX));
        let high = |k: usize| window[k].saturating_sub(size[k]).saturating_sub(margin);
        let at = match corner {
            Corner::TopLeft => [margin, margin],
            Corner::TopRight => [high(0), margin],
            Corner::BottomLeft => [margin, high(1)],
            Corner::BottomRight => [high(0), high(1)],
            Corner::Middle => [0, 1].map(|k| window[k].saturating_sub(size[k]) / 2),
        };
        let first = niwaki_core::to_u32(self.cells.len());
        self.panels.push(Panel { at, cells, first, zoom, margin: MARGIN, pad: 0 });
        for line in &lines.0 {
            self.cells.extend(line);
            let rest = columns - line.len();
            self.cells.extend(std::iter::repeat_n(u32::from(b' '), rest));
        }
    }
}

/// The font: for each character 13 words, a row each, bit 0 on the left.
pub(super) fn font() -> Vec<u32> {
    let mut glyphs = Vec::with_capacity(usize::from(GLYPHS) * GLYPH[1] as usize);
    for c in FIRST..FIRST + GLYPHS {
        let mut rows = Rows([0; GLYPH[1] as usize]);
        let text = char::from(c).to_string();
        let style = MonoTextStyle::new(&FONT_7X13, BinaryColor::On);
        // Drawing into memory cannot fail.
        let drawn = Text::with_baseline(&text, Point::zero(), style, Baseline::Top).draw(&mut rows);
        debug_assert!(drawn.is_ok());
        glyphs.extend(rows.0);
    }
    glyphs
}

/// The rows of one character.
struct Rows([u32; GLYPH[1] as usize]);

impl OriginDimensions for Rows {
    fn size(&self) -> Size {
        Size::new(GLYPH[0], GLYPH[1])
    }
}

impl DrawTarget for Rows {
    type Color = BinaryColor;
    type Error = std::convert::Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Self::Error>
    where
        I: IntoIterator<Item = Pixel<Self::Color>>,
    {
        for Pixel(at, colour) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(at.x), usize::try_from(at.y)) else { continue };
            if let Some(row) = self.0.get_mut(y)
                && x < GLYPH[0]
                && colour.is_on()
            {
                *row |= 1 << x;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_but_the_blank_has_pixels_of_its_own() {
        let font = font();
        let glyph = |c: u8| {
            let from = usize::from(c - FIRST) * GLYPH[1] as usize;
            font[from..from + GLYPH[1] as usize].to_vec()
        };
        assert!(glyph(b' ').iter().all(|row| *row == 0));
        let mut all: Vec<_> = (FIRST..FIRST + GLYPHS).map(glyph).collect();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), usize::from(GLYPHS));
        // An L: a stem on the left, a foot at the end of it.
        let l: Vec<u32> = glyph(b'L').into_iter().filter(|row| *row != 0).collect();
        assert!(l.len() > 6 && l[..l.len() - 1].iter().all(|row| row.count_ones() == 1));
        assert!(l[l.len() - 1].count_ones() > 3);
    }

    #[test]
    fn panels_stand_in_their_corners_and_lines_are_as_long_as_the_longest() {
        let mut lines = Lines::default();
        lines.line().write("ab", Ink::Plain).write("c", Ink::Warn);
        lines.line().write("\u{e9}", Ink::Faint);
        let mut page = Page::default();
        for corner in [Corner::TopLeft, Corner::BottomRight, Corner::Middle, Corner::TopRight] {
            page.put(&lines, corner, [1000, 500], 2);
        }
        let size = [2 * (3 * 7 + 12), 2 * (2 * 13 + 12)];
        assert_eq!(page.panels[0].at, [12, 12]);
        assert_eq!(page.panels[1].at, [1000 - 12 - size[0], 500 - 12 - size[1]]);
        assert_eq!(page.panels[2].at, [(1000 - size[0]) / 2, (500 - size[1]) / 2]);
        assert_eq!(page.panels[3].at, [1000 - 12 - size[0], 12]);
        assert_eq!((page.panels[1].cells, page.panels[1].first), ([3, 2], 6));
        let faint = u32::from(b'?') | 1 << 8;
        let warn = u32::from(b'c') | 2 << 8;
        assert_eq!(page.cells[2..4], [warn, faint]);
        // Nothing to write is no panel.
        page.put(&Lines::default(), Corner::Middle, [0, 0], 1);
        assert_eq!(page.panels.len(), 4);
    }

    #[test]
    fn bars_are_as_long_as_their_share() {
        for (share, sixteenths) in [(0.0, 1), (0.5, 48), (1.0, 96), (7.0, 96), (-1.0, 1)] {
            let mut lines = Lines::default();
            lines.line().bar(share, 6);
            let covered: u32 = lines.0[0].iter().map(|cell| cell >> 16 & 0xff).sum();
            assert_eq!(covered, sixteenths, "{share}");
        }
    }
}
