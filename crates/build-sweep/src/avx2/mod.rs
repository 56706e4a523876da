//! The sweep on 256-bit registers. Same operations in the same order as [`crate::scalar`].
//!
//! Extents of eight positions are transposed, so that areas and costs are formed eight at a time.

mod axis;
mod node;

pub(crate) use axis::sweep_axis;
pub(crate) use node::{bounds_of_two, sweep, sweep_eight, sweep_four};

use crate::kernel::Split;
use crate::rule::SplitRule;
use std::arch::x86_64::*;

/// Half areas of eight extents: that of box `k` stands in the low half of register `k`, that of
/// box `k + 4` in its high half.
#[inline]
#[target_feature(enable = "avx2")]
fn half_areas([r0, r1, r2, r3]: [__m256; 4], scale: __m256) -> __m256 {
    let xy01 = _mm256_unpacklo_ps(r0, r1);
    let xy23 = _mm256_unpacklo_ps(r2, r3);
    let z01 = _mm256_unpackhi_ps(r0, r1);
    let z23 = _mm256_unpackhi_ps(r2, r3);
    let x = _mm256_mul_ps(_mm256_shuffle_ps::<0b01_00_01_00>(xy01, xy23), scale);
    let y = _mm256_mul_ps(_mm256_shuffle_ps::<0b11_10_11_10>(xy01, xy23), scale);
    let z = _mm256_mul_ps(_mm256_shuffle_ps::<0b01_00_01_00>(z01, z23), scale);
    _mm256_add_ps(_mm256_mul_ps(x, _mm256_add_ps(y, z)), _mm256_mul_ps(y, z))
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn lanes() -> __m256i {
    _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)
}

/// The best of each lane: cost, and number of primitives on the left.
#[derive(Clone, Copy)]
struct BestOfLanes {
    cost: __m256,
    left: __m256i,
}

/// Costs of eight positions at a time.
struct Costs {
    leaf: __m256,
    triangle: __m256,
    count: __m256i,
}

impl Costs {
    #[inline]
    #[target_feature(enable = "avx2")]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "below 2^31")]
    fn new(rule: &SplitRule, count: usize) -> Self {
        Self {
            leaf: _mm256_set1_ps(rule.leaf),
            triangle: _mm256_set1_ps(rule.triangle),
            count: _mm256_set1_epi32(count as i32),
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn weight(&self, count: __m256i) -> __m256 {
        _mm256_add_ps(self.leaf, _mm256_mul_ps(self.triangle, _mm256_cvtepi32_ps(count)))
    }

    /// Improves `best` by the splits with `left` primitives on the left, where there are some on
    /// the right as well.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn improve(
        &self,
        best: &mut BestOfLanes,
        left: __m256i,
        area_left: __m256,
        area_right: __m256,
    ) {
        let right = _mm256_sub_epi32(self.count, left);
        let cost = _mm256_add_ps(
            _mm256_mul_ps(area_left, self.weight(left)),
            _mm256_mul_ps(area_right, self.weight(right)),
        );
        let valid = _mm256_castsi256_ps(_mm256_cmpgt_epi32(self.count, left));
        let cost = _mm256_blendv_ps(_mm256_set1_ps(f32::INFINITY), cost, valid);
        let better = _mm256_cmp_ps::<_CMP_LT_OQ>(cost, best.cost);
        best.cost = _mm256_blendv_ps(best.cost, cost, better);
        best.left = _mm256_blendv_epi8(best.left, left, _mm256_castps_si256(better));
    }
}

impl BestOfLanes {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new() -> Self {
        Self { cost: _mm256_set1_ps(f32::INFINITY), left: _mm256_set1_epi32(i32::MAX) }
    }

    /// The lowest cost, and the lowest code among the lanes that have it.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn reduce(self) -> (f32, u32) {
        let c = self.cost;
        let m = _mm256_min_ps(c, _mm256_permute2f128_ps::<1>(c, c));
        let m = _mm256_min_ps(m, _mm256_shuffle_ps::<0b01_00_11_10>(m, m));
        let m = _mm256_min_ps(m, _mm256_shuffle_ps::<0b10_11_00_01>(m, m));
        let lowest = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_EQ_OQ>(c, m));
        let l = _mm256_blendv_epi8(_mm256_set1_epi32(i32::MAX), self.left, lowest);
        let l = _mm256_min_epi32(l, _mm256_permute2x128_si256::<1>(l, l));
        let l = _mm256_min_epi32(l, _mm256_shuffle_epi32::<0b01_00_11_10>(l));
        let l = _mm256_min_epi32(l, _mm256_shuffle_epi32::<0b10_11_00_01>(l));
        let cost = _mm_cvtss_f32(_mm256_castps256_ps128(m));
        (cost, _mm_cvtsi128_si32(_mm256_castsi256_si128(l)).cast_unsigned())
    }
}

/// The best split of all axes: cost first, then axis, then position.
#[inline]
#[target_feature(enable = "avx2")]
fn best_of_axes(best: &[BestOfLanes; 3]) -> Split {
    const CODE_BITS: u32 = 28;
    // Lanes compare costs first and codes, axis before position, second.
    let mut all = best[0];
    for (axis, other) in [(1, best[1]), (2, best[2])] {
        let better = _mm256_cmp_ps::<_CMP_LT_OQ>(other.cost, all.cost);
        all.cost = _mm256_blendv_ps(all.cost, other.cost, better);
        let code = _mm256_add_epi32(other.left, _mm256_set1_epi32(axis << CODE_BITS));
        all.left = _mm256_blendv_epi8(all.left, code, _mm256_castps_si256(better));
    }
    let (cost, code) = all.reduce();
    if cost < f32::INFINITY {
        Split {
            cost,
            axis: (code >> CODE_BITS) as usize,
            left: (code & ((1 << CODE_BITS) - 1)) as usize,
        }
    } else {
        Split::NONE
    }
}
