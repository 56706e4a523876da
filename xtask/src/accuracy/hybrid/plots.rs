//! The plots of the suite.

use super::study::{Point, SceneStudy};
use super::sweep::{GRID, Member, PRESETS, Sweep};
use crate::accuracy::scatter::{Dot, Look, plot};
use crate::report::axis::{LinearAxis, NameAxis};
use crate::report::canvas::{INK, LEGEND, PALETTE, SIZE, chart, draw, failed, legend, marker};
use anyhow::Result;
use plotters::prelude::*;

/// Where no error stands on a logarithmic axis.
const NO_ERROR: (f64, &str) = (1e-5, "0");

/// Time of a frame against its error, with the front and the presets named.
pub(super) fn pareto(scene: &SceneStudy, sweep: &Sweep) -> Result<String> {
    // Presets first, so that a point that belongs to several families has that name.
    let mut families = sweep.families();
    families.sort_by_key(|family| *family != PRESETS);
    let mut dots: Vec<Dot<'_>> = Vec::new();
    let mut seen: Vec<usize> = Vec::new();
    for family in families {
        for member in sweep.of_family(family) {
            let Some(point) = scene.point(member.setup) else { continue };
            let first = !seen.contains(&member.setup);
            seen.push(member.setup);
            let on_front = point.on_front && first;
            let named = first && (on_front || family == PRESETS);
            let label = if family == PRESETS { &member.value } else { &point.setup };
            dots.push(Dot { family, label, x: point.flip, y: point.ms, on_front, named });
        }
    }
    let axes = ("mean FLIP", "frame, ms");
    let look = Look { axes, least: Some(NO_ERROR), loose: &[PRESETS, GRID] };
    plot(&dots, &look, &format!("Time of a frame of {} against its error", scene.scene))
}

/// What a plot shows of a point.
type Value = fn(&Point) -> f64;

/// Error and time as a knob is turned, a line a scene.
pub(super) fn knob(scenes: &[SceneStudy], sweep: &Sweep, family: &str) -> Result<String> {
    let members: Vec<&Member> = sweep.of_family(family).collect();
    let description = format!("Error and time of a frame as {family} changes");
    draw(&description, |area| {
        let half = (SIZE.0 - LEGEND) / 2;
        let (left, right) = area.split_horizontally(half);
        let names = || members.iter().map(|member| member.value.clone()).collect::<Vec<_>>();
        let error = (&left, "mean FLIP", 8, (|p| p.flip) as Value);
        let time = (&right, "time ÷ default", LEGEND, (|p| p.relative) as Value);
        let default = members.iter().position(|member| member.setup == Sweep::DEFAULT);
        for (panel, label, margin, value) in [error, time] {
            let line = |scene: &SceneStudy| -> Vec<(f64, f64)> {
                let at = |(i, member): (usize, &&Member)| {
                    Some((i as f64, value(scene.point(member.setup)?)))
                };
                members.iter().enumerate().filter_map(at).collect()
            };
            let most = scenes.iter().flat_map(line).map(|(_, y)| y).fold(0.0, f64::max);
            let axes = (NameAxis::new(names()), LinearAxis::up_to(most * 1.08));
            let mut chart = chart(panel, axes, (family, label), margin)?;
            for (number, scene) in scenes.iter().enumerate() {
                let points = line(scene);
                let colour = PALETTE[number % PALETTE.len()].stroke_width(2);
                let series = LineSeries::new(points.clone(), colour);
                chart.draw_series(series).map_err(failed)?;
                for at in points {
                    // On the whole area, since this is where the place is counted from.
                    let place = chart.backend_coord(&at);
                    marker(area, place, number, 3)?;
                    if default.is_some_and(|i| i as f64 == at.0) {
                        area.draw(&Circle::new(place, 6, INK.stroke_width(1))).map_err(failed)?;
                    }
                }
            }
        }
        legend(area, scenes.iter().map(|scene| scene.scene.as_str()).enumerate())
    })
}
