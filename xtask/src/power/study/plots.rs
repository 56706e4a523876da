//! Plots of a study, by the layout of paper II.

use super::rows::Cell;
use crate::power::plots::{Curve, Plot, data, draw_curves, smooth};
use crate::power::published::ALGORITHMS;
use crate::report::axis::{LinearAxis, NameAxis};
use crate::report::canvas::{FAINT, LEGEND, PALETTE, chart, draw, failed, legend, marker};
use crate::report::table::{Best, Table};
use anyhow::Result;
use plotters::prelude::*;

fn colour(cell: &Cell) -> usize {
    ALGORITHMS.iter().position(|a| *a == cell.key.algorithm.short()).unwrap_or(0)
}

/// Cells of an algorithm one after the other, lights ascending, as the paper's figures have them.
fn by_algorithm<'a>(cells: &[&'a Cell]) -> Vec<Vec<&'a Cell>> {
    let mut all: Vec<Vec<&Cell>> = Vec::new();
    for cell in cells {
        match all.iter_mut().find(|run| run[0].key.algorithm == cell.key.algorithm) {
            Some(run) => run.push(cell),
            None => all.push(vec![cell]),
        }
    }
    all.iter_mut().for_each(|run| run.sort_by_key(|c| c.key.lights));
    all
}

/// What is drawn along the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Along {
    /// Time from start to end of a frame.
    Time,
    /// Power, where a meter tells.
    Power,
}

/// Frames along the path by each algorithm (figures 4 to 6); none if there is nothing to show.
pub(super) fn along(cells: &[&Cell], what: Along, name: &str) -> Result<Option<Plot>> {
    let (label, unit) = match what {
        Along::Time => ("frame time (ms)", "ms"),
        Along::Power => ("power (W)", "W"),
    };
    let mut curves = Vec::new();
    for run in by_algorithm(cells) {
        let (mut raw, mut first) = (Vec::new(), 0.0);
        for cell in &run {
            match (what, &cell.energy) {
                (Along::Time, _) => {
                    let times = cell.path_ms.iter().enumerate();
                    raw.extend(times.map(|(at, ms)| (first + at as f64 + 1.0, *ms)));
                }
                (Along::Power, Some(energy)) => {
                    raw.extend(energy.path_w.iter().map(|(at, w)| (first + at + 1.0, *w)));
                }
                (Along::Power, None) => {}
            }
            first += cell.frames as f64;
        }
        if raw.is_empty() {
            continue;
        }
        let name = run[0].key.algorithm.short().to_owned();
        curves.push(Curve { name, colour: colour(run[0]), smooth: smooth(&raw)?, raw });
    }
    if curves.is_empty() {
        return Ok(None);
    }
    let svg = draw_curves(&format!("{label} along the path, {name}"), &curves, ("frame", label))?;
    let columns = ["algorithm", "frame", unit, &format!("{unit} smooth")];
    Ok(Some(Plot { svg, data: data(name, &columns, &curves) }))
}

/// Energy of a frame over its time, a point each cell, and the line of the mean power.
pub(super) fn energy_over_time(cells: &[Cell]) -> Result<Option<Plot>> {
    let points: Vec<(&Cell, f64, f64)> = cells
        .iter()
        .filter_map(|c| c.energy.as_ref().map(|e| (c, e.ms, 1e3 * e.joules_per_frame)))
        .collect();
    if points.is_empty() {
        return Ok(None);
    }
    let most = |of: fn(&(&Cell, f64, f64)) -> f64| points.iter().map(of).fold(0.0, f64::max);
    let (most_x, most_y) = (most(|p| p.1), most(|p| p.2));
    let sum = |of: fn(&(&Cell, f64, f64)) -> f64| points.iter().map(of).sum::<f64>();
    let watts = sum(|p| p.2) / sum(|p| p.1);
    let svg = draw("Energy of a frame over its time", |area| {
        let axes = (LinearAxis::up_to(1.05 * most_x), LinearAxis::up_to(1.08 * most_y));
        let mut chart = chart(area, axes, ("frame time (ms)", "energy of a frame (mJ)"), LEGEND)?;
        let end = (1.05 * most_x).min(1.08 * most_y / watts);
        let line =
            DashedLineSeries::new([(0.0, 0.0), (end, watts * end)], 6, 4, FAINT.stroke_width(1));
        chart.draw_series(line).map_err(failed)?;
        for (cell, x, y) in &points {
            marker(area, chart.backend_coord(&(*x, *y)), colour(cell), 4)?;
        }
        let shown: Vec<_> = ALGORITHMS
            .into_iter()
            .enumerate()
            .filter(|(_, name)| points.iter().any(|p| p.0.key.algorithm.short() == *name))
            .collect();
        legend(area, shown.into_iter())
    })?;
    let mut table = Table::new("study-energy-time")
        .column("scene", Best::Neither)
        .column("size", Best::Neither)
        .column("algorithm", Best::Neither)
        .column("ms", Best::Neither)
        .column("mJ", Best::Neither);
    for (cell, x, y) in &points {
        let key = &cell.key;
        let row = [key.scene.clone(), key.size(), key.name()];
        let mut row: Vec<_> = row.into_iter().map(Into::into).collect();
        row.extend([(*x).into(), (*y).into()]);
        table.push(row);
    }
    Ok(Some(Plot { svg, data: table }))
}

