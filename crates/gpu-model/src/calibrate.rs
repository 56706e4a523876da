//! Parameters of a device that fit measured times best.
//!
//! The thesis's Paper I, section 3.1: latency and both departure delays "are varied to find the
//! best fit for the particular architecture". Micro-benchmarks measure memory without a cache;
//! fitted to times of real kernels, the same parameters contain what the cache saves.
//!
//! Not all of them can be told from times: where computation bounds every frame, no time depends on
//! a delay. [`choose`] finds those that predict views which the fit has not seen.

use crate::{Constants, Device, FrameModel, ModelError, RaySettings, Workload, program::check};

/// A frame that was drawn and timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Its workload. Observations of the same workload are of one view.
    pub workload: Workload,
    /// Its settings.
    pub settings: RaySettings,
    /// How long it took, seconds. Above 0.
    pub seconds: f64,
}

/// What can be fitted: a model around a [`FrameModel`].
pub trait Calibrated: Clone {
    /// The parameters.
    fn frame_model(&self) -> &FrameModel;

    /// The parameters, to be changed.
    fn frame_model_mut(&mut self) -> &mut FrameModel;

    /// How long a frame takes, seconds.
    ///
    /// # Errors
    /// As [`FrameModel::predict`].
    fn seconds(&self, workload: &Workload, settings: &RaySettings) -> Result<f64, ModelError>;
}

impl Calibrated for FrameModel {
    fn frame_model(&self) -> &FrameModel {
        self
    }

    fn frame_model_mut(&mut self) -> &mut FrameModel {
        self
    }

    fn seconds(&self, workload: &Workload, settings: &RaySettings) -> Result<f64, ModelError> {
        Ok(self.predict(workload, settings)?.seconds)
    }
}

/// What a fit may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// [`Device::issue_cycles`]. Where computation bounds all frames, a factor on their time.
    Issue,
    /// [`Device::memory_latency_cycles`].
    Latency,
    /// [`Device::departure_delay_coalesced_cycles`].
    CoalescedDelay,
    /// [`Device::departure_delay_uncoalesced_cycles`].
    UncoalescedDelay,
    /// [`Constants::cached_traversals`].
    Cached,
    /// [`Constants::divergence`], from 1 if it is 0.
    Divergence,
}

impl Parameter {
    /// All.
    pub const ALL: [Self; 6] = [
        Self::Latency,
        Self::CoalescedDelay,
        Self::UncoalescedDelay,
        Self::Issue,
        Self::Cached,
        Self::Divergence,
    ];

    /// Those of [`calibrate`]: what the paper varies, the issue rate, and its 23.
    pub const PAPER: [Self; 5] =
        [Self::Latency, Self::CoalescedDelay, Self::UncoalescedDelay, Self::Issue, Self::Cached];

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Issue => "issue, cycles an instruction",
            Self::Latency => "latency, cycles",
            Self::CoalescedDelay => "coalesced departure delay, cycles",
            Self::UncoalescedDelay => "uncoalesced departure delay, cycles",
            Self::Cached => "traversals of AO rays that the cache holds",
            Self::Divergence => "share of divergence that costs time",
        }
    }

    /// Its value in a model.
    #[must_use]
    pub const fn value(self, model: &FrameModel) -> f64 {
        match self {
            Self::Issue => model.device.issue_cycles,
            Self::Latency => model.device.memory_latency_cycles,
            Self::CoalescedDelay => model.device.departure_delay_coalesced_cycles,
            Self::UncoalescedDelay => model.device.departure_delay_uncoalesced_cycles,
            Self::Cached => model.constants.cached_traversals,
            Self::Divergence => model.constants.divergence,
        }
    }

    fn multiply(self, model: &mut FrameModel, factor: f64) {
        let Device {
            memory_latency_cycles,
            departure_delay_coalesced_cycles,
            departure_delay_uncoalesced_cycles,
            issue_cycles,
            ..
        } = &mut model.device;
        let Constants { cached_traversals, divergence, .. } = &mut model.constants;
        if self == Self::Divergence && *divergence <= 0.0 {
            // Nothing has no factor.
            *divergence = 1.0;
        }
        let (value, least) = match self {
            Self::Issue => (issue_cycles, 1e-9),
            Self::Latency => (memory_latency_cycles, 1e-9),
            Self::CoalescedDelay => (departure_delay_coalesced_cycles, 1e-9),
            Self::UncoalescedDelay => (departure_delay_uncoalesced_cycles, 1e-9),
            Self::Cached => (cached_traversals, 1e-3),
            // Threads wait for all of it at most, unless regions are smaller than warps.
            Self::Divergence => (divergence, 1e-9),
        };
        let most = if self == Self::Divergence { 10.0 } else { 1e9 };
        *value = (*value * factor).clamp(least, most);
    }
}

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration<M = FrameModel> {
    /// The model with the fitted device.
    pub model: M,
    /// Mean of |predicted − measured| / measured before the fit.
    pub error_before: f64,
    /// The same after it.
    pub error_after: f64,
}

