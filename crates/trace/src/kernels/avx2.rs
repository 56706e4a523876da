//! The kernel for AVX2 and FMA.

use super::{
    batches::{AT_LEAVES, AT_NODES, DONE, Queues, RAYS, Waiting, define_batches},
    modes::define_kernels,
    quantised_boxes::define_quantised_boxes,
    scalar::used_boxes,
    simd::define_traversal,
    simd_boxes::define_full_boxes,
    simd_fast::define_fast_corners,
    simd_watertight::define_watertight_corners,
    sort::sort8,
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

define_kernels!("avx2,fma,bmi1,bmi2,popcnt", 8, Node8, QuantisedNode8);

/// Lanes with `a ≤ b`.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
#[inline]
fn hit_mask(a: __m256, b: __m256) -> u32 {
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)).cast_unsigned()
}

/// The keys of the lanes in `mask`, sorted upwards: the others become the largest there is.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
#[inline]
fn sorted_keys(keys: __m256i, mask: u32) -> __m256i {
    let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    let set = _mm256_and_si256(_mm256_set1_epi32(mask.cast_signed()), bits);
    let selected = _mm256_cmpeq_epi32(set, bits);
    sort8(_mm256_blendv_epi8(_mm256_set1_epi32(i32::MAX), keys, selected))
}

/// For batches: without a branch, as [`sorted_keys`] is.
use sorted_keys as sorted_where;

/// The children of the lanes in `mask`, at the front.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
#[inline]
fn compacted(children: __m256i, mask: u32) -> __m256i {
    // One byte per lane: 0xff where set; then the set lanes' numbers gathered at the low end.
    let lanes = _pdep_u64(u64::from(mask), 0x0101_0101_0101_0101) * 0xff;
    let order = _pext_u64(0x0706_0504_0302_0100, lanes);
    let order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order.cast_signed()));
    _mm256_permutevar8x32_epi32(children, order)
}
