//! The sweep of one axis of a large node, straight from the references.

use super::{BestOfLanes, Costs, half_areas, lanes};
use crate::kernel::Split;
use crate::rule::SplitRule;
use niwaki_core::{Aabb, PrimRef, glam::Vec3};
use std::arch::x86_64::*;

/// A box as it grows.
#[derive(Clone, Copy)]
struct Running {
    min: __m128,
    max: __m128,
}

impl Running {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new() -> Self {
        Self { min: _mm_set1_ps(f32::INFINITY), max: _mm_set1_ps(f32::NEG_INFINITY) }
    }

    /// Grows by a primitive and returns the extent; lane 3 has no meaning.
    ///
    /// # Safety
    /// `prims` points to more than `index` references.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn grow(&mut self, prims: *const PrimRef, index: u32) -> __m128 {
        // SAFETY: in bounds by the caller; a reference is two aligned halves of four floats.
        unsafe {
            let p = prims.add(index as usize).cast::<f32>();
            self.min = _mm_min_ps(self.min, _mm_load_ps(p));
            self.max = _mm_max_ps(self.max, _mm_load_ps(p.add(4)));
        }
        _mm_sub_ps(self.max, self.min)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn aabb(self) -> Aabb {
        let (mut min, mut max) = ([0.0; 4], [0.0; 4]);
        // SAFETY: both arrays hold four floats.
        unsafe {
            _mm_storeu_ps(min.as_mut_ptr(), self.min);
            _mm_storeu_ps(max.as_mut_ptr(), self.max);
        }
        Aabb::new(Vec3::new(min[0], min[1], min[2]), Vec3::new(max[0], max[1], max[2]))
    }
}

/// Eight extents as [`half_areas`] takes them.
#[inline]
#[target_feature(enable = "avx2")]
fn pairs(e: &[__m128; 8]) -> [__m256; 4] {
    [0, 1, 2, 3].map(|k| _mm256_set_m128(e[k + 4], e[k]))
}

/// Sweeps one axis of a large node, without touching anything outside it.
///
/// # Safety
/// The machine has AVX2, and `order` holds valid indices into `prims`, at least one and below
/// 2^31 of them; `right` is as long.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn sweep_axis(
    prims: &[PrimRef],
    order: &[u32],
    axis: usize,
    rule: &SplitRule,
    right: &mut [f32],
) -> (Aabb, Split) {
    let count = order.len();
    assert!(right.len() == count);
    let refs = prims.as_ptr();
    let scale = _mm256_set1_ps(rule.scale.get());
    let mut running = Running::new();
    let mut extents = [_mm_set1_ps(0.0); 8];
    for (order, right) in order.chunks(8).zip(right.chunks_mut(8)).rev() {
        for (extent, &i) in extents.iter_mut().zip(order).rev() {
            // SAFETY: the index is valid.
            *extent = unsafe { running.grow(refs, i) };
        }
        let mut areas = [0.0; 8];
        // SAFETY: eight floats.
        unsafe { _mm256_storeu_ps(areas.as_mut_ptr(), half_areas(pairs(&extents), scale)) };
        right.copy_from_slice(&areas[..right.len()]);
    }
    let costs = Costs::new(rule, count);
    let mut best = BestOfLanes::new();
    let mut position = _mm256_add_epi32(lanes(), _mm256_set1_epi32(1));
    running = Running::new();
    let mut first = 0;
    while first + 8 < count {
        for (extent, &i) in extents.iter_mut().zip(&order[first..first + 8]) {
            // SAFETY: the index is valid.
            *extent = unsafe { running.grow(refs, i) };
        }
        // SAFETY: the last area read is that of position `first + 8`, which exists.
        let area_right = unsafe { _mm256_loadu_ps(right[first + 1..first + 9].as_ptr()) };
        costs.improve(&mut best, position, half_areas(pairs(&extents), scale), area_right);
        position = _mm256_add_epi32(position, _mm256_set1_epi32(8));
        first += 8;
    }
    // One to eight primitives are left, all but the last of which end a left side.
    let mut last = [0.0; 9];
    last[..count - first].copy_from_slice(&right[first..]);
    for (extent, &i) in extents.iter_mut().zip(&order[first..]) {
        // SAFETY: the indices are valid.
        *extent = unsafe { running.grow(refs, i) };
    }
    // SAFETY: eight floats from the second of nine on.
    let area_right = unsafe { _mm256_loadu_ps(last[1..].as_ptr()) };
    costs.improve(&mut best, position, half_areas(pairs(&extents), scale), area_right);
    let (cost, left) = best.reduce();
    let split =
        if cost < f32::INFINITY { Split { cost, axis, left: left as usize } } else { Split::NONE };
    (running.aabb(), split)
}
