//! Bitonic networks that sort the lanes of a vector upwards, as signed integers.

use std::arch::x86_64::*;

/// Four lanes.
#[target_feature(enable = "avx2")]
#[inline]
pub(crate) fn sort4(v: __m128i) -> __m128i {
    let (lo, hi) = (|a, b| _mm_min_epi32(a, b), |a, b| _mm_max_epi32(a, b));
    let p = _mm_shuffle_epi32::<0b10_11_00_01>(v);
    let v = _mm_blend_epi32::<0b1010>(lo(v, p), hi(v, p));
    let p = _mm_shuffle_epi32::<0b00_01_10_11>(v);
    let v = _mm_blend_epi32::<0b1100>(lo(v, p), hi(v, p));
    let p = _mm_shuffle_epi32::<0b10_11_00_01>(v);
    _mm_blend_epi32::<0b1010>(lo(v, p), hi(v, p))
}

/// Eight lanes.
#[target_feature(enable = "avx2")]
#[inline]
pub(crate) fn sort8(v: __m256i) -> __m256i {
    let (lo, hi) = (|a, b| _mm256_min_epi32(a, b), |a, b| _mm256_max_epi32(a, b));
    let p = _mm256_shuffle_epi32::<0b10_11_00_01>(v);
    let v = _mm256_blend_epi32::<0b1010_1010>(lo(v, p), hi(v, p));
    let p = _mm256_shuffle_epi32::<0b00_01_10_11>(v);
    let v = _mm256_blend_epi32::<0b1100_1100>(lo(v, p), hi(v, p));
    let p = _mm256_shuffle_epi32::<0b10_11_00_01>(v);
    let v = _mm256_blend_epi32::<0b1010_1010>(lo(v, p), hi(v, p));
    let p = _mm256_permutevar8x32_epi32(v, _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0));
    let v = _mm256_blend_epi32::<0b1111_0000>(lo(v, p), hi(v, p));
    let p = _mm256_shuffle_epi32::<0b01_00_11_10>(v);
    let v = _mm256_blend_epi32::<0b1100_1100>(lo(v, p), hi(v, p));
    let p = _mm256_shuffle_epi32::<0b10_11_00_01>(v);
    _mm256_blend_epi32::<0b1010_1010>(lo(v, p), hi(v, p))
}
