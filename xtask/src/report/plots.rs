//! The plots, as SVG that follows the page's light or dark colours.

use super::axis::{LogAxis, short};
use super::break_even::{Cost, Interval};
use super::canvas::{Area, FAINT, GLYPH, INK, SIZE, chart, colour, draw, failed, text};
use super::model::{Engine, pareto_front};
use crate::results::Source;
use anyhow::Result;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) x: (f64, f64),
    pub(crate) y: (f64, f64),
}

impl Frame {
    const fn around((x, y): (f64, f64), half_width: f64, half_height: f64) -> Self {
        Self { x: (x - half_width, x + half_width), y: (y - half_height, y + half_height) }
    }

    fn overlap(&self, other: &Self) -> f64 {
        let along = |a: (f64, f64), b: (f64, f64)| (a.1.min(b.1) - a.0.max(b.0)).max(0.0);
        along(self.x, other.x) * along(self.y, other.y)
    }

    fn outside(&self, page: &Self) -> f64 {
        let area = (self.x.1 - self.x.0) * (self.y.1 - self.y.0);
        area - self.overlap(page)
    }
}

/// Finds a place for each label near its point where it covers neither points nor labels.
/// Returns the middle of each.
pub(crate) fn place_labels(
    points: &[(f64, f64)],
    labels: &[String],
    size: f64,
    page: Frame,
) -> Vec<(f64, f64)> {
    let mut taken: Vec<Frame> = points.iter().map(|&p| Frame::around(p, 7.0, 7.0)).collect();
    let mut places = Vec::with_capacity(points.len());
    for (i, (&(x, y), label)) in points.iter().zip(labels).enumerate() {
        let half_width = label.chars().count() as f64 * size * GLYPH / 2.0 + 1.0;
        let half_height = size * 0.6;
        let mut best: Option<(f64, (f64, f64), Frame)> = None;
        for ring in 0..7 {
            for step in 0..16 {
                // To the right first, then around the point in both directions.
                let turn = f64::from((step + 1) / 2) * if step % 2 == 0 { 1.0 } else { -1.0 };
                let angle = turn * std::f64::consts::TAU / 16.0;
                let reach = 10.0 + 13.0 * f64::from(ring);
                let centre = (
                    x + angle.cos() * (reach + half_width),
                    y + angle.sin() * (reach + half_height * 0.4),
                );
                let frame = Frame::around(centre, half_width, half_height);
                let covered: f64 = taken
                    .iter()
                    .enumerate()
                    .filter(|&(other, _)| other != i)
                    .map(|(_, other)| frame.overlap(other))
                    .sum();
                let penalty = covered * 4.0
                    + frame.outside(&page) * 8.0
                    + f64::from(ring) * 12.0
                    + f64::from(step) * 0.5;
                if best.as_ref().is_none_or(|(known, ..)| penalty < *known) {
                    best = Some((penalty, centre, frame));
                }
            }
        }
        if let Some((_, centre, frame)) = best {
            taken.push(frame);
            places.push(centre);
        }
    }
    places
}

#[expect(clippy::cast_possible_truncation, reason = "saturates; pixels are few")]
fn pixel((x, y): (f64, f64)) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

