//! What an analysis says.

use super::{AnalysisOptions, Found, IdlePolicy};
use crate::frames::{
    FrameEnergy, GapPlace, IdleGap, Segmentation, SensorVerdict, Signature, Spans, Waveform,
};
use crate::rails::Rail;
use crate::stats::{Statistic, level_changes, median, statistic};
use crate::survey::{Bins, Levels, Survey};
use crate::sync::ClockMap;
use crate::{Decimated, Quality, TraceInfo};
use serde::Serialize;

/// Least relative change of busy power that counts as another power state.
const STATE_CHANGE: f64 = 0.08;
/// Frames that a power state lasts at least.
const STATE_FRAMES: usize = 5;

/// Energy per pixel by the paper's eq. 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Eq2 {
    /// Energy over frames and pixels, in nanojoules; NaN if the size of images is not known.
    pub mean_nj_per_pixel: f64,
    /// Standard deviation over frames (over windows, where those are measured).
    pub deviation_nj_per_pixel: f64,
    /// Half the width of the confidence interval of the mean.
    pub half_width_nj_per_pixel: f64,
}

/// Frames of one algorithm, number of lights and size.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GroupResult {
    /// The algorithm.
    pub algorithm: String,
    /// Number of lights.
    pub lights: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Frames that were measured.
    pub frames: u64,
    /// Frames that count nowhere, because the trace does not hold all of them.
    pub incomplete: u64,
    /// Frames with interpolated samples.
    pub repaired: u64,
    /// Frames with clipped samples.
    pub clipped: u64,
    /// Energy per pixel.
    pub energy: Eq2,
    /// Energy per frame in joules.
    pub energy_j: Statistic,
    /// Time per frame in seconds.
    pub time_s: Statistic,
    /// Mean power over frames in watts, after the idle policy.
    pub power_w: Statistic,
    /// Mean power while frames were worked on, as measured.
    pub busy_w: Statistic,
    /// Idle time within the work of a frame, in seconds.
    pub idle_inside_s: f64,
    /// Idle time after the work of a frame, in seconds.
    pub idle_between_s: f64,
}

/// A frame that takes much longer than those around it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spike {
    /// The frame.
    pub frame: u64,
    /// Which of [`Analysis::groups`].
    pub group: usize,
    /// Its time in seconds.
    pub time_s: f64,
    /// Median time of the frames around it.
    pub usual_s: f64,
    /// Share of the additional time that is idle: near 1 for the paper's figure 3, whose cause is
    /// outside of the device.
    pub idle_share: f64,
    /// Its busy power relative to that of the frames around it.
    pub busy_ratio: f64,
}

/// A change of the power that the same work takes, such as from one clock to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PowerState {
    /// Which of [`Analysis::groups`].
    pub group: usize,
    /// The first frame (or window) in the new state.
    pub frame: u64,
    /// Its place in [`Analysis::frames`].
    pub index: usize,
    /// Mean busy power before and after, in watts.
    pub from_w: f64,
    /// See `from_w`.
    pub to_w: f64,
}

/// What was subtracted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IdleResult {
    /// By which policy.
    pub policy: IdlePolicy,
    /// How much, in watts.
    pub watts: f64,
    /// Mean power before the first and after the last frame, if there is such time.
    pub outside_w: Option<f64>,
}

