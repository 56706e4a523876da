//! A whole analysis: a trace, and a log if there is one, to energy per pixel.

mod report;

pub use report::{Analysis, Eq2, GroupResult, IdleResult, PowerState, Spike};

use crate::clean::{CleanOptions, CleanStream, PowerBlock, PowerStream};
use crate::filter::{Decimated, Decimator};
use crate::frames::{
    Captures, GapFinder, Meter, Segmentation, Signatures, Spans, judge_sensor, window_ns,
};
use crate::rails::{Rail, rails_by_name};
use crate::survey::{Levels, Survey, survey};
use crate::sync::{ClockMap, SyncMethod, synchronize};
use crate::{Butterworth, FrameLog, PowerError, TraceReader, Waveform};
use serde::{Deserialize, Serialize};

/// What is subtracted as power that is not the algorithm's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IdlePolicy {
    /// Nothing, as in the paper for graphics cards: all that flows into the card counts.
    #[default]
    Keep,
    /// A constant in watts, measured otherwise.
    Watts(f64),
    /// The mean power before the first and after the last frame of the trace, as in the paper for
    /// devices whose graphics processor is not alone on its supply.
    Outside,
    /// The lowest level of the trace, [`Levels::low_w`].
    Lowest,
}

/// Settings of [`analyze`].
#[derive(Clone, Debug)]
pub struct AnalysisOptions {
    /// Rails; none to take them from names of columns ([`rails_by_name`]).
    pub rails: Option<Vec<Rail>>,
    /// Constant voltages of rails by name, for that.
    pub volts: Vec<(String, f64)>,
    /// How far repair may go.
    pub clean: CleanOptions,
    /// How the log and the trace are brought together.
    pub sync: SyncMethod,
    /// What is subtracted.
    pub idle: IdlePolicy,
    /// Width and height in pixels where there is no log to tell.
    pub size: Option<(u32, u32)>,
    /// Level of confidence intervals.
    pub confidence: f64,
    /// Least length of an idle gap in seconds, at least four samples. The default is 100 µs.
    pub least_gap_s: f64,
    /// Bytes of power to keep between the two passes; longer traces are read twice. The default is
    /// 384 MiB, 13 minutes at 40 kHz.
    pub keep_bytes: usize,
    /// Points of the overview, about. The default is 4000.
    pub overview_points: usize,
}

impl Default for AnalysisOptions {
    fn default() -> Self {
        Self {
            rails: None,
            volts: Vec::new(),
            clean: CleanOptions::default(),
            sync: SyncMethod::Auto,
            idle: IdlePolicy::Keep,
            size: None,
            confidence: 0.95,
            least_gap_s: 100e-6,
            keep_bytes: 384 << 20,
            overview_points: 4000,
        }
    }
}

/// Analyses a trace in two passes: the first repairs it and finds what synchronisation needs, the second
/// measures frames. `open` is called once, or twice if the trace is longer than
/// [`AnalysisOptions::keep_bytes`] allows to keep; memory does not grow with the trace beyond that.
///
/// ```
/// use niwaki_power::generator::{Recording, RecordingOptions};
/// use niwaki_power::{AnalysisOptions, analyze};
///
/// let recording = Recording::new(&RecordingOptions::quick(1))?;
/// let analysis = analyze(
///     || Ok(Box::new(recording.reader())),
///     Some(&recording.log()),
///     &AnalysisOptions::default(),
/// )?;
/// let group = &analysis.groups[0];
/// println!("{} {:.1} nJ/pixel", group.algorithm, group.energy.mean_nj_per_pixel);
/// # Ok::<(), niwaki_power::PowerError>(())
/// ```
///
/// # Errors
/// Those of the reader and of [`crate::Cleaner::new`]; [`PowerError::Empty`] without samples;
/// [`PowerError::NoSync`] if a log was given that does not fit; [`PowerError::Setting`] if the idle policy
/// asks for idle time that the trace does not have.
pub fn analyze(
    mut open: impl FnMut() -> Result<Box<dyn TraceReader>, PowerError>,
    log: Option<&FrameLog>,
    options: &AnalysisOptions,
) -> Result<Analysis, PowerError> {
    if !(options.confidence > 0.0 && options.confidence < 1.0) {
        return Err(PowerError::Setting("a level of confidence is between 0 and 1".into()));
    }
    let reader = open()?;
    let info = reader.info().clone();
    let rails = match &options.rails {
        Some(rails) => rails.clone(),
        None => rails_by_name(&info.columns, &options.volts, true)?,
    };
    let mut stream = CleanStream::new(reader, &rails, &options.clean)?;
    let mut survey = survey(&mut stream, options.keep_bytes)?;
    let quality = stream.into_quality();
    survey.period_ns = quality.period_ns;
    let kept = survey.kept.take();

    let resolution = quality.refresh_ns.max(quality.period_ns);
    let clock = match log {
        Some(log) => Some(synchronize(log, &survey, info.clock, resolution, options.sync)?),
        None => None,
    };
    let mut spans = cut(log, clock.as_ref(), &survey, resolution, options);
    let frame_ns = match spans.segmentation {
        Segmentation::Windows => None,
        _ => spans.median_length(),
    };
    let sensor = judge_sensor(&quality, &info.sensor, frame_ns);
    if sensor.is_too_slow {
        spans = spans.in_windows(window_ns(&sensor));
    }

    let mut second = Second::new(
        &spans,
        &survey,
        [quality.period_ns, 1e9 * sensor.refresh_s],
        frame_ns,
        options,
    )?;
    if let Some(blocks) = kept {
        // Blocks go as they are used, so that their memory does too.
        for block in blocks {
            second.push(&block);
        }
    } else {
        let mut again = CleanStream::new(open()?, &rails, &options.clean)?;
        while let Some(block) = again.next_power()? {
            second.push(&block);
        }
    }
    let idle = idle(options.idle, &survey.levels, &second.meter)?;
    let found = second.finish(&survey, idle.watts, quality.period_ns);
    Ok(report::assemble(report::Parts {
        info,
        rails,
        quality,
        survey,
        clock,
        spans: &spans,
        sensor,
        idle,
        found,
        options,
    }))
}