/// Build time against the mean time of a ray: one point an engine, the front of those that
/// nothing beats in both drawn through them.
pub(crate) fn scatter(engines: &[(Engine<'_>, Cost)], mix: &str) -> Result<String> {
    let nanoseconds = |cost: &Cost| cost.per_ray * 1e6;
    draw("Build time against trace time", |area| {
        let x = LogAxis::around(engines.iter().map(|(_, c)| c.once), 0.08);
        let y = LogAxis::around(engines.iter().map(|(_, c)| nanoseconds(c)), 0.08);
        let y_label = format!("time per ray, ns ({mix})");
        let mut chart = chart(area, (x, y), ("mesh to traversable structure, ms", &y_label), 14)?;

        let costs: Vec<_> = engines.iter().map(|(_, c)| (c.once, nanoseconds(c))).collect();
        let mut front: Vec<_> = (costs.iter().zip(pareto_front(&costs)))
            .filter_map(|(&cost, on_front)| on_front.then_some(cost))
            .collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart
            .draw_series(DashedLineSeries::new(front, 4, 4, FAINT.stroke_width(1)))
            .map_err(failed)?;

        let at: Vec<_> = costs
            .iter()
            .map(|cost| {
                let (x, y) = chart.backend_coord(cost);
                (f64::from(x), f64::from(y))
            })
            .collect();
        let labels: Vec<_> = engines.iter().map(|(e, _)| e.label()).collect();
        let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
        let page = Frame { x: (72.0, width - 4.0), y: (6.0, height - 56.0) };
        let places = place_labels(&at, &labels, 12.0, page);
        for (((engine, _), (&point, &place)), label) in
            engines.iter().zip(at.iter().zip(&places)).zip(&labels)
        {
            let colour = colour(engine.source, engine.builder);
            let far = (place.0 - point.0).abs() - label.len() as f64 * 12.0 * GLYPH / 2.0;
            if far.max((place.1 - point.1).abs()) > 22.0 {
                let line = PathElement::new([pixel(point), pixel(place)], colour.mix(0.5));
                area.draw(&line).map_err(failed)?;
            }
            if engine.is_peers_own() {
                area.draw(&TriangleMarker::new(pixel(point), 7, colour.filled()))
                    .map_err(failed)?;
            } else if engine.source == Source::Niwaki {
                area.draw(&Circle::new(pixel(point), 5, colour.filled())).map_err(failed)?;
            } else {
                area.draw(&Circle::new(pixel(point), 4, colour.stroke_width(2))).map_err(failed)?;
            }
            let style = text(12.0, INK).pos(Pos::new(HPos::Center, VPos::Center));
            area.draw(&Text::new(label.clone(), pixel(place), style)).map_err(failed)?;
        }
        Ok(())
    })
}

/// The numbers of rays that the curves of total time cover: two decades around where the best
/// structure changes, or where tracing takes as long as building.
pub(crate) fn ray_range(costs: &[Cost], intervals: &[Interval]) -> (f64, f64) {
    let changes = intervals.iter().map(|i| i.from).filter(|&x| x > 0.0);
    let evens = costs.iter().map(|c| c.once / c.per_ray).filter(|&x| x > 0.0 && x.is_finite());
    let (low, high) = changes
        .chain(evens)
        .fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
    if low > high { (1e3, 1e9) } else { (low / 30.0, high * 10.0) }
}

/// Evenly spread numbers of rays on a logarithmic axis.
pub(crate) fn ray_counts((from, to): (f64, f64), count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| from * (to / from).powf(f64::from(i) / f64::from(count - 1)))
}

/// What the curves of total time show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Totals {
    /// Milliseconds.
    Absolute,
    /// Times the best total at that number of rays.
    Relative,
}

/// How far the axis of relative totals reaches: to where each curve is at its best, within reason.
fn most_relative(costs: &[Cost], range: (f64, f64)) -> f64 {
    let best = |rays: f64| costs.iter().map(|c| c.total(rays)).fold(f64::INFINITY, f64::min);
    let lowest = |cost: &Cost| {
        ray_counts(range, 50).map(|r| cost.total(r) / best(r)).fold(f64::INFINITY, f64::min)
    };
    costs.iter().map(|cost| 1.3 * lowest(cost)).fold(0.0, f64::max).clamp(3.0, 10.0)
}

