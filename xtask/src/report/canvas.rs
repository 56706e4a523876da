//! What all plots share: the size, colours that follow the page, axes.

use super::axis::{Axis, LogAxis};
use crate::results::Source;
use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Chart<'a, 'b, X = LogAxis, Y = LogAxis> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, Y>>;

/// Width and height in CSS pixels; the page scales them down where it is narrower.
pub(crate) const SIZE: (u32, u32) = (720, 440);
/// Size of text: plotters divides by this to get CSS pixels.
pub(crate) const EM: f64 = 1.24;
/// Widths of a glyph of the page's font, on average, in text sizes; used to keep labels apart.
pub(crate) const GLYPH: f64 = 0.56;

// Stand-ins that `themed` replaces by the page's colours.
pub(crate) const INK: RGBColor = RGBColor(1, 2, 3);
pub(crate) const FAINT: RGBColor = RGBColor(1, 2, 4);
pub(crate) const GRID: RGBColor = RGBColor(1, 2, 5);

/// The colour of a builder, the same in all plots and legible on white and on black.
pub(crate) fn colour(source: Source, builder: &str) -> RGBColor {
    match (source, builder) {
        (Source::Niwaki, "sweep") => RGBColor(120, 128, 138),
        (Source::Niwaki, "binned") => RGBColor(214, 125, 20),
        (Source::Niwaki, "lbvh") => RGBColor(196, 68, 60),
        (Source::Niwaki, "median_object") => RGBColor(166, 124, 92),
        (Source::Niwaki, "median_spatial") => RGBColor(190, 150, 60),
        (Source::Niwaki, "bonsai") => RGBColor(98, 168, 62),
        (Source::Niwaki, "bonsai_p") => RGBColor(20, 150, 100),
        (Source::Niwaki, "bonsai_p_star") => RGBColor(16, 158, 158),
        (Source::Niwaki, "bonsai_s") => RGBColor(0, 118, 60),
        (Source::Niwaki, "sweep_pre") => RGBColor(84, 92, 112),
        (Source::Niwaki, "binned_pre") => RGBColor(150, 90, 20),
        (Source::Niwaki, "sbvh") => RGBColor(206, 66, 130),
        (Source::Niwaki, "sbvh_sweep") => RGBColor(150, 50, 110),
        (Source::Niwaki, "aac_hq") => RGBColor(128, 110, 200),
        (Source::Niwaki, "aac_lq") => RGBColor(176, 160, 226),
        (Source::Niwaki, _) => RGBColor(110, 140, 90),
        (Source::Embree, "low") => RGBColor(110, 160, 235),
        (Source::Embree, "high") => RGBColor(40, 85, 200),
        (Source::Embree, _) => RGBColor(62, 122, 230),
        (Source::Obvhs, _) => RGBColor(160, 84, 200),
    }
}

/// Colours of lines and points that belong together; they repeat with another marker.
pub(crate) const PALETTE: [RGBColor; 10] = [
    RGBColor(62, 122, 230),
    RGBColor(214, 125, 20),
    RGBColor(20, 150, 100),
    RGBColor(196, 68, 60),
    RGBColor(160, 84, 200),
    RGBColor(150, 110, 80),
    RGBColor(210, 90, 160),
    RGBColor(110, 140, 60),
    RGBColor(16, 158, 178),
    RGBColor(120, 128, 138),
];

/// A marker whose shape and colour tell the number in the legend.
pub(crate) fn marker(area: &Area<'_>, at: (i32, i32), number: usize, size: i32) -> Result<()> {
    let colour = PALETTE[number % PALETTE.len()];
    match number / PALETTE.len() {
        0 => area.draw(&Circle::new(at, size, colour.filled())),
        1 => area.draw(&TriangleMarker::new(at, size + 2, colour.filled())),
        2 => area.draw(&Cross::new(at, size, colour.stroke_width(2))),
        _ => {
            let (low, high) = ((at.0 - size, at.1 - size), (at.0 + size, at.1 + size));
            area.draw(&Rectangle::new([low, high], colour.filled()))
        }
    }
    .map_err(failed)
}

/// Width that the legend takes, unless its names are longer than usual.
pub(crate) const LEGEND: u32 = 134;

/// Names beside the markers of their numbers, below each other at the right, closer to each other
/// where there are many.
pub(crate) fn legend<'a>(
    area: &Area<'_>,
    entries: impl ExactSizeIterator<Item = (usize, &'a str)>,
) -> Result<()> {
    let x = f64::from(SIZE.0 - LEGEND) + 14.0;
    let pitch = ((f64::from(SIZE.1) - 24.0) / entries.len().max(1) as f64).min(18.0);
    let size = (pitch - 1.0).min(12.0);
    for (row, (number, name)) in entries.enumerate() {
        let y = 14.0 + pitch * row as f64;
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let (at, place) = ((x as i32, y as i32), ((x + 10.0) as i32, (y - 0.5 * size) as i32));
        marker(area, at, number, 4)?;
        area.draw(&Text::new(name.to_owned(), place, text(size, INK))).map_err(failed)?;
    }
    Ok(())
}

pub(crate) fn failed<E: std::fmt::Debug>(error: E) -> anyhow::Error {
    anyhow!("cannot draw a plot: {error:?}")
}

pub(crate) fn text(size: f64, colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", size * EM).into_font().color(&colour)
}

/// Replaces the stand-in colours by the page's, with fallbacks for a plot opened by itself, and
/// lets the page set the font and the size.
pub(crate) fn themed(svg: &str, description: &str) -> String {
    let mut svg = svg.to_owned();
    for (stand_in, name, fallback) in [
        ("#010203", "ink", "#1f2328"),
        ("#010204", "faint", "#59636e"),
        ("#010205", "grid", "#dde1e6"),
    ] {
        for attribute in ["fill", "stroke"] {
            svg = svg.replace(
                &format!("{attribute}=\"{stand_in}\""),
                &format!("style=\"{attribute}:var(--{name},{fallback})\""),
            );
        }
    }
    let start = svg.find("<svg ").map_or(0, |at| at + "<svg ".len());
    svg.insert_str(
        start,
        &format!("role=\"img\" aria-label=\"{}\" ", super::table::escape(description)),
    );
    svg
}

pub(crate) fn draw(
    description: &str,
    paint: impl FnOnce(&Area<'_>) -> Result<()>,
) -> Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        paint(&area)?;
        area.present().map_err(failed)?;
    }
    Ok(themed(&svg, description))
}

/// Axes with their ticks and names, and a margin at the right for a legend.
pub(crate) fn chart<'a, 'b, X: Axis, Y: Axis>(
    area: &'a Area<'b>,
    (x, y): (X, Y),
    (x_label, y_label): (&str, &str),
    right: u32,
) -> Result<Chart<'a, 'b, X, Y>> {
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(right)
        .x_label_area_size(46)
        .y_label_area_size(62)
        .build_cartesian_2d(x, y)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_labels(9)
        .y_labels(8)
        .max_light_lines(0)
        .bold_line_style(GRID)
        .axis_style(FAINT)
        .x_desc(x_label)
        .y_desc(y_label)
        .label_style(text(12.0, FAINT))
        .axis_desc_style(text(13.0, INK))
        .draw()
        .map_err(failed)?;
    Ok(chart)
}
