//! The kernel for AVX-512: 256-bit vectors, masks and compression.

use crate::{
    setup::{RaySetup, Slabs},
    simd::define_traversal,
    stack::{Heap, UNINIT, room},
    triangle::no_hit,
    wide::{WORDS, WideScene},
};
use niwaki_core::Hit;
use niwaki_wide::Node8;
use std::arch::x86_64::*;

define_traversal!("avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt");

/// Lanes with `a ≤ b`.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn hit_mask(a: __m256, b: __m256) -> u32 {
    u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b))
}

/// The keys of the lanes in `mask`, sorted upwards.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn sorted_keys(keys: __m256i, mask: u32) -> __m256i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of eight lanes")]
    let keys = _mm256_mask_compress_epi32(_mm256_set1_epi32(i32::MAX), mask as u8, keys);
    if mask.count_ones() > 4 {
        return sort8(keys);
    }
    // Nearly always the first three of the network's six layers are enough, in half a register.
    let (lo, hi) = (|a, b| _mm_min_epi32(a, b), |a, b| _mm_max_epi32(a, b));
    let v = _mm256_castsi256_si128(keys);
    let p = _mm_shuffle_epi32::<0b10_11_00_01>(v);
    let v = _mm_blend_epi32::<0b1010>(lo(v, p), hi(v, p));
    let p = _mm_shuffle_epi32::<0b00_01_10_11>(v);
    let v = _mm_blend_epi32::<0b1100>(lo(v, p), hi(v, p));
    let p = _mm_shuffle_epi32::<0b10_11_00_01>(v);
    _mm256_castsi128_si256(_mm_blend_epi32::<0b1010>(lo(v, p), hi(v, p)))
}

/// The children of the lanes in `mask`, at the front.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn compacted(children: __m256i, mask: u32) -> __m256i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of eight lanes")]
    _mm256_maskz_compress_epi32(mask as u8, children)
}
