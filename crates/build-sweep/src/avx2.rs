//! The sweep on 256-bit registers. Same operations in the same order as [`crate::scalar`].
//!
//! The running box is a dependent chain of `minps` and `maxps`, four cycles a primitive. Three
//! axes and two directions make six such chains, which run side by side in one loop and fill the
//! machine. Extents of eight positions are transposed, so that areas and costs are formed eight at
//! a time. Blocks may reach past the ends of a node: what they read there is another node's and
//! what they compute from it is never used, and so a node of up to eight primitives runs through
//! straight code without a branch that could be mispredicted.

use crate::kernel::Split;
use crate::rule::SplitRule;
use niwaki_core::{Aabb, PrimRef, glam::Vec3};
use std::arch::x86_64::{
    __m128, __m256, __m256i, _CMP_EQ_OQ, _CMP_LT_OQ, _mm_cvtsi128_si32, _mm_cvtss_f32, _mm_load_ps,
    _mm_loadl_epi64, _mm_max_ps, _mm_min_ps, _mm_set1_ps, _mm_storeu_ps, _mm_sub_ps,
    _mm256_add_epi32, _mm256_add_ps, _mm256_and_si256, _mm256_blendv_epi8, _mm256_blendv_ps,
    _mm256_castps_si256, _mm256_castps256_ps128, _mm256_castsi256_ps, _mm256_castsi256_si128,
    _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_cmpgt_epi32, _mm256_cvtepi32_ps,
    _mm256_cvtepu8_epi32, _mm256_loadu_ps, _mm256_loadu_si256, _mm256_maskstore_epi32,
    _mm256_min_epi32, _mm256_min_epu32, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps,
    _mm256_or_si256, _mm256_permute2f128_ps, _mm256_permute2x128_si256,
    _mm256_permutevar8x32_epi32, _mm256_permutevar8x32_ps, _mm256_set_m128, _mm256_set1_epi32,
    _mm256_set1_ps, _mm256_setr_epi32, _mm256_shuffle_epi32, _mm256_shuffle_ps, _mm256_slli_epi32,
    _mm256_storeu_ps, _mm256_storeu_si256, _mm256_sub_epi32, _mm256_unpackhi_ps,
    _mm256_unpacklo_ps,
};

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

/// Half areas of eight extents.
#[inline]
#[target_feature(enable = "avx2")]
fn half_areas(e: &[__m128; 8], scale: __m256) -> __m256 {
    let r0 = _mm256_set_m128(e[4], e[0]);
    let r1 = _mm256_set_m128(e[5], e[1]);
    let r2 = _mm256_set_m128(e[6], e[2]);
    let r3 = _mm256_set_m128(e[7], e[3]);
    let xy01 = _mm256_unpacklo_ps(r0, r1);
    let xy23 = _mm256_unpacklo_ps(r2, r3);
    let z01 = _mm256_unpackhi_ps(r0, r1);
    let z23 = _mm256_unpackhi_ps(r2, r3);
    let x = _mm256_mul_ps(_mm256_shuffle_ps::<0b01_00_01_00>(xy01, xy23), scale);
    let y = _mm256_mul_ps(_mm256_shuffle_ps::<0b11_10_11_10>(xy01, xy23), scale);
    let z = _mm256_mul_ps(_mm256_shuffle_ps::<0b01_00_01_00>(z01, z23), scale);
    _mm256_add_ps(_mm256_mul_ps(x, _mm256_add_ps(y, z)), _mm256_mul_ps(y, z))
}

#[inline]
#[target_feature(enable = "avx2")]
fn lanes() -> __m256i {
    _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)
}

/// The best of each lane: cost, and number of primitives on the left.
#[derive(Clone, Copy)]
struct BestOfLanes {
    cost: __m256,
    left: __m256i,
}

/// Costs of eight positions at a time.
struct Costs {
    leaf: __m256,
    triangle: __m256,
    count: __m256i,
}