/// Fits [what the paper varies](Parameter::PAPER) and two more to frames that were drawn.
///
/// Minimises the mean square of the logarithm of predicted over measured time by a pattern search
/// over factors (Hooke and Jeeves 1961): no derivatives, which the model has not everywhere, and
/// the same result every time. Parameters stay within a factor of 10⁴ of where they begin. Some
/// thousand predictions an observation.
///
/// Observations of one kind tell a fit little: draw with and without AO and shadows, of full and of
/// empty views.
///
/// # Errors
/// [`ModelError::OutOfRange`] for a time that is none, or without observations; otherwise as
/// [`FrameModel::predict`].
pub fn calibrate<M: Calibrated>(
    model: &M,
    observations: &[Observation],
) -> Result<Calibration<M>, ModelError> {
    calibrate_only(model, observations, &Parameter::PAPER)
}

/// [`calibrate`] with some of the parameters; the others stay as they are.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_only<M: Calibrated>(
    model: &M,
    observations: &[Observation],
    parameters: &[Parameter],
) -> Result<Calibration<M>, ModelError> {
    check_all(observations)?;
    let error_before = mean_error(model, observations)?;
    let mut fitted = with(model, parameters, &search(model, observations, parameters)?);
    let mut error_after = mean_error(&fitted, observations)?;
    if error_after > error_before {
        // The least square need not be the least mean: what was there is kept.
        (fitted, error_after) = (model.clone(), error_before);
    } else {
        let device = &mut fitted.frame_model_mut().device;
        device.source = format!("{}; fitted to {} frames", device.source, observations.len());
    }
    Ok(Calibration { model: fitted, error_before, error_after })
}

/// The parameters that times tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The one that tells most first. Empty if none lessens the error of what a fit has not seen.
    pub parameters: Vec<Parameter>,
    /// Mean of |predicted − measured| / measured of each view, by fits of these parameters to the
    /// others; of the model as it is, if there are none.
    pub left_out_error: f64,
}

/// A parameter is worth fitting if it lessens the error of views that were left out by this share.
const WORTH: f64 = 0.05;

/// Chooses which of some parameters to fit: one after the other, always the one that lessens the error
/// of views most that the fit has not seen (leave-one-out cross-validation), until none does so by a
/// twentieth. Parameters that no time depends on, or that only follow the noise, are left as they are.
///
/// A view is all observations of a workload. With fewer than three views single observations are
/// left out.
///
/// # Errors
/// As [`calibrate`].
pub fn choose<M: Calibrated>(
    model: &M,
    observations: &[Observation],
    candidates: &[Parameter],
) -> Result<Choice, ModelError> {
    check_all(observations)?;
    let folds = folds(observations);
    let mut chosen =
        Choice { parameters: Vec::new(), left_out_error: mean_error(model, observations)? };
    // What a single observation tells cannot be asked of another.
    while folds.len() > 1 {
        let mut best: Option<(Parameter, f64)> = None;
        for &candidate in candidates.iter().filter(|one| !chosen.parameters.contains(one)) {
            let mut tried = chosen.parameters.clone();
            tried.push(candidate);
            let error = left_out(model, observations, &folds, &tried)?;
            if best.is_none_or(|(_, least)| error < least) {
                best = Some((candidate, error));
            }
        }
        match best {
            Some((parameter, error)) if error < (1.0 - WORTH) * chosen.left_out_error => {
                chosen.parameters.push(parameter);
                chosen.left_out_error = error;
            }
            _ => break,
        }
    }
    Ok(chosen)
}

/// The fold of each observation: its view, or itself if there are but few views. Which are there.
fn folds(observations: &[Observation]) -> Vec<Vec<usize>> {
    let mut views: Vec<Vec<usize>> = Vec::new();
    for (i, one) in observations.iter().enumerate() {
        match views.iter_mut().find(|view| observations[view[0]].workload == one.workload) {
            Some(view) => view.push(i),
            None => views.push(vec![i]),
        }
    }
    if views.len() < 3 { (0..observations.len()).map(|i| vec![i]).collect() } else { views }
}

