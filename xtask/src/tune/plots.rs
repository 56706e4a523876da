//! Curves over frames.

use crate::report::axis::LinearAxis;
use crate::report::canvas::{INK, LEGEND, PALETTE, chart, draw, failed, legend};
use anyhow::Result;
use plotters::prelude::*;

/// A curve: its name, its colour by number, and a value for each frame that has one.
pub(super) struct Curve<'a> {
    pub(super) name: &'a str,
    pub(super) values: Vec<Option<f64>>,
}

/// Curves over frames, from 0 up to `most` at most, where what is above runs along; a dashed line at
/// `level`, if there is one.
pub(super) fn frames(
    curves: &[Curve<'_>],
    y_label: &str,
    (level, most): (Option<f64>, f64),
    description: &str,
) -> Result<String> {
    let count = curves.iter().map(|curve| curve.values.len()).max().unwrap_or(1).max(2);
    let values = || curves.iter().flat_map(|curve| curve.values.iter().flatten().copied());
    // One absurd frame should not flatten all others: the plot ends at half more than the 98th percentile.
    let mut sorted: Vec<f64> = values().chain(level).filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let high = sorted.get((sorted.len().saturating_sub(1)) * 98 / 100).copied().unwrap_or(1.0);
    let top = (1.25 * high.max(level.unwrap_or(0.0)).max(1e-9)).min(most);
    draw(description, |area| {
        let x = LinearAxis::up_to(count as f64 - 1.0);
        let y = LinearAxis::up_to(top);
        let mut chart = chart(area, (x, y), ("frame", y_label), LEGEND)?;
        if let Some(level) = level {
            let ends = [(0.0, level), (count as f64 - 1.0, level)];
            let line = DashedLineSeries::new(ends, 6, 4, INK.stroke_width(1));
            chart.draw_series(line).map_err(failed)?;
        }
        for (number, curve) in curves.iter().enumerate() {
            let colour = PALETTE[number % PALETTE.len()];
            let points: Vec<Option<(f64, f64)>> = curve
                .values
                .iter()
                .enumerate()
                .map(|(frame, value)| value.map(|value| (frame as f64, value.min(top))))
                .collect();
            // A frame without a value is a gap.
            for run in points.split(Option::is_none) {
                let line = run.iter().flatten().copied();
                chart.draw_series(LineSeries::new(line, colour.stroke_width(2))).map_err(failed)?;
            }
        }
        legend(area, curves.iter().map(|curve| curve.name).enumerate())
    })
}