/// Cuts the trace into frames.
fn cut(
    log: Option<&FrameLog>,
    clock: Option<&ClockMap>,
    survey: &Survey,
    resolution: f64,
    options: &AnalysisOptions,
) -> Spans {
    let size = options.size.unwrap_or((0, 0));
    if let (Some(log), Some(clock)) = (log, clock) {
        let mut spans = Spans::of_log(log, |t| clock.to_trace(t), 1e9);
        let reach = (5.0 * clock.residual_ns).clamp(3.0 * resolution, 20.0 * resolution);
        match clock.method {
            SyncMethod::Marker => {
                spans.snap(&survey.mark_times(), &[], reach);
            }
            SyncMethod::Correlation => {
                let range = survey.levels.high_w - survey.levels.low_w;
                let strong = |sign: f64| -> Vec<f64> {
                    let all = survey.edges.iter();
                    let is_strong = |step: f32| sign * f64::from(step) > 0.4 * range;
                    all.filter(|e| is_strong(e.step_w)).map(|e| e.time_ns).collect()
                };
                spans.snap(&strong(1.0), &strong(-1.0), reach);
            }
            _ => {}
        }
        return spans;
    }
    if survey.marks.len() > 1 {
        return Spans::of_marks(&survey.mark_times(), size);
    }
    let length = (survey.span_ns.1 - survey.span_ns.0) as f64;
    // A hundred windows, if the sensor gives enough readings for that.
    Spans::of_time(survey.span_ns, (length / 100.0).max(20.0 * resolution), size)
}

fn idle(policy: IdlePolicy, levels: &Levels, meter: &Meter<'_>) -> Result<IdleResult, PowerError> {
    let (outside, samples) = meter.outside();
    let measured = (samples >= 16.0).then_some(outside);
    let watts = match policy {
        IdlePolicy::Keep => 0.0,
        IdlePolicy::Watts(watts) if watts.is_finite() => watts,
        IdlePolicy::Watts(_) => {
            return Err(PowerError::Setting("idle power is not a number".into()));
        }
        IdlePolicy::Outside => measured.ok_or_else(|| {
            PowerError::Setting(
                "there is no time before the first or after the last frame to measure idle power in; \
                 record some, or give it in watts"
                    .into(),
            )
        })?,
        IdlePolicy::Lowest => levels.low_w,
    };
    Ok(IdleResult { policy, watts, outside_w: measured })
}

/// What the second pass finds.
pub(crate) struct Found {
    pub(crate) frames: Vec<crate::FrameEnergy>,
    pub(crate) gaps: Vec<crate::IdleGap>,
    pub(crate) signatures: Vec<crate::Signature>,
    pub(crate) waveforms: Vec<Waveform>,
    pub(crate) delays: Vec<Waveform>,
    pub(crate) overview: Decimated,
}

