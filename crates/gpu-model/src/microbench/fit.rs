//! Lines through measured times.

use super::MicrobenchError;

/// A line through times of runs of several lengths, by least squares.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Seconds of a unit of length: what was measured.
    pub slope_s: f64,
    /// Seconds of a run of no length: the launch.
    pub intercept_s: f64,
    /// Root mean square of the times' distances from the line, over their mean.
    pub residual: f64,
    /// Lengths and seconds.
    pub samples: Vec<(f64, f64)>,
}

impl Fit {
    /// The line through samples of length and seconds.
    ///
    /// # Errors
    /// [`MicrobenchError::NoSlope`] if it does not rise, or there are no two lengths.
    pub fn of(what: &'static str, samples: Vec<(f64, f64)>) -> Result<Self, MicrobenchError> {
        let n = samples.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| samples.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(|s| s.0), mean(|s| s.1));
        let products: f64 = samples.iter().map(|s| (s.0 - x) * (s.1 - y)).sum();
        let squares: f64 = samples.iter().map(|s| (s.0 - x) * (s.0 - x)).sum();
        let slope_s = products / squares;
        // NaN is none either.
        if !(slope_s > 0.0 && slope_s.is_finite()) {
            return Err(MicrobenchError::NoSlope { what, slope_s });
        }
        let intercept_s = y - slope_s * x;
        let off = |s: &(f64, f64)| s.1 - (intercept_s + slope_s * s.0);
        let residual = (samples.iter().map(|s| off(s) * off(s)).sum::<f64>() / n).sqrt() / y;
        Ok(Self { slope_s, intercept_s, residual, samples })
    }
}
