//! The kernel for 16-wide trees: 512-bit vectors.

use super::{
    batches::{AT_LEAVES, AT_NODES, DONE, Queues, RAYS, Waiting, define_batches},
    modes::define_kernels,
    quantised_boxes::define_quantised_boxes,
    scalar::used_boxes,
    simd::define_traversal,
    simd_boxes::define_full_boxes,
    simd_fast::define_fast_corners,
    simd_watertight::define_watertight_corners,
    sort::{sort4, sort8, sort16},
    stack::{Heap, UNINIT, room},
    vectors::vectors512::*,
};
use crate::{
    query::visitor::{Closest, First, Found, Visitor},
    scale::SceneScale,
    setup::{RaySetup, Slabs},
    wide::{Layout, WORDS},
};
use niwaki_core::{Hit, Ray, glam::Vec3A};
use std::arch::x86_64::*;

define_kernels!("avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt", 16, Node16, QuantisedNode16);

/// Lanes with `a ≤ b`.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn hit_mask(a: __m512, b: __m512) -> u32 {
    u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b))
}

/// The keys of the lanes in `mask`, sorted upwards.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn sorted_keys(keys: __m512i, mask: u32) -> __m512i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of sixteen lanes")]
    let keys = _mm512_mask_compress_epi32(_mm512_set1_epi32(i32::MAX), mask as u16, keys);
    // Most nodes are met in a few children only.
    match mask.count_ones() {
        ..=4 => _mm512_castsi128_si512(sort4(_mm512_castsi512_si128(keys))),
        5..=8 => _mm512_castsi256_si512(sort8(_mm512_castsi512_si256(keys))),
        count => sort_by_rank(keys, count),
    }
}

/// Sorts the first `count` lanes upwards, which differ from each other; the others must be no
/// smaller.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
fn sort_by_rank(keys: __m512i, count: u32) -> __m512i {
    let mut sorted = [i32::MAX; 16];
    let mut rest = keys;
    for _ in 0..count {
        let key = _mm_cvtsi128_si32(_mm512_castsi512_si128(rest));
        rest = _mm512_alignr_epi32::<1>(rest, rest);
        let smaller = _mm512_cmplt_epi32_mask(keys, _mm512_set1_epi32(key));
        sorted[smaller.count_ones() as usize % 16] = key;
    }
    // SAFETY: sixteen words.
    unsafe { _mm512_loadu_si512(sorted.as_ptr().cast()) }
}

/// The keys of the lanes in `mask`, sorted upwards, without a branch: the others become the largest
/// integer.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn sorted_where(keys: __m512i, mask: u32) -> __m512i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of sixteen lanes")]
    let mask = mask as u16;
    sort16(_mm512_mask_mov_epi32(_mm512_set1_epi32(i32::MAX), mask, keys))
}

/// The children of the lanes in `mask`, at the front.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma,bmi1,bmi2,popcnt")]
#[inline]
fn compacted(children: __m512i, mask: u32) -> __m512i {
    #[expect(clippy::cast_possible_truncation, reason = "a mask of sixteen lanes")]
    _mm512_maskz_compress_epi32(mask as u16, children)
}
