//! Which time belongs to which frame.

use crate::stats::median;
use crate::{FrameLog, Quality, SensorNote};
use serde::{Deserialize, Serialize};

/// Readings of the sensor that a frame must span to be measured by itself.
const LEAST_READINGS: f64 = 8.0;
/// Readings that a window spans where frames are too short.
const WINDOW_READINGS: f64 = 20.0;

/// How the trace was cut into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Segmentation {
    /// By the frame log.
    Log,
    /// From mark to mark; there is no log.
    Marks,
    /// Windows of several frames of the log, because the sensor is too slow for one.
    LogWindows,
    /// Windows of time; there is neither log nor mark.
    Windows,
}

/// What the sensor can resolve.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorVerdict {
    /// Time between new readings in seconds.
    pub refresh_s: f64,
    /// Median time of a frame in seconds, where there are frames.
    pub frame_s: Option<f64>,
    /// Whether frames are too short to be measured one by one.
    pub is_too_slow: bool,
    /// Share of the time that the sensor sees, as far as it is known.
    pub coverage: Option<f64>,
    /// All of that in words.
    pub words: String,
}

/// Frames that render the same thing in the same way.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Group {
    pub(crate) algorithm: String,
    pub(crate) lights: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
}

/// A stretch of time that is measured as one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    /// Number of its (first) frame.
    pub(crate) frame: u64,
    /// Frames in it.
    pub(crate) frames: u32,
    pub(crate) group: usize,
    /// Nanoseconds of the trace.
    pub(crate) start: f64,
    /// End of the work; idle time follows until `end`.
    pub(crate) busy_end: f64,
    pub(crate) end: f64,
}

/// All spans in order, none overlapping.
#[derive(Clone, Debug)]
pub(crate) struct Spans {
    pub(crate) list: Vec<Span>,
    pub(crate) groups: Vec<Group>,
    pub(crate) segmentation: Segmentation,
}

