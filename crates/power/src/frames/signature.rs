//! What power looks like within a frame: on average, and of single frames.

use super::spans::Spans;
use crate::PowerBlock;
use serde::Serialize;

/// Most parts of a frame, a power of two.
const PARTS: usize = 256;
/// Fewest parts that tell anything of a frame.
const LEAST_PARTS: usize = 4;
/// New readings that a part needs on average: the power of a single one is as noisy as its clock.
const LEAST_READINGS: f64 = 16.0;
/// Samples of one waveform that are kept.
const MAX_SAMPLES: usize = 1 << 17;

/// The average course of power within the frames of a group.
///
/// The work of a frame and the idle time after it are stretched each to its mean share of a frame, so
/// that both ends of the work line up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Signature {
    /// Which of [`crate::Analysis::groups`].
    pub group: usize,
    /// Mean power in each of 4 to 256 equal parts of a frame's time, in watts; NaN where no sample fell.
    /// As many parts, a power of two, as the sensor can tell apart: none is shorter than the time between
    /// new readings, and each had 16 of them or more over all frames. Sensors too slow, or frames too
    /// few, for four parts give no signature.
    pub mean_w: Vec<f64>,
    /// Standard deviation over samples in each part.
    pub deviation_w: Vec<f64>,
    /// Mean share of a frame's time after which its work was done.
    pub busy_share: f64,
    /// Mean time of a frame in seconds.
    pub frame_s: f64,
    /// Frames that were averaged.
    pub frames: usize,
}

/// Samples of a stretch of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Waveform {
    /// Which of [`crate::Analysis::groups`].
    pub group: usize,
    /// Number of the frame that it shows, or that is in its middle.
    pub frame: u64,
    /// Times in seconds from the start of that frame.
    pub times_s: Vec<f64>,
    /// Power as measured, in watts.
    pub watts: Vec<f64>,
    /// The same after a zero-phase low-pass filter.
    pub smooth_w: Vec<f64>,
    /// Starts and ends of work of the frames that are shown, in seconds.
    pub frames_s: Vec<(f64, f64)>,
}

/// Averages signatures.
pub(crate) struct Signatures<'a> {
    spans: &'a Spans,
    sums: Vec<Vec<(f64, f64, u32)>>,
    /// Mean share of work of each group.
    busy: Vec<f64>,
    /// Time between new readings.
    refresh_ns: f64,
    at: usize,
}

impl<'a> Signatures<'a> {
    pub(crate) fn new(spans: &'a Spans, refresh_ns: f64) -> Self {
        let share = |group: usize| {
            let (mut sum, mut n) = (0.0, 0.0f64);
            for span in spans.list.iter().filter(|s| s.group == group) {
                sum += (span.busy_end - span.start) / (span.end - span.start);
                n += 1.0;
            }
            sum / n.max(1.0)
        };
        let groups = spans.groups.len();
        Self {
            spans,
            sums: vec![vec![(0.0, 0.0, 0); PARTS]; groups],
            busy: (0..groups).map(share).collect(),
            refresh_ns,
            at: 0,
        }
    }

