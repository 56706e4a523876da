//! One pattern found within another: coarsely by correlation, finely by events.

use super::fit::fit;
use super::{ClockMap, SyncMethod};
use crate::PowerError;
use crate::survey::Bins;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Longest stretch of the log that is looked for at once, in nanoseconds: over it, clocks drift apart by
/// less than a bin or two.
const STRETCH_NS: i64 = 20_000_000_000;
/// Silence before and after the frames that belongs to the pattern.
const SILENCE_NS: i64 = 500_000_000;
const STRETCHES: i64 = 4;
const PEAKS: usize = 6;

/// What is to be aligned.
pub(super) struct Pattern<'a> {
    /// When the log says that something was on, in order.
    pub(super) intervals: &'a [(i64, i64)],
    /// What the trace shows, from 0 (off) to 1.
    pub(super) shown: &'a Bins,
    /// Events of one kind each: times in the log, times in the trace; both in order.
    pub(super) events: &'a [(Vec<f64>, Vec<f64>)],
    /// Time between readings, in nanoseconds.
    pub(super) period_ns: f64,
    /// Positions less than this apart are the same, in nanoseconds.
    pub(super) distinct_ns: f64,
}

impl Pattern<'_> {
    /// The line that makes both patterns most alike.
    pub(super) fn align(&self, method: SyncMethod) -> Result<ClockMap, PowerError> {
        let (Some(&(first, _)), Some(&(_, last))) = (self.intervals.first(), self.intervals.last())
        else {
            return Err(PowerError::NoSync("the log has no frames".into()));
        };
        let mut found: Vec<ClockMap> = Vec::new();
        let mut search = Search::new(self, (last - first).min(STRETCH_NS) + 2 * SILENCE_NS)?;
        let spare = (last - first - STRETCH_NS).max(0);
        let stretches = if spare == 0 { 1 } else { STRETCHES };
        for which in 0..stretches {
            let start = first + spare / (stretches - 1).max(1) * which - SILENCE_NS;
            let end = start + (last - first).min(STRETCH_NS) + 2 * SILENCE_NS;
            for offset in search.offsets(self, start, end)? {
                let Some(mut map) = self.track(offset, start, end, method) else { continue };
                map.similarity = Some(self.similarity(&map));
                found.push(map);
            }
        }
        found.sort_by(|a, b| {
            b.similarity.partial_cmp(&a.similarity).unwrap_or(std::cmp::Ordering::Equal)
        });
        let Some(mut best) = found.first().copied() else {
            return Err(PowerError::NoSync(
                "no edges of the power follow the frames: the sensor may be too slow, or the device \
                 never idles between frames; give marks to the meter, or let it be idle before and \
                 after"
                    .into(),
            ));
        };
        let middle = best.reference_ns;
        best.runner_up = found
            .iter()
            .find(|m| (m.to_trace(middle) - best.to_trace(middle)).abs() > self.distinct_ns)
            .and_then(|m| m.similarity);
        Ok(best)
    }

    /// Follows events from a stretch where the offset is known to the whole log.
    fn track(&self, offset: f64, start: i64, end: i64, method: SyncMethod) -> Option<ClockMap> {
        let width = self.shown.width_ns as f64;
        let centre = 0.5 * (start as f64 + end as f64);
        let mut half = 0.5 * (end - start) as f64;
        let whole = self.intervals.iter().fold(0.0f64, |far, &(a, b)| {
            far.max((a as f64 - centre).abs()).max((b as f64 - centre).abs())
        });
        #[expect(clippy::cast_possible_truncation, reason = "a time within the log")]
        let mut map = ClockMap {
            method,
            reference_ns: centre as i64,
            offset_ns: offset,
            offset_error_ns: width,
            drift_ppm: 0.0,
            drift_error_ppm: 0.0,
            residual_ns: width,
            matched: 0,
            similarity: None,
            runner_up: None,
        };
        let mut reach = 2.0 * width;
        let mut rounds_over_all = 0;
        for round in 0..64 {
            let mut pairs = self.pairs(&map, centre - half, centre + half, reach);
            if pairs.len() < 2 {
                return None;
            }
            if round == 0 {
                // The best lag is right to a bin; what most events agree on is much better.
                map.offset_ns += densest(&pairs, &map, 4.0 * self.period_ns);
                reach = width;
                continue;
            }
            let fitted = fit(&pairs, method, 2.0 * self.period_ns)?;
            // Over a short stretch, jitter would pass for drift.
            let is_long = 2.0 * half > 2e9 || half >= whole;
            map = if is_long { fitted } else { ClockMap { drift_ppm: 0.0, ..fitted } };
            pairs.clear();
            reach = (6.0 * map.residual_ns).clamp(4.0 * self.period_ns, width);
            if half >= whole {
                rounds_over_all += 1;
                if rounds_over_all == 3 {
                    return Some(map);
                }
            }
            half *= 2.0;
        }
        Some(map)
    }

    /// Events of the log within a stretch with the nearest of the trace.
    fn pairs(&self, map: &ClockMap, from: f64, to: f64, reach: f64) -> Vec<(f64, f64)> {
        let mut pairs = Vec::new();
        for (log, trace) in self.events {
            let first = log.partition_point(|&t| t < from);
            let last = log.partition_point(|&t| t <= to);
            for &time in &log[first..last.max(first)] {
                let since = time - map.reference_ns as f64;
                let expected = time + map.offset_ns + map.drift_ppm * 1e-6 * since;
                if let Some(near) =
                    nearest(trace, expected).filter(|n| (n - expected).abs() <= reach)
                {
                    pairs.push((time, near));
                }
            }
        }
        pairs
    }

    /// Correlation of what the log says with what the trace shows, over the whole trace.
    fn similarity(&self, map: &ClockMap) -> f64 {
        let mut expected = vec![0.0f32; self.shown.watts.len()];
        let place = |log: i64| {
            (map.to_trace(log) - self.shown.start_ns as f64) / self.shown.width_ns as f64
        };
        for &(start, end) in self.intervals {
            cover(&mut expected, place(start), place(end));
        }
        let (mut n, mut sums) = (0.0, [0.0; 5]);
        for (&a, &b) in expected.iter().zip(&self.shown.watts) {
            if b.is_finite() {
                let (a, b) = (f64::from(a), f64::from(b));
                n += 1.0;
                for (sum, x) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                    *sum += x;
                }
            }
        }
        let [a, b, aa, bb, ab] = sums;
        let below = ((aa - a * a / n) * (bb - b * b / n)).sqrt();
        if below > 0.0 { (ab - a * b / n) / below } else { 0.0 }
    }
}

