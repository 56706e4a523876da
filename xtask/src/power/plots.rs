//! Plots of an analysis, by the layout of paper II.

use super::published::ALGORITHMS;
use super::tables::name;
use crate::report::axis::LinearAxis;
use crate::report::canvas::{FAINT, INK, LEGEND, PALETTE, SIZE, chart, draw, failed, legend, text};
use crate::report::table::{Best, Table};
use anyhow::Result;
use niwaki_power::{Analysis, Butterworth, FrameEnergy, Signature, Waveform};
use plotters::prelude::*;

/// A plot and what it shows.
pub(super) struct Plot {
    pub(super) svg: String,
    pub(super) data: Table,
}

/// A curve: a faint raw one and a strong smooth one.
pub(super) struct Curve {
    pub(super) name: String,
    pub(super) colour: usize,
    pub(super) raw: Vec<(f64, f64)>,
    pub(super) smooth: Vec<(f64, f64)>,
}

/// The algorithms of the two columns of figures 4 to 6; names that the paper does not know are in the
/// first.
pub(super) fn is_shadow(algorithm: &str) -> bool {
    matches!(algorithm, "SV" | "SM" | "VSM")
}

/// A colour for an algorithm, the same in all plots.
fn colour(analysis: &Analysis, algorithm: &str) -> usize {
    ALGORITHMS.iter().position(|a| *a == algorithm).map_or_else(
        || {
            let others = analysis.groups.iter().map(|g| g.algorithm.as_str());
            let mut others: Vec<_> = others.filter(|a| !ALGORITHMS.contains(a)).collect();
            others.dedup();
            ALGORITHMS.len() + others.iter().position(|a| *a == algorithm).unwrap_or(0)
        },
        |at| at % 3,
    )
}

/// Frames of each algorithm along its animation: power if `is_power`, else times (figures 4 to 6).
pub(super) fn along(analysis: &Analysis, shadows: bool, is_power: bool) -> Result<Option<Plot>> {
    let kind = if is_power { "power" } else { "time" };
    let part = if shadows { "shadows" } else { "primary" };
    let (label, unit) = if is_power { ("power (W)", "W") } else { ("frame time (ms)", "ms") };
    let mut algorithms: Vec<&str> = Vec::new();
    for group in analysis.groups.iter().filter(|g| is_shadow(&g.algorithm) == shadows) {
        if !algorithms.contains(&group.algorithm.as_str()) {
            algorithms.push(&group.algorithm);
        }
    }
    let of = |frame: &FrameEnergy| if is_power { frame.mean_w } else { 1e3 * frame.time_s };
    let mut curves = Vec::new();
    for algorithm in algorithms {
        let mut x = 0.0;
        let raw: Vec<_> = analysis
            .frames
            .iter()
            .filter(|f| analysis.groups[f.group].algorithm == algorithm && !f.is_incomplete)
            .map(|f| {
                x += f64::from(f.frames);
                (x, of(f))
            })
            .collect();
        let smooth = smooth(&raw)?;
        let title = if algorithm.is_empty() { "all" } else { algorithm };
        curves.push(Curve { name: title.into(), colour: colour(analysis, algorithm), raw, smooth });
    }
    if curves.iter().all(|c| c.raw.is_empty()) {
        return Ok(None);
    }
    let description = format!("{label} of frames along the animation, {part}");
    let plot = draw_curves(&description, &curves, ("frame", label))?;
    let columns = ["algorithm", "frame", unit, &format!("{unit} smooth")];
    Ok(Some(Plot { svg: plot, data: data(&format!("power-{part}-{kind}"), &columns, &curves) }))
}

/// The series after a low-pass filter of a twentieth of a cycle a frame.
pub(super) fn smooth(raw: &[(f64, f64)]) -> Result<Vec<(f64, f64)>> {
    let filter = Butterworth::low_pass(2, 0.05, 1.0)?;
    let values: Vec<_> = raw.iter().map(|p| p.1).collect();
    let smooth = filter.filter_both_ways(&values);
    Ok(raw.iter().map(|p| p.0).zip(smooth).collect())
}

/// What curves show.
pub(super) fn data(name: &str, columns: &[&str], curves: &[Curve]) -> Table {
    let mut table = Table::new(name);
    for column in columns {
        table = table.column(*column, Best::Neither);
    }
    for curve in curves {
        for (at, raw) in curve.raw.iter().enumerate() {
            let smooth = curve.smooth.get(at).map(|p| p.1);
            table.push(vec![curve.name.as_str().into(), raw.0.into(), raw.1.into(), smooth.into()]);
        }
    }
    table
}

/// At most about 2000 points: the least and the largest of each stretch.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let stretch = points.len().div_ceil(1000);
    if stretch < 3 {
        return points.to_vec();
    }
    let ends = |part: &[(f64, f64)]| {
        let low = part.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
        let high = part.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
        let mut both: Vec<_> = low.into_iter().chain(high).collect();
        both.sort_by(|a, b| a.0.total_cmp(&b.0));
        both
    };
    points.chunks(stretch).flat_map(ends).collect()
}

