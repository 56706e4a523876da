//! Counter-based random numbers: each is a hash of where it is used, so an image does not depend
//! on which thread renders which pixel, or on how many there are.

use glam::Vec2;

/// The pcg4d hash (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", JCGT 9(3)): four
/// words in, four well-mixed words out.
#[must_use]
pub fn pcg4d(mut v: [u32; 4]) -> [u32; 4] {
    fn mix(v: &mut [u32; 4]) {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
    }
    for x in &mut v {
        *x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    }
    mix(&mut v);
    for x in &mut v {
        *x ^= *x >> 16;
    }
    mix(&mut v);
    v
}

/// The 24 high bits as a number in [0, 1): the most that `f32` holds without rounding up to 1.
const fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1_u32 << 24) as f32
}

/// The low and the high half of a number.
#[expect(clippy::cast_possible_truncation, reason = "the halves are what is wanted")]
pub(crate) const fn halves(x: u64) -> [u32; 2] {
    [x as u32, (x >> 32) as u32]
}

/// The random numbers of one path: a hash of (pixel, sample, dimension, seed), the dimension
/// counting up with every draw.
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    pixel: u32,
    sample: u32,
    dimension: u32,
    seed: u32,
}

impl Sampler {
    /// The numbers of sample `sample` of pixel number `pixel`.
    pub(crate) fn new(pixel: u32, sample: u32, seed: u64) -> Self {
        let [low, high] = halves(seed);
        Self { pixel, sample, dimension: 0, seed: low ^ pcg4d([high, 0, 0, 0])[0] }
    }

    fn draw(&mut self) -> [u32; 4] {
        let words = pcg4d([self.pixel, self.sample, self.dimension, self.seed]);
        self.dimension = self.dimension.wrapping_add(1);
        words
    }

    /// Leaves out as many draws.
    pub(crate) const fn skip(&mut self, draws: u32) {
        self.dimension = self.dimension.wrapping_add(draws);
    }

    /// The next number in [0, 1).
    pub(crate) fn next_1d(&mut self) -> f32 {
        unit(self.draw()[0])
    }

    /// The next pair in [0, 1)².
    pub(crate) fn next_2d(&mut self) -> Vec2 {
        let [x, y, ..] = self.draw();
        Vec2::new(unit(x), unit(y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pearson's χ² of counts that should be equal.
    fn chi_squared(counts: &[u32]) -> f64 {
        let mean = counts.iter().map(|&c| f64::from(c)).sum::<f64>() / counts.len() as f64;
        counts.iter().map(|&c| (f64::from(c) - mean).powi(2) / mean).sum()
    }

    #[test]
    fn neighbours_in_every_counter_are_uniform_and_independent() {
        // 256 cells of consecutive pairs: χ² has mean 255 and standard deviation 22.6.
        for axis in 0..3 {
            let mut counts = [0_u32; 256];
            let draw = |i: u32| {
                let (pixel, sample) = [(i, 0), (0, i), (7, 7)][axis];
                let mut sampler = Sampler::new(pixel, sample, 1);
                for _ in 0..if axis == 2 { i % 64 } else { 0 } {
                    sampler.draw();
                }
                if axis == 2 {
                    sampler.sample = i / 64;
                }
                sampler.next_1d()
            };
            for i in 0..65_536 {
                #[expect(clippy::cast_possible_truncation, reason = "below 16")]
                let cell = |x: f32| (x * 16.0).floor() as usize;
                counts[cell(draw(i)) * 16 + cell(draw(i + 1))] += 1;
            }
            let chi = chi_squared(&counts);
            assert!((chi - 255.0).abs() < 6.0 * 22.6, "axis {axis}: χ² = {chi}");
        }
    }

    #[test]
    fn both_halves_of_the_seed_count() {
        let first = |seed| Sampler::new(3, 5, seed).draw();
        assert_eq!(first(9), first(9));
        assert_ne!(first(9), first(10));
        assert_ne!(first(9), first(9 | 1 << 40));
    }
}
