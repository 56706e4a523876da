//! Stable partitions of the three orders on 256-bit registers, the counterpart of
//! [`crate::scalar::partition`].

use crate::avx2::lanes;
use std::arch::x86_64::{
    __m256i, _mm_loadl_epi64, _mm256_and_si256, _mm256_blendv_epi8, _mm256_castsi256_ps,
    _mm256_cmpeq_epi32, _mm256_cmpgt_epi32, _mm256_cvtepu8_epi32, _mm256_loadu_si256,
    _mm256_mask_i32gather_epi32, _mm256_maskstore_epi32, _mm256_movemask_ps, _mm256_or_si256,
    _mm256_permutevar8x32_epi32, _mm256_set1_epi32, _mm256_slli_epi32, _mm256_storeu_si256,
};

/// [`partition`] of the other two orders of a node of up to eight primitives, of which the first
/// `left` along the axis of the split go left.
///
/// # Safety
/// The machine has AVX2. `left < count ≤ 8`, each pointer may be accessed up to
/// [`crate::kernel::PAD`] entries on, and the first `count` entries of each name the same
/// primitives, none twice.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn partition_eight(
    split: *const u32,
    others: [*mut u32; 2],
    count: usize,
    left: usize,
) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 8")]
    let (count, left) = (count as i32, left as i32);
    let inside = _mm256_cmpgt_epi32(_mm256_set1_epi32(count), lanes());
    // SAFETY: eight entries.
    let on_left = unsafe {
        // No primitive has the highest index.
        let split = _mm256_loadu_si256(split.cast());
        let goes_left = _mm256_cmpgt_epi32(_mm256_set1_epi32(left), lanes());
        _mm256_blendv_epi8(_mm256_set1_epi32(-1), split, goes_left)
    };
    // SAFETY: eight entries.
    let [a, b] = others.map(|order| unsafe { _mm256_loadu_si256(order.cast()) });
    let (mut in_a, mut in_b) = (_mm256_set1_epi32(0), _mm256_set1_epi32(0));
    for k in 0..7 {
        let one = _mm256_permutevar8x32_epi32(on_left, _mm256_set1_epi32(k));
        in_a = _mm256_or_si256(in_a, _mm256_cmpeq_epi32(a, one));
        in_b = _mm256_or_si256(in_b, _mm256_cmpeq_epi32(b, one));
    }
    for (order, (block, is_left)) in others.into_iter().zip([(a, in_a), (b, in_b)]) {
        // Entries of the next node count as right and keep their place.
        let is_left = _mm256_castsi256_ps(_mm256_and_si256(is_left, inside));
        let mask = _mm256_movemask_ps(is_left).cast_unsigned() as usize;
        let arranged = _mm256_permutevar8x32_epi32(block, first_left(mask));
        // SAFETY: eight entries.
        unsafe { _mm256_storeu_si256(order.cast(), arranged) };
    }
}

/// Writes the side of every primitive of a node: 0 for the first `left` in `order`, 1 for the rest.
///
/// # Safety
/// `order` holds valid indices into `side`, which nothing else uses meanwhile.
pub(crate) unsafe fn mark(order: &[u32], left: usize, side: *mut u8) {
    let (on_left, on_right) = order.split_at(left);
    for &p in on_left {
        // SAFETY: by the caller.
        unsafe { side.add(p as usize).write(0) };
    }
    for &p in on_right {
        // SAFETY: by the caller.
        unsafe { side.add(p as usize).write(1) };
    }
}

/// For each set of lanes that go left: which lane comes to each place when those go first and the
/// others follow, both in order.
static FIRST_LEFT: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let mut place = 0;
        let mut pass = 0;
        while pass < 2 {
            let mut lane = 0;
            while lane < 8 {
                if (mask >> lane) & 1 != pass {
                    #[expect(clippy::cast_possible_truncation, reason = "below 8")]
                    {
                        table[mask][place] = lane as u8;
                    }
                    place += 1;
                }
                lane += 1;
            }
            pass += 1;
        }
        mask += 1;
    }
    table
};

#[inline]
#[target_feature(enable = "avx2")]
fn first_left(mask: usize) -> __m256i {
    // SAFETY: a row of the table is eight bytes.
    unsafe { _mm256_cvtepu8_epi32(_mm_loadl_epi64(FIRST_LEFT[mask & 255].as_ptr().cast())) }
}

/// Stable partition of one order: primitives with `side` 0 go to the front. The rest of `order`
/// keeps its place. Returns nothing: the caller knows the number on the left.
///
/// # Safety
/// The machine has AVX2. `order` may be accessed from 0 to `count` + [`crate::kernel::PAD`], its first `count`
/// entries are valid indices into `side`, which has three more bytes than indices reach, and
/// `scratch` has room for `count` + [`crate::kernel::PAD`].
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn partition(order: *mut u32, count: usize, side: *const u8, scratch: *mut u32) {
    let (mut left, mut right) = (0, 0);
    let mut first = 0;
    while first < count {
        // SAFETY: `left ≤ first`, so that a store of eight to the left never reaches past what was
        // loaded; `right ≤ first` too. The last block may hold entries of the next node: they
        // count as right.
        unsafe {
            let block = _mm256_loadu_si256(order.add(first).cast());
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_possible_wrap,
                reason = "counts are below 2^28"
            )]
            let inside = _mm256_cmpgt_epi32(_mm256_set1_epi32((count - first) as i32), lanes());
            let sides =
                _mm256_mask_i32gather_epi32::<1>(_mm256_set1_epi32(1), side.cast(), block, inside);
            let goes_right = _mm256_castsi256_ps(_mm256_slli_epi32::<31>(sides));
            let mask = !_mm256_movemask_ps(goes_right).cast_unsigned() as usize & 255;
            let arranged = _mm256_permutevar8x32_epi32(block, first_left(mask));
            let here = mask.count_ones() as usize;
            let valid = (count - first).min(8);
            if valid == 8 {
                _mm256_storeu_si256(order.add(left).cast(), arranged);
            } else {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_possible_wrap,
                    reason = "at most 8"
                )]
                let keep = _mm256_cmpgt_epi32(_mm256_set1_epi32(here as i32), lanes());
                _mm256_maskstore_epi32(order.add(left).cast(), keep, arranged);
            }
            // The same with the others first: rotate by what went left.
            let others = _mm256_permutevar8x32_epi32(block, first_left(!mask & 255));
            _mm256_storeu_si256(scratch.add(right).cast(), others);
            left += here;
            right += valid - here;
        }
        first += 8;
    }
    // SAFETY: `left + right == count`, and the scratch holds `right` entries.
    unsafe { std::ptr::copy_nonoverlapping(scratch, order.add(left), right) };
}