/// Curves from 0 on.
pub(super) fn draw_curves(
    description: &str,
    curves: &[Curve],
    labels: (&str, &str),
) -> Result<String> {
    draw(description, |area| {
        let all = || curves.iter().flat_map(|c| c.raw.iter().chain(&c.smooth));
        let most_x = all().map(|p| p.0).fold(0.0, f64::max);
        let most_y = all().map(|p| p.1).filter(|y| y.is_finite()).fold(0.0, f64::max);
        let right = if curves.len() > 1 { LEGEND } else { 16 };
        let axes = (LinearAxis::up_to(most_x), LinearAxis::up_to(1.08 * most_y));
        let mut chart = chart(area, axes, labels, right)?;
        for curve in curves {
            let colour = PALETTE[curve.colour % PALETTE.len()];
            let faint = colour.mix(if curve.smooth.is_empty() { 1.0 } else { 0.35 });
            let raw = thin(&curve.raw).into_iter().filter(|p| p.1.is_finite());
            chart.draw_series(LineSeries::new(raw, faint.stroke_width(1))).map_err(failed)?;
        }
        for curve in curves {
            let colour = PALETTE[curve.colour % PALETTE.len()];
            let smooth = thin(&curve.smooth);
            chart.draw_series(LineSeries::new(smooth, colour.stroke_width(2))).map_err(failed)?;
        }
        if curves.len() > 1 {
            let entries: Vec<_> = curves.iter().map(|c| (c.colour, c.name.as_str())).collect();
            legend(area, entries.into_iter())?;
        }
        Ok(())
    })
}

/// The whole trace.
pub(super) fn overview(analysis: &Analysis) -> Result<Plot> {
    let start = analysis.quality.span_ns.0;
    let seconds = |ns: i64| 1e-9 * (ns - start) as f64;
    let bins = &analysis.bins;
    let raw = (0i64..)
        .zip(&bins.watts)
        .filter(|(_, w)| w.is_finite())
        .map(|(at, w)| (seconds(bins.start_ns + at * bins.width_ns), f64::from(*w)))
        .collect();
    let smooth = analysis.overview.times_ns.iter().zip(&analysis.overview.watts);
    let smooth = smooth.map(|(t, w)| (seconds(*t), *w)).collect();
    let curves = [Curve { name: "trace".into(), colour: 0, raw, smooth }];
    let svg = draw_curves("Power over the whole trace", &curves, ("time (s)", "power (W)"))?;
    let mut table =
        Table::new("power-overview").column("s", Best::Neither).column("W", Best::Neither);
    for (x, y) in &curves[0].smooth {
        table.push(vec![(*x).into(), (*y).into()]);
    }
    Ok(Plot { svg, data: table })
}

/// Frames with their raw and filtered power (figures 3, 7 and 8).
pub(super) fn waveform(
    waveform: &Waveform,
    title: &str,
    file: &str,
    average: Option<&Signature>,
) -> Result<Plot> {
    let origin = waveform.times_s.first().copied().unwrap_or(0.0);
    let ms = |s: f64| 1e3 * (s - origin);
    let series = |watts: &[f64]| -> Vec<(f64, f64)> {
        waveform.times_s.iter().zip(watts).map(|(t, w)| (ms(*t), *w)).collect()
    };
    let (raw, smooth) = (series(&waveform.watts), series(&waveform.smooth_w));
    let svg = draw(title, |area| {
        let most_x = raw.last().map_or(0.0, |p| p.0);
        let most_y = raw.iter().map(|p| p.1).fold(0.0, f64::max);
        let axes = (LinearAxis::up_to(most_x), LinearAxis::up_to(1.08 * most_y));
        let mut chart = chart(area, axes, ("time (ms)", "power (W)"), 16)?;
        for (start, end) in &waveform.frames_s {
            for x in [ms(*start), ms(*end)] {
                let line = [(x, 0.0), (x, 1.08 * most_y)];
                chart
                    .draw_series(DashedLineSeries::new(line, 4, 4, FAINT.stroke_width(1)))
                    .map_err(failed)?;
            }
        }
        let colour = PALETTE[0];
        chart
            .draw_series(LineSeries::new(thin(&raw), colour.mix(0.35).stroke_width(1)))
            .map_err(failed)?;
        chart
            .draw_series(LineSeries::new(thin(&smooth), colour.stroke_width(2)))
            .map_err(failed)?;
        if let Some(average) = average {
            let parts = average.mean_w.len() as f64;
            let points = average.mean_w.iter().enumerate().filter(|(_, w)| w.is_finite()).map(
                |(part, watts)| {
                    let share = (part as f64 + 0.5) / parts;
                    (ms(0.0) + 1e3 * average.frame_s * share, *watts)
                },
            );
            let points: Vec<_> = points.filter(|p| p.0 <= most_x).collect();
            chart
                .draw_series(LineSeries::new(points, PALETTE[1].stroke_width(2)))
                .map_err(failed)?;
        }
        let place = (i32::try_from(SIZE.0 / 2)? - 30, 10);
        area.draw(&Text::new(title.to_owned(), place, text(13.0, INK))).map_err(failed)
    })?;
    let mut table = Table::new(file)
        .column("ms", Best::Neither)
        .column("W", Best::Neither)
        .column("W smooth", Best::Neither);
    for (raw, smooth) in raw.iter().zip(&smooth) {
        table.push(vec![raw.0.into(), raw.1.into(), smooth.1.into()]);
    }
    Ok(Plot { svg, data: table })
}

/// Typical frames in the order of figures 7 and 8, of the shadow algorithms with six lights if there are:
/// the index of the waveform and its title.
pub(super) fn typical(analysis: &Analysis) -> Vec<(usize, String)> {
    let mut chosen: Vec<(usize, usize, String)> = Vec::new();
    for (at, waveform) in analysis.waveforms.iter().enumerate() {
        let group = &analysis.groups[waveform.group];
        let order = ALGORITHMS.iter().position(|a| *a == group.algorithm).unwrap_or(usize::MAX);
        let same = chosen.iter().position(|c| {
            analysis.groups[analysis.waveforms[c.1].group].algorithm == group.algorithm
        });
        match same {
            Some(place) if group.lights == 6 => chosen[place] = (order, at, name(group)),
            Some(_) => {}
            None => chosen.push((order, at, name(group))),
        }
    }
    chosen.sort_by_key(|c| c.0);
    chosen.into_iter().map(|c| (c.1, c.2)).collect()
}
