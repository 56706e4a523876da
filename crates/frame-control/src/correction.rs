//! The outer loop: a slow correction of the predictor, learnt from measured times.

use serde::{Deserialize, Serialize};

use crate::error::within;
use crate::{Error, admissible_gain};

/// Settings of the outer loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectionConfig {
    /// Share of the present error that a measurement removes where errors have no direction: the
    /// slow loop. Above 0, default 0.2.
    pub gain: f64,
    /// Share that it removes where all errors point the same way, because the error of the predictor
    /// drifts with the view; between the two by the tracking signal of Trigg and Leach (1967,
    /// *Exponential smoothing with an adaptive response rate*). At least `gain` and below
    /// [`admissible_gain`], default 0.8. The same as `gain` for a loop of constant gain.
    pub max_gain: f64,
    /// Takes the plain mean of the measurements until there are 1 / `gain` of them, so that a large
    /// constant error is gone after one frame. Default true.
    pub warm_up: bool,
    /// Most that a measurement moves the logarithm of the correction, once a first one has set
    /// it; above 0. Default 0.7 (a factor of 2).
    pub max_rate: f64,
    /// Bound on the correction: it stays within 1 / `max_correction` and `max_correction`. Above
    /// 1, up to 1e6, default 64.
    pub max_correction: f64,
    /// An error larger than this many mean absolute errors is held back until the next measurement
    /// confirms it; at least 1. None takes every measurement as it comes. Default 4.
    pub outlier_threshold: Option<f64>,
    /// Frames from a frame's decision to the first decision that knows its time, 1 to 64: 1 where
    /// each frame is measured before the next is decided. Bounds the gain. Default 3.
    pub delay: u32,
    /// Assumed bound on |σ|: by how many percent measured over predicted time changes where the
    /// controller changes the predicted time by one percent. 0 to 16; default 1, for which every
    /// gain below 1 is stable at every delay.
    pub sensitivity: f64,
}

impl Default for CorrectionConfig {
    fn default() -> Self {
        Self {
            gain: 0.2,
            max_gain: 0.8,
            warm_up: true,
            max_rate: 0.7,
            max_correction: 64.0,
            outlier_threshold: Some(4.0),
            delay: 3,
            sensitivity: 1.0,
        }
    }
}

impl CorrectionConfig {
    /// Believes the last measurement and nothing else, spikes included: what an engine without a
    /// model does.
    pub fn previous_frame() -> Self {
        Self {
            gain: 1.0,
            max_gain: 1.0,
            warm_up: false,
            max_rate: 20.0,
            max_correction: 1e6,
            outlier_threshold: None,
            delay: 1,
            sensitivity: 0.5,
        }
    }

    fn validate(&self) -> Result<(), Error> {
        within("max_rate", self.max_rate, f64::MIN_POSITIVE, 20.0, "above 0 and up to 20")?;
        within("max_correction", self.max_correction, 1.0 + 1e-9, 1e6, "above 1 and up to 1e6")?;
        if let Some(threshold) = self.outlier_threshold {
            within("outlier_threshold", threshold, 1.0, 1e6, "at least 1 and up to 1e6")?;
        }
        within("delay", f64::from(self.delay), 1.0, 64.0, "within 1 and 64")?;
        within("sensitivity", self.sensitivity, 0.0, 16.0, "within 0 and 16")?;
        within("max_gain", self.max_gain, f64::MIN_POSITIVE, 2.0, "above 0 and below 2")?;
        within("gain", self.gain, f64::MIN_POSITIVE, self.max_gain, "above 0 and up to max_gain")?;
        let bound = admissible_gain(self.delay, self.sensitivity);
        if self.max_gain < bound {
            Ok(())
        } else {
            let Self { max_gain: gain, delay, sensitivity, .. } = *self;
            Err(Error::UnstableGain { gain, delay, sensitivity, bound })
        }
    }
}

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Verdict {
    /// It moved the correction by its share.
    Used,
    /// It and the one before are far off alike: the correction followed at once.
    Confirmed,
    /// It is far off: only a small part was believed until another confirms it.
    Suspect,
    /// No time came for the frame. Nothing changes.
    Dropped,
    /// The time is not a positive number, or beyond any correction. Nothing changes.
    Absurd,
    /// The frame is not waiting for a time: it is unknown, too old, was measured before, or was
    /// held without a prediction. Nothing changes.
    Unknown,
}

/// Least error, as a logarithm, that counts as far off, however quiet the measurements were.
const LEAST_LIMIT: f64 = 0.03;
/// Error that counts as far off however noisy they were.
const MOST_LIMIT: f64 = 0.5;
/// Share of the newest error in the running mean of what is normal.
const SCALE_GAIN: f64 = 0.1;
/// Share of the newest error in the two means of the tracking signal.
const TRACKING_GAIN: f64 = 0.3;

