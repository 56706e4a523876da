//! The sweep of all axes of a small node.
//!
//! The running box is a dependent chain, four cycles a primitive. Three axes and two directions
//! make six such chains, which run side by side in one loop and fill the machine. A box whose
//! smallest corner is negated grows by a single `maxps` that also loads the primitive. Blocks may
//! reach past the ends of a node: what they read there is another node's and what they compute
//! from it is never used, and so a node of up to eight primitives runs through straight code
//! without a branch that could be mispredicted.

use super::{BestOfLanes, Costs, best_of_axes, half_areas, lanes};
use crate::kernel::Split;
use crate::rule::SplitRule;
use niwaki_core::bins::Corners;
use niwaki_core::{Aabb, glam::Vec3};
use std::arch::x86_64::*;

/// A box as it grows, with its smallest corner negated.
#[derive(Clone, Copy)]
struct Running(__m256);

impl Running {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new() -> Self {
        Self(_mm256_set1_ps(f32::NEG_INFINITY))
    }

    /// Grows by a primitive and returns both corners.
    ///
    /// # Safety
    /// `boxes` points to more than `index` boxes.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn grow(&mut self, boxes: *const Corners, index: u32) -> __m256 {
        // SAFETY: in bounds by the caller; a box is eight aligned floats.
        let other = unsafe { _mm256_load_ps(boxes.add(index as usize).cast()) };
        self.0 = _mm256_max_ps(self.0, other);
        self.0
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn aabb(self) -> Aabb {
        let mut c = [0.0; 8];
        // SAFETY: eight floats.
        unsafe { _mm256_storeu_ps(c.as_mut_ptr(), self.0) };
        Aabb::new(-Vec3::new(c[0], c[1], c[2]), Vec3::new(c[4], c[5], c[6]))
    }
}

/// The extents of eight boxes as [`half_areas`] takes them; lanes 3 and 7 have no meaning.
#[inline]
#[target_feature(enable = "avx2")]
fn extents(c: &[__m256; 8]) -> [__m256; 4] {
    [0, 1, 2, 3].map(|k| {
        // Each register has one corner of either box.
        let outer = _mm256_blend_ps::<0xf0>(c[k], c[k + 4]);
        let inner = _mm256_permute2f128_ps::<0x21>(c[k], c[k + 4]);
        _mm256_add_ps(outer, inner)
    })
}

/// [`sweep`] for nodes of up to eight primitives: one block, and areas stay in registers.
///
/// # Safety
/// As for [`sweep`], with `count ≤ 8`.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn sweep_eight(
    boxes: &[Corners],
    order: [*const u32; 3],
    count: usize,
    rule: &SplitRule,
) -> (Aabb, Split) {
    let boxes = boxes.as_ptr();
    let scale = _mm256_set1_ps(rule.scale.get());
    let costs = Costs::new(rule, count);
    let mut best = [BestOfLanes::new(); 3];
    let mut bounds = Aabb::EMPTY;
    let count = count.cast_signed();
    let left = _mm256_add_epi32(lanes(), _mm256_set1_epi32(1));
    #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
    let count32 = count as i32;
    // Lane `l` of the areas from the right is that of position `count − 8 + l`; the split with
    // `l + 1` on the left needs that of position `l + 1`.
    let shift = _mm256_add_epi32(lanes(), _mm256_set1_epi32(9 - count32));
    let clamp = _mm256_min_epu32(lanes(), _mm256_set1_epi32(count32 - 1));
    for axis in 0..3 {
        let mut from_left = Running::new();
        let mut from_right = Running::new();
        let mut on_left = [_mm256_set1_ps(0.0); 8];
        let mut on_right = [_mm256_set1_ps(0.0); 8];
        let mut indices = [0_u32; 8];
        // SAFETY: as in `sweep`.
        unsafe {
            let here = _mm256_loadu_si256(order[axis].cast());
            let here = _mm256_permutevar8x32_epi32(here, clamp);
            _mm256_storeu_si256(indices.as_mut_ptr().cast(), here);
            let from = order[axis].offset(count - 8);
            for k in 0..8 {
                on_left[k] = from_left.grow(boxes, indices[k]);
                on_right[7 - k] = from_right.grow(boxes, *from.add(7 - k));
            }
        }
        let area_right = half_areas(extents(&on_right), scale);
        let area_right = _mm256_permutevar8x32_ps(area_right, shift);
        costs.improve(&mut best[axis], left, half_areas(extents(&on_left), scale), area_right);
        if axis == 0 {
            bounds = from_left.aabb();
        }
    }
    (bounds, best_of_axes(&best))
}

