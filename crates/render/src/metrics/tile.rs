//! Where an image is worst.

use super::ErrorMap;

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tile {
    /// The leftmost column.
    pub x: u32,
    /// The topmost row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Tile {
    /// The tile with `margin` more pixels on each side, cut to an image of this size.
    #[must_use]
    pub const fn grown(self, margin: u32, width: u32, height: u32) -> Self {
        let (left, right) = grown(self.x, self.width, margin, width);
        let (top, bottom) = grown(self.y, self.height, margin, height);
        Self { x: left, y: top, width: right - left, height: bottom - top }
    }

    /// The part that lies in an image of this size; without pixels if none does.
    #[must_use]
    pub const fn within(self, width: u32, height: u32) -> Self {
        self.grown(0, width, height)
    }
}

/// From and to, with a margin, up to a limit.
const fn grown(from: u32, count: u32, margin: u32, limit: u32) -> (u32, u32) {
    let to = from.saturating_add(count).saturating_add(margin);
    let to = if to < limit { to } else { limit };
    let from = from.saturating_sub(margin);
    (if from < to { from } else { to }, to)
}

impl ErrorMap {
    /// The square of `side` pixels (less where the map is smaller) with the largest mean error, and
    /// that mean. All positions are tried; of equals, the first by rows from the top wins. `None`
    /// if the map or the square has no pixels.
    ///
    /// The mean of an image hides an artifact that is small and plain to see; this finds it.
    ///
    /// ```
    /// use niwaki_core::glam::Vec3;
    /// use niwaki_render::{Image, metrics::{FlipSettings, flip}};
    /// let black = Image::black(32, 16);
    /// let mut spot = black.clone();
    /// spot.set(20, 9, Vec3::ONE);
    /// let map = flip(&spot, &black, &FlipSettings::default())?;
    /// let (tile, mean) = map.worst_tile(4).ok_or("the map has pixels")?;
    /// assert!((17..=20).contains(&tile.x) && (6..=9).contains(&tile.y) && mean > map.mean());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn worst_tile(&self, side: u32) -> Option<(Tile, f64)> {
        let (width, height) = (side.min(self.width), side.min(self.height));
        if width == 0 || height == 0 {
            return None;
        }
        let sums = Sums::of(self);
        let mut worst: Option<(Tile, f64)> = None;
        for y in 0..=self.height - height {
            for x in 0..=self.width - width {
                let tile = Tile { x, y, width, height };
                let sum = sums.of_tile(tile);
                if worst.is_none_or(|(_, most)| sum > most) {
                    worst = Some((tile, sum));
                }
            }
        }
        worst.map(|(tile, _)| (tile, self.mean_of(tile)))
    }

    /// The mean error of the part of a tile that lies in the map; 0 if none does.
    #[must_use]
    pub fn mean_of(&self, tile: Tile) -> f64 {
        let Tile { x, y, width, height } = tile.within(self.width, self.height);
        let row = |y: u32| {
            let start = y as usize * self.width as usize + x as usize;
            self.values[start..start + width as usize].iter().map(|&e| f64::from(e)).sum::<f64>()
        };
        let sum: f64 = (y..y + height).map(row).sum();
        sum / (f64::from(width) * f64::from(height)).max(1.0)
    }
}

/// Sums over all rectangles that begin at the top left (Crow 1984, "Summed-Area Tables for Texture
/// Mapping"), so that the sum over any other takes four of them.
struct Sums {
    /// One more than the map has columns: those of no columns and of no rows are 0.
    width: usize,
    sums: Vec<f64>,
}

impl Sums {
    fn of(map: &ErrorMap) -> Self {
        let width = map.width as usize + 1;
        let mut sums = vec![0.0; width];
        for (y, row) in map.values.chunks_exact(map.width as usize).enumerate() {
            let mut of_row = 0.0;
            sums.push(0.0);
            for (x, &error) in row.iter().enumerate() {
                of_row += f64::from(error);
                sums.push(sums[y * width + x + 1] + of_row);
            }
        }
        Self { width, sums }
    }

    fn of_tile(&self, tile: Tile) -> f64 {
        let (left, right) = (tile.x as usize, (tile.x + tile.width) as usize);
        let (top, bottom) = (tile.y as usize, (tile.y + tile.height) as usize);
        let at = |x: usize, y: usize| self.sums[y * self.width + x];
        at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> ErrorMap {
        let row = |y: u32| (0..width).map(move |x| (x, y));
        let values = (0..height).flat_map(row).map(|(x, y)| value(x, y)).collect();
        ErrorMap { width, height, values }
    }

    #[test]
    fn the_worst_tile_is_that_of_trying_all() {
        // Values of eighths, so that sums in any order are exact.
        for seed in 0..20_u32 {
            let noise = |x: u32, y: u32| {
                let h = (x * 7_919 + y * 104_729 + seed * 1_299_709).wrapping_mul(2_654_435_761);
                (h >> 29) as f32 / 8.0
            };
            let (width, height) = (5 + seed % 7, 4 + seed % 5);
            let map = map(width, height, noise);
            for side in [1, 2, 3, 4] {
                let (tile, mean) = map.worst_tile(side).unwrap();
                let mut best = (Tile { x: 0, y: 0, width: side, height: side }, -1.0);
                for y in 0..=height - side {
                    for x in 0..=width - side {
                        let tile = Tile { x, y, width: side, height: side };
                        if map.mean_of(tile) > best.1 {
                            best = (tile, map.mean_of(tile));
                        }
                    }
                }
                assert_eq!((tile, mean), best, "seed {seed}, side {side}");
            }
        }
    }

    #[test]
    fn tiles_are_cut_to_the_map() {
        let whole = map(6, 3, |_, _| 0.5);
        let (tile, mean) = whole.worst_tile(100).unwrap();
        assert_eq!((tile, mean), (Tile { x: 0, y: 0, width: 6, height: 3 }, 0.5));
        assert_eq!(whole.worst_tile(0), None);
        assert_eq!(map(0, 0, |_, _| 0.0).worst_tile(4), None);
        let corner = Tile { x: 4, y: 1, width: 9, height: 9 };
        assert_eq!(whole.mean_of(corner), 0.5);
        assert_eq!(whole.mean_of(Tile { x: 6, ..corner }), 0.0);
        assert_eq!(whole.mean_of(Tile { x: u32::MAX, width: u32::MAX, ..corner }), 0.0);
    }

    #[test]
    fn tiles_grow_up_to_the_border() {
        let tile = Tile { x: 2, y: 3, width: 4, height: 5 };
        assert_eq!(tile.grown(1, 100, 100), Tile { x: 1, y: 2, width: 6, height: 7 });
        assert_eq!(tile.grown(9, 12, 100), Tile { x: 0, y: 0, width: 12, height: 17 });
        let outside = Tile { x: 50, ..tile }.within(10, 10);
        assert_eq!((outside.width, outside.height), (0, 5));
    }
}
