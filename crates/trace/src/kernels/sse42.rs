//! The kernel for 4-wide trees on processors without AVX2 and FMA: 128-bit vectors and SSE4.2.
//!
//! Fused multiply-adds are emulated where hits depend on them, so that they have the bits of all
//! other kernels, and left out in the test of boxes.

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
    vectors_sse::*,
};
use crate::{
    query::visitor::{Closest, First, Found, Visitor},
    scale::SceneScale,
    setup::{RaySetup, Slabs},
    wide::{Layout, WORDS},
};
use niwaki_core::{Hit, Ray, glam::Vec3A};
use std::arch::x86_64::*;

define_kernels!("sse4.2,popcnt", 4, Node4, QuantisedNode4);

/// Lanes with `a ≤ b`.
#[target_feature(enable = "sse4.2,popcnt")]
#[inline]
fn hit_mask(a: __m128, b: __m128) -> u32 {
    _mm_movemask_ps(_mm_cmple_ps(a, b)).cast_unsigned()
}

/// The keys of the lanes in `mask`, sorted upwards: the others become the largest there is.
#[target_feature(enable = "sse4.2,popcnt")]
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
#[target_feature(enable = "sse4.2,popcnt")]
#[inline]
fn compacted(children: __m128i, mask: u32) -> __m128i {
    /// For each mask the bytes of the lanes that are set.
    const ORDER: [[u8; 16]; 16] = {
        let mut order = [[0; 16]; 16];
        let mut mask = 0;
        while mask < 16 {
            let (mut to, mut lane) = (0, 0);
            while lane < 4 {
                if mask >> lane & 1 != 0 {
                    let mut byte = 0;
                    while byte < 4 {
                        order[mask][4 * to + byte as usize] = 4 * lane + byte;
                        byte += 1;
                    }
                    to += 1;
                }
                lane += 1;
            }
            mask += 1;
        }
        order
    };
    // SAFETY: sixteen bytes.
    let order = unsafe { _mm_loadu_si128(ORDER[mask as usize % 16].as_ptr().cast()) };
    _mm_shuffle_epi8(children, order)
}