impl Spans {
    /// Frames of a log. A frame lasts until the next one starts (that is what eq. 2 divides by frames),
    /// unless that is more than `break_ns` after its work ended: then something else went on between.
    pub(crate) fn of_log(log: &FrameLog, place: impl Fn(i64) -> f64, break_ns: f64) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        let mut list: Vec<Span> = Vec::with_capacity(log.frames.len());
        for frame in &log.frames {
            let group = Group {
                algorithm: frame.algorithm.clone(),
                lights: frame.lights,
                width: frame.width,
                height: frame.height,
            };
            let group = groups.iter().rposition(|g| *g == group).unwrap_or_else(|| {
                groups.push(group);
                groups.len() - 1
            });
            let start = place(frame.start_ns);
            let busy_end = place(frame.end_ns).max(start);
            if let Some(before) = list.last_mut() {
                let is_same_run = before.group == group && start - before.busy_end <= break_ns;
                before.busy_end = before.busy_end.min(start).max(before.start);
                before.end = if is_same_run { start } else { before.busy_end };
                before.end = before.end.max(before.start);
            }
            let span =
                Span { frame: frame.frame, frames: 1, group, start, busy_end, end: busy_end };
            list.push(span);
        }
        list.retain(|span| span.end > span.start);
        Self { list, groups, segmentation: Segmentation::Log }
    }

    pub(crate) fn of_marks(marks: &[f64], size: (u32, u32)) -> Self {
        let group = Group { width: size.0, height: size.1, ..Group::default() };
        let list = (0..)
            .zip(marks.windows(2))
            .map(|(frame, pair)| {
                let (start, end) = (pair[0], pair[1]);
                Span { frame, frames: 1, group: 0, start, busy_end: end, end }
            })
            .filter(|span| span.end > span.start)
            .collect();
        Self { list, groups: vec![group], segmentation: Segmentation::Marks }
    }

    /// Equal windows.
    pub(crate) fn of_time((from, to): (i64, i64), window_ns: f64, size: (u32, u32)) -> Self {
        let group = Group { width: size.0, height: size.1, ..Group::default() };
        let length = (to - from) as f64;
        let count = (length / window_ns).floor().clamp(1.0, 1e6);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
        let list = (0..count as u64)
            .map(|frame| {
                let at = |i: u64| from as f64 + length * i as f64 / count;
                let (start, end) = (at(frame), at(frame + 1));
                Span { frame, frames: 1, group: 0, start, busy_end: end, end }
            })
            .collect();
        Self { list, groups: vec![group], segmentation: Segmentation::Windows }
    }

    /// Frames of one group on end, together as long as a window; what is left over joins the last one.
    pub(crate) fn in_windows(self, window_ns: f64) -> Self {
        let mut list: Vec<Span> = Vec::new();
        for span in &self.list {
            match list.last_mut() {
                Some(last)
                    if last.group == span.group
                        && span.start <= last.end
                        && last.end - last.start < window_ns =>
                {
                    last.end = span.end;
                    last.busy_end = span.busy_end;
                    last.frames += span.frames;
                }
                _ => list.push(*span),
            }
        }
        let mut at = 1;
        while at < list.len() {
            let (before, this) = (list[at - 1], list[at]);
            let is_rest = this.end - this.start < window_ns && before.group == this.group;
            if is_rest && this.start <= before.end {
                list[at - 1].end = this.end;
                list[at - 1].busy_end = this.busy_end;
                list[at - 1].frames += this.frames;
                list.remove(at);
            } else {
                at += 1;
            }
        }
        Self { list, segmentation: Segmentation::LogWindows, ..self }
    }

    /// Puts starts and ends of frames on edges or marks that are near, in order.
    pub(crate) fn snap(&mut self, rising: &[f64], falling: &[f64], reach: f64) {
        let near = |times: &[f64], time: f64| {
            let at = times.partition_point(|&t| t < time);
            let both = times[at.saturating_sub(1)..(at + 1).min(times.len())].iter().copied();
            let nearest = both.min_by(|a, b| (a - time).abs().total_cmp(&(b - time).abs()));
            nearest.filter(|t| (t - time).abs() <= reach).unwrap_or(time)
        };
        for at in 0..self.list.len() {
            let joins = at > 0 && self.list[at - 1].end == self.list[at].start;
            let start = near(rising, self.list[at].start);
            if start < self.list[at].busy_end && (at == 0 || start >= self.list[at - 1].busy_end) {
                self.list[at].start = start;
                if joins {
                    self.list[at - 1].end = start;
                }
            }
            let span = &mut self.list[at];
            let busy_end = near(falling, span.busy_end);
            if busy_end > span.start {
                let is_last = span.end == span.busy_end;
                if is_last || busy_end <= span.end {
                    span.busy_end = busy_end;
                }
                if is_last {
                    span.end = busy_end;
                }
            }
        }
        // An end that moved past the next start would let frames share samples.
        for at in 1..self.list.len() {
            let start = self.list[at].start;
            let before = &mut self.list[at - 1];
            before.end = before.end.min(start);
            before.busy_end = before.busy_end.min(before.end);
        }
    }

    pub(crate) fn median_length(&self) -> Option<f64> {
        let length = median(self.list.iter().map(|s| s.end - s.start).collect());
        length.is_finite().then_some(length)
    }
}

/// Compares the time of frames with the sensor's.
pub(crate) fn judge_sensor(
    quality: &Quality,
    note: &SensorNote,
    frame_ns: Option<f64>,
) -> SensorVerdict {
    let declared = note.refresh_s.unwrap_or(0.0) * 1e9;
    let refresh = quality.refresh_ns.max(quality.period_ns).max(declared);
    let is_too_slow = frame_ns.is_some_and(|frame| frame < LEAST_READINGS * refresh);
    let mut words = format!("new readings every {}", time(refresh));
    if let Some(frame) = frame_ns {
        words += &format!("; frames take {}", time(frame));
    }
    words += if is_too_slow {
        ", too short to be measured one by one: windows of many frames are measured instead, and \
         nothing is said about what happens within a frame"
    } else if frame_ns.is_some() {
        ", long enough to be measured one by one"
    } else {
        ""
    };
    if let Some(coverage) = note.coverage {
        words += &format!(
            "; the sensor sees only {:.0} % of the time ({}), so whatever repeats in step with it is \
             measured wrongly",
            100.0 * coverage,
            note.source
        );
    }
    SensorVerdict {
        refresh_s: refresh * 1e-9,
        frame_s: frame_ns.map(|x| x * 1e-9),
        is_too_slow,
        coverage: note.coverage,
        words,
    }
}

/// How long windows have to be.
pub(crate) fn window_ns(verdict: &SensorVerdict) -> f64 {
    WINDOW_READINGS * verdict.refresh_s * 1e9
}

fn time(ns: f64) -> String {
    match ns {
        x if x < 1e3 => format!("{x:.0} ns"),
        x if x < 1e6 => format!("{:.3} µs", x / 1e3),
        x if x < 1e9 => format!("{:.3} ms", x / 1e6),
        x => format!("{:.3} s", x / 1e9),
    }
}
