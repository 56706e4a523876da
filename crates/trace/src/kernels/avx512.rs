//! The kernel for AVX-512: 256-bit vectors, masks and compression.

use super::{
    batches::{AT_LEAVES, AT_NODES, DONE, Queues, RAYS, Waiting, define_batches},
    modes::define_kernels,
    quantised_boxes::define_quantised_boxes,
    scalar::used_boxes,
    simd::define_traversal,
    simd_boxes::define_full_boxes,
    simd_fast::define_fast_corners,
    simd_watertight::define_watertight_corners,
    sort::{sort4, sort8},
    stack::{Heap, UNINIT, room},
    vectors::vectors256::*,
};
use crate::{
    query::visitor::{Closest, First, Found, Visitor},
    scale::SceneScale,
    setup::{RaySetup, Slabs},
    wide::{Layout, WORDS},
};
use niwaki_core::{Hit, Ray, glam::Vec3A};
use std::arch::x86_64::*;

define_kernels!("avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt", 8, Node8, QuantisedNode8);

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
    // Nearly always half a register is enough, with half the layers of the network.
    _mm256_castsi128_si256(sort4(_mm256_castsi256_si128(keys)))
}

/// The keys of the lanes in `mask`, sorted upwards, without a branch: the others become the largest
/// integer.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn sorted_where(keys: __m256i, mask: u32) -> __m256i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of eight lanes")]
    let mask = mask as u8;
    sort8(_mm256_mask_mov_epi32(_mm256_set1_epi32(i32::MAX), mask, keys))
}

/// The children of the lanes in `mask`, at the front.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn compacted(children: __m256i, mask: u32) -> __m256i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of eight lanes")]
    _mm256_maskz_compress_epi32(mask as u8, children)
}