impl Costs {
    #[inline]
    #[target_feature(enable = "avx2")]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "below 2^31")]
    fn new(rule: &SplitRule, count: usize) -> Self {
        Self {
            leaf: _mm256_set1_ps(rule.leaf),
            triangle: _mm256_set1_ps(rule.triangle),
            count: _mm256_set1_epi32(count as i32),
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn weight(&self, count: __m256i) -> __m256 {
        _mm256_add_ps(self.leaf, _mm256_mul_ps(self.triangle, _mm256_cvtepi32_ps(count)))
    }

    /// Improves `best` by the splits with `left` primitives on the left, where there are some on
    /// the right as well.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn improve(
        &self,
        best: &mut BestOfLanes,
        left: __m256i,
        area_left: __m256,
        area_right: __m256,
    ) {
        let right = _mm256_sub_epi32(self.count, left);
        let cost = _mm256_add_ps(
            _mm256_mul_ps(area_left, self.weight(left)),
            _mm256_mul_ps(area_right, self.weight(right)),
        );
        let valid = _mm256_castsi256_ps(_mm256_cmpgt_epi32(self.count, left));
        let cost = _mm256_blendv_ps(_mm256_set1_ps(f32::INFINITY), cost, valid);
        let better = _mm256_cmp_ps::<_CMP_LT_OQ>(cost, best.cost);
        best.cost = _mm256_blendv_ps(best.cost, cost, better);
        best.left = _mm256_blendv_epi8(best.left, left, _mm256_castps_si256(better));
    }
}

impl BestOfLanes {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new() -> Self {
        Self { cost: _mm256_set1_ps(f32::INFINITY), left: _mm256_set1_epi32(i32::MAX) }
    }

    /// The lowest cost, and the lowest code among the lanes that have it.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn reduce(self) -> (f32, u32) {
        let c = self.cost;
        let m = _mm256_min_ps(c, _mm256_permute2f128_ps::<1>(c, c));
        let m = _mm256_min_ps(m, _mm256_shuffle_ps::<0b01_00_11_10>(m, m));
        let m = _mm256_min_ps(m, _mm256_shuffle_ps::<0b10_11_00_01>(m, m));
        let lowest = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_EQ_OQ>(c, m));
        let l = _mm256_blendv_epi8(_mm256_set1_epi32(i32::MAX), self.left, lowest);
        let l = _mm256_min_epi32(l, _mm256_permute2x128_si256::<1>(l, l));
        let l = _mm256_min_epi32(l, _mm256_shuffle_epi32::<0b01_00_11_10>(l));
        let l = _mm256_min_epi32(l, _mm256_shuffle_epi32::<0b10_11_00_01>(l));
        let cost = _mm_cvtss_f32(_mm256_castps256_ps128(m));
        (cost, _mm_cvtsi128_si32(_mm256_castsi256_si128(l)).cast_unsigned())
    }
}

/// The best split of all axes: cost first, then axis, then position.
#[inline]
#[target_feature(enable = "avx2")]
fn best_of_axes(best: &[BestOfLanes; 3]) -> Split {
    const CODE_BITS: u32 = 28;
    // Lanes compare costs first and codes, axis before position, second.
    let mut all = best[0];
    for (axis, other) in [(1, best[1]), (2, best[2])] {
        let better = _mm256_cmp_ps::<_CMP_LT_OQ>(other.cost, all.cost);
        all.cost = _mm256_blendv_ps(all.cost, other.cost, better);
        let code = _mm256_add_epi32(other.left, _mm256_set1_epi32(axis << CODE_BITS));
        all.left = _mm256_blendv_epi8(all.left, code, _mm256_castps_si256(better));
    }
    let (cost, code) = all.reduce();
    if cost < f32::INFINITY {
        Split {
            cost,
            axis: (code >> CODE_BITS) as usize,
            left: (code & ((1 << CODE_BITS) - 1)) as usize,
        }
    } else {
        Split::NONE
    }
}

/// [`sweep`] for nodes of up to eight primitives: one block, and areas stay in registers.
///
/// # Safety
/// As for [`sweep`], with `count ≤ 8`.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn sweep_eight(
    prims: &[PrimRef],
    order: [*const u32; 3],
    count: usize,
    rule: &SplitRule,
) -> (Aabb, Split) {
    let prims = prims.as_ptr();
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
        let mut on_left = [_mm_set1_ps(0.0); 8];
        let mut on_right = [_mm_set1_ps(0.0); 8];
        let mut indices = [0_u32; 8];
        // SAFETY: as in `sweep`.
        unsafe {
            let here = _mm256_loadu_si256(order[axis].cast());
            let here = _mm256_permutevar8x32_epi32(here, clamp);
            _mm256_storeu_si256(indices.as_mut_ptr().cast(), here);
            let from = order[axis].offset(count - 8);
            for k in 0..8 {
                on_left[k] = from_left.grow(prims, indices[k]);
                on_right[7 - k] = from_right.grow(prims, *from.add(7 - k));
            }
        }
        let area_right = half_areas(&on_right, scale);
        let area_right = _mm256_permutevar8x32_ps(area_right, shift);
        costs.improve(&mut best[axis], left, half_areas(&on_left, scale), area_right);
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
    prims: &[PrimRef],
    order: [*const u32; 3],
    count: usize,
    rule: &SplitRule,
) -> (Aabb, Split) {
    let prims = prims.as_ptr();
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
        let mut extents = [_mm_set1_ps(0.0); 8];
        // SAFETY: as in `sweep`.
        unsafe {
            let from = order[axis].offset(count.cast_signed() - 4);
            for k in 0..4 {
                extents[k] = from_left.grow(prims, *order[axis].add(k.min(last)));
                extents[7 - k] = from_right.grow(prims, *from.add(3 - k));
            }
        }
        let areas = half_areas(&extents, scale);
        let area_right = _mm256_permutevar8x32_ps(areas, shift);
        costs.improve(&mut best[axis], left, areas, area_right);
        if axis == 0 {
            bounds = from_left.aabb();
        }
    }
    (bounds, best_of_axes(&best))
}

