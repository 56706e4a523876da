//! A line through matched times.

use super::{ClockMap, SyncMethod};

/// Offset and drift through pairs of times (log, trace), by least squares without outliers: pairs more
/// than four deviations (estimated from the median) off are left out, up to ten times over. None for
/// fewer than two pairs.
pub(super) fn fit(pairs: &[(f64, f64)], method: SyncMethod, least_ns: f64) -> Option<ClockMap> {
    let mut used: Vec<(f64, f64)> = pairs.iter().map(|&(log, trace)| (log, trace - log)).collect();
    let mut line = through(&used)?;
    for round in 0..10 {
        let mut sizes: Vec<_> = used.iter().map(|p| (p.1 - line.at(p.0)).abs()).collect();
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        // Rounding to samples leaves residuals that are evenly spread, never Gaussian tails.
        let limit = (4.0 * median / 0.6745).max(least_ns);
        let kept: Vec<_> =
            used.iter().copied().filter(|p| (p.1 - line.at(p.0)).abs() <= limit).collect();
        if kept.len() < 2 || (kept.len() == used.len() && round > 0) {
            break;
        }
        used = kept;
        line = through(&used)?;
    }
    let n = used.len() as f64;
    let squares: f64 = used.iter().map(|p| (p.1 - line.at(p.0)).powi(2)).sum();
    // Two pairs determine the line exactly; their own uncertainty is that of a reading.
    let variance = if n > 2.0 { squares / (n - 2.0) } else { (least_ns / 3.0).powi(2) };
    #[expect(clippy::cast_possible_truncation, reason = "a time within the log")]
    let reference_ns = line.middle as i64;
    Some(ClockMap {
        method,
        reference_ns,
        offset_ns: line.at(reference_ns as f64),
        offset_error_ns: (variance / n).sqrt(),
        drift_ppm: line.slope * 1e6,
        drift_error_ppm: if line.spread > 0.0 {
            (variance / line.spread).sqrt() * 1e6
        } else {
            0.0
        },
        residual_ns: variance.sqrt(),
        matched: used.len(),
        similarity: None,
        runner_up: None,
    })
}

struct Line {
    middle: f64,
    height: f64,
    slope: f64,
    /// Sum of squares about the middle.
    spread: f64,
}

impl Line {
    fn at(&self, x: f64) -> f64 {
        self.height + self.slope * (x - self.middle)
    }
}

fn through(points: &[(f64, f64)]) -> Option<Line> {
    if points.len() < 2 {
        return None;
    }
    let n = points.len() as f64;
    // Times are large and offsets larger; differences from the first keep their digits.
    let (x0, y0) = points[0];
    let middle = x0 + points.iter().map(|p| p.0 - x0).sum::<f64>() / n;
    let height = y0 + points.iter().map(|p| p.1 - y0).sum::<f64>() / n;
    let spread: f64 = points.iter().map(|p| (p.0 - middle).powi(2)).sum();
    let common: f64 = points.iter().map(|p| (p.0 - middle) * (p.1 - height)).sum();
    let slope = if spread > 0.0 { common / spread } else { 0.0 };
    Some(Line { middle, height, slope, spread })
}
