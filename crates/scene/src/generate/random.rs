//! A small seeded generator of random numbers.

use glam::DVec3;

/// The output function of `SplitMix64` (Steele, Lea and Flood 2014, "Fast splittable pseudorandom
/// number generators", §4): mixes 64 bits so that each depends on all.
pub(super) const fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// `SplitMix64`: one 64-bit counter, mixed.
#[derive(Clone)]
pub(super) struct Random(u64);

impl Random {
    /// The `stream`-th independent sequence of a seed.
    pub(super) const fn new(seed: u64, stream: u64) -> Self {
        Self(mix(mix(seed) ^ stream))
    }

    pub(super) const fn next_u64(&mut self) -> u64 {
        let out = mix(self.0);
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        out
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [a, b).
    pub(super) fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// Uniform among 0 to n − 1; 0 for n = 0.
    pub(super) fn below(&mut self, n: usize) -> usize {
        let wide = u128::from(self.next_u64()) * n as u128;
        usize::try_from(wide >> 64).unwrap_or(0)
    }

    /// Uniform on the unit sphere.
    pub(super) fn direction(&mut self) -> DVec3 {
        let y = self.range(-1.0, 1.0);
        super::math::circle(self.unit()) * (1.0 - y * y).max(0.0).sqrt() + DVec3::Y * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_sequence() {
        // The first outputs of SplitMix64 from state 1234567, as its reference code prints them.
        let mut r = Random(1_234_567);
        let first = [r.next_u64(), r.next_u64()];
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn numbers_fill_their_range() {
        let mut r = Random::new(1, 2);
        let mean = (0..10_000).map(|_| r.unit()).sum::<f64>() / 10_000.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert!((0..1000).all(|_| r.below(7) < 7) && r.below(0) == 0);
        assert!((0..1000).all(|_| (r.direction().length() - 1.0).abs() < 1e-12));
    }
}