/// The outer loop by itself: corrected time = factor · predicted time.
///
/// One factor, not a factor and an offset: the controller holds the time constant, and where the
/// predicted time does not vary, nothing tells the two apart.
///
/// ```
/// use niwaki_frame_control::{Correction, CorrectionConfig, Verdict};
///
/// let mut correction = Correction::new(CorrectionConfig::default())?;
/// // The device takes 13 ms where the model says 10.
/// assert_eq!(correction.learn(10.0, Some(13.0)), Verdict::Used);
/// assert!((correction.apply(20.0) - 26.0).abs() < 1e-9);
/// assert_eq!(correction.learn(10.0, Some(f64::NAN)), Verdict::Absurd);
/// assert_eq!(correction.learn(10.0, None), Verdict::Dropped);
/// assert!((correction.factor() - 1.3).abs() < 1e-9);
/// # Ok::<(), niwaki_frame_control::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Correction {
    config: CorrectionConfig,
    /// Logarithm of the factor.
    theta: f64,
    /// Measurements since the start, the last restart or the last confirmed step.
    seen: u32,
    /// Running mean of the absolute error, slow: what is normal.
    scale: f64,
    /// Running means of the error and of its absolute value, fast: their quotient is the tracking
    /// signal.
    drift: f64,
    spread: f64,
    /// Logarithm of measured over predicted time of a suspect measurement.
    suspect: Option<f64>,
}

impl Correction {
    /// A correction of 1. Fails for settings out of range and for a gain that is not stable.
    pub fn new(config: CorrectionConfig) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self {
            config,
            theta: 0.0,
            seen: 0,
            scale: LEAST_LIMIT,
            drift: 0.0,
            spread: 0.0,
            suspect: None,
        })
    }

    /// Measured over predicted time, as far as it is known: within the configured bound.
    pub fn factor(&self) -> f64 {
        self.theta.exp()
    }

    /// A predicted time, corrected.
    pub fn apply(&self, predicted_ms: f64) -> f64 {
        predicted_ms * self.factor()
    }

    /// Running mean of the relative error of corrected predictions: how far they can be trusted.
    pub fn mean_error(&self) -> f64 {
        self.scale.exp_m1()
    }

    /// Learns from a frame: the time that the *uncorrected* predictor gave for it, with the settings
    /// and the workload that it really had, and the time it took, none where it is not known.
    ///
    /// The ratio of the two holds no earlier correction, so a late measurement does not count what
    /// was corrected since a second time: see [`admissible_gain`].
    pub fn learn(&mut self, predicted_ms: f64, measured_ms: Option<f64>) -> Verdict {
        let Some(measured_ms) = measured_ms else { return Verdict::Dropped };
        let bound = self.config.max_correction.ln();
        if !(measured_ms > 0.0 && measured_ms.is_finite() && predicted_ms > 0.0) {
            return Verdict::Absurd;
        }
        // A difference of logarithms: the quotient could overflow.
        let ratio = measured_ms.ln() - predicted_ms.ln();
        // One more factor of e, so that a device at the bound is still heard.
        if ratio.abs() > bound + 1.0 {
            return Verdict::Absurd;
        }
        let error = ratio - self.theta;
        let first = self.seen == 0 && self.suspect.is_none();
        let limit = match self.config.outlier_threshold {
            Some(threshold) if !(first && self.config.warm_up) => {
                (threshold * self.scale).clamp(LEAST_LIMIT, MOST_LIMIT)
            }
            _ => f64::INFINITY,
        };
        let before = self.suspect.take().map(|suspect| suspect - self.theta);
        let (step, verdict) = if error.abs() <= limit {
            if !first {
                self.drift += TRACKING_GAIN * (error - self.drift);
                self.spread += TRACKING_GAIN * (error.abs() - self.spread);
            }
            (error * self.share(), Verdict::Used)
        } else {
            match before.filter(|before| before * error > 0.0) {
                Some(before) => {
                    // Two alike are a change, not a spike: go as far as both agree.
                    self.seen = 1;
                    (self.drift, self.spread) = (0.0, 0.0);
                    (before.abs().min(error.abs()).copysign(error), Verdict::Confirmed)
                }
                None => {
                    self.suspect = Some(ratio);
                    // All that it says for sure is its sign.
                    (self.scale.copysign(error) * self.config.gain, Verdict::Suspect)
                }
            }
        };
        let rate = if first { f64::INFINITY } else { self.config.max_rate };
        self.theta = (self.theta + step.clamp(-rate, rate)).clamp(-bound, bound);
        if !first {
            self.scale += SCALE_GAIN * (error.abs().min(limit).min(MOST_LIMIT) - self.scale);
        }
        if verdict != Verdict::Suspect {
            self.seen = self.seen.saturating_add(1);
        }
        verdict
    }

    /// Believes the next measurement as if it were the first, because the workload is a different one
    /// now and the predictor's error with it. The factor stays until then.
    pub fn restart(&mut self) {
        self.seen = 0;
        self.suspect = None;
        (self.drift, self.spread) = (0.0, 0.0);
    }

    /// Forgets everything: for a new scene or device.
    pub fn reset(&mut self) {
        self.restart();
        self.theta = 0.0;
        self.scale = LEAST_LIMIT;
    }

    /// Share of the present error to remove.
    fn share(&self) -> f64 {
        let CorrectionConfig { gain, max_gain, warm_up, .. } = self.config;
        let signal = if self.spread > 0.0 { self.drift.abs() / self.spread } else { 0.0 };
        let share = signal.clamp(gain, max_gain);
        // Beyond the bound on stability only for the first: it sets the factor, and feeds nothing back.
        if warm_up { share.max(1.0 / (f64::from(self.seen) + 1.0)) } else { share }
    }
}
