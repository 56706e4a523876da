//! The plots of the report.

use super::compare::{Comparison, speedups};
use super::measure::SceneResult;
use super::names::Standing;
use super::published::Item;
use crate::report::axis::LogAxis;
use crate::report::canvas::{Area, FAINT, GRID, INK, SIZE, chart, colour, draw, failed, text};
use crate::results::Source;
use anyhow::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Pixels to the right of a plot that names need.
const NAMES_WIDTH: u32 = 150;

/// The colour of a builder of ours or of a peer by its full name.
fn colour_of(name: &str) -> RGBColor {
    match name.split_once(':') {
        Some(("embree", preset)) => colour(Source::Embree, preset),
        Some(("obvhs", preset)) => colour(Source::Obvhs, preset),
        _ => colour(Source::Niwaki, name),
    }
}

fn pixels(number: u32) -> i32 {
    i32::try_from(number).unwrap_or(i32::MAX)
}

/// Names the colours at the right edge, from the top.
fn legend(area: &Area<'_>, names: &[&str]) -> Result<()> {
    let left = pixels(SIZE.0 - NAMES_WIDTH) + 12;
    let mut y = 20;
    for name in names {
        let mark = Circle::new((left, y), 5, colour_of(name).filled());
        area.draw(&mark).map_err(failed)?;
        let style = text(12.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new((*name).to_owned(), (left + 12, y), style)).map_err(failed)?;
        y += 19;
    }
    Ok(())
}

/// Every name once, in the order of appearance.
fn once<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

/// What was measured for an item's quantity besides the builder that all is relative to.
pub(crate) fn measured<'a>(
    comparisons: &'a [Comparison],
    item: Item,
    quantity: &'a str,
) -> impl Iterator<Item = (&'a Comparison, f64)> {
    comparisons
        .iter()
        .filter(move |c| c.item == item && c.quantity == quantity)
        .filter(move |c| Some(c.builder.as_str()) != item.baseline())
        .filter_map(|c| c.measured_relative.map(|measured| (c, measured)))
        // A logarithmic axis has no place for nothing.
        .filter(|(_, measured)| *measured > 0.0)
}

/// Published against measured, a point a scene and builder: on the diagonal they agree.
pub(crate) fn agreement(
    comparisons: &[Comparison],
    item: Item,
    quantity: &str,
    what: &str,
) -> Result<String> {
    let points: Vec<_> = measured(comparisons, item, quantity).collect();
    let numbers = points.iter().flat_map(|(c, measured)| [c.published_relative, *measured]);
    let axis = LogAxis::around(numbers, 0.05);
    let (x_label, y_label) = (format!("published {what}"), format!("measured {what}"));
    draw(&format!("{}: published against measured", item.title()), |area| {
        let axes = (axis.clone(), axis.clone());
        let mut chart = chart(area, axes, (&x_label, &y_label), NAMES_WIDTH)?;
        let range = plotters::coord::ranged1d::Ranged::range(&axis);
        let diagonal = [(range.start, range.start), (range.end, range.end)];
        chart
            .draw_series(DashedLineSeries::new(diagonal, 5, 4, FAINT.stroke_width(1)))
            .map_err(failed)?;
        for (c, measured) in &points {
            let at = chart.backend_coord(&(c.published_relative, *measured));
            let colour = colour_of(&c.ours);
            if c.standing.is_some_and(Standing::is_had) {
                area.draw(&Circle::new(at, 5, colour.filled())).map_err(failed)?;
            } else {
                area.draw(&Circle::new(at, 4, colour.stroke_width(1))).map_err(failed)?;
            }
        }
        legend(area, &once(points.iter().map(|(c, _)| c.ours.as_str())))
    })
}

/// A row of a plot of pairs.
pub(crate) struct PairRow {
    pub(crate) label: String,
    /// Our builder, for the colour.
    pub(crate) ours: String,
    pub(crate) published: f64,
    pub(crate) measured: Option<f64>,
}

