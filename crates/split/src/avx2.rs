//! Measuring and spreading references on 256-bit registers, one reference to a register: the
//! counterparts of [`crate::sets::Sides::measure`] and [`crate::spread`], with the same results.

use crate::sets::{Plane, Set, Sides};
use niwaki_core::PrimRef;
use niwaki_core::glam::Vec4;
use std::arch::x86_64::{
    __m256, _CMP_GT_OQ, _CMP_LT_OQ, _CMP_NLT_UQ, _MM_HINT_T0, _mm_prefetch, _mm256_and_ps,
    _mm256_broadcast_ss, _mm256_castps256_ps128, _mm256_castsi256_ps, _mm256_cmp_ps,
    _mm256_extractf128_ps, _mm256_load_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_movemask_ps,
    _mm256_mul_ps, _mm256_or_ps, _mm256_permute2f128_ps, _mm256_permutevar8x32_ps,
    _mm256_set1_epi32, _mm256_set1_ps, _mm256_setr_epi32, _mm256_setr_ps, _mm256_store_ps,
    _mm256_sub_ps, _mm256_xor_ps,
};

/// Indices of overlapping references wait in a block until it is full: storing each one, whether
/// it counts or not, costs less than a branch that cannot be predicted.
const BLOCK: usize = 256;

/// How far ahead references are fetched into the cache, in floats: 1.5 KiB. Large sets are not in
/// it, and the machine by itself does not ask for them early enough.
const AHEAD: usize = 8 * 48;

/// A plane and what else turns references into numbers that one comparison or maximum serves:
/// smallest corners are negated.
struct Constants {
    /// The plane's position on its axis, negated in the lower half; what no number is beyond in
    /// all other lanes.
    planes: __m256,
    axis: u32,
    /// Lanes 3 and 7 are ids. They look like denormals, which make arithmetic slow.
    numbers: __m256,
    negate_min: __m256,
}

impl Constants {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(plane: Plane) -> Self {
        let mut planes = [f32::INFINITY; 8];
        planes[plane.axis] = -plane.position;
        planes[plane.axis + 4] = plane.position;
        Self {
            // SAFETY: eight floats.
            planes: unsafe { _mm256_loadu_ps(planes.as_ptr()) },
            axis: niwaki_core::to_u32(plane.axis),
            numbers: _mm256_castsi256_ps(_mm256_setr_epi32(-1, -1, -1, 0, -1, -1, -1, 0)),
            negate_min: _mm256_setr_ps(-0.0, -0.0, -0.0, -0.0, 0.0, 0.0, 0.0, 0.0),
        }
    }

    /// The box and the point in its middle, smallest corners negated.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn corners(&self, prim: __m256) -> [__m256; 2] {
        let corners = _mm256_xor_ps(_mm256_and_ps(prim, self.numbers), self.negate_min);
        let half = _mm256_mul_ps(corners, _mm256_set1_ps(0.5));
        // −min/2 − max/2 and max/2 + min/2.
        let centroid = _mm256_sub_ps(half, _mm256_permute2f128_ps::<1>(half, half));
        [corners, centroid]
    }

    /// Bit 0: the smallest corner is left of the plane. Bit 4: the largest is right of it.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn beyond(&self, corners: __m256) -> u32 {
        let bits = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(corners, self.planes));
        bits.cast_unsigned() >> self.axis
    }
}

/// Both corners of a box whose smallest corner is negated.
#[inline]
#[target_feature(enable = "avx2")]
fn halves(corners: __m256) -> [Vec4; 2] {
    let min = Vec4::from(_mm256_castps256_ps128(corners));
    [-min, Vec4::from(_mm256_extractf128_ps::<1>(corners))]
}

/// The box and the centroid bounds of a set as they grow. They stay in registers: tables in memory,
/// indexed by what a reference is, make each reference wait for the one before.
#[derive(Clone, Copy)]
struct Grown([__m256; 2]);

impl Grown {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new() -> Self {
        Self([_mm256_set1_ps(f32::NEG_INFINITY); 2])
    }