/// Total time (build and trace) against the number of rays; marks where the best changes.
pub(crate) fn totals(
    engines: &[(Engine<'_>, Cost)],
    intervals: &[Interval],
    kind: Totals,
) -> Result<String> {
    let costs: Vec<_> = engines.iter().map(|(_, c)| *c).collect();
    let range = ray_range(&costs, intervals);
    let best = |rays: f64| costs.iter().map(|c| c.total(rays)).fold(f64::INFINITY, f64::min);
    let value = |cost: &Cost, rays: f64| match kind {
        Totals::Absolute => cost.total(rays),
        Totals::Relative => cost.total(rays) / best(rays),
    };
    let (y, y_label, description) = match kind {
        Totals::Absolute => {
            let ends = costs.iter().flat_map(|c| [c.total(range.0), c.total(range.1)]);
            (LogAxis::around(ends, 0.03), "build + trace, ms", "Total time against number of rays")
        }
        Totals::Relative => (
            LogAxis::exactly(0.93..most_relative(&costs, range)),
            "total time ÷ the best total there",
            "Total time relative to the best against number of rays",
        ),
    };
    let most = y.range().end;
    draw(description, |area| {
        let x = LogAxis::exactly(range.0..range.1);
        let mut chart = chart(area, (x, y), ("rays traced", y_label), 170)?;
        let mut ends = Vec::new();
        for (engine, cost) in engines {
            let colour = colour(engine.source, engine.builder);
            let is_best = intervals.iter().any(|i| engines[i.best].0 == *engine);
            let width = if is_best { 3 } else { 1 };
            let points: Vec<_> = ray_counts(range, 200)
                .map(|rays| (rays, value(cost, rays)))
                .filter(|&(_, y)| y <= most)
                .collect();
            if let Some(&(_, y)) = points.last().filter(|(x, _)| *x > range.1 * 0.99) {
                ends.push((engine, chart.backend_coord(&(range.1, y)).1));
            } else {
                // It leaves through the top; name it there, after those that end on the right.
                ends.push((engine, i32::MIN));
            }
            let own = engine.is_peers_own() || engine.source == Source::Niwaki;
            if own {
                chart.draw_series(LineSeries::new(points, colour.stroke_width(width)))
            } else {
                chart.draw_series(LineSeries::new(points, colour.mix(0.55).stroke_width(width)))
            }
            .map_err(failed)?;
        }
        for interval in intervals.iter().filter(|i| i.from > 0.0) {
            let rays = interval.from;
            let at = chart.backend_coord(&(rays, value(&costs[interval.best], rays)));
            area.draw(&Circle::new(at, 4, INK.filled())).map_err(failed)?;
            let (dy, v_pos) = match kind {
                Totals::Absolute => (8, VPos::Top),
                // Below is the axis.
                Totals::Relative => (-10, VPos::Bottom),
            };
            let style = text(12.0, INK).pos(Pos::new(HPos::Center, v_pos));
            area.draw(&Text::new(short(rays), (at.0, at.1 + dy), style)).map_err(failed)?;
        }
        name_ends(area, &mut ends)
    })
}

/// Names curves beside their right ends, spread so that no two names overlap.
fn name_ends(area: &Area<'_>, ends: &mut [(&Engine<'_>, i32)]) -> Result<()> {
    const STEP: i32 = 16;
    ends.sort_by_key(|&(_, y)| y);
    let bottom = i32::try_from(SIZE.1)? - 54;
    let mut ys: Vec<i32> = Vec::with_capacity(ends.len());
    for &(_, y) in ends.iter() {
        let lowest = ys.last().map_or(12, |last| last + STEP);
        ys.push(y.max(lowest));
    }
    let mut limit = bottom;
    for y in ys.iter_mut().rev() {
        *y = (*y).min(limit);
        limit = *y - STEP;
    }
    let right = i32::try_from(SIZE.0)? - 168;
    for ((engine, end), y) in ends.iter().zip(ys) {
        let colour = colour(engine.source, engine.builder);
        // A long line to a far name would cross all the others; the colour tells.
        let near = (i64::from(*end) - i64::from(y)).abs() < 40;
        let from = if near { (right - 9, *end) } else { (right, y) };
        let line = PathElement::new([from, (right, y), (right + 14, y)], colour.stroke_width(2));
        area.draw(&line).map_err(failed)?;
        let style = text(12.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(engine.label(), (right + 18, y), style)).map_err(failed)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::break_even::lower_envelope;

    fn engines() -> Vec<(Engine<'static>, Cost)> {
        let engine = |builder, kernel, source, once, per_ray| {
            (Engine { source, builder, kernel }, Cost { once, per_ray })
        };
        vec![
            engine("lbvh", "avx2", Source::Niwaki, 10.0, 8e-4),
            engine("sweep", "avx2", Source::Niwaki, 200.0, 4e-4),
            engine("medium", "embree", Source::Embree, 100.0, 3e-4),
            engine("medium", "avx2", Source::Embree, 130.0, 5e-4),
        ]
    }

    #[test]
    fn plots_name_every_engine_and_follow_the_page() {
        let engines = engines();
        let costs: Vec<_> = engines.iter().map(|(_, c)| *c).collect();
        let intervals = lower_envelope(&costs);
        for svg in [
            scatter(&engines, "camera").unwrap(),
            totals(&engines, &intervals, Totals::Absolute).unwrap(),
            totals(&engines, &intervals, Totals::Relative).unwrap(),
        ] {
            for label in ["lbvh", "sweep", "embree:medium", "embree:medium tree"] {
                assert!(svg.contains(&format!("\n{label}\n")), "{label} in {svg}");
            }
            assert!(svg.contains("var(--ink") && !svg.contains("#01020"));
            assert!(svg.starts_with("<svg ") && svg.contains("aria-label"));
        }
    }

    #[test]
    fn labels_of_points_that_coincide_are_kept_apart() {
        let points = [(300.0, 200.0); 6];
        let labels: Vec<_> = (0..6).map(|i| format!("label {i}")).collect();
        let page = Frame { x: (0.0, 700.0), y: (0.0, 400.0) };
        let places = place_labels(&points, &labels, 12.0, page);
        let frames: Vec<_> = places.iter().map(|&p| Frame::around(p, 24.0, 7.0)).collect();
        for (i, a) in frames.iter().enumerate() {
            assert!(frames[..i].iter().all(|b| a.overlap(b) == 0.0), "{places:?}");
        }
    }

    #[test]
    fn the_range_covers_all_changes() {
        let engines = engines();
        let costs: Vec<_> = engines.iter().map(|(_, c)| *c).collect();
        let intervals = lower_envelope(&costs);
        let (from, to) = ray_range(&costs, &intervals);
        assert!(intervals.iter().filter(|i| i.from > 0.0).all(|i| from < i.from && i.from < to));
        let counts: Vec<_> = ray_counts((from, to), 50).collect();
        assert!((counts[0] - from).abs() < 1e-9 * from && (counts[49] - to).abs() < 1e-9 * to);
    }
}