/// The second pass.
struct Second<'a> {
    meter: Meter<'a>,
    gaps: GapFinder<'a>,
    signatures: Option<Signatures<'a>>,
    singles: Captures,
    delays: Captures,
    decimator: Decimator,
    overview: Decimated,
}

impl<'a> Second<'a> {
    fn new(
        spans: &'a Spans,
        survey: &Survey,
        [period_ns, refresh_ns]: [f64; 2],
        frame_ns: Option<f64>,
        options: &AnalysisOptions,
    ) -> Result<Self, PowerError> {
        let rows = survey.measured_s * 1e9 / period_ns.max(1.0);
        let factor = (rows / options.overview_points.max(16) as f64).clamp(1.0, 1e6);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to a million"
        )]
        let factor = factor as usize;
        #[expect(clippy::cast_possible_truncation, reason = "a time below a trace's")]
        let least_gap = (options.least_gap_s * 1e9).max(4.0 * period_ns) as i64;
        let is_by_frame = matches!(spans.segmentation, Segmentation::Log | Segmentation::Marks)
            && frame_ns.is_some();
        let (mut singles, mut delays) = (Captures::new(), Captures::new());
        if is_by_frame {
            for group in 0..spans.groups.len() {
                if let Some(at) = typical(spans, group) {
                    singles.add(spans, at, at, at, 0.05);
                }
            }
            if let Some(at) = longest(spans) {
                // The paper's figure 3: eight frames, the fourth of which is followed by a delay.
                let first = at.saturating_sub(3);
                delays.add(spans, first, at, (at + 4).min(spans.list.len() - 1), 0.0);
            }
        }
        Ok(Self {
            meter: Meter::new(spans),
            gaps: GapFinder::new(spans, survey.levels.idle_limit_w(), least_gap),
            signatures: is_by_frame.then(|| Signatures::new(spans, refresh_ns)),
            singles,
            delays,
            decimator: Decimator::new(factor)?,
            overview: Decimated::default(),
        })
    }

    fn push(&mut self, block: &PowerBlock) {
        self.meter.push(block);
        self.gaps.push(block);
        if let Some(signatures) = &mut self.signatures {
            signatures.push(block);
        }
        self.singles.push(block);
        self.delays.push(block);
        self.decimator.push(block, &mut self.overview);
    }

    fn finish(mut self, survey: &Survey, idle_w: f64, period_ns: f64) -> Found {
        self.decimator.flush(&mut self.overview);
        let mut frames = self.meter.finish(survey.span_ns.0, idle_w);
        let gaps = self.gaps.finish(&mut frames);
        let smooth = |captures: Captures| {
            let mut waveforms = captures.finish();
            waveforms.retain(|w| w.watts.len() > 8);
            for waveform in &mut waveforms {
                // A tenth of the rate halves the noise; the first order does not overshoot at flanks.
                let rate = 1e9 / period_ns.max(1.0);
                if let Ok(filter) = Butterworth::low_pass(1, 0.1 * rate, rate) {
                    waveform.smooth_w = filter.filter_both_ways(&waveform.watts);
                }
            }
            waveforms
        };
        Found {
            frames,
            gaps,
            signatures: self.signatures.map(Signatures::finish).unwrap_or_default(),
            waveforms: smooth(self.singles),
            delays: smooth(self.delays),
            overview: self.overview,
        }
    }
}

/// The frame of a group whose time is the median.
fn typical(spans: &Spans, group: usize) -> Option<usize> {
    let mut members: Vec<_> =
        (0..spans.list.len()).filter(|&at| spans.list[at].group == group).collect();
    let length = |at: &usize| spans.list[*at].end - spans.list[*at].start;
    if members.is_empty() {
        return None;
    }
    let middle = members.len() / 2;
    Some(*members.select_nth_unstable_by(middle, |a, b| length(a).total_cmp(&length(b))).1)
}

/// The frame that takes longest against the median of its group, if any takes longer by a third.
fn longest(spans: &Spans) -> Option<usize> {
    let length = |at: usize| spans.list[at].end - spans.list[at].start;
    let usual: Vec<_> = (0..spans.groups.len())
        .map(|group| typical(spans, group).map_or(f64::INFINITY, length))
        .collect();
    let excess = |at: usize| length(at) / usual[spans.list[at].group];
    let best = (0..spans.list.len()).max_by(|&a, &b| excess(a).total_cmp(&excess(b)))?;
    (excess(best) > report::SPIKE).then_some(best)
}