/// The result of [`crate::analyze`].
#[derive(Clone, Debug, Serialize)]
pub struct Analysis {
    /// The trace about itself.
    pub info: TraceInfo,
    /// Rails.
    pub rails: Vec<Rail>,
    /// How good the trace is.
    pub quality: Quality,
    /// Levels of power.
    pub levels: Levels,
    /// Energy of the whole trace without its holes, in joules, nothing subtracted.
    pub total_j: f64,
    /// The time that this energy was measured over, in seconds.
    pub measured_s: f64,
    /// The line between the clocks of log and trace; none without a log.
    pub clock: Option<ClockMap>,
    /// How frames were found.
    pub segmentation: Segmentation,
    /// What the sensor can resolve.
    pub sensor: SensorVerdict,
    /// What was subtracted.
    pub idle: IdleResult,
    /// Results by algorithm, lights and size.
    pub groups: Vec<GroupResult>,
    /// All frames or windows, in order.
    pub frames: Vec<FrameEnergy>,
    /// Idle gaps, the first 65,536.
    pub gaps: Vec<IdleGap>,
    /// Frames that take longer than those around them by a third or more.
    pub spikes: Vec<Spike>,
    /// Changes of power states.
    pub states: Vec<PowerState>,
    /// Average course of power within frames; empty if the sensor is too slow.
    pub signatures: Vec<Signature>,
    /// A typical frame of each group (figures 7 and 8); empty if the sensor is too slow.
    pub waveforms: Vec<Waveform>,
    /// Eight frames around the longest delay, if there is one (figure 3).
    pub delays: Vec<Waveform>,
    /// The whole trace, filtered and decimated.
    #[serde(skip)]
    pub overview: Decimated,
    /// The whole trace as means over even bins.
    #[serde(skip)]
    pub bins: Bins,
}

pub(super) struct Parts<'a> {
    pub(super) info: TraceInfo,
    pub(super) rails: Vec<Rail>,
    pub(super) quality: Quality,
    pub(super) survey: Survey,
    pub(super) clock: Option<ClockMap>,
    pub(super) spans: &'a Spans,
    pub(super) sensor: SensorVerdict,
    pub(super) idle: IdleResult,
    pub(super) found: Found,
    pub(super) options: &'a AnalysisOptions,
}

pub(super) fn assemble(parts: Parts<'_>) -> Analysis {
    let Parts { spans, found, survey, .. } = parts;
    let groups = (0..spans.groups.len())
        .map(|group| group_result(spans, group, &found.frames, parts.options.confidence))
        .collect();
    let is_by_frame =
        spans.segmentation == Segmentation::Log || spans.segmentation == Segmentation::Marks;
    Analysis {
        info: parts.info,
        rails: parts.rails,
        quality: parts.quality,
        levels: survey.levels,
        total_j: survey.energy_j,
        measured_s: survey.measured_s,
        clock: parts.clock,
        segmentation: spans.segmentation,
        sensor: parts.sensor,
        idle: parts.idle,
        groups,
        spikes: if is_by_frame { spikes(&found.frames) } else { Vec::new() },
        states: states(&found.frames),
        frames: found.frames,
        gaps: found.gaps,
        signatures: found.signatures,
        waveforms: found.waveforms,
        delays: found.delays,
        overview: found.overview,
        bins: survey.bins,
    }
}

fn group_result(
    spans: &Spans,
    group: usize,
    frames: &[FrameEnergy],
    confidence: f64,
) -> GroupResult {
    let what = &spans.groups[group];
    let members: Vec<_> = frames.iter().filter(|f| f.group == group).collect();
    let good: Vec<_> = members.iter().filter(|f| !f.is_incomplete).copied().collect();
    let series = |of: fn(&FrameEnergy) -> f64| -> Vec<f64> { good.iter().map(|f| of(f)).collect() };
    let count = |is: fn(&FrameEnergy) -> bool| -> u64 {
        members.iter().filter(|f| is(f)).map(|f| u64::from(f.frames)).sum()
    };
    let pixels = f64::from(what.width) * f64::from(what.height);
    let nj = |joules: f64| if pixels > 0.0 { 1e9 * joules / pixels } else { f64::NAN };
    let energy_j = statistic(&series(|f| f.energy_j), confidence);
    let frames: f64 = good.iter().map(|f| f64::from(f.frames)).sum();
    // Eq. 2 weighs frames alike, however many are in a window.
    let total: f64 = good.iter().map(|f| f.energy_j * f64::from(f.frames)).sum();
    let mean = |of: fn(&FrameEnergy) -> f64| {
        good.iter().map(|f| of(f) * f64::from(f.frames)).sum::<f64>() / frames.max(1.0)
    };
    GroupResult {
        algorithm: what.algorithm.clone(),
        lights: what.lights,
        width: what.width,
        height: what.height,
        frames: good.iter().map(|f| u64::from(f.frames)).sum(),
        incomplete: count(|f| f.is_incomplete),
        repaired: count(|f| f.is_repaired && !f.is_incomplete),
        clipped: count(|f| f.is_clipped && !f.is_incomplete),
        energy: Eq2 {
            mean_nj_per_pixel: nj(total / frames),
            deviation_nj_per_pixel: nj(energy_j.deviation),
            half_width_nj_per_pixel: nj(energy_j.half_width),
        },
        energy_j,
        time_s: statistic(&series(|f| f.time_s), confidence),
        power_w: statistic(&series(|f| f.mean_w), confidence),
        busy_w: statistic(&series(|f| f.busy_w), confidence),
        idle_inside_s: mean(|f| f.idle_inside_s),
        idle_between_s: mean(|f| f.idle_between_s),
    }
}