/// The average course of power within a frame (figures 7 and 8); none if the meter does not tell.
pub(super) fn signature(cell: &Cell, name: &str) -> Result<Option<Plot>> {
    let Some(energy) = cell.energy.as_ref().filter(|e| !e.signature_w.is_empty()) else {
        return Ok(None);
    };
    let parts = energy.signature_w.len() as f64;
    let raw: Vec<(f64, f64)> = energy
        .signature_w
        .iter()
        .enumerate()
        .filter(|(_, w)| w.is_finite())
        .map(|(at, w)| (energy.signature_ms * (at as f64 + 0.5) / parts, *w))
        .collect();
    let curve = Curve { name: cell.key.name(), colour: colour(cell), raw, smooth: Vec::new() };
    let labels = ("time within the frame (ms)", "power (W)");
    let svg =
        draw_curves(&format!("Power within a frame of {}", cell.key.name()), &[curve], labels)?;
    let mut table = Table::new(name).column("ms", Best::Neither).column("W", Best::Neither);
    for (at, watts) in energy.signature_w.iter().enumerate() {
        let ms = energy.signature_ms * (at as f64 + 0.5) / parts;
        table.push(vec![ms.into(), (*watts).into()]);
    }
    Ok(Some(Plot { svg, data: table }))
}

/// Times of passes on the GPU, on top of each other, a bar each cell; none without such times.
pub(super) fn passes(cells: &[&Cell], name: &str) -> Result<Option<Plot>> {
    let timed: Vec<&Cell> = cells.iter().filter(|c| c.gpu_ms.is_some()).copied().collect();
    let most = timed.iter().filter_map(|c| c.gpu_ms).fold(0.0, f64::max);
    if timed.is_empty() || most <= 0.0 {
        return Ok(None);
    }
    let mut names: Vec<&str> = Vec::new();
    for pass in timed.iter().flat_map(|c| &c.passes) {
        if !names.contains(&pass.name.as_str()) {
            names.push(&pass.name);
        }
    }
    let svg = draw("Times of passes on the GPU", |area| {
        let bars = timed.iter().map(|c| match c.key.algorithm.has_shadows() {
            true => format!("{} {}", c.key.algorithm, c.key.lights),
            false => c.key.algorithm.short().to_owned(),
        });
        let axes = (NameAxis::new(bars.collect()), LinearAxis::up_to(1.05 * most));
        let mut chart = chart(area, axes, ("", "time on the GPU (ms)"), LEGEND)?;
        for (at, cell) in timed.iter().enumerate() {
            let mut below = 0.0;
            for pass in &cell.passes {
                let place = names.iter().position(|n| *n == pass.name).unwrap_or(0);
                let (left, right) = (at as f64 - 0.36, at as f64 + 0.36);
                let bar = [(left, below), (right, below + pass.ms)];
                let colour = PALETTE[place % PALETTE.len()].filled();
                chart.draw_series([Rectangle::new(bar, colour)]).map_err(failed)?;
                below += pass.ms;
            }
        }
        let entries: Vec<_> =
            names.iter().enumerate().map(|(at, name)| (at, name.replace('_', " "))).collect();
        legend(area, entries.iter().map(|(at, name)| (*at, name.as_str())))
    })?;
    Ok(Some(Plot { svg, data: super::tables::passes(&timed, name) }))
}
