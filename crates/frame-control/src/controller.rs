//! Controllers: what they share, and the one with a predictor.

use serde::{Deserialize, Serialize};

use crate::error::within;
use crate::history::History;
use crate::{Correction, CorrectionConfig, Error, InnerConfig, InnerLoop, Ladder, Status, Verdict};

/// Predicts the time of a frame from its settings and its workload. Every
/// `Fn(&S, &W) -> f64` is one.
pub trait Predictor<S, W> {
    /// Milliseconds. Anything that is not finite, or negative, says "I don't know".
    fn predict(&self, settings: &S, workload: &W) -> f64;
}

impl<S, W, F: Fn(&S, &W) -> f64> Predictor<S, W> for F {
    fn predict(&self, settings: &S, workload: &W) -> f64 {
        self(settings, workload)
    }
}

/// A predictor that sees the same workload in every frame: all that is left of `predictor` where
/// nothing is known of the frame to come. With [`CorrectionConfig::previous_frame`] this makes
/// feedback from the previous frame alone, with a price list for its ladder.
#[derive(Clone, Debug)]
pub struct FrozenWorkload<P, W> {
    /// The predictor.
    pub predictor: P,
    /// The workload that it sees, such as that of the first frame.
    pub workload: W,
}

impl<S, W, P: Predictor<S, W>> Predictor<S, W> for FrozenWorkload<P, W> {
    fn predict(&self, settings: &S, _: &W) -> f64 {
        self.predictor.predict(settings, &self.workload)
    }
}

/// What a controller decided for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Number of the frame, from 0: give its time back under this number.
    pub frame: u64,
    /// Rung of the ladder to draw it with.
    pub rung: usize,
    /// Time that the predictor itself gives it, in milliseconds, where there is one (y₁).
    pub model_ms: Option<f64>,
    /// Time that the controller expects, in milliseconds, where it expects any.
    pub predicted_ms: Option<f64>,
    /// Whether the ladder can meet the target.
    pub status: Status,
    /// How many rungs were predicted.
    pub evaluated: usize,
}

/// Decides frames and learns from their times, which may come late, out of order or never.
pub trait Controller<W> {
    /// Decides the next frame, whose workload is (an estimate of) `workload`.
    fn decide(&mut self, workload: &W) -> Decision;

    /// Takes the measured time of a frame in milliseconds, or none where it will never be known.
    fn measure(&mut self, frame: u64, milliseconds: Option<f64>) -> Verdict;

    /// Changes the target, in milliseconds. Fails, and keeps the old one, where it is none.
    fn set_target(&mut self, target_ms: f64) -> Result<(), Error>;
}

/// Settings of a [`FrameController`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// The inner feedforward loop.
    pub inner: InnerConfig,
    /// The outer feedback loop; none leaves the predictor as it is.
    pub outer: Option<CorrectionConfig>,
    /// A sudden view: where the workload of a frame makes the settings of the one before this many
    /// times as long or as short, by the predictor, the outer loop starts again with that frame's
    /// measurement, because the error of the predictor is a different one too. Above 1; none never
    /// starts again. Default 1.3.
    pub cut: Option<f64>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            inner: InnerConfig::default(),
            outer: Some(CorrectionConfig::default()),
            cut: Some(1.3),
        }
    }
}

impl Config {
    /// The predictor alone, uncorrected (the thesis's Fig. 1).
    pub fn feedforward() -> Self {
        Self { outer: None, ..Self::default() }
    }

    /// Believes the previous frame, for use with [`FrozenWorkload`].
    pub fn feedback() -> Self {
        Self { outer: Some(CorrectionConfig::previous_frame()), ..Self::default() }
    }
}

/// The thesis's controller: an inner loop that searches the ladder by predicted times, and a slow
/// outer loop that corrects the predictor (Ganestam and Doggett, Paper I §4.4, Figs. 1 and 2).
#[derive(Clone, Debug)]
pub struct FrameController<S, P> {
    inner: InnerLoop<S>,
    correction: Option<Correction>,
    predictor: P,
    /// Logarithm of [`Config::cut`].
    cut: Option<f64>,
    /// Rung and predictor's own time of the last frame that has one.
    last: Option<(usize, f64)>,
    waiting: History<Waiting>,
}

/// What is known of a frame on the way.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    /// The predictor's own time.
    model_ms: f64,
    /// Whether its workload is suddenly a different one.
    cut: bool,
}

