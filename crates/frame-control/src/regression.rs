//! A predictor without a model of the device: linear regression on counters, learnt while running.

use serde::{Deserialize, Serialize};

use crate::error::within;
use crate::history::History;
use crate::{Controller, Decision, Error, InnerConfig, InnerLoop, Ladder, Verdict};

/// Settings of a [`RegressionController`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegressionConfig {
    /// The inner loop, which searches with the regression's predictions.
    pub inner: InnerConfig,
    /// Weight of a measurement relative to the one after it, above 0.5 and up to 1; default 0.97.
    pub forgetting: f64,
    /// Ridge: how strongly coefficients are held at zero before there are measurements, above 0 and
    /// up to 1e6; default 1e-3.
    pub ridge: f64,
}

impl Default for RegressionConfig {
    fn default() -> Self {
        Self { inner: InnerConfig::default(), forgetting: 0.97, ridge: 1e-3 }
    }
}

/// Recursive least squares over `N` features of settings and workload, with exponential forgetting,
/// a ridge prior and coefficients that are never negative, because work never takes negative time
/// (Haykin, *Adaptive Filter Theory*, chapter 10).
///
/// Errors are relative: a frame's features are divided by its time, and the sum should be one. The
/// covariance stops growing at its prior, so that a view that stands still does not make it forget
/// everything else.
#[derive(Clone, Debug)]
pub struct Regression<const N: usize> {
    forgetting: f64,
    prior: f64,
    unit_ms: f64,
    /// Largest features of the first workload; one where they are zero.
    scale: Option<[f64; N]>,
    coefficients: [f64; N],
    covariance: [[f64; N]; N],
    seen: u32,
}

impl<const N: usize> Regression<N> {
    fn new(config: &RegressionConfig, unit_ms: f64) -> Result<Self, Error> {
        within("forgetting", config.forgetting, 0.5 + 1e-9, 1.0, "above 0.5 and up to 1")?;
        within("ridge", config.ridge, 1e-12, 1e6, "within 1e-12 and 1e6")?;
        let prior = 1.0 / config.ridge;
        let covariance =
            core::array::from_fn(|i| core::array::from_fn(|j| if i == j { prior } else { 0.0 }));
        Ok(Self {
            forgetting: config.forgetting,
            prior,
            unit_ms,
            scale: None,
            coefficients: [0.0; N],
            covariance,
            seen: 0,
        })
    }

    /// Milliseconds for each feature at its largest value in the first workload.
    pub fn coefficients_ms(&self) -> [f64; N] {
        self.coefficients.map(|coefficient| coefficient * self.unit_ms)
    }

    /// Takes the features of the most expensive settings as the unit of each.
    fn set_scale(&mut self, largest: &[f64; N]) {
        if self.scale.is_none() && largest.iter().all(|x| x.is_finite()) {
            self.scale = Some(largest.map(|x| if x.abs() > 0.0 { x.abs() } else { 1.0 }));
        }
    }

    /// Milliseconds; NaN before the first measurement and where the features are not finite.
    fn predict(&self, features: &[f64; N]) -> f64 {
        let Some(scale) = self.scale.filter(|_| self.seen > 0) else { return f64::NAN };
        let sum: f64 = (0..N).map(|i| self.coefficients[i] * features[i] / scale[i]).sum();
        sum * self.unit_ms
    }

    fn learn(&mut self, features: &[f64; N], measured_ms: f64) -> Verdict {
        let Some(scale) = self.scale else { return Verdict::Unknown };
        if !(measured_ms > 0.0 && measured_ms.is_finite()) {
            return Verdict::Absurd;
        }
        let x: [f64; N] =
            core::array::from_fn(|i| features[i] / scale[i] * (self.unit_ms / measured_ms));
        if !x.iter().all(|x| x.is_finite() && x.abs() < 1e9) {
            return Verdict::Absurd;
        }
        let px: [f64; N] = self.covariance.map(|row| dot(&row, &x));
        let spread = dot(&x, &px);
        let error = (1.0 - dot(&self.coefficients, &x)).clamp(-1.0, 1.0);
        let denominator = self.forgetting + spread;
        for (coefficient, px) in self.coefficients.iter_mut().zip(px) {
            *coefficient = (*coefficient + px * error / denominator).clamp(0.0, 1e9);
        }
        let mut trace = 0.0;
        for i in 0..N {
            for j in 0..N {
                self.covariance[i][j] -= px[i] * px[j] / denominator;
            }
            // Rounding may take it below zero, which would make the next step run away.
            self.covariance[i][i] = self.covariance[i][i].max(1e-12);
            trace += self.covariance[i][i];
        }
        if trace / self.forgetting <= self.prior * N as f64 {
            for entry in self.covariance.iter_mut().flatten() {
                *entry /= self.forgetting;
            }
        }
        self.seen = self.seen.saturating_add(1);
        Verdict::Used
    }
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
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
    pub fn new(
        ladder: Ladder<S>,
        features: F,
        target_ms: f64,
        start: usize,
        config: RegressionConfig,
    ) -> Result<Self, Error> {
        let mut inner = InnerLoop::new(ladder, target_ms, config.inner)?;
        inner.start_at(start)?;
        let regression = Regression::new(&config, target_ms)?;
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
        let ladder = self.inner.ladder();
        self.regression.set_scale(&(self.features)(&ladder.rungs()[ladder.top()], workload));
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
