//! Parameters of a device that fit measured times best.
//!
//! The thesis's Paper I, section 3.1: latency and both departure delays "are varied to find the
//! best fit for the particular architecture". Micro-benchmarks measure memory without a cache;
//! fitted to times of real kernels, the same parameters contain what the cache saves.

use crate::{Device, FrameModel, ModelError, RaySettings, Workload, program::check};

/// A frame that was drawn and timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Its workload.
    pub workload: Workload,
    /// Its settings.
    pub settings: RaySettings,
    /// How long it took, seconds. Above 0.
    pub seconds: f64,
}

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The model with the fitted device.
    pub model: FrameModel,
    /// Mean of |predicted − measured| / measured before the fit.
    pub error_before: f64,
    /// The same after it.
    pub error_after: f64,
}

/// Factors on the parameters that are fitted.
const PARAMETERS: usize = 4;

/// Fits latency, both departure delays and the cycles of an instruction to frames that were drawn.
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
pub fn calibrate(
    model: &FrameModel,
    observations: &[Observation],
) -> Result<Calibration, ModelError> {
    check("observations", observations.len() as f64, 1.0, 1e9, "at least 1")?;
    for one in observations {
        check("seconds", one.seconds, 1e-12, 1e9, "between 1e-12 and 1e9")?;
    }
    let error_before = mean_error(model, observations)?;
    let mut at = [0.0; PARAMETERS];
    let mut least = cost(model, observations, at)?;
    let mut step = 1.0;
    while step > 1e-3 {
        let mut moved = at;
        let mut reached = least;
        for direction in directions() {
            let tried: [f64; PARAMETERS] = std::array::from_fn(|i| moved[i] + step * direction[i]);
            let cost = cost(model, observations, tried)?;
            if cost < reached {
                (moved, reached) = (tried, cost);
            }
        }
        if reached < least {
            // As far again in the same direction, if that is better still.
            let further: [f64; PARAMETERS] = std::array::from_fn(|i| 2.0 * moved[i] - at[i]);
            (at, least) = (moved, reached);
            let cost = cost(model, observations, further)?;
            if cost < least {
                (at, least) = (further, cost);
            }
        } else {
            step *= 0.5;
        }
    }
    let mut fitted = with(model, at);
    let mut error_after = mean_error(&fitted, observations)?;
    if error_after > error_before {
        // The least square need not be the least mean: what was there is kept.
        (fitted, error_after) = (model.clone(), error_before);
    } else {
        fitted.device.source =
            format!("{}; fitted to {} frames", model.device.source, observations.len());
    }
    Ok(Calibration { model: fitted, error_before, error_after })
}

/// Along each parameter, and each two at once: what one parameter adds another often takes away, so
/// the way to the least cost leads along such valleys.
fn directions() -> impl Iterator<Item = [f64; PARAMETERS]> {
    let signs = [1.0, -1.0];
    let pairs = (0..PARAMETERS).flat_map(|i| (i..PARAMETERS).map(move |j| (i, j)));
    pairs.flat_map(move |(i, j)| {
        signs.into_iter().flat_map(move |a| {
            signs.into_iter().map(move |b| {
                let mut direction = [0.0; PARAMETERS];
                direction[i] = a;
                // For i = j along one parameter, by one sign or the other.
                direction[j] = b;
                direction
            })
        })
    })
}

/// The model whose parameters are these powers of e times as large.
fn with(model: &FrameModel, at: [f64; PARAMETERS]) -> FrameModel {
    let [latency, coalesced, uncoalesced, issue] = at.map(|x| x.clamp(-9.2, 9.2).exp());
    let mut model = model.clone();
    let Device {
        memory_latency_cycles,
        departure_delay_coalesced_cycles,
        departure_delay_uncoalesced_cycles,
        issue_cycles,
        ..
    } = &mut model.device;
    for (value, factor) in [
        (memory_latency_cycles, latency),
        (departure_delay_coalesced_cycles, coalesced),
        (departure_delay_uncoalesced_cycles, uncoalesced),
        (issue_cycles, issue),
    ] {
        *value = (*value * factor).clamp(1e-9, 1e9);
    }
    model
}

fn cost(
    model: &FrameModel,
    observations: &[Observation],
    at: [f64; PARAMETERS],
) -> Result<f64, ModelError> {
    let model = with(model, at);
    let mut sum = 0.0;
    for one in observations {
        let made = model.predict(&one.workload, &one.settings)?.seconds;
        // A view and kernel of nothing take no time, of which there is no logarithm.
        let log = (made.max(1e-15) / one.seconds).ln();
        sum += log * log;
    }
    Ok(sum / observations.len() as f64)
}

fn mean_error(model: &FrameModel, observations: &[Observation]) -> Result<f64, ModelError> {
    let mut sum = 0.0;
    for one in observations {
        let made = model.predict(&one.workload, &one.settings)?.seconds;
        sum += (made - one.seconds).abs() / one.seconds;
    }
    Ok(sum / observations.len() as f64)
}