impl<S, P> FrameController<S, P> {
    /// Fails for a target that is no frame time and for settings out of range.
    pub fn new(
        ladder: Ladder<S>,
        predictor: P,
        target_ms: f64,
        config: Config,
    ) -> Result<Self, Error> {
        if let Some(cut) = config.cut {
            within("cut", cut, 1.0 + 1e-9, 1e9, "above 1 and up to 1e9")?;
        }
        Ok(Self {
            inner: InnerLoop::new(ladder, target_ms, config.inner)?,
            correction: config.outer.map(Correction::new).transpose()?,
            predictor,
            cut: config.cut.map(f64::ln),
            last: None,
            waiting: History::new(),
        })
    }

    /// The inner loop: ladder, target and present rung.
    pub fn inner(&self) -> &InnerLoop<S> {
        &self.inner
    }

    /// The settings to draw a decided frame with.
    pub fn settings(&self, decision: &Decision) -> &S {
        let rungs = self.inner.ladder().rungs();
        // A decision of another controller may name a rung that this ladder lacks.
        &rungs[decision.rung.min(rungs.len() - 1)]
    }

    /// The outer loop, where there is one.
    pub fn correction(&self) -> Option<&Correction> {
        self.correction.as_ref()
    }

    /// The predictor.
    pub fn predictor(&self) -> &P {
        &self.predictor
    }

    /// Starts at a rung, to hold there until predictions are usable. Fails where there is no such
    /// rung.
    pub fn start_at(&mut self, rung: usize) -> Result<(), Error> {
        self.inner.start_at(rung)
    }

    /// Forgets what was learnt and all frames on the way: for a new scene or device.
    pub fn reset(&mut self) {
        self.waiting.forget();
        self.last = None;
        if let Some(correction) = &mut self.correction {
            correction.reset();
        }
    }
}

impl<S, P> FrameController<S, P> {
    /// Whether the workload is suddenly a different one: by what it makes of the last settings.
    fn is_cut<W>(&self, workload: &W) -> bool
    where
        P: Predictor<S, W>,
    {
        let (Some(cut), Some((rung, before))) = (self.cut, self.last) else { return false };
        let now = self.predictor.predict(&self.inner.ladder().rungs()[rung], workload);
        (now.ln() - before.ln()).abs() > cut
    }
}

impl<S, W, P: Predictor<S, W>> Controller<W> for FrameController<S, P> {
    fn decide(&mut self, workload: &W) -> Decision {
        let factor = self.correction.as_ref().map_or(1.0, Correction::factor);
        let predictor = &self.predictor;
        let choice = self.inner.choose(|settings| factor * predictor.predict(settings, workload));
        let model_ms = choice.predicted_ms.map(|time| time / factor);
        let cut = self.is_cut(workload);
        self.last = model_ms.map(|time| (choice.rung, time)).or(self.last);
        Decision {
            frame: self.waiting.push(model_ms.map(|model_ms| Waiting { model_ms, cut })),
            rung: choice.rung,
            model_ms,
            predicted_ms: choice.predicted_ms,
            status: choice.status,
            evaluated: choice.evaluated,
        }
    }

    fn measure(&mut self, frame: u64, milliseconds: Option<f64>) -> Verdict {
        let Some(Waiting { model_ms, cut }) = self.waiting.take(frame) else {
            return Verdict::Unknown;
        };
        let Some(correction) = &mut self.correction else { return Verdict::Unknown };
        if cut {
            correction.restart();
        }
        correction.learn(model_ms, milliseconds)
    }

    fn set_target(&mut self, target_ms: f64) -> Result<(), Error> {
        self.inner.set_target(target_ms)
    }
}

/// No tuning: one rung for ever, such as the one that a person found good for the first frame.
#[derive(Clone, Debug)]
pub struct FixedRung {
    rung: usize,
    next: u64,
}

impl FixedRung {
    /// Fails where the ladder has no such rung.
    pub fn new<S>(ladder: &Ladder<S>, rung: usize) -> Result<Self, Error> {
        ladder.check(rung)?;
        Ok(Self { rung, next: 0 })
    }
}

impl<W> Controller<W> for FixedRung {
    fn decide(&mut self, _: &W) -> Decision {
        let frame = self.next;
        self.next += 1;
        Decision {
            frame,
            rung: self.rung,
            model_ms: None,
            predicted_ms: None,
            status: Status::Held,
            evaluated: 0,
        }
    }

    fn measure(&mut self, _: u64, _: Option<f64>) -> Verdict {
        Verdict::Unknown
    }

    fn set_target(&mut self, _: f64) -> Result<(), Error> {
        Ok(())
    }
}
