//! Traces whose truth is known, for tests and for people who have no meter.
//!
//! A [`Recording`] is an animation as a power station such as the paper's would see it: several rails at
//! 40 kHz with noise and quantisation, a meter whose clock drifts against the renderer's, frames that are
//! busy and idle, changes of power states, delays, marks, and every fault that [`crate::Fault`] names.
//! [`Recording::truth`] tells where each frame is and what it cost.

mod faults;
mod program;
mod reader;

pub use faults::FaultPlan;
pub use program::{Animation, Phase};
pub use reader::RecordingReader;

use crate::rails::{Rail, RailKind, Voltage};
use crate::{
    Calibration, Clock, Column, FrameLog, FrameLogHeader, FrameRecord, PassTime, PowerError,
    SensorNote, TraceInfo, Unit,
};
use fastrand::Rng;
use faults::PlannedFault;
use program::Segment;

/// A rail of the meter.
#[derive(Clone, Debug, PartialEq)]
pub struct RailSpec {
    /// Its name.
    pub name: String,
    /// Its voltage in volts.
    pub volts: f64,
    /// Whether the voltage is measured; otherwise it is constant and has no column.
    pub has_voltage: bool,
    /// Its share of the power.
    pub share: f64,
    /// Largest current that its sensor can tell, in amperes.
    pub full_scale_a: f64,
}

impl RailSpec {
    fn new(name: &str, volts: f64, has_voltage: bool, share: f64, full_scale_a: f64) -> Self {
        Self { name: name.into(), volts, has_voltage, share, full_scale_a }
    }
}

/// When marks are given to the meter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MarkPolicy {
    /// Never.
    #[default]
    Never,
    /// At the start of every so many frames, the first included.
    Every(usize),
}

/// What to record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingOptions {
    /// Seed: equal options give equal recordings.
    pub seed: u64,
    /// Samples a second.
    pub rate_hz: f64,
    /// Rails; their shares are taken relative to the sum.
    pub rails: Vec<RailSpec>,
    /// Deviation of the noise of a current, as a share of the sensor's full scale.
    pub noise: f64,
    /// Bits of the converter over the full scale; 0 for none.
    pub bits: u32,
    /// Time constant in seconds with which the power that flows in follows what is drawn.
    pub lag_s: f64,
    /// Idle power in watts.
    pub idle_w: f64,
    /// Idle time before and after the animations, in seconds.
    pub margin_s: f64,
    /// What is rendered, one after the other.
    pub animations: Vec<Animation>,
    /// Width and height of images.
    pub size: (u32, u32),
    /// Trace time minus log time at the first frame, in seconds.
    pub offset_s: f64,
    /// How much faster the meter's clock runs, in parts per million.
    pub drift_ppm: f64,
    /// Deviation of the log's time stamps, in seconds.
    pub log_jitter_s: f64,
    /// Deviation of the meter's time stamps, in seconds.
    pub sample_jitter_s: f64,
    /// Marks.
    pub marks: MarkPolicy,
    /// From these frames on (counted over all animations), power is multiplied.
    pub states: Vec<(usize, f64)>,
    /// After these frames, the device idles for so many seconds: the paper's figure 3.
    pub delays: Vec<(usize, f64)>,
    /// Faults.
    pub faults: FaultPlan,
}

impl RecordingOptions {
    /// Two algorithms, 60 frames each, three rails with measured voltages; two seconds, no faults.
    #[must_use]
    pub fn quick(seed: u64) -> Self {
        Self {
            seed,
            rate_hz: 40e3,
            rails: vec![
                RailSpec::new("slot", 12.0, true, 0.25, 12.0),
                RailSpec::new("aux1", 12.0, true, 0.4, 12.0),
                RailSpec::new("aux2", 12.0, true, 0.35, 12.0),
            ],
            // 11 mA of 12 A: the noise of an ACS710 at its full bandwidth is some tens of millivolts.
            noise: 2e-3,
            bits: 12,
            lag_s: 20e-6,
            idle_w: 45.0,
            margin_s: 0.25,
            animations: vec![Animation::forward(60), Animation::shadow_maps(60, 4)],
            size: (2560, 1440),
            offset_s: 3.217,
            drift_ppm: 50.0,
            log_jitter_s: 10e-6,
            sample_jitter_s: 0.0,
            marks: MarkPolicy::Never,
            states: Vec::new(),
            delays: Vec::new(),
            faults: FaultPlan::default(),
        }
    }

