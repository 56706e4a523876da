//! Plots of points in families, with the Pareto front.

use crate::report::axis::LogAxis;
use crate::report::canvas::{
    FAINT, INK, LEGEND, PALETTE, SIZE, chart, draw, failed, legend, marker, text,
};
use crate::report::{Frame, place_labels};
use anyhow::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A point of a plot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dot<'a> {
    /// Points of the same family share a marker, and are joined by a line, in their order.
    pub(super) family: &'a str,
    pub(super) label: &'a str,
    pub(super) x: f64,
    pub(super) y: f64,
    /// Ringed and joined by the dashed line.
    pub(super) on_front: bool,
    /// Its label is shown.
    pub(super) named: bool,
}

/// What a plot shows beside its points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look<'a> {
    /// What x and y are.
    pub(super) axes: (&'a str, &'a str),
    /// Where all below this stands on the axis of x, and under which name, as a logarithm has no 0.
    pub(super) least: Option<(f64, &'static str)>,
    /// Families whose points are not joined.
    pub(super) loose: &'a [&'a str],
}

fn families<'a>(dots: &[Dot<'a>]) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for dot in dots {
        if !names.contains(&dot.family) {
            names.push(dot.family);
        }
    }
    names
}

/// A plot of points by two quantities, with a line through those of each family and one along the
/// front.
pub(super) fn plot(dots: &[Dot<'_>], look: &Look<'_>, description: &str) -> Result<String> {
    let families = families(dots);
    let least = look.least.map_or(0.0, |(least, _)| least);
    let dots: Vec<Dot<'_>> = dots.iter().map(|dot| Dot { x: dot.x.max(least), ..*dot }).collect();
    draw(description, |area| {
        let x = LogAxis::around(dots.iter().map(|dot| dot.x), 0.05).with_least(look.least);
        let y = LogAxis::around(dots.iter().map(|dot| dot.y), 0.05);
        let mut chart = chart(area, (x, y), look.axes, LEGEND)?;
        let joined = |family: &&str| !look.loose.contains(family);
        for (i, family) in families.iter().enumerate().filter(|(_, family)| joined(family)) {
            let colour = PALETTE[i % PALETTE.len()].mix(0.5);
            let line = dots.iter().filter(|dot| dot.family == *family).map(|dot| (dot.x, dot.y));
            chart.draw_series(LineSeries::new(line, colour)).map_err(failed)?;
        }
        let mut front: Vec<(f64, f64)> =
            dots.iter().filter(|dot| dot.on_front).map(|dot| (dot.x, dot.y)).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        let line = DashedLineSeries::new(front, 4, 4, FAINT.stroke_width(1));
        chart.draw_series(line).map_err(failed)?;
        let mut labels = Vec::new();
        for dot in &dots {
            let at = chart.backend_coord(&(dot.x, dot.y));
            let family = families.iter().position(|f| *f == dot.family).unwrap_or_default();
            marker(area, at, family, 3)?;
            if dot.on_front {
                area.draw(&Circle::new(at, 6, INK.stroke_width(1))).map_err(failed)?;
            }
            if dot.named {
                labels.push(((f64::from(at.0), f64::from(at.1)), dot.label.to_owned()));
            }
        }
        let (at, names): (Vec<_>, Vec<_>) = labels.into_iter().unzip();
        let page =
            Frame { x: (72.0, f64::from(SIZE.0 - LEGEND)), y: (6.0, f64::from(SIZE.1) - 56.0) };
        for ((x, y), name) in place_labels(&at, &names, 11.0, page).into_iter().zip(names) {
            let style = text(11.0, INK).pos(Pos::new(HPos::Center, VPos::Center));
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let at = (x as i32, y as i32);
            area.draw(&Text::new(name, at, style)).map_err(failed)?;
        }
        legend(area, families.iter().copied().enumerate())
    })
}