    pub(crate) fn push(&mut self, block: &PowerBlock) {
        let times = &block.times_ns;
        let mut row = 0;
        while let (Some(span), true) = (self.spans.list.get(self.at), row < times.len()) {
            row += times[row..].partition_point(|&t| (t as f64) < span.start);
            let end = row + times[row..].partition_point(|&t| (t as f64) < span.end);
            let busy = self.busy[span.group] * PARTS as f64;
            let work = busy / (span.busy_end - span.start);
            let idle = (PARTS as f64 - busy) / (span.end - span.busy_end);
            let sums = &mut self.sums[span.group];
            for (&time, &watts) in times[row..end].iter().zip(&block.watts[row..end]) {
                let time = time as f64;
                let part = if time < span.busy_end {
                    (time - span.start) * work
                } else {
                    busy + (time - span.busy_end) * idle
                };
                // A span without work or without idle time has no such samples.
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0 to 256"
                )]
                let part = part as usize;
                let (sum, squares, count) = &mut sums[part.min(PARTS - 1)];
                let watts = f64::from(watts);
                *sum += watts;
                *squares += watts * watts;
                *count += 1;
            }
            row = end;
            if end < times.len() {
                self.at += 1;
            }
        }
    }

    pub(crate) fn finish(self) -> Vec<Signature> {
        let of = |(group, sums): (usize, &Vec<(f64, f64, u32)>)| {
            let members = || self.spans.list.iter().filter(|s| s.group == group);
            let frames = members().count();
            let n = frames.max(1) as f64;
            let length = members().map(|s| s.end - s.start).sum::<f64>() / n;
            let parts = told_apart(length / self.refresh_ns.max(1.0), n)?;
            let sums: Vec<_> = sums
                .chunks(PARTS / parts)
                .map(|some| {
                    some.iter().fold((0.0, 0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2))
                })
                .collect();
            let means = sums.iter().map(|(sum, _, n)| sum / f64::from(*n));
            let spread = |(sum, squares, count): &(f64, f64, u32)| {
                let n = f64::from(*count);
                ((squares - sum * sum / n) / (n - 1.0)).max(0.0).sqrt()
            };
            Some(Signature {
                group,
                mean_w: means.collect(),
                deviation_w: sums.iter().map(spread).collect(),
                busy_share: self.busy[group],
                frame_s: 1e-9 * length,
                frames,
            })
        };
        self.sums.iter().enumerate().filter_map(of).filter(|s| s.frames > 0).collect()
    }
}

/// Into how many parts, a power of two, a frame can be divided where the sensor has so many new readings a frame;
/// `None` if into too few to tell anything.
fn told_apart(readings: f64, frames: f64) -> Option<usize> {
    let most = readings.min(readings * frames / LEAST_READINGS);
    let mut parts = PARTS;
    while parts as f64 > most {
        parts /= 2;
        if parts < LEAST_PARTS {
            return None;
        }
    }
    Some(parts)
}

/// Keeps samples of chosen stretches.
pub(crate) struct Captures {
    /// Bounds, origin, and what is kept.
    wanted: Vec<(i64, i64, f64, Waveform)>,
}

impl Captures {
    pub(crate) const fn new() -> Self {
        Self { wanted: Vec::new() }
    }

    /// Asks for the frames `first..=last` of the list, with `margin` of their time before and after.
    pub(crate) fn add(
        &mut self,
        spans: &Spans,
        first: usize,
        shown: usize,
        last: usize,
        margin: f64,
    ) {
        let (a, b) = (spans.list[first].start, spans.list[last].end);
        let margin = margin * (b - a);
        let origin = spans.list[shown].start;
        let frames = spans.list[first..=last].iter();
        let waveform = Waveform {
            group: spans.list[shown].group,
            frame: spans.list[shown].frame,
            frames_s: frames
                .map(|s| (1e-9 * (s.start - origin), 1e-9 * (s.busy_end - origin)))
                .collect(),
            ..Waveform::default()
        };
        #[expect(clippy::cast_possible_truncation, reason = "times of the trace")]
        self.wanted.push(((a - margin) as i64, (b + margin) as i64, origin, waveform));
    }

    pub(crate) fn push(&mut self, block: &PowerBlock) {
        let times = &block.times_ns;
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return };
        for (from, to, origin, waveform) in &mut self.wanted {
            if *to < first || *from > last {
                continue;
            }
            let start = times.partition_point(|t| t < from);
            let end = times.partition_point(|t| t <= to);
            let room = MAX_SAMPLES.saturating_sub(waveform.watts.len());
            for row in (start..end).take(room) {
                waveform.times_s.push(1e-9 * (times[row] as f64 - *origin));
                waveform.watts.push(f64::from(block.watts[row]));
            }
        }
    }

    pub(crate) fn finish(self) -> Vec<Waveform> {
        self.wanted.into_iter().map(|(.., waveform)| waveform).collect()
    }
}
