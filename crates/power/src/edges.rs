//! Steps of the power, as they are found in a stream.

use crate::PowerBlock;
use serde::Serialize;

/// A step of the power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Edge {
    /// When, in nanoseconds of the trace: half-way up or down.
    pub time_ns: f64,
    /// Power after minus power before, in watts.
    pub step_w: f32,
}

/// Samples on either side that are averaged.
const WIDTH: usize = 4;

/// More edges than this are thinned out, the smallest first.
const MAX_EDGES: usize = 1 << 21;

/// Finds edges: places where the mean of the next four samples differs most from that of the last four.
#[derive(Debug)]
pub(crate) struct EdgeFinder {
    /// Least step in watts; none until the noise is known.
    threshold: Option<f64>,
    times: Vec<i64>,
    watts: Vec<f32>,
    edges: Vec<Edge>,
    period_ns: f64,
}

impl EdgeFinder {
    pub(crate) const fn new() -> Self {
        Self {
            threshold: None,
            times: Vec::new(),
            watts: Vec::new(),
            edges: Vec::new(),
            period_ns: 0.0,
        }
    }

    pub(crate) fn push(&mut self, block: &PowerBlock) {
        if block.follows_hole {
            self.search();
            self.times.clear();
            self.watts.clear();
        }
        self.times.extend_from_slice(&block.times_ns);
        self.watts.extend_from_slice(&block.watts);
        if self.threshold.is_none() && self.watts.len() < 4096 {
            return;
        }
        self.search();
        // The next search needs the samples around its first place.
        let keep = self.watts.len().saturating_sub(2 * WIDTH + 2);
        self.times.drain(..keep);
        self.watts.drain(..keep);
    }

    /// Six deviations of the noise of such a difference, from the median step between samples, which
    /// few edges do not move.
    fn noise(watts: &[f32]) -> f64 {
        let mut steps: Vec<_> = watts.windows(2).map(|p| (p[1] - p[0]).abs()).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let middle = steps.len() / 2;
        let median = f64::from(*steps.select_nth_unstable_by(middle, f32::total_cmp).1);
        // Median of |difference of two normal numbers| is 0.6745 √2 deviations of one.
        let deviation = median / (0.6745 * std::f64::consts::SQRT_2);
        6.0 * deviation * (2.0 / WIDTH as f64).sqrt()
    }

    fn search(&mut self) {
        let n = self.watts.len();
        if n < 2 * WIDTH + 1 {
            return;
        }
        self.period_ns = (self.times[n - 1] - self.times[0]) as f64 / (n - 1) as f64;
        let watts = &self.watts;
        let threshold = *self.threshold.get_or_insert_with(|| Self::noise(watts).max(1e-6));
        let step_at = |at: usize| -> f64 {
            let sum =
                |from: usize| watts[from..from + WIDTH].iter().map(|w| f64::from(*w)).sum::<f64>();
            (sum(at) - sum(at - WIDTH)) / WIDTH as f64
        };
        // The difference slides along: one sample enters, one changes sides, one leaves.
        let mut step = step_at(WIDTH);
        let mut best: Option<(usize, f64)> = None;
        let last = n - WIDTH;
        for at in WIDTH..=last {
            if step.abs() > threshold && best.is_none_or(|(_, s)| step.abs() > s.abs()) {
                best = Some((at, step));
            } else if let Some((place, size)) = best
                && (at >= place + WIDTH || step.signum() != size.signum())
            {
                self.edges.push(refine(&self.times, place, size, &step_at));
                best = None;
            }
            if at < last {
                let moved = f64::from(watts[at + WIDTH]) - 2.0 * f64::from(watts[at])
                    + f64::from(watts[at - WIDTH]);
                step += moved / WIDTH as f64;
            }
        }
        if let Some((place, size)) = best {
            self.edges.push(refine(&self.times, place, size, &step_at));
        }
        if self.edges.len() > MAX_EDGES {
            self.thin();
        }
    }

    fn thin(&mut self) {
        let mut sizes: Vec<_> = self.edges.iter().map(|e| e.step_w.abs()).collect();
        let middle = sizes.len() / 2;
        let least = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
        self.edges.retain(|e| e.step_w.abs() > least);
        self.threshold = Some(f64::from(least));
    }

    /// All edges in order.
    pub(crate) fn finish(mut self) -> Vec<Edge> {
        self.search();
        // The overlap of two searches may show an edge twice, its flank and its middle.
        self.edges.sort_by(|a, b| a.time_ns.total_cmp(&b.time_ns));
        let near = 2.5 * self.period_ns;
        self.edges.dedup_by(|b, a| {
            let is_same = b.time_ns - a.time_ns < near && a.step_w * b.step_w > 0.0;
            if is_same && b.step_w.abs() > a.step_w.abs() {
                *a = *b;
            }
            is_same
        });
        self.edges
    }
}

/// The difference falls off linearly to both sides of a sharp step; where both lines meet is the step.
fn refine(times: &[i64], place: usize, size: f64, step_at: &impl Fn(usize) -> f64) -> Edge {
    let n = times.len();
    let (time, before) = (times[place] as f64, times[place - 1] as f64);
    let period = time - before;
    let mut shift = 0.0;
    if place > WIDTH && place + WIDTH < n {
        let sign = size.signum();
        let (left, right) = (sign * step_at(place - 1), sign * step_at(place + 1));
        shift = (0.5 * (right - left) * WIDTH as f64 / size.abs()).clamp(-0.5, 0.5);
    }
    #[expect(clippy::cast_possible_truncation, reason = "watts of a device")]
    Edge { time_ns: time + (shift - 0.5) * period, step_w: size as f32 }
}
