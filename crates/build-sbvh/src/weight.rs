//! What a number of references is expected to cost.

use crate::Sbvh;
use niwaki_core::SahConstants;

/// Steps of the table to each doubling: numbers below twice this are looked up, not interpolated.
const STEPS: u32 = 64;
/// Doublings up to 2³².
const DOUBLINGS: u32 = 32;

/// The expected cost of a child by its number of references, relative to its area: see
/// [`Sbvh::count_exponent`].
#[derive(Clone, Debug)]
pub(crate) struct Weights {
    sah: SahConstants,
    /// N to the power, at `STEPS` places between powers of two.
    table: Vec<f32>,
}

impl Weights {
    /// Bytes of a table.
    pub(crate) const BYTES: usize = (STEPS * DOUBLINGS + 1) as usize * size_of::<f32>();

    pub(crate) fn new(config: &Sbvh) -> Self {
        let linear = config.max_leaf_size as f64;
        let exponent = f64::from(config.count_exponent);
        let power = |n: f64| if n <= linear { n } else { linear * (n / linear).powf(exponent) };
        let table = (0..=STEPS * DOUBLINGS).map(|i| {
            let (doublings, step) = (i / STEPS, i % STEPS);
            let n = 2_f64.powi(doublings.cast_signed());
            #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
            let weight = power(n * (1.0 + f64::from(step) / f64::from(STEPS))) as f32;
            weight
        });
        Self { sah: config.sah, table: table.collect() }
    }

    /// C_T·w(N) + C_L for `count` references, 1 or more.
    #[inline]
    pub(crate) fn of(&self, count: u32) -> f32 {
        // The exponent and the first bits of the significand are the place in the table.
        let bits = (count as f32).to_bits() - 1_f32.to_bits();
        let shift = 23 - STEPS.ilog2();
        let place = (bits >> shift) as usize;
        let rest = (bits & ((1 << shift) - 1)) as f32 * (1.0 / (1 << shift) as f32);
        let [from, to] = [self.table[place], self.table[(place + 1).min(self.table.len() - 1)]];
        self.sah.triangle * (from + rest * (to - from)) + self.sah.leaf
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_powers() {
        for exponent in [1.0, 0.8, 0.5] {
            let config = Sbvh { count_exponent: exponent, ..Sbvh::default() };
            let weights = Weights::new(&config);
            for count in (1..3000).chain([1 << 20, 12_345_678, u32::MAX]) {
                let n = count as f32;
                let expected = if n <= 8.0 { n } else { 8.0 * (n / 8.0).powf(exponent) };
                let weight = weights.of(count);
                assert!((weight / expected - 1.0).abs() < 1e-4, "{count}: {weight} {expected}");
                assert!(exponent < 1.0 || count > 1 << 24 || weight == n, "{count}: {weight}");
            }
        }
    }
}
