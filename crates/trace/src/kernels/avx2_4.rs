//! The kernel for 4-wide trees: 128-bit vectors with the instructions of AVX2 and FMA.

use super::{
    batches::{AT_LEAVES, AT_NODES, DONE, Queues, RAYS, Waiting, define_batches},
    modes::define_kernels,
    quantised_boxes::define_quantised_boxes,
    scalar::used_boxes,
    simd::define_traversal,
    simd_boxes::define_full_boxes,
    simd_fast::define_fast_corners,
    simd_watertight::define_watertight_corners,
    sort::sort4,
    stack::{Heap, UNINIT, room},
    vectors::vectors128::*,
};
use crate::{
    query::visitor::{Closest, First, Found, Visitor},
    scale::SceneScale,
    setup::{RaySetup, Slabs},
    wide::{Layout, WORDS},
};
use niwaki_core::{Hit, Ray, glam::Vec3A};
use std::arch::x86_64::*;

define_kernels!("avx2,fma,bmi1,bmi2,popcnt", 4, Node4, QuantisedNode4);

/// Lanes with `a ≤ b`.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
#[inline]
fn hit_mask(a: __m128, b: __m128) -> u32 {
    _mm_movemask_ps(_mm_cmple_ps(a, b)).cast_unsigned()
}

/// The keys of the lanes in `mask`, sorted upwards: the others become the largest there is.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
#[inline]
fn sorted_keys(keys: __m128i, mask: u32) -> __m128i {
    let bits = _mm_setr_epi32(1, 2, 4, 8);
    let set = _mm_and_si128(_mm_set1_epi32(mask.cast_signed()), bits);
    let selected = _mm_cmpeq_epi32(set, bits);
    sort4(_mm_blendv_epi8(_mm_set1_epi32(i32::MAX), keys, selected))
}

/// For batches: without a branch, as [`sorted_keys`] is.
use sorted_keys as sorted_where;

/// The children of the lanes in `mask`, at the front.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
#[inline]
fn compacted(children: __m128i, mask: u32) -> __m128i {
    // One byte per lane: 0xff where set; then the set lanes' numbers gathered at the low end.
    let lanes = _pdep_u32(mask, 0x0101_0101) * 0xff;
    let order = _pext_u32(0x0302_0100, lanes);
    permute(children, _mm_cvtepu8_epi32(_mm_cvtsi32_si128(order.cast_signed())))
}