/// Published and measured values of several builders, one below the other.
pub(crate) fn pairs(rows: &[PairRow], what: &str) -> Result<String> {
    let numbers = rows.iter().flat_map(|r| [Some(r.published), r.measured]).flatten();
    let axis = LogAxis::around(numbers.chain([1.0]), 0.05);
    draw(&format!("{what}: published and measured"), |area| {
        // Rows stand between 0.5 and their number and a half of an axis that is not drawn.
        let count = rows.len() as f64;
        let left = 196;
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(16)
            .x_label_area_size(46)
            .y_label_area_size(left)
            .build_cartesian_2d(axis, 0.0..count)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .x_labels(9)
            .max_light_lines(0)
            .disable_y_mesh()
            .disable_y_axis()
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_desc(what)
            .label_style(text(12.0, FAINT))
            .axis_desc_style(text(13.0, INK))
            .draw()
            .map_err(failed)?;
        chart
            .draw_series(LineSeries::new([(1.0, 0.0), (1.0, count)], FAINT.stroke_width(1)))
            .map_err(failed)?;
        for (at, row) in rows.iter().enumerate() {
            let y = count - 0.5 - at as f64;
            let colour = colour_of(&row.ours);
            let published = chart.backend_coord(&(row.published, y));
            if let Some(measured) = row.measured {
                let measured = chart.backend_coord(&(measured, y));
                let line = PathElement::new([published, measured], colour.stroke_width(2));
                area.draw(&line).map_err(failed)?;
                area.draw(&Circle::new(measured, 6, colour.filled())).map_err(failed)?;
            }
            // The ring on top, so that it shows where both coincide.
            area.draw(&Circle::new(published, 6, INK.stroke_width(2))).map_err(failed)?;
            let style = text(12.0, INK).pos(Pos::new(HPos::Right, VPos::Center));
            let place = (pixels(left) - 2, published.1);
            area.draw(&Text::new(row.label.clone(), place, style)).map_err(failed)?;
        }
        Ok(())
    })
}

/// Colours of the steps of a build, in order.
const STEP_COLOURS: [RGBColor; 6] = [
    RGBColor(62, 122, 230),
    RGBColor(16, 158, 158),
    RGBColor(98, 168, 62),
    RGBColor(196, 68, 60),
    RGBColor(160, 84, 200),
    RGBColor(150, 156, 164),
];

/// A bar of a stack: its name, and the shares of its steps.
pub(crate) type Bar = (String, Vec<(String, f64)>);

/// Bars of steps, one below the other, as shares of the same whole.
pub(crate) fn steps(bars: &[Bar]) -> Result<String> {
    let whole = bars
        .iter()
        .map(|(_, steps)| steps.iter().map(|s| s.1).sum::<f64>())
        .fold(f64::MIN_POSITIVE, f64::max);
    let (left, right) = (120.0, f64::from(SIZE.0) - 20.0);
    let across = |share: f64| left + share / whole * (right - left);
    #[expect(clippy::cast_possible_truncation, reason = "saturates; pixels are few")]
    let pixel = |x: f64| x.round() as i32;
    draw("Steps of the builds", |area| {
        let mut y = 20;
        for (name, steps) in bars {
            let style = text(13.0, INK).pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(name.clone(), (pixel(left) - 10, y + 30), style))
                .map_err(failed)?;
            let mut from = 0.0;
            for ((_, share), colour) in steps.iter().zip(STEP_COLOURS.iter().cycle()) {
                let corners = [(pixel(across(from)), y), (pixel(across(from + share)), y + 60)];
                area.draw(&Rectangle::new(corners, colour.filled())).map_err(failed)?;
                from += share;
            }
            let style = text(12.0, INK).pos(Pos::new(HPos::Right, VPos::Bottom));
            let sum = format!("{:.1} %", from * 100.0);
            area.draw(&Text::new(sum, (pixel(across(from)), y - 2), style)).map_err(failed)?;
            y += 95;
        }
        // The legend has the shares, which thin steps have no room for.
        let Some((_, first)) = bars.first() else { return Ok(()) };
        for (at, ((step, _), colour)) in first.iter().zip(STEP_COLOURS.iter().cycle()).enumerate() {
            let corners = [(pixel(left), y), (pixel(left) + 14, y + 14)];
            area.draw(&Rectangle::new(corners, colour.filled())).map_err(failed)?;
            let shares: Vec<_> = bars
                .iter()
                .filter_map(|(name, steps)| {
                    steps.get(at).map(|s| format!("{name} {:.1} %", s.1 * 100.0))
                })
                .collect();
            let label = format!("{step}: {}", shares.join(", "));
            let style = text(12.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(label, (pixel(left) + 22, y + 7), style)).map_err(failed)?;
            y += 24;
        }
        Ok(())
    })
}