    /// Grows unless all bits of `except` are set.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn grow(&mut self, corners: [__m256; 2], except: __m256) {
        // A number with all bits set is none, and then `max` returns the second operand.
        for (grown, corner) in self.0.iter_mut().zip(corners) {
            *grown = _mm256_max_ps(_mm256_or_ps(corner, except), *grown);
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn set(self, count: usize) -> Set {
        Set::new(count, halves(self.0[0]), halves(self.0[1]))
    }
}

/// As [`Sides::measure`].
///
/// # Safety
/// The machine has AVX2, and the plane's axis is 0, 1 or 2.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn measure(prims: &[PrimRef], plane: Plane, overlapping: &mut Vec<u32>) -> Sides {
    let constants = Constants::new(plane);
    let position = _mm256_set1_ps(plane.position);
    let upper_axis = _mm256_set1_epi32(4 + constants.axis.cast_signed());
    let mut disjoint = [Grown::new(); 2];
    let mut overlap = [Grown::new(); 2];
    let (mut all_right, mut across, mut right_across) = (0_usize, 0_usize, 0_usize);
    let mut block = [0_u32; BLOCK];
    for (here, start) in prims.chunks(BLOCK).zip((0_u32..).step_by(BLOCK)) {
        let mut found = 0;
        for (prim, index) in here.iter().zip(start..) {
            let prim: *const f32 = (&raw const *prim).cast();
            _mm_prefetch::<_MM_HINT_T0>(prim.wrapping_add(AHEAD).cast());
            // SAFETY: a reference is eight aligned floats, and the axis is less than 4.
            let (corners, min, max) = unsafe {
                (
                    constants.corners(_mm256_load_ps(prim)),
                    _mm256_broadcast_ss(&*prim.add(plane.axis)),
                    _mm256_broadcast_ss(&*prim.add(plane.axis + 4)),
                )
            };
            let middle = _mm256_permutevar8x32_ps(corners[1], upper_axis);
            let left = _mm256_cmp_ps::<_CMP_LT_OQ>(middle, position);
            let right = _mm256_cmp_ps::<_CMP_NLT_UQ>(middle, position);
            let overlaps = _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_LT_OQ>(min, position),
                _mm256_cmp_ps::<_CMP_GT_OQ>(max, position),
            );
            disjoint[0].grow(corners, _mm256_or_ps(right, overlaps));
            disjoint[1].grow(corners, _mm256_or_ps(left, overlaps));
            block[found & (BLOCK - 1)] = index;
            found += (_mm256_movemask_ps(overlaps) & 1) as usize;
            all_right += (_mm256_movemask_ps(right) & 1) as usize;
        }
        // Few overlap, and what is left to do for them is in the cache.
        for &index in &block[..found] {
            // SAFETY: a reference is eight aligned floats.
            let prim = unsafe { _mm256_load_ps((&raw const prims[index as usize]).cast()) };
            let corners = constants.corners(prim);
            let is_right = !constants.beyond(corners[1]) & 1;
            overlap[is_right as usize].grow(corners, _mm256_set1_ps(0.0));
            right_across += is_right as usize;
        }
        across += found;
        overlapping.extend_from_slice(&block[..found]);
    }
    let left_across = across - right_across;
    let left = prims.len() - all_right;
    Sides {
        disjoint: [disjoint[0].set(left - left_across), disjoint[1].set(all_right - right_across)],
        overlap: [overlap[0].set(left_across), overlap[1].set(right_across)],
    }
}

/// As [`crate::spread::forward`] or, if `BACKWARD`, [`crate::spread::backward`].
///
/// # Safety
/// The machine has AVX2, and `len` is not more than the region has.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn spread<const BACKWARD: bool>(
    region: &mut [PrimRef],
    len: usize,
    plane: Plane,
    flip: bool,
) -> usize {
    let constants = Constants::new(plane);
    let out = region.as_mut_ptr();
    let (mut low, mut high) = (0, region.len());
    for i in 0..len {
        let from = if BACKWARD { region.len() - 1 - i } else { i };
        // SAFETY: `from` is within the region. Not more than `i` references went to either end
        // before, and `i` is less than the region's length: so are `low` and `high − 1`.
        unsafe {
            let prim = _mm256_load_ps(out.add(from).cast());
            let [_, centroid] = constants.corners(prim);
            let is_left = constants.beyond(centroid) & 1 == 1;
            let goes_low = usize::from(is_left != flip);
            _mm256_store_ps(out.add(low).cast(), prim);
            _mm256_store_ps(out.add(high - 1).cast(), prim);
            low += goes_low;
            high -= 1 - goes_low;
        }
    }
    low
}
