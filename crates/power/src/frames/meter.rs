//! Energy of spans, in one pass.

use super::spans::Spans;
use crate::{Fault, PowerBlock};
use serde::Serialize;

/// What a frame (or a window of frames) cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameEnergy {
    /// Number of the (first) frame.
    pub frame: u64,
    /// Frames in the window; 1 if frames are measured one by one.
    pub frames: u32,
    /// Which of [`crate::Analysis::groups`] it belongs to.
    pub group: usize,
    /// Start in nanoseconds of the trace.
    pub start_ns: f64,
    /// Time from the start to the next frame's, in seconds, per frame.
    pub time_s: f64,
    /// Time of work, in seconds, per frame.
    pub busy_s: f64,
    /// Energy over the whole time per frame, in joules, after the idle policy.
    pub energy_j: f64,
    /// Mean power over the whole time, in watts, after the idle policy.
    pub mean_w: f64,
    /// Mean power while it worked, in watts, as measured.
    pub busy_w: f64,
    /// Idle time within the work, in seconds, per frame.
    pub idle_inside_s: f64,
    /// Idle time between the work and the next frame, in seconds, per frame.
    pub idle_between_s: f64,
    /// Some of its samples were interpolated.
    pub is_repaired: bool,
    /// Some of its samples were clipped: its energy is a lower bound.
    pub is_clipped: bool,
    /// It is not wholly within the trace, or touches a hole: it counts nowhere.
    pub is_incomplete: bool,
}

/// Integrates power over spans, by trapezoids.
pub(crate) struct Meter<'a> {
    spans: &'a Spans,
    frames: Vec<FrameEnergy>,
    /// Boundaries passed so far: three for each span.
    passed: usize,
    /// Energy up to each boundary that was passed, twice, in W ns.
    at: Vec<f64>,
    sum: f64,
    before: Option<(i64, f32)>,
    /// Energy and time outside of all spans, by more than the guard.
    outside: (f64, f64),
    outside_bounds: (f64, f64),
}

/// Time next to frames that is not taken for idle: what was submitted may still run.
const GUARD_NS: f64 = 20e6;

impl<'a> Meter<'a> {
    pub(crate) fn new(spans: &'a Spans) -> Self {
        let frames = spans.list.iter().map(|span| FrameEnergy {
            frame: span.frame,
            frames: span.frames,
            group: span.group,
            start_ns: span.start,
            ..FrameEnergy::default()
        });
        let first = spans.list.first().map_or(f64::INFINITY, |s| s.start);
        let last = spans.list.last().map_or(f64::INFINITY, |s| s.end);
        Self {
            spans,
            frames: frames.collect(),
            passed: 0,
            at: Vec::with_capacity(3 * spans.list.len()),
            sum: 0.0,
            before: None,
            outside: (0.0, 0.0),
            outside_bounds: (first - GUARD_NS, last + GUARD_NS),
        }
    }

    fn boundary(&self, which: usize) -> f64 {
        self.spans.list.get(which / 3).map_or(f64::INFINITY, |span| match which % 3 {
            0 => span.start,
            1 => span.busy_end,
            _ => span.end,
        })
    }

    pub(crate) fn push(&mut self, block: &PowerBlock) {
        if block.follows_hole
            && let (Some((from, _)), Some(&to)) = (self.before, block.times_ns.first())
        {
            self.touch(from as f64, to as f64, |frame| frame.is_incomplete = true);
            self.before = None;
        }
        for flag in &block.flags {
            let (from, to) = (flag.from_ns as f64, flag.to_ns as f64);
            match flag.fault {
                Fault::Clipped => self.touch(from, to, |frame| frame.is_clipped = true),
                _ => self.touch(from, to, |frame| frame.is_repaired = true),
            }
        }
        let mut next = self.boundary(self.passed);
        let (Some(&first), Some(&watts)) = (block.times_ns.first(), block.watts.first()) else {
            return;
        };
        let mut before = self.before.unwrap_or((first, watts));
        for (&time, &watts) in block.times_ns.iter().zip(&block.watts) {
            let step = (time - before.0) as f64;
            while next <= time as f64 {
                // Energy up to a boundary between two samples, on the line between them.
                let part = (next - before.0 as f64).max(0.0);
                let slope = if step > 0.0 { f64::from(watts - before.1) / step } else { 0.0 };
                let here = f64::from(before.1) + slope * part;
                self.at.push(self.sum + part * (f64::from(before.1) + here));
                self.passed += 1;
                next = self.boundary(self.passed);
            }
            let piece = step * f64::from(watts + before.1);
            self.sum += piece;
            before = (time, watts);
        }
        self.before = Some(before);
        // Idle before and after is long; whole blocks are too coarse, but samples need no test each.
        let (low, high) = self.outside_bounds;
        if (first as f64) < low || before.0 as f64 > high {
            let times = &block.times_ns;
            let until = times.partition_point(|&t| (t as f64) < low);
            let from = times.partition_point(|&t| (t as f64) <= high);
            for watts in block.watts[..until].iter().chain(&block.watts[from.max(until)..]) {
                self.outside.0 += f64::from(*watts);
                self.outside.1 += 1.0;
            }
        }
    }

    /// Calls for all spans that overlap a stretch of time.
    fn touch(&mut self, from: f64, to: f64, mut what: impl FnMut(&mut FrameEnergy)) {
        let first = self.spans.list.partition_point(|span| span.end < from);
        for (span, frame) in self.spans.list[first..].iter().zip(&mut self.frames[first..]) {
            if span.start > to {
                break;
            }
            what(frame);
        }
    }

    /// Mean power before the first and after the last span, and the number of samples.
    pub(crate) fn outside(&self) -> (f64, f64) {
        (self.outside.0 / self.outside.1.max(1.0), self.outside.1)
    }

    /// Energies, less a constant power.
    pub(crate) fn finish(mut self, trace_start: i64, idle_w: f64) -> Vec<FrameEnergy> {
        for (which, (span, frame)) in self.spans.list.iter().zip(&mut self.frames).enumerate() {
            let n = f64::from(span.frames.max(1));
            let seconds = 1e-9 * (span.end - span.start);
            frame.time_s = seconds / n;
            frame.busy_s = 1e-9 * (span.busy_end - span.start) / n;
            let Some(at) = self.at.get(3 * which..3 * which + 3) else {
                frame.is_incomplete = true;
                continue;
            };
            if span.start < trace_start as f64 {
                frame.is_incomplete = true;
            }
            let energy = 0.5e-9 * (at[2] - at[0]);
            frame.energy_j = (energy - idle_w * seconds) / n;
            frame.mean_w = energy / seconds - idle_w;
            let busy = 1e-9 * (span.busy_end - span.start);
            frame.busy_w = if busy > 0.0 { 0.5e-9 * (at[1] - at[0]) / busy } else { 0.0 };
        }
        self.frames
    }
}