/// The deviation from the map around which most pairs lie.
fn densest(pairs: &[(f64, f64)], map: &ClockMap, width: f64) -> f64 {
    let mut off: Vec<_> = pairs.iter().map(|(log, trace)| trace - log - map.offset_ns).collect();
    off.sort_by(f64::total_cmp);
    let mut first = 0;
    let mut best = (0, 0, 0);
    for last in 0..off.len() {
        while off[last] - off[first] > width {
            first += 1;
        }
        if last - first + 1 > best.0 {
            best = (last - first + 1, first, last);
        }
    }
    0.5 * (off[best.1] + off[best.2])
}

/// The element that is nearest.
pub(super) fn nearest(sorted: &[f64], to: f64) -> Option<f64> {
    let at = sorted.partition_point(|&t| t < to);
    let candidates = sorted[at.saturating_sub(1)..(at + 1).min(sorted.len())].iter().copied();
    candidates.min_by(|a, b| (a - to).abs().total_cmp(&(b - to).abs()))
}

/// Adds the share of each bin that lies between two places.
fn cover(bins: &mut [f32], from: f64, to: f64) {
    let (from, to) = (from.max(0.0), to.min(bins.len() as f64));
    if from >= to || from.is_nan() || to.is_nan() {
        return;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the bins")]
    let (first, last) = (from as usize, (to as usize).min(bins.len() - 1));
    for (bin, share) in bins[first..=last].iter_mut().zip(first..) {
        let start = from.max(share as f64);
        let end = to.min((share + 1) as f64);
        #[expect(clippy::cast_possible_truncation, reason = "a share")]
        {
            *bin += (end - start).max(0.0) as f32;
        }
    }
}

/// The trace in frequencies, for correlation with many stretches of the log.
struct Search {
    planner: RealFftPlanner<f32>,
    length: usize,
    bins: usize,
    trace: Vec<Complex<f32>>,
}

impl Search {
    fn new(pattern: &Pattern<'_>, stretch_ns: i64) -> Result<Self, PowerError> {
        let shown = pattern.shown;
        let bins = usize::try_from(stretch_ns / shown.width_ns).unwrap_or(0) + 2;
        let length = (shown.watts.len() + 2 * bins).next_power_of_two();
        let mut planner = RealFftPlanner::new();
        let (mut sum, mut n) = (0.0, 0.0);
        for &x in shown.watts.iter().filter(|x| x.is_finite()) {
            sum += f64::from(x);
            n += 1.0;
        }
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
        let mean = (sum / f64::max(n, 1.0)) as f32;
        // What was not recorded says nothing.
        let mut values: Vec<f32> =
            shown.watts.iter().map(|x| if x.is_finite() { x - mean } else { 0.0 }).collect();
        values.resize(length, 0.0);
        let trace = transform(&mut planner, &mut values)?;
        Ok(Self { planner, length, bins, trace })
    }

    /// Offsets, trace minus log, at which a stretch of the log fits best.
    fn offsets(
        &mut self,
        pattern: &Pattern<'_>,
        start: i64,
        end: i64,
    ) -> Result<Vec<f64>, PowerError> {
        let width = pattern.shown.width_ns as f64;
        let mut activity = vec![0.0f32; self.bins];
        let place = |t: i64| (t - start) as f64 / width;
        let first = pattern.intervals.partition_point(|i| i.1 < start);
        for &(a, b) in pattern.intervals[first..].iter().take_while(|i| i.0 <= end) {
            cover(&mut activity, place(a), place(b));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1")]
        let used = (place(end).max(1.0) as usize).min(self.bins);
        let mean = activity[..used].iter().sum::<f32>() / used as f32;
        activity[..used].iter_mut().for_each(|x| *x -= mean);
        activity[used..].fill(0.0);
        activity.resize(self.length, 0.0);
        let mut product = transform(&mut self.planner, &mut activity)?;
        for (a, b) in product.iter_mut().zip(&self.trace) {
            *a = a.conj() * b;
        }
        // Rounding leaves an imaginary part where a real signal has none.
        if let Some(first) = product.first_mut() {
            first.im = 0.0;
        }
        if let Some(last) = product.last_mut() {
            last.im = 0.0;
        }
        let mut scores = vec![0.0f32; self.length];
        self.planner
            .plan_fft_inverse(self.length)
            .process(&mut product, &mut scores)
            .map_err(|e| PowerError::NoSync(e.to_string()))?;
        let mut offsets = Vec::new();
        for _ in 0..PEAKS {
            let best = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
            let Some((at, _)) = best.filter(|(_, score)| **score > 0.0) else { break };
            let lag =
                if at >= self.length / 2 { at as f64 - self.length as f64 } else { at as f64 };
            offsets.push(pattern.shown.start_ns as f64 + lag * width - start as f64);
            // Its flanks are not other peaks.
            for near in at + self.length - 3..=at + self.length + 3 {
                scores[near % self.length] = f32::NEG_INFINITY;
            }
        }
        Ok(offsets)
    }
}

fn transform(
    planner: &mut RealFftPlanner<f32>,
    values: &mut [f32],
) -> Result<Vec<Complex<f32>>, PowerError> {
    let plan = planner.plan_fft_forward(values.len());
    let mut spectrum = plan.make_output_vec();
    plan.process(values, &mut spectrum).map_err(|e| PowerError::NoSync(e.to_string()))?;
    Ok(spectrum)
}