/// [`partition`] of the other two orders of a node of up to eight primitives, of which the first
/// `left` along the axis of the split go left.
///
/// # Safety
/// The machine has AVX2. `left < count ≤ 8`, each pointer may be accessed up to
/// [`crate::kernel::PAD`] entries on, and the first `count` entries of each name the same
/// primitives, none twice.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn partition_eight(
    split: *const u32,
    others: [*mut u32; 2],
    count: usize,
    left: usize,
) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 8")]
    let (count, left) = (count as i32, left as i32);
    let inside = _mm256_cmpgt_epi32(_mm256_set1_epi32(count), lanes());
    // SAFETY: eight entries.
    let on_left = unsafe {
        // No primitive has the highest index.
        let split = _mm256_loadu_si256(split.cast());
        let goes_left = _mm256_cmpgt_epi32(_mm256_set1_epi32(left), lanes());
        _mm256_blendv_epi8(_mm256_set1_epi32(-1), split, goes_left)
    };
    // SAFETY: eight entries.
    let [a, b] = others.map(|order| unsafe { _mm256_loadu_si256(order.cast()) });
    let (mut in_a, mut in_b) = (_mm256_set1_epi32(0), _mm256_set1_epi32(0));
    for k in 0..7 {
        let one = _mm256_permutevar8x32_epi32(on_left, _mm256_set1_epi32(k));
        in_a = _mm256_or_si256(in_a, _mm256_cmpeq_epi32(a, one));
        in_b = _mm256_or_si256(in_b, _mm256_cmpeq_epi32(b, one));
    }
    for (order, (block, is_left)) in others.into_iter().zip([(a, in_a), (b, in_b)]) {
        // Entries of the next node count as right and keep their place.
        let is_left = _mm256_castsi256_ps(_mm256_and_si256(is_left, inside));
        let mask = _mm256_movemask_ps(is_left).cast_unsigned() as usize;
        let arranged = _mm256_permutevar8x32_epi32(block, first_left(mask));
        // SAFETY: eight entries.
        unsafe { _mm256_storeu_si256(order.cast(), arranged) };
    }
}

/// Sweeps a node along all axes. `order` points to the first primitive of the node in each order,
/// `left` and `right` to the places for the areas of its first position.
///
/// # Safety
/// The machine has AVX2. `1 ≤ count < 2^28`. Each of `order`, `left` and `right` may be accessed
/// from [`crate::kernel::PAD`] before to `count` + [`crate::kernel::PAD`] after the pointer, and everything in `order`
/// before the end of the node is a valid index into `prims`.
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn sweep(
    prims: &[PrimRef],
    order: [*const u32; 3],
    count: usize,
    rule: &SplitRule,
    left: [*mut f32; 3],
    right: [*mut f32; 3],
) -> (Aabb, Split) {
    let prims = prims.as_ptr();
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
            let mut extents = [_mm_set1_ps(0.0); 8];
            let mut indices = [0_u32; 8];
            // SAFETY: blocks reach at most 7 places past either end of the node, which the caller
            // allows, and the indices there are valid. The last primitive is repeated instead of
            // reading on, so that the running box ends as that of the node.
            unsafe {
                let here = _mm256_loadu_si256(order[axis].add(first).cast());
                let here = _mm256_permutevar8x32_epi32(here, clamp);
                _mm256_storeu_si256(indices.as_mut_ptr().cast(), here);
                for k in 0..8 {
                    extents[k] = from_left[axis].grow(prims, indices[k]);
                }
                _mm256_storeu_ps(left[axis].add(first), half_areas(&extents, scale));
                let end = count.cast_signed() - first.cast_signed() - 8;
                let from = order[axis].offset(end);
                for k in (0..8).rev() {
                    extents[k] = from_right[axis].grow(prims, *from.add(k));
                }
                _mm256_storeu_ps(right[axis].offset(end), half_areas(&extents, scale));
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
        unsafe { _mm256_storeu_ps(areas.as_mut_ptr(), half_areas(&extents, scale)) };
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
        costs.improve(&mut best, position, half_areas(&extents, scale), area_right);
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
    costs.improve(&mut best, position, half_areas(&extents, scale), area_right);
    let (cost, left) = best.reduce();
    let split =
        if cost < f32::INFINITY { Split { cost, axis, left: left as usize } } else { Split::NONE };
    (running.aabb(), split)
}

/// The box of a node of one or two primitives: that of its first and last.
///
/// # Safety
/// The machine has AVX2 and both indices are valid.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn bounds_of_two(prims: &[PrimRef], first: u32, last: u32) -> Aabb {
    let mut running = Running::new();
    // SAFETY: by the caller.
    unsafe {
        running.grow(prims.as_ptr(), first);
        running.grow(prims.as_ptr(), last);
    }
    running.aabb()
}