    /// All six algorithms of the paper, `frames` each and lights of the shadow algorithms from 2 to 8,
    /// with a change of the power state, a delay and a mark every hundred frames.
    #[must_use]
    pub fn paper(seed: u64, frames: usize) -> Self {
        let mut animations = vec![
            Animation::forward(frames),
            Animation::z_prepass(frames),
            Animation::deferred(frames),
        ];
        type Make = fn(usize, u32) -> Animation;
        let shadows: [Make; 3] =
            [Animation::shadow_volumes, Animation::shadow_maps, Animation::variance_shadow_maps];
        for make in shadows {
            for lights in [2, 4, 6, 8] {
                animations.push(make(frames.div_ceil(4), lights));
            }
        }
        Self {
            margin_s: 1.0,
            animations,
            marks: MarkPolicy::Every(100),
            states: vec![(frames / 2, 1.25), (frames, 1.0)],
            delays: vec![(frames / 4, 8e-3)],
            ..Self::quick(seed)
        }
    }

    /// So many seconds of frames on six rails of constant voltage: six samples a row.
    #[must_use]
    pub fn six_rails(seed: u64, seconds: f64) -> Self {
        let rails = [
            ("slot12", 12.0, 0.15, 6.0),
            ("slot3", 3.3, 0.02, 4.0),
            ("aux1", 12.0, 0.21, 12.0),
            ("aux2", 12.0, 0.21, 12.0),
            ("aux3", 12.0, 0.21, 12.0),
            ("aux4", 12.0, 0.2, 12.0),
        ];
        let rails =
            rails.map(|(name, volts, share, full)| RailSpec::new(name, volts, false, share, full));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let frames = ((seconds - 1.0).max(0.1) / 24.6e-3) as usize;
        Self {
            rails: rails.into(),
            margin_s: 0.5,
            animations: vec![Animation::forward(frames), Animation::deferred(frames)],
            ..Self::quick(seed)
        }
    }
}

/// A frame as it was.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueFrame {
    /// Start, in nanoseconds of the trace.
    pub start_ns: f64,
    /// End of its work.
    pub busy_end_ns: f64,
    /// Start of the next frame, or end of the work of the last of its animation.
    pub end_ns: f64,
    /// Energy from start to end, in joules.
    pub energy_j: f64,
    /// Which animation it belongs to.
    pub animation: usize,
}

/// What a recording really holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Frames.
    pub frames: Vec<TrueFrame>,
    /// Faults that were put in, by class in the order of [`crate::Fault::ALL`]: stretches of rows for
    /// gaps and holes, samples for those that are not numbers, stretches of rows for clipped ones, else
    /// rows. (How many samples are clipped depends on the power there.)
    pub faults: [u64; 7],
    /// Marks that were left out, and marks that were put where no frame starts.
    pub wrong_marks: (u64, u64),
    /// Energy per pixel of each animation, in nanojoules.
    pub nj_per_pixel: Vec<f64>,
}

/// A recording, generated as it is read.
#[derive(Clone, Debug)]
pub struct Recording {
    options: RecordingOptions,
    info: TraceInfo,
    truth: Truth,
    log: FrameLog,
    /// Power over time, in nanoseconds of the trace.
    segments: Vec<Segment>,
    marks: Vec<(f64, u8)>,
    faults: Vec<PlannedFault>,
    rows: u64,
}

impl Recording {
    /// Plans a recording. Memory grows with frames, not with samples.
    ///
    /// # Errors
    /// [`PowerError::Setting`] if there are no rails or no frames, or if rates, times, powers or shares
    /// are not positive numbers.
    pub fn new(options: &RecordingOptions) -> Result<Self, PowerError> {
        check(options)?;
        let mut random = Rng::with_seed(options.seed);
        let program::Program { segments, frames: planned, end_ns } =
            program::plan(options, &mut random);
        let period = 1e9 / options.rate_hz;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
        let rows = ((end_ns + options.margin_s * 1e9) / period) as u64;

        let stretch = 1.0 + options.drift_ppm * 1e-6;
        #[expect(clippy::cast_possible_truncation, reason = "seconds")]
        let to_log = |trace_ns: f64, jitter_ns: f64| {
            // The first frame is at the margin in the trace.
            let since = (trace_ns - options.margin_s * 1e9) / stretch;
            let first = (options.margin_s - options.offset_s) * 1e9;
            (first + since + jitter_ns) as i64
        };
        let mut log = FrameLog {
            header: FrameLogHeader {
                clock: Clock::Monotonic,
                device: "generated".into(),
                scene: "generated".into(),
            },
            frames: Vec::with_capacity(planned.len()),
        };
        let mut marks = Vec::new();
        let mut truth = Truth::default();
        let pixels = f64::from(options.size.0) * f64::from(options.size.1);
        let mut sums = vec![(0.0, 0u32); options.animations.len()];
        for (index, frame) in planned.iter().enumerate() {
            let animation = &options.animations[frame.animation];
            let is_marked =
                matches!(options.marks, MarkPolicy::Every(n) if index.is_multiple_of(n.max(1)));
            if is_marked {
                marks.push((frame.start_ns, b'F'));
            }
            let mut jitter = || program::gauss(&mut random) * options.log_jitter_s * 1e9;
            let start_ns = to_log(frame.start_ns, jitter());
            log.frames.push(FrameRecord {
                frame: frame.number as u64,
                start_ns,
                end_ns: to_log(frame.busy_end_ns, jitter()).max(start_ns),
                algorithm: animation.algorithm.clone(),
                lights: animation.lights,
                width: options.size.0,
                height: options.size.1,
                marker: is_marked,
                passes: frame
                    .passes
                    .iter()
                    .map(|&(name, ns)| PassTime { name: name.into(), ns })
                    .collect(),
            });
            sums[frame.animation].0 += frame.energy_j;
            sums[frame.animation].1 += 1;
            truth.frames.push(TrueFrame {
                start_ns: frame.start_ns,
                busy_end_ns: frame.busy_end_ns,
                end_ns: frame.end_ns,
                energy_j: frame.energy_j,
                animation: frame.animation,
            });
        }
        // Jitter must not put frames out of order: a renderer's own stamps never are.
        let mut least = i64::MIN;
        for frame in &mut log.frames {
            frame.start_ns = frame.start_ns.max(least);
            frame.end_ns = frame.end_ns.max(frame.start_ns);
            least = frame.start_ns;
        }
        truth.nj_per_pixel =
            sums.iter().map(|(energy, n)| 1e9 * energy / (f64::from(*n) * pixels)).collect();
        truth.wrong_marks = faults::spoil_marks(&options.faults, &mut marks, end_ns, &mut random);
        let faults = faults::plan(&options.faults, rows, &mut random);
        truth.faults = faults::count(&faults);
        Ok(Self {
            info: info(options),
            options: options.clone(),
            truth,
            log,
            segments,
            marks,
            faults,
            rows,
        })
    }

