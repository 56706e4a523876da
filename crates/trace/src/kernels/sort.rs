//! Bitonic networks that sort the lanes of a vector upwards, as signed integers.

use std::arch::x86_64::*;

/// Four lanes.
#[target_feature(enable = "sse4.1")]
#[inline]
pub(crate) fn sort4(v: __m128i) -> __m128i {
    let (lo, hi) = (|a, b| _mm_min_epi32(a, b), |a, b| _mm_max_epi32(a, b));
    let p = _mm_shuffle_epi32::<0b10_11_00_01>(v);
    let v = _mm_blend_epi16::<0b1100_1100>(lo(v, p), hi(v, p));
    let p = _mm_shuffle_epi32::<0b00_01_10_11>(v);
    let v = _mm_blend_epi16::<0b1111_0000>(lo(v, p), hi(v, p));
    let p = _mm_shuffle_epi32::<0b10_11_00_01>(v);
    _mm_blend_epi16::<0b1100_1100>(lo(v, p), hi(v, p))
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

/// Sixteen lanes.
#[target_feature(enable = "avx512f")]
#[inline]
pub(crate) fn sort16(v: __m512i) -> __m512i {
    /// Puts the smaller of each lane and its partner into the lanes that `UPPER` leaves out.
    #[target_feature(enable = "avx512f")]
    #[inline]
    fn exchange<const UPPER: u16>(v: __m512i, partner: __m512i) -> __m512i {
        _mm512_mask_max_epi32(_mm512_min_epi32(v, partner), UPPER, v, partner)
    }
    // Partners at distances of 1, 2, 4 and 8, and mirrored within 2, 4, 8 and 16 lanes.
    let by_1 = |v| _mm512_shuffle_epi32::<0b10_11_00_01>(v);
    let by_2 = |v| _mm512_shuffle_epi32::<0b01_00_11_10>(v);
    let by_4 = |v| _mm512_shuffle_i32x4::<0b10_11_00_01>(v, v);
    let in_4 = |v| _mm512_shuffle_epi32::<0b00_01_10_11>(v);
    let in_8 = |v| by_4(in_4(v));
    let in_16 = |v| _mm512_shuffle_i32x4::<0b00_01_10_11>(in_4(v), in_4(v));
    let v = exchange::<0xaaaa>(v, by_1(v));
    let v = exchange::<0xcccc>(v, in_4(v));
    let v = exchange::<0xaaaa>(v, by_1(v));
    let v = exchange::<0xf0f0>(v, in_8(v));
    let v = exchange::<0xcccc>(v, by_2(v));
    let v = exchange::<0xaaaa>(v, by_1(v));
    let v = exchange::<0xff00>(v, in_16(v));
    let v = exchange::<0xf0f0>(v, by_4(v));
    let v = exchange::<0xcccc>(v, by_2(v));
    exchange::<0xaaaa>(v, by_1(v))
}
