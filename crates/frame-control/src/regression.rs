//! A predictor without a model of the device: linear regression on counters, learnt while running.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::error::within;
use crate::history::History;
use crate::least_squares::{Row, least_squares};
use crate::{Controller, Decision, Error, InnerConfig, InnerLoop, Ladder, Verdict};

/// Settings of a [`RegressionController`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegressionConfig {
    /// The inner loop, which searches with the regression's predictions.
    pub inner: InnerConfig,
    /// Weight of a measurement relative to the one after it, above 0.5 and up to 1; default 0.95.
    pub forgetting: f64,
    /// Ridge: share of its own weight by which each coefficient is drawn to zero, so that features
    /// that always vary together share what they cost; above 0 and up to 1, default 1e-4.
    pub ridge: f64,
}

impl Default for RegressionConfig {
    fn default() -> Self {
        Self { inner: InnerConfig::default(), forgetting: 0.95, ridge: 1e-4 }
    }
}

/// Least squares over `N` features of settings and workload, with exponential forgetting, a ridge,
/// and coefficients that are never negative, because work never takes negative time: without that
/// bound, coefficients of opposite signs that cancel on a smooth path predict nonsense after a turn.
///
/// Errors are relative: a frame's features are divided by its time, and their weighted sum should be
/// one. Solved anew ([`least_squares`]) for each measurement from the last 128, so that nothing winds
/// up.
#[derive(Clone, Debug)]
pub struct Regression<const N: usize> {
    forgetting: f64,
    ridge: f64,
    coefficients: [f64; N],
    /// Features over the time of their frame, newest first. A window, not running sums: however large
    /// a sample was, it is gone when it leaves.
    samples: VecDeque<[f64; N]>,
    /// Measurements in a row that were beyond belief.
    lost: u32,
}

/// Measurements that count; with the default forgetting the oldest weighs 0.1 %.
const WINDOW: usize = 128;
/// Factor by which a time is beyond belief: it is not learnt, because by the square of its weight it
/// would rule the window, unless so many come in a row.
const LOST_FACTOR: f64 = 8.0;
const LOST_FRAMES: u32 = 3;

impl<const N: usize> Regression<N> {
    fn new(config: &RegressionConfig) -> Result<Self, Error> {
        within("forgetting", config.forgetting, 0.5 + 1e-9, 1.0, "above 0.5 and up to 1")?;
        within("ridge", config.ridge, 1e-12, 1.0, "within 1e-12 and 1")?;
        Ok(Self {
            forgetting: config.forgetting,
            ridge: config.ridge,
            coefficients: [0.0; N],
            samples: VecDeque::with_capacity(WINDOW),
            lost: 0,
        })
    }

    /// Milliseconds a unit of each feature, never negative.
    pub fn coefficients_ms(&self) -> [f64; N] {
        self.coefficients
    }

    /// Milliseconds; NaN before the first measurement and where the features are not finite.
    fn predict(&self, features: &[f64; N]) -> f64 {
        if self.samples.is_empty() {
            return f64::NAN;
        }
        self.coefficients.iter().zip(features).map(|(c, x)| c * x).sum()
    }

    fn learn(&mut self, features: &[f64; N], measured_ms: f64) -> Verdict {
        if !(measured_ms > 0.0 && measured_ms.is_finite()) {
            return Verdict::Absurd;
        }
        let x: [f64; N] = features.map(|feature| feature / measured_ms);
        // Squares of these have to be finite, and sums of their products too.
        if !x.iter().all(|x| x.abs() < 1e100) {
            return Verdict::Absurd;
        }
        let ratio = self.predict(features) / measured_ms;
        if !self.samples.is_empty() && !(1.0 / LOST_FACTOR..=LOST_FACTOR).contains(&ratio) {
            self.lost += 1;
            if self.lost < LOST_FRAMES {
                return Verdict::Suspect;
            }
        } else {
            self.lost = 0;
        }
        self.samples.truncate(WINDOW - 1);
        self.samples.push_front(x);
        self.coefficients = self.solve();
        Verdict::Used
    }

    fn solve(&self) -> [f64; N] {
        let mut weight = 1.0;
        let rows = self.samples.iter().map(|&features| {
            let row = Row { features, value: 1.0, weight };
            weight *= self.forgetting;
            row
        });
        least_squares(rows, self.ridge)
    }
}

/// The present-day baseline: the inner loop over a [`Regression`] on counters that `features` makes
/// of settings and workload. It needs no model of the device, and knows nothing until a frame was
/// measured: until then it holds the rung that it starts with.
#[derive(Clone, Debug)]
pub struct RegressionController<S, F, const N: usize> {
    inner: InnerLoop<S>,
    regression: Regression<N>,
    features: F,
    waiting: History<[f64; N]>,
}

impl<S, F, const N: usize> RegressionController<S, F, N> {
    /// `start` is the rung of the first frame. Fails for a target that is no frame time, for
    /// settings out of range and for a rung that the ladder lacks.
    pub fn new<W>(
        ladder: Ladder<S>,
        features: F,
        target_ms: f64,
        start: usize,
        config: RegressionConfig,
    ) -> Result<Self, Error>
    where
        F: Fn(&S, &W) -> [f64; N],
    {
        let mut inner = InnerLoop::new(ladder, target_ms, config.inner)?;
        inner.start_at(start)?;
        let regression = Regression::new(&config)?;
        Ok(Self { inner, regression, features, waiting: History::new() })
    }

    /// What was learnt so far.
    pub fn regression(&self) -> &Regression<N> {
        &self.regression
    }

    /// The inner loop: ladder, target and present rung.
    pub fn inner(&self) -> &InnerLoop<S> {
        &self.inner
    }
}

impl<S, W, F, const N: usize> Controller<W> for RegressionController<S, F, N>
where
    F: Fn(&S, &W) -> [f64; N],
{
    fn decide(&mut self, workload: &W) -> Decision {
        let (regression, features) = (&self.regression, &self.features);
        let choice = self.inner.choose(|s| regression.predict(&features(s, workload)));
        let used = (self.features)(&self.inner.ladder().rungs()[choice.rung], workload);
        Decision {
            frame: self.waiting.push(Some(used)),
            rung: choice.rung,
            model_ms: choice.predicted_ms,
            predicted_ms: choice.predicted_ms,
            status: choice.status,
            evaluated: choice.evaluated,
        }
    }

    fn measure(&mut self, frame: u64, milliseconds: Option<f64>) -> Verdict {
        match (self.waiting.take(frame), milliseconds) {
            (None, _) => Verdict::Unknown,
            (Some(_), None) => Verdict::Dropped,
            (Some(features), Some(measured)) => self.regression.learn(&features, measured),
        }
    }

    fn set_target(&mut self, target_ms: f64) -> Result<(), Error> {
        self.inner.set_target(target_ms)
    }
}
