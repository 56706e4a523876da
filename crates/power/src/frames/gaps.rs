//! Idle gaps within and between frames.

use super::meter::FrameEnergy;
use super::spans::Spans;
use crate::PowerBlock;
use serde::{Deserialize, Serialize};

/// Where a gap is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GapPlace {
    /// Within the work of a frame, such as between the lights of shadow mapping (the paper's figure 7).
    Inside,
    /// Between the end of a frame's work and the next frame (the paper's figure 3).
    Between,
}

/// A stretch of idle power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IdleGap {
    /// The frame that it is in or after.
    pub frame: u64,
    /// Which of [`crate::Analysis::groups`] that frame belongs to.
    pub group: usize,
    /// Where.
    pub place: GapPlace,
    /// Start in nanoseconds of the trace.
    pub start_ns: i64,
    /// Length in nanoseconds.
    pub length_ns: i64,
}

/// Gaps that are kept; times per frame go on.
const MAX_GAPS: usize = 1 << 16;

/// Finds stretches of idle power.
pub(crate) struct GapFinder<'a> {
    spans: &'a Spans,
    limit: f32,
    least_ns: i64,
    /// First and last low sample of the gap that is open.
    open: Option<(i64, i64)>,
    /// Whether the sample before this one was high.
    was_high: bool,
    before: i64,
    gaps: Vec<IdleGap>,
    /// Idle nanoseconds of each span: inside, between.
    idle: Vec<(f64, f64)>,
    first_open: usize,
}

impl<'a> GapFinder<'a> {
    /// Gaps are at least `least_ns` long.
    pub(crate) fn new(spans: &'a Spans, limit_w: f64, least_ns: i64) -> Self {
        Self {
            spans,
            #[expect(clippy::cast_possible_truncation, reason = "watts of a device")]
            limit: limit_w as f32,
            least_ns,
            open: None,
            was_high: false,
            before: i64::MIN,
            gaps: Vec::new(),
            idle: vec![(0.0, 0.0); spans.list.len()],
            first_open: 0,
        }
    }

    pub(crate) fn push(&mut self, block: &PowerBlock) {
        if block.follows_hole {
            self.close();
        }
        for (&time, &watts) in block.times_ns.iter().zip(&block.watts) {
            if watts < self.limit {
                let start = self.open.map_or(time, |(start, _)| start);
                self.open = Some((start, time));
                self.was_high = false;
            } else if self.open.is_some() {
                // A single sample of noise does not end a gap.
                if self.was_high {
                    self.close();
                } else {
                    self.was_high = true;
                    self.before = time;
                }
            }
        }
    }

    fn close(&mut self) {
        let Some((start, last)) = self.open.take() else { return };
        // Up to the first high sample, if there was one.
        let end = if self.was_high { self.before } else { last };
        self.was_high = false;
        if end - start < self.least_ns {
            return;
        }
        let (from, to) = (start as f64, end as f64);
        while self.spans.list.get(self.first_open).is_some_and(|span| span.end < from) {
            self.first_open += 1;
        }
        for at in self.first_open..self.spans.list.len() {
            let span = self.spans.list[at];
            if span.start > to {
                break;
            }
            let inside = to.min(span.busy_end) - from.max(span.start);
            let between = to.min(span.end) - from.max(span.busy_end);
            for (length, place) in [(inside, GapPlace::Inside), (between, GapPlace::Between)] {
                // What reaches over a border by less than a gap belongs to the other side.
                if length < self.least_ns as f64 {
                    continue;
                }
                let begin = match place {
                    GapPlace::Inside => {
                        self.idle[at].0 += length;
                        from.max(span.start)
                    }
                    GapPlace::Between => {
                        self.idle[at].1 += length;
                        from.max(span.busy_end)
                    }
                };
                if self.gaps.len() < MAX_GAPS {
                    #[expect(clippy::cast_possible_truncation, reason = "times of the trace")]
                    self.gaps.push(IdleGap {
                        frame: span.frame,
                        group: span.group,
                        place,
                        start_ns: begin as i64,
                        length_ns: length as i64,
                    });
                }
            }
        }
    }

    /// The gaps; the times of each frame are put into `frames`.
    pub(crate) fn finish(mut self, frames: &mut [FrameEnergy]) -> Vec<IdleGap> {
        self.close();
        for (frame, (inside, between)) in frames.iter_mut().zip(&self.idle) {
            let n = f64::from(frame.frames.max(1));
            frame.idle_inside_s = 1e-9 * inside / n;
            frame.idle_between_s = 1e-9 * between / n;
        }
        self.gaps
    }
}
