//! One set of names for vectors of 128, 256 and 512 bits, for `define_traversal`.
//!
//! `mul_add` rounds once. `loose_mul_add` may round twice where that is faster: boxes have room for
//! the difference.

/// Four lanes: AVX, FMA and SSE4.1.
pub(crate) mod vectors128 {
    pub(crate) use std::arch::x86_64::{
        __m128 as Floats, __m128i as Ints, _mm_add_ps as add, _mm_and_ps as and,
        _mm_and_si128 as and_ints, _mm_andnot_ps as and_not, _mm_andnot_si128 as and_not_ints,
        _mm_castps_si128 as as_ints, _mm_cvtss_f32 as first_lane, _mm_div_ps as div,
        _mm_fmadd_ps as mul_add, _mm_fmadd_ps as loose_mul_add, _mm_fmsub_ps as mul_sub,
        _mm_fnmadd_ps as neg_mul_add, _mm_load_ps as load, _mm_load_si128 as load_ints,
        _mm_loadu_ps as load_unaligned, _mm_max_ps as max, _mm_min_ps as min, _mm_mul_ps as mul,
        _mm_or_si128 as or_ints, _mm_permutevar_ps as permute_floats, _mm_set1_epi32 as splat_int,
        _mm_set1_ps as splat, _mm_setzero_ps as zero, _mm_storeu_ps as store_unaligned,
        _mm_storeu_si128 as store_ints, _mm_sub_epi32 as sub_ints, _mm_sub_ps as sub,
        _mm_xor_ps as xor,
    };
    use std::arch::x86_64::{
        _mm_castps_si128, _mm_castsi128_ps, _mm_cvtepi32_ps, _mm_cvtepu8_epi32, _mm_cvtsi32_si128,
        _mm_permutevar_ps, _mm_setr_epi32,
    };

    /// [`loose_mul_add`] rounds once.
    pub(crate) const FUSED: bool = true;

    /// The first `count` lanes of a mask.
    #[target_feature(enable = "bmi2")]
    #[inline]
    pub(crate) fn low_lanes(mask: u32, count: u32) -> u32 {
        std::arch::x86_64::_bzhi_u32(mask, count)
    }

    /// The lanes that `lanes` names in its two lowest bits.
    #[target_feature(enable = "avx")]
    #[inline]
    pub(crate) fn permute(v: Ints, lanes: Ints) -> Ints {
        _mm_castps_si128(_mm_permutevar_ps(_mm_castsi128_ps(v), lanes))
    }

    /// The first four lanes.
    #[inline]
    pub(crate) fn low(v: Ints) -> Ints {
        v
    }

    /// Four bytes as numbers.
    ///
    /// # Safety
    /// They must be readable.
    #[target_feature(enable = "sse4.1")]
    #[inline]
    pub(crate) unsafe fn load_bytes(bytes: *const u8) -> Floats {
        // SAFETY: as promised.
        let word = unsafe { bytes.cast::<i32>().read_unaligned() };
        _mm_cvtepi32_ps(_mm_cvtepu8_epi32(_mm_cvtsi32_si128(word)))
    }

    /// Each lane's number.
    #[target_feature(enable = "sse2")]
    #[inline]
    pub(crate) fn lane_ids() -> Ints {
        _mm_setr_epi32(0, 1, 2, 3)
    }
}

/// Eight lanes: AVX2 and FMA.
pub(crate) mod vectors256 {
    pub(crate) use std::arch::x86_64::{
        __m256 as Floats, __m256i as Ints, _mm256_add_ps as add, _mm256_and_ps as and,
        _mm256_and_si256 as and_ints, _mm256_andnot_ps as and_not,
        _mm256_andnot_si256 as and_not_ints, _mm256_castps_si256 as as_ints,
        _mm256_castsi256_si128 as low, _mm256_cvtss_f32 as first_lane, _mm256_div_ps as div,
        _mm256_fmadd_ps as mul_add, _mm256_fmadd_ps as loose_mul_add, _mm256_fmsub_ps as mul_sub,
        _mm256_fnmadd_ps as neg_mul_add, _mm256_load_ps as load, _mm256_load_si256 as load_ints,
        _mm256_loadu_ps as load_unaligned, _mm256_max_ps as max, _mm256_min_ps as min,
        _mm256_mul_ps as mul, _mm256_or_si256 as or_ints, _mm256_permutevar8x32_epi32 as permute,
        _mm256_permutevar8x32_ps as permute_floats, _mm256_set1_epi32 as splat_int,
        _mm256_set1_ps as splat, _mm256_setzero_ps as zero, _mm256_storeu_ps as store_unaligned,
        _mm256_storeu_si256 as store_ints, _mm256_sub_epi32 as sub_ints, _mm256_sub_ps as sub,
        _mm256_xor_ps as xor,
    };
    use std::arch::x86_64::{
        _mm_setr_epi8, _mm256_cvtepi32_ps, _mm256_set_m128i, _mm256_set1_epi64x, _mm256_setr_epi32,
        _mm256_shuffle_epi8,
    };