/// Times as fast as on one thread, against the number of threads.
pub(crate) fn scaling(result: &SceneResult) -> Result<String> {
    let builders = once(result.scaling.iter().map(|s| s.builder.as_str()));
    let most = result.scaling.iter().map(|s| s.threads).max().unwrap_or(1).max(2) as f64;
    draw("Scaling with threads", |area| {
        let axis = LogAxis::exactly(0.9..most * 1.1);
        let labels = ("threads", "times as fast as on one thread");
        let mut chart = chart(area, (axis.clone(), axis), labels, NAMES_WIDTH)?;
        let ideal = [(1.0, 1.0), (most, most)];
        chart
            .draw_series(DashedLineSeries::new(ideal, 5, 4, FAINT.stroke_width(1)))
            .map_err(failed)?;
        for builder in &builders {
            let colour = colour_of(builder);
            let points: Vec<_> =
                speedups(result, builder).into_iter().map(|(n, s)| (n as f64, s)).collect();
            let marks: Vec<_> = points.iter().map(|&p| chart.backend_coord(&p)).collect();
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2))).map_err(failed)?;
            for at in marks {
                area.draw(&Circle::new(at, 4, colour.filled())).map_err(failed)?;
            }
        }
        legend(area, &builders)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::compare::{compare, result, tree};
    use crate::thesis::measure::Scaling;
    use crate::thesis::published::Published;

    #[test]
    fn plots_name_what_they_show_and_follow_the_page() {
        let trees = vec![
            tree("sweep", 100.0, 50.0, 80.0),
            tree("binned", 60.0, 55.0, 84.0),
            tree("embree:medium", 30.0, 50.0, 80.0),
        ];
        let mut plant = result("Power Plant", Standing::StandIn, Vec::new());
        plant.scaling = [(1, 10.0), (2, 6.0), (4, 4.0)]
            .map(|(threads, build_ms)| Scaling { builder: "binned".into(), threads, build_ms })
            .to_vec();
        let results = [result("Sponza", Standing::Same, trees)];
        let comparisons = compare(&Published::read().unwrap(), &results);
        assert_eq!(measured(&comparisons, Item::IvFigure5, "build").count(), 2);
        let row = |label: &str, published, measured| PairRow {
            label: label.into(),
            ours: "binned".into(),
            published,
            measured,
        };
        let rows = [row("binned", 0.9, Some(0.8)), row("absent", 0.9, None)];
        let bar = vec![("midpoints".to_owned(), 0.4), ("pruning".to_owned(), 0.01)];
        for (svg, names) in [
            (
                agreement(&comparisons, Item::IvFigure5, "build", "build").unwrap(),
                &["binned", "embree:medium"][..],
            ),
            (pairs(&rows, "build").unwrap(), &["binned", "absent"]),
            (
                steps(&[("bonsai".into(), bar)]).unwrap(),
                &["midpoints: bonsai 40.0 %", "pruning: bonsai 1.0 %"],
            ),
            (scaling(&plant).unwrap(), &["binned"]),
        ] {
            for name in names {
                assert!(svg.contains(&format!("\n{name}\n")), "{name} in {svg}");
            }
            assert!(svg.contains("var(--ink") && !svg.contains("#01020"), "{svg}");
        }
    }

    #[test]
    fn nothing_measured_is_still_a_plot() {
        let comparisons = compare(&Published::read().unwrap(), &[]);
        assert!(agreement(&comparisons, Item::VTable3, "added references", "x").is_ok());
        assert!(pairs(&[], "x").is_ok() && steps(&[]).is_ok());
        let empty = result("Power Plant", Standing::StandIn, Vec::new());
        assert!(scaling(&empty).is_ok());
    }
}