/// [`sweep`] for nodes of up to four primitives: areas from both sides share a register.
///
/// # Safety
/// As for [`sweep`], with `count ≤ 4`.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn sweep_four(
    boxes: &[Corners],
    order: [*const u32; 3],
    count: usize,
    rule: &SplitRule,
) -> (Aabb, Split) {
    let boxes = boxes.as_ptr();
    let scale = _mm256_set1_ps(rule.scale.get());
    let costs = Costs::new(rule, count);
    let mut best = [BestOfLanes::new(); 3];
    let mut bounds = Aabb::EMPTY;
    let left = _mm256_add_epi32(lanes(), _mm256_set1_epi32(1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 4")]
    let count32 = count as i32;
    // As in `sweep_eight`, with positions from `count − 4` on in lanes 4 to 7. Lanes from
    // `count − 1` on are not used.
    let shift = _mm256_add_epi32(lanes(), _mm256_set1_epi32(9 - count32));
    let last = count - 1;
    for axis in 0..3 {
        let mut from_left = Running::new();
        let mut from_right = Running::new();
        let mut grown = [_mm256_set1_ps(0.0); 8];
        // SAFETY: as in `sweep`.
        unsafe {
            let from = order[axis].offset(count.cast_signed() - 4);
            for k in 0..4 {
                grown[k] = from_left.grow(boxes, *order[axis].add(k.min(last)));
                grown[7 - k] = from_right.grow(boxes, *from.add(3 - k));
            }
        }
        let areas = half_areas(extents(&grown), scale);
        let area_right = _mm256_permutevar8x32_ps(areas, shift);
        costs.improve(&mut best[axis], left, areas, area_right);
        if axis == 0 {
            bounds = from_left.aabb();
        }
    }
    (bounds, best_of_axes(&best))
}

/// Sweeps a node along all axes. `order` points to the first primitive of the node in each order,
/// `left` and `right` to the places for the areas of its first position.
///
/// # Safety
/// The machine has AVX2. `1 ≤ count < 2^28`. Each of `order`, `left` and `right` may be accessed
/// from [`crate::kernel::PAD`] before to `count` + [`crate::kernel::PAD`] after the pointer, and everything in `order`
/// before the end of the node is a valid index into `boxes`.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn sweep(
    boxes: &[Corners],
    order: [*const u32; 3],
    count: usize,
    rule: &SplitRule,
    left: [*mut f32; 3],
    right: [*mut f32; 3],
) -> (Aabb, Split) {
    let boxes = boxes.as_ptr();
    let scale = _mm256_set1_ps(rule.scale.get());
    let mut from_left = [Running::new(); 3];
    let mut from_right = [Running::new(); 3];
    let blocks = count.div_ceil(8);
    for block in 0..blocks {
        let first = 8 * block;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_possible_wrap,
            reason = "counts are below 2^28"
        )]
        let clamp = _mm256_min_epu32(lanes(), _mm256_set1_epi32((count - 1 - first) as i32));
        for axis in 0..3 {
            let mut grown = [_mm256_set1_ps(0.0); 8];
            let mut indices = [0_u32; 8];
            // SAFETY: blocks reach at most 7 places past either end of the node, which the caller
            // allows, and the indices there are valid. The last primitive is repeated instead of
            // reading on, so that the running box ends as that of the node.
            unsafe {
                let here = _mm256_loadu_si256(order[axis].add(first).cast());
                let here = _mm256_permutevar8x32_epi32(here, clamp);
                _mm256_storeu_si256(indices.as_mut_ptr().cast(), here);
                for k in 0..8 {
                    grown[k] = from_left[axis].grow(boxes, indices[k]);
                }
                _mm256_storeu_ps(left[axis].add(first), half_areas(extents(&grown), scale));
                let end = count.cast_signed() - first.cast_signed() - 8;
                let from = order[axis].offset(end);
                for k in (0..8).rev() {
                    grown[k] = from_right[axis].grow(boxes, *from.add(k));
                }
                _mm256_storeu_ps(right[axis].offset(end), half_areas(extents(&grown), scale));
            }
        }
    }
    let costs = Costs::new(rule, count);
    let mut best = [BestOfLanes::new(); 3];
    let mut position = _mm256_add_epi32(lanes(), _mm256_set1_epi32(1));
    for block in 0..(count - 1).div_ceil(8) {
        for axis in 0..3 {
            // SAFETY: at most 8 places past the end of the node.
            unsafe {
                costs.improve(
                    &mut best[axis],
                    position,
                    _mm256_loadu_ps(left[axis].add(8 * block)),
                    _mm256_loadu_ps(right[axis].add(8 * block + 1)),
                );
            }
        }
        position = _mm256_add_epi32(position, _mm256_set1_epi32(8));
    }
    (from_left[0].aabb(), best_of_axes(&best))
}

/// The box of a node of one or two primitives: that of its first and last.
///
/// # Safety
/// The machine has AVX2 and both indices are valid.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn bounds_of_two(boxes: &[Corners], first: u32, last: u32) -> Aabb {
    let mut running = Running::new();
    // SAFETY: by the caller.
    unsafe {
        running.grow(boxes.as_ptr(), first);
        running.grow(boxes.as_ptr(), last);
    }
    running.aabb()
}