    /// [`loose_mul_add`] rounds once.
    pub(crate) const FUSED: bool = true;

    /// The first `count` lanes of a mask.
    #[target_feature(enable = "bmi2")]
    #[inline]
    pub(crate) fn low_lanes(mask: u32, count: u32) -> u32 {
        std::arch::x86_64::_bzhi_u32(mask, count)
    }

    /// Each lane's number.
    #[target_feature(enable = "avx")]
    #[inline]
    pub(crate) fn lane_ids() -> Ints {
        _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)
    }

    /// Eight bytes as numbers.
    ///
    /// # Safety
    /// They must be readable.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(crate) unsafe fn load_bytes(bytes: *const u8) -> Floats {
        // SAFETY: as promised.
        let row = unsafe { bytes.cast::<i64>().read_unaligned() };
        // To load the row into both halves and shuffle within them takes a cycle; instructions
        // that zero-extend across them take three, on a port that is busy.
        let first = _mm_setr_epi8(0, -1, -1, -1, 1, -1, -1, -1, 2, -1, -1, -1, 3, -1, -1, -1);
        let last = _mm_setr_epi8(4, -1, -1, -1, 5, -1, -1, -1, 6, -1, -1, -1, 7, -1, -1, -1);
        let spread = _mm256_set_m128i(last, first);
        _mm256_cvtepi32_ps(_mm256_shuffle_epi8(_mm256_set1_epi64x(row), spread))
    }
}

/// Sixteen lanes: AVX-512 F and DQ.
pub(crate) mod vectors512 {
    pub(crate) use std::arch::x86_64::{
        __m512 as Floats, __m512i as Ints, _mm512_add_ps as add, _mm512_and_ps as and,
        _mm512_and_si512 as and_ints, _mm512_andnot_ps as and_not,
        _mm512_andnot_si512 as and_not_ints, _mm512_castps_si512 as as_ints,
        _mm512_castsi512_si128 as low, _mm512_cvtss_f32 as first_lane, _mm512_div_ps as div,
        _mm512_fmadd_ps as mul_add, _mm512_fmadd_ps as loose_mul_add, _mm512_fmsub_ps as mul_sub,
        _mm512_fnmadd_ps as neg_mul_add, _mm512_load_ps as load, _mm512_load_si512 as load_ints,
        _mm512_loadu_ps as load_unaligned, _mm512_max_ps as max, _mm512_min_ps as min,
        _mm512_mul_ps as mul, _mm512_or_si512 as or_ints, _mm512_set1_epi32 as splat_int,
        _mm512_set1_ps as splat, _mm512_setzero_ps as zero, _mm512_storeu_ps as store_unaligned,
        _mm512_storeu_si512 as store_ints, _mm512_sub_epi32 as sub_ints, _mm512_sub_ps as sub,
        _mm512_xor_ps as xor,
    };
    use std::arch::x86_64::{
        _mm_loadu_si128, _mm512_cvtepi32_ps, _mm512_cvtepu8_epi32, _mm512_permutexvar_epi32,
        _mm512_permutexvar_ps, _mm512_setr_epi32,
    };

    /// [`loose_mul_add`] rounds once.
    pub(crate) const FUSED: bool = true;

    /// The first `count` lanes of a mask.
    #[target_feature(enable = "bmi2")]
    #[inline]
    pub(crate) fn low_lanes(mask: u32, count: u32) -> u32 {
        std::arch::x86_64::_bzhi_u32(mask, count)
    }

    /// The lanes that `lanes` names in its four lowest bits.
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(crate) fn permute(v: Ints, lanes: Ints) -> Ints {
        _mm512_permutexvar_epi32(lanes, v)
    }

    /// As [`permute`].
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(crate) fn permute_floats(v: Floats, lanes: Ints) -> Floats {
        _mm512_permutexvar_ps(lanes, v)
    }

    /// Each lane's number.
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(crate) fn lane_ids() -> Ints {
        _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
    }

    /// Sixteen bytes as numbers.
    ///
    /// # Safety
    /// They must be readable.
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(crate) unsafe fn load_bytes(bytes: *const u8) -> Floats {
        // SAFETY: as promised.
        let bytes = unsafe { _mm_loadu_si128(bytes.cast()) };
        _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes))
    }
}
