//! Butterworth low-pass filters by the bilinear transform.

use crate::PowerError;
use serde::Serialize;
use std::f64::consts::PI;

/// A section of second order, `H(z) = (b₀ + b₁z⁻¹ + b₂z⁻²) / (1 + a₁z⁻¹ + a₂z⁻²)`, with a gain of 1 at
/// frequency 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Section {
    /// Numerator.
    pub b: [f64; 3],
    /// Denominator without its leading 1.
    pub a: [f64; 2],
}

impl Section {
    /// One step (transposed direct form II).
    #[inline]
    pub(crate) fn step(&self, state: &mut [f64; 2], x: f64) -> f64 {
        let y = self.b[0] * x + state[0];
        state[0] = self.b[1] * x - self.a[0] * y + state[1];
        state[1] = self.b[2] * x - self.a[1] * y;
        y
    }

    /// The state in which an input of 1 since ever leaves the section.
    const fn steady(&self) -> [f64; 2] {
        // With y = x = 1 in both update rules.
        let second = self.b[2] - self.a[1];
        [self.b[1] - self.a[0] + second, second]
    }
}

/// A Butterworth low-pass filter: no other of its order is flatter where it passes.
///
/// ```
/// use niwaki_power::Butterworth;
///
/// // 40,000 samples a second; 2 kHz and below pass.
/// let filter = Butterworth::low_pass(4, 2e3, 40e3)?;
/// let smooth = filter.filter_both_ways(&[100.0; 64]);
/// assert!(smooth.iter().all(|w| (w - 100.0).abs() < 1e-9));
/// # Ok::<(), niwaki_power::PowerError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Butterworth {
    sections: Vec<Section>,
}

impl Butterworth {
    /// A filter of this order (1 to 16) that halves the power of a sine at `cutoff_hz`.
    ///
    /// Poles of the analogue prototype lie evenly on the left half of a circle; its radius is
    /// 2·tan(π·cutoff/rate), so that the bilinear transform s = 2·(z − 1)/(z + 1), which bends
    /// frequencies, puts the cutoff where it was asked for (Oppenheim and Schafer, Discrete-Time Signal
    /// Processing, §7.1).
    ///
    /// # Errors
    /// [`PowerError::Setting`] for another order, or a cutoff that is not between 0 and half the rate.
    pub fn low_pass(order: u32, cutoff_hz: f64, rate_hz: f64) -> Result<Self, PowerError> {
        if !(1..=16).contains(&order) {
            return Err(PowerError::Setting(format!("no filter of order {order}: 1 to 16")));
        }
        let is_inside = cutoff_hz > 0.0 && cutoff_hz < 0.5 * rate_hz && rate_hz.is_finite();
        if !is_inside {
            return Err(PowerError::Setting(format!(
                "a cutoff of {cutoff_hz} Hz is not between 0 and half of {rate_hz} samples a second"
            )));
        }
        let radius = 2.0 * (PI * cutoff_hz / rate_hz).tan();
        let mut sections = Vec::new();
        // Pairs of conjugate poles; those nearest to the real axis, which ring least, come first.
        for pair in (0..order / 2).rev() {
            let angle = PI * f64::from(2 * pair + 1) / f64::from(2 * order);
            let (re, im) = (-radius * angle.sin(), radius * angle.cos());
            // z = (2 + s) / (2 − s)
            let below = (2.0 - re).powi(2) + im * im;
            let z_re = ((2.0 + re) * (2.0 - re) - im * im) / below;
            let z_norm = ((2.0 + re).powi(2) + im * im) / below;
            let a = [-2.0 * z_re, z_norm];
            let gain = (1.0 + a[0] + a[1]) / 4.0;
            sections.push(Section { b: [gain, 2.0 * gain, gain], a });
        }
        if order % 2 == 1 {
            let a = [-(2.0 - radius) / (2.0 + radius), 0.0];
            let gain = (1.0 + a[0]) / 2.0;
            sections.insert(0, Section { b: [gain, gain, 0.0], a });
        }
        Ok(Self { sections })
    }

    /// Its sections, in the order in which samples go through them.
    #[must_use]
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// States in which an input of 1 since ever leaves all sections.
    pub(crate) fn steady(&self) -> Vec<[f64; 2]> {
        self.sections.iter().map(Section::steady).collect()
    }

    pub(crate) fn states_at(&self, value: f64) -> Vec<[f64; 2]> {
        self.steady().into_iter().map(|s| s.map(|x| x * value)).collect()
    }

    #[inline]
    pub(crate) fn step(&self, states: &mut [[f64; 2]], x: f64) -> f64 {
        self.sections.iter().zip(states).fold(x, |x, (section, state)| section.step(state, x))
    }

    /// Filters forward, then backward, so that nothing is delayed and the attenuation doubles.
    ///
    /// Both passes start as if the first sample had been there since ever. It is the reference of
    /// [`super::ZeroPhase`], which does the same on a stream.
    #[must_use]
    pub fn filter_both_ways(&self, samples: &[f64]) -> Vec<f64> {
        let mut values = samples.to_vec();
        for _ in 0..2 {
            let mut states = self.states_at(values.first().copied().unwrap_or(0.0));
            values.iter_mut().for_each(|x| *x = self.step(&mut states, *x));
            values.reverse();
        }
        values
    }
}