/// For each set of lanes that go left: which lane comes to each place when those go first and the
/// others follow, both in order.
static FIRST_LEFT: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let mut place = 0;
        let mut pass = 0;
        while pass < 2 {
            let mut lane = 0;
            while lane < 8 {
                if (mask >> lane) & 1 != pass {
                    #[expect(clippy::cast_possible_truncation, reason = "below 8")]
                    {
                        table[mask][place] = lane as u8;
                    }
                    place += 1;
                }
                lane += 1;
            }
            pass += 1;
        }
        mask += 1;
    }
    table
};

#[inline]
#[target_feature(enable = "avx2")]
fn first_left(mask: usize) -> __m256i {
    // SAFETY: a row of the table is eight bytes.
    unsafe { _mm256_cvtepu8_epi32(_mm_loadl_epi64(FIRST_LEFT[mask & 255].as_ptr().cast())) }
}

/// Stable partition of one order: primitives with `side` 0 go to the front. The rest of `order`
/// keeps its place. Returns nothing: the caller knows the number on the left.
///
/// # Safety
/// The machine has AVX2. `order` may be accessed from 0 to `count` + [`crate::kernel::PAD`], its first `count`
/// entries are valid indices into `side`, which has three more bytes than indices reach, and
/// `scratch` has room for `count` + [`crate::kernel::PAD`].
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn partition(order: *mut u32, count: usize, side: *const u8, scratch: *mut u32) {
    let (mut left, mut right) = (0, 0);
    let mut first = 0;
    while first < count {
        // SAFETY: `left ≤ first`, so that a store of eight to the left never reaches past what was
        // loaded; `right ≤ first` too. The last block may hold entries of the next node: they
        // count as right.
        unsafe {
            let block = _mm256_loadu_si256(order.add(first).cast());
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_possible_wrap,
                reason = "counts are below 2^28"
            )]
            let inside = _mm256_cmpgt_epi32(_mm256_set1_epi32((count - first) as i32), lanes());
            let sides = std::arch::x86_64::_mm256_mask_i32gather_epi32::<1>(
                _mm256_set1_epi32(1),
                side.cast(),
                block,
                inside,
            );
            let goes_right = _mm256_castsi256_ps(_mm256_slli_epi32::<31>(sides));
            let mask = !_mm256_movemask_ps(goes_right).cast_unsigned() as usize & 255;
            let arranged = _mm256_permutevar8x32_epi32(block, first_left(mask));
            let here = mask.count_ones() as usize;
            let valid = (count - first).min(8);
            if valid == 8 {
                _mm256_storeu_si256(order.add(left).cast(), arranged);
            } else {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_possible_wrap,
                    reason = "at most 8"
                )]
                let keep = _mm256_cmpgt_epi32(_mm256_set1_epi32(here as i32), lanes());
                _mm256_maskstore_epi32(order.add(left).cast(), keep, arranged);
            }
            // The same with the others first: rotate by what went left.
            let others = _mm256_permutevar8x32_epi32(block, first_left(!mask & 255));
            _mm256_storeu_si256(scratch.add(right).cast(), others);
            left += here;
            right += valid - here;
        }
        first += 8;
    }
    // SAFETY: `left + right == count`, and the scratch holds `right` entries.
    unsafe { std::ptr::copy_nonoverlapping(scratch, order.add(left), right) };
}