    /// What it really holds.
    #[must_use]
    pub const fn truth(&self) -> &Truth {
        &self.truth
    }

    /// The renderer's log.
    #[must_use]
    pub fn log(&self) -> FrameLog {
        self.log.clone()
    }

    /// What the trace says about itself.
    #[must_use]
    pub const fn info(&self) -> &TraceInfo {
        &self.info
    }

    /// Rows without faults.
    #[must_use]
    pub const fn rows(&self) -> u64 {
        self.rows
    }

    /// Rails with their constant voltages and ranges, for the analysis.
    #[must_use]
    pub fn rails(&self) -> Vec<Rail> {
        let rail = |spec: &RailSpec| Rail {
            name: spec.name.clone(),
            kind: RailKind::Current {
                current: format!("{}_a", spec.name),
                voltage: if spec.has_voltage {
                    Voltage::Column(format!("{}_v", spec.name))
                } else {
                    Voltage::Volts(spec.volts)
                },
                voltage_calibration: Calibration::default(),
            },
            calibration: Calibration::default(),
            range: Some((-spec.full_scale_a, spec.full_scale_a)),
        };
        self.options.rails.iter().map(rail).collect()
    }

    /// Reads it from the start.
    #[must_use]
    pub fn reader(&self) -> RecordingReader {
        RecordingReader::new(self.clone())
    }
}

fn info(options: &RecordingOptions) -> TraceInfo {
    let columns = |rail: &RailSpec| {
        let mut columns = vec![Column::new(format!("{}_a", rail.name), Unit::Amperes)];
        if rail.has_voltage {
            columns.push(Column::new(format!("{}_v", rail.name), Unit::Volts));
        }
        columns
    };
    TraceInfo {
        columns: options.rails.iter().flat_map(columns).collect(),
        rate_hz: Some(options.rate_hz),
        clock: Clock::Device,
        sensor: SensorNote { name: "generated".into(), ..SensorNote::default() },
    }
}

fn check(options: &RecordingOptions) -> Result<(), PowerError> {
    let is_positive = |x: f64| x > 0.0 && x.is_finite();
    let is_size = |x: f64| x >= 0.0 && x.is_finite();
    let rails_are_good = options
        .rails
        .iter()
        .all(|r| is_positive(r.volts) && is_size(r.share) && is_positive(r.full_scale_a));
    let animations_are_good = options.animations.iter().all(Animation::is_valid);
    let is_good = is_positive(options.rate_hz)
        && options.rate_hz <= 1e8
        && rails_are_good
        && is_positive(options.rails.iter().map(|r| r.share).sum())
        && animations_are_good
        && options.animations.iter().any(|a| a.frames > 0)
        && [options.noise, options.lag_s, options.idle_w, options.margin_s].map(is_size)
            == [true; 4]
        && is_size(options.log_jitter_s)
        && is_size(options.sample_jitter_s)
        && options.bits <= 32
        && options.drift_ppm.abs() < 1e5
        && options.offset_s.is_finite();
    if is_good {
        return Ok(());
    }
    Err(PowerError::Setting(
        "a recording needs rails, frames, and rates, times, powers and shares that are positive"
            .into(),
    ))
}