/// The mean error of each fold by a fit to the others.
fn left_out<M: Calibrated>(
    model: &M,
    observations: &[Observation],
    folds: &[Vec<usize>],
    parameters: &[Parameter],
) -> Result<f64, ModelError> {
    let mut sum = 0.0;
    for fold in folds {
        let is_in = |i: &usize| fold.contains(i);
        let rest: Vec<Observation> =
            (0..observations.len()).filter(|i| !is_in(i)).map(|i| observations[i]).collect();
        let fitted = with(model, parameters, &search(model, &rest, parameters)?);
        for &i in fold {
            sum += error_of(&fitted, &observations[i])?;
        }
    }
    Ok(sum / observations.len() as f64)
}

/// The logarithms of the factors on parameters by which the cost is least.
fn search<M: Calibrated>(
    model: &M,
    observations: &[Observation],
    parameters: &[Parameter],
) -> Result<Vec<f64>, ModelError> {
    let mut at = vec![0.0; parameters.len()];
    let mut least = cost(&with(model, parameters, &at), observations)?;
    // What no model can have, far from where the search began, is no way to go.
    let cost =
        |at: &[f64]| cost(&with(model, parameters, at), observations).unwrap_or(f64::INFINITY);
    let mut step = 1.0;
    while step > 1e-3 {
        let mut moved = at.clone();
        let mut reached = least;
        for direction in directions(parameters.len()) {
            let tried: Vec<f64> = moved.iter().zip(&direction).map(|(x, d)| x + step * d).collect();
            let cost = cost(&tried);
            if cost < reached {
                (moved, reached) = (tried, cost);
            }
        }
        if reached < least {
            // As far again in the same direction, if that is better still.
            let further: Vec<f64> = moved.iter().zip(&at).map(|(m, a)| 2.0 * m - a).collect();
            (at, least) = (moved, reached);
            let cost = cost(&further);
            if cost < least {
                (at, least) = (further, cost);
            }
        } else {
            step *= 0.5;
        }
    }
    Ok(at)
}

/// Along each parameter, and each two at once: what one parameter adds another often takes away, so
/// the way to the least cost leads along such valleys.
fn directions(parameters: usize) -> impl Iterator<Item = Vec<f64>> {
    let signs = [1.0, -1.0];
    let pairs = (0..parameters).flat_map(move |i| (i..parameters).map(move |j| (i, j)));
    pairs.flat_map(move |(i, j)| {
        signs.into_iter().flat_map(move |a| {
            signs.into_iter().map(move |b| {
                let mut direction = vec![0.0; parameters];
                direction[i] = a;
                // For i = j along one parameter, by one sign or the other.
                direction[j] = b;
                direction
            })
        })
    })
}

/// The model whose parameters are these powers of e times as large.
fn with<M: Calibrated>(model: &M, parameters: &[Parameter], at: &[f64]) -> M {
    let mut model = model.clone();
    for (parameter, x) in parameters.iter().zip(at) {
        parameter.multiply(model.frame_model_mut(), x.clamp(-9.2, 9.2).exp());
    }
    model
}

fn cost<M: Calibrated>(model: &M, observations: &[Observation]) -> Result<f64, ModelError> {
    let mut sum = 0.0;
    for one in observations {
        let made = model.seconds(&one.workload, &one.settings)?;
        // A view and kernel of nothing take no time, of which there is no logarithm.
        let log = (made.max(1e-15) / one.seconds).ln();
        sum += log * log;
    }
    Ok(sum / observations.len().max(1) as f64)
}

fn error_of<M: Calibrated>(model: &M, one: &Observation) -> Result<f64, ModelError> {
    let made = model.seconds(&one.workload, &one.settings)?;
    Ok((made - one.seconds).abs() / one.seconds)
}

fn mean_error<M: Calibrated>(model: &M, observations: &[Observation]) -> Result<f64, ModelError> {
    let errors = observations.iter().map(|one| error_of(model, one));
    Ok(errors.sum::<Result<f64, _>>()? / observations.len() as f64)
}

fn check_all(observations: &[Observation]) -> Result<(), ModelError> {
    check("observations", observations.len() as f64, 1.0, 1e9, "at least 1")?;
    for one in observations {
        check("seconds", one.seconds, 1e-12, 1e9, "between 1e-12 and 1e9")?;
    }
    Ok(())
}
