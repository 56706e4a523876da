//! The partition of midpoints on 256-bit registers, the counterpart of the loop in
//! [`super::partition::partition`]: two midpoints at a time.

use super::Midpoint;
use super::partition::Running;
use glam::Vec4;
use std::arch::x86_64::{
    __m256, __m256i, _CMP_LT_OQ, _mm_max_ps, _mm_min_ps, _mm256_castps_si256,
    _mm256_castps256_ps128, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_extractf128_ps,
    _mm256_load_si256, _mm256_loadu_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps,
    _mm256_or_ps, _mm256_permutevar8x32_epi32, _mm256_set1_epi32, _mm256_set1_ps,
    _mm256_storeu_si256, _mm256_xor_si256,
};

/// By which of two midpoints go left (bit 0, bit 1): all bits of those that do, and the lanes in
/// the order in which they are stored, those that go left first and in order, the others in
/// reverse order.
#[repr(C, align(32))]
struct Row {
    goes_left: [u32; 8],
    lanes: [u32; 8],
}

const ONES: u32 = u32::MAX;

static ROWS: [Row; 4] = [
    Row { goes_left: [0; 8], lanes: [4, 5, 6, 7, 0, 1, 2, 3] },
    Row { goes_left: [ONES, ONES, ONES, ONES, 0, 0, 0, 0], lanes: [0, 1, 2, 3, 4, 5, 6, 7] },
    Row { goes_left: [0, 0, 0, 0, ONES, ONES, ONES, ONES], lanes: [4, 5, 6, 7, 0, 1, 2, 3] },
    Row { goes_left: [ONES; 8], lanes: [0, 1, 2, 3, 4, 5, 6, 7] },
];

/// The smaller and the larger of both halves.
#[inline]
#[target_feature(enable = "avx2")]
fn join(min: __m256, max: __m256) -> (Vec4, Vec4) {
    let min = _mm_min_ps(_mm256_castps256_ps128(min), _mm256_extractf128_ps::<1>(min));
    let max = _mm_max_ps(_mm256_castps256_ps128(max), _mm256_extractf128_ps::<1>(max));
    (Vec4::from(min), Vec4::from(max))
}

/// Partitions all midpoints but a few and grows the bounds by them. Returns where the next to the
/// left goes and where the last to the right went: as many midpoints are left, the last of
/// `source`.
///
/// # Safety
/// The machine has AVX2, `target` is as long as `source`, and `axis < 3`.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn partition(
    source: &[Midpoint],
    target: &mut [Midpoint],
    axis: usize,
    plane: f32,
    running: &mut Running,
) -> (usize, usize) {
    // Nothing is below −∞, so that only the axis sets bits.
    let mut planes = [f32::NEG_INFINITY; 8];
    planes[axis] = plane;
    planes[axis + 4] = plane;
    // SAFETY: eight floats.
    let planes = unsafe { _mm256_loadu_ps(planes.as_ptr()) };
    let infinity = _mm256_set1_ps(f32::INFINITY);
    let minus_infinity = _mm256_set1_ps(f32::NEG_INFINITY);
    let (mut min_left, mut max_left) = (infinity, minus_infinity);
    let (mut min_right, mut max_right) = (infinity, minus_infinity);
    let out = target.as_mut_ptr();
    let (mut left, mut right) = (0, source.len());
    let mut from = source.as_ptr();
    // With four places or more between the ends, what is stored for nothing lies between them.
    while right - left >= 4 {
        // SAFETY: `right − left` is the number of midpoints still to come, so two can be read, and
        // two written at `left` and below `right`. The index of the row is two bits.
        unsafe {
            let pair = _mm256_loadu_ps(from.cast());
            from = from.add(2);
            let bits = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(pair, planes));
            let bits = bits.cast_unsigned() as usize >> axis;
            let which = (bits | bits >> 3) & 3;
            let row = ROWS.as_ptr().add(which);
            let goes_left = _mm256_load_si256((&raw const (*row).goes_left).cast::<__m256i>());
            let lanes = _mm256_load_si256((&raw const (*row).lanes).cast::<__m256i>());
            let arranged = _mm256_permutevar8x32_epi32(_mm256_castps_si256(pair), lanes);
            _mm256_storeu_si256(out.add(left).cast(), arranged);
            _mm256_storeu_si256(out.add(right - 2).cast(), arranged);
            let count = (which & 1) + (which >> 1);
            left += count;
            right -= 2 - count;
            // A number with all bits set is none, and then `min` and `max` return the second
            // operand.
            let right_bits = _mm256_xor_si256(goes_left, _mm256_set1_epi32(-1));
            let lefts = _mm256_or_ps(pair, _mm256_castsi256_ps(right_bits));
            let rights = _mm256_or_ps(pair, _mm256_castsi256_ps(goes_left));
            min_left = _mm256_min_ps(lefts, min_left);
            max_left = _mm256_max_ps(lefts, max_left);
            min_right = _mm256_min_ps(rights, min_right);
            max_right = _mm256_max_ps(rights, max_right);
        }
    }
    let (min_left, max_left) = join(min_left, max_left);
    let (min_right, max_right) = join(min_right, max_right);
    running.min = [running.min[0].min(min_left), running.min[1].min(min_right)];
    running.max = [running.max[0].max(max_left), running.max[1].max(max_right)];
    (left, right)
}