/// How much longer than usual a frame takes that is reported.
pub(super) const SPIKE: f64 = 4.0 / 3.0;

/// Neighbours on either side that a frame is compared with.
const AROUND: usize = 10;

fn spikes(frames: &[FrameEnergy]) -> Vec<Spike> {
    let mut spikes = Vec::new();
    for (at, frame) in frames.iter().enumerate() {
        let around = &frames[at.saturating_sub(AROUND)..(at + AROUND + 1).min(frames.len())];
        let near: Vec<_> = around
            .iter()
            .filter(|f| f.group == frame.group && f.frame != frame.frame && !f.is_incomplete)
            .collect();
        if near.len() < 4 || frame.is_incomplete {
            continue;
        }
        let usual = |of: fn(&FrameEnergy) -> f64| median(near.iter().map(|f| of(f)).collect());
        let usual_s = usual(|f| f.time_s);
        if frame.time_s < SPIKE * usual_s {
            continue;
        }
        let idle = |f: &FrameEnergy| f.idle_inside_s + f.idle_between_s;
        let more_idle = idle(frame) - usual(|f| f.idle_inside_s + f.idle_between_s);
        spikes.push(Spike {
            frame: frame.frame,
            group: frame.group,
            time_s: frame.time_s,
            usual_s,
            idle_share: (more_idle / (frame.time_s - usual_s)).clamp(0.0, 1.0),
            busy_ratio: frame.busy_w / usual(|f| f.busy_w),
        });
    }
    spikes
}

/// Changes within stretches of the same work; that other work takes other power is no change of state.
fn states(frames: &[FrameEnergy]) -> Vec<PowerState> {
    let mut found = Vec::new();
    let good: Vec<_> = frames.iter().enumerate().filter(|(_, f)| !f.is_incomplete).collect();
    for run in good.chunk_by(|a, b| a.1.group == b.1.group) {
        let power: Vec<_> = run.iter().map(|(_, f)| f.busy_w).collect();
        let changes = level_changes(&power, STATE_CHANGE, STATE_FRAMES);
        let mut borders = vec![0];
        borders.extend_from_slice(&changes);
        borders.push(power.len());
        let mean = |a: usize, b: usize| power[a..b].iter().sum::<f64>() / (b - a) as f64;
        for three in borders.windows(3) {
            let (index, frame) = run[three[1]];
            found.push(PowerState {
                group: frame.group,
                frame: frame.frame,
                index,
                from_w: mean(three[0], three[1]),
                to_w: mean(three[1], three[2]),
            });
        }
    }
    found
}

impl Analysis {
    /// Number and total time in seconds of idle gaps at a place, as far as they are listed.
    #[must_use]
    pub fn idle_gaps(&self, place: GapPlace) -> (usize, f64) {
        let all = self.gaps.iter().filter(|g| g.place == place);
        (all.clone().count(), all.map(|g| 1e-9 * g.length_ns as f64).sum())
    }
}
