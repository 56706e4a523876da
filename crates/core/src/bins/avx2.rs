//! The kernels of [`super::scalar`] for AVX2: a primitive reference is one register. The same
//! operations in the same order, hence the same bits.

use super::{Bins, Corners, MAX_BINS, Mapping, Parted, Split};
use crate::{AreaScale, PrimRef, SahConstants};
use glam::Vec3;
use std::arch::x86_64::*;

#[inline]
#[target_feature(enable = "avx2")]
fn load_prim(p: &PrimRef) -> __m256 {
    // SAFETY: a `PrimRef` is 32 bytes of plain numbers at an address divisible by 32.
    unsafe { _mm256_load_ps(std::ptr::from_ref(p).cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn store_prim(p: &mut PrimRef, v: __m256) {
    // SAFETY: as for `load_prim`; any bits are a valid `PrimRef`.
    unsafe { _mm256_store_ps(std::ptr::from_mut(p).cast(), v) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn load(c: &Corners) -> __m256 {
    // SAFETY: `Corners` is eight floats at an address divisible by 32.
    unsafe { _mm256_load_ps(c.0.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn store(c: &mut Corners, v: __m256) {
    // SAFETY: as for `load`.
    unsafe { _mm256_store_ps(c.0.as_mut_ptr(), v) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn load_counts(c: &[u32; 4]) -> __m128i {
    // SAFETY: 16 bytes are read, at any address.
    unsafe { _mm_loadu_si128(c.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn vec3(v: Vec3) -> __m128 {
    _mm_setr_ps(v.x, v.y, v.z, 0.0)
}

/// The coordinates alone. Ids, read as floats, are mostly denormal, and arithmetic on those takes
/// the processor's slow path: a hundred cycles and more for every primitive.
#[inline]
#[target_feature(enable = "avx2")]
fn without_ids(v: __m256) -> __m256 {
    _mm256_blend_ps::<0b1000_1000>(v, _mm256_setzero_ps())
}

/// Twice the centroid; 0 in the last lane.
#[inline]
#[target_feature(enable = "avx2")]
fn centroid2(coordinates: __m256) -> __m128 {
    _mm_add_ps(_mm256_castps256_ps128(coordinates), _mm256_extractf128_ps::<1>(coordinates))
}

/// The sign bits of lanes 0 to 3.
#[inline]
#[target_feature(enable = "avx2")]
fn low_signs() -> __m256 {
    _mm256_setr_ps(-0.0, -0.0, -0.0, -0.0, 0.0, 0.0, 0.0, 0.0)
}

#[target_feature(enable = "avx2")]
pub(super) fn fill(bins: &mut Bins, prims: &[PrimRef], mapping: &Mapping) {
    let low = vec3(mapping.low);
    let scale = vec3(mapping.scale);
    let last = _mm_set1_ps((mapping.bins - 1) as f32);
    let signs = low_signs();
    for p in prims {
        let v = without_ids(load_prim(p));
        let position = _mm_mul_ps(_mm_sub_ps(centroid2(v), low), scale);
        // The second operand is the result for NaN.
        let position = _mm_min_ps(_mm_max_ps(position, _mm_setzero_ps()), last);
        let bin = _mm_cvttps_epi32(position);
        let corners = _mm256_xor_ps(v, signs);
        let indices =
            [_mm_extract_epi32::<0>(bin), _mm_extract_epi32::<1>(bin), _mm_extract_epi32::<2>(bin)];
        for (axis, index) in indices.into_iter().enumerate() {
            // The mask changes nothing; it shows that no bounds check is needed.
            let index = index.cast_unsigned() as usize & (MAX_BINS - 1);
            let bounds = &mut bins.bounds[index][axis];
            let grown = _mm256_max_ps(load(bounds), corners);
            store(bounds, grown);
            bins.counts[index][axis] += 1;
        }
    }
}

// No closures here: those that go through `array::map` could not be inlined, because that
// function is compiled without AVX2.

/// Scaled edge lengths in lanes 0 to 2.
#[inline]
#[target_feature(enable = "avx2")]
fn extent(v: __m256, scale: __m128) -> __m128 {
    let sum = _mm_add_ps(_mm256_extractf128_ps::<1>(v), _mm256_castps256_ps128(v));
    _mm_mul_ps(sum, scale)
}

/// Grows a box for each axis by a bin of that axis.
#[inline]
#[target_feature(enable = "avx2")]
fn grow(boxes: [__m256; 3], bin: &[Corners; 3]) -> [__m256; 3] {
    [
        _mm256_max_ps(boxes[0], load(&bin[0])),
        _mm256_max_ps(boxes[1], load(&bin[1])),
        _mm256_max_ps(boxes[2], load(&bin[2])),
    ]
}

/// Half areas of one box for each axis, in lanes 0 to 2; 0 where `count` is.
#[inline]
#[target_feature(enable = "avx2")]
fn half_areas(boxes: [__m256; 3], count: __m128i, scale: __m128) -> __m128 {
    let (a, b, c) = (extent(boxes[0], scale), extent(boxes[1], scale), extent(boxes[2], scale));
    // Transposed: the x of all three boxes, the y, the z.
    let ab = _mm_unpacklo_ps(a, b); // a.x b.x a.y b.y
    let cc = _mm_unpacklo_ps(c, c); // c.x c.x c.y c.y
    let x = _mm_movelh_ps(ab, cc);
    let y = _mm_movehl_ps(cc, ab);
    let z = _mm_movelh_ps(_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, c));
    let area = _mm_add_ps(_mm_mul_ps(x, _mm_add_ps(y, z)), _mm_mul_ps(y, z));
    let some = _mm_cmpgt_epi32(count, _mm_setzero_si128());
    _mm_and_ps(area, _mm_castsi128_ps(some))
}

#[target_feature(enable = "avx2")]
pub(super) fn best(
    bins: &Bins,
    number: usize,
    scale: AreaScale,
    sah: &SahConstants,
) -> Option<Split> {
    let number = number.min(MAX_BINS);
    let scale = _mm_set1_ps(scale.get());
    let triangle = _mm_set1_ps(sah.triangle);
    let leaf = _mm_set1_ps(sah.leaf);
    let empty = _mm256_set1_ps(f32::NEG_INFINITY);
    // For each bin the area from it on, and the number of primitives.
    let mut right = [(_mm_setzero_ps(), _mm_setzero_si128()); MAX_BINS];
    let mut boxes = [empty; 3];
    let mut count = _mm_setzero_si128();
    for i in (1..number).rev() {
        boxes = grow(boxes, &bins.bounds[i]);
        count = _mm_add_epi32(count, load_counts(&bins.counts[i]));
        right[i] = (half_areas(boxes, count, scale), count);
    }
    boxes = [empty; 3];
    count = _mm_setzero_si128();
    let mut least = _mm_set1_ps(f32::INFINITY);
    let mut least_bin = _mm_setzero_si128();
    let mut bin = _mm_setzero_si128();
    for (i, &(right_area, right_count)) in right.iter().enumerate().take(number).skip(1) {
        boxes = grow(boxes, &bins.bounds[i - 1]);
        count = _mm_add_epi32(count, load_counts(&bins.counts[i - 1]));
        bin = _mm_add_epi32(bin, _mm_set1_epi32(1));
        let left_area = half_areas(boxes, count, scale);
        let weighted = _mm_add_ps(
            _mm_mul_ps(left_area, _mm_cvtepi32_ps(count)),
            _mm_mul_ps(right_area, _mm_cvtepi32_ps(right_count)),
        );
        let cost = _mm_add_ps(
            _mm_mul_ps(triangle, weighted),
            _mm_mul_ps(leaf, _mm_add_ps(left_area, right_area)),
        );
        let zero = _mm_setzero_si128();
        let both = _mm_and_si128(_mm_cmpgt_epi32(count, zero), _mm_cmpgt_epi32(right_count, zero));
        let better = _mm_and_ps(_mm_cmplt_ps(cost, least), _mm_castsi128_ps(both));
        least = _mm_blendv_ps(least, cost, better);
        least_bin = _mm_blendv_epi8(least_bin, bin, _mm_castps_si128(better));
    }
    let mut costs = Corners::EMPTY;
    store(&mut costs, _mm256_castps128_ps256(least));
    let bins = [
        _mm_extract_epi32::<0>(least_bin),
        _mm_extract_epi32::<1>(least_bin),
        _mm_extract_epi32::<2>(least_bin),
    ];
    let mut best: Option<Split> = None;
    for (axis, bin) in bins.into_iter().enumerate() {
        let cost = costs.0[axis];
        if bin != 0 && best.is_none_or(|b| cost < b.cost) {
            best = Some(Split { axis, bin: bin.cast_unsigned() as usize, cost });
        }
    }
    best
}

#[target_feature(enable = "avx2")]
pub(super) fn partition(prims: &mut [PrimRef], mapping: &Mapping, split: &Split) -> Parted {
    let low = vec3(mapping.low);
    let scale = vec3(mapping.scale);
    let border = _mm_set1_ps(split.bin as f32);
    let signs = low_signs();
    let empty = _mm256_set1_ps(f32::NEG_INFINITY);
    let mut sides = [empty; 2];
    let mut left = 0;
    for i in 0..prims.len() {
        let v = load_prim(&prims[i]);
        let centroid = centroid2(without_ids(v));
        let position = _mm_mul_ps(_mm_sub_ps(centroid, low), scale);
        // Not (≥), so that NaN goes where bin 0 goes.
        let below = _mm_movemask_ps(_mm_cmpnge_ps(position, border)) >> split.axis & 1;
        let centroid = _mm256_xor_ps(_mm256_set_m128(centroid, centroid), signs);
        let mask = _mm256_castsi256_ps(_mm256_set1_epi32(-below));
        sides[0] = _mm256_max_ps(sides[0], _mm256_blendv_ps(empty, centroid, mask));
        sides[1] = _mm256_max_ps(sides[1], _mm256_blendv_ps(centroid, empty, mask));
        let other = load_prim(&prims[left]);
        store_prim(&mut prims[i], other);
        store_prim(&mut prims[left], v);
        left += usize::from(below != 0);
    }
    let mut centroids = [Corners::EMPTY; 2];
    for (to, side) in centroids.iter_mut().zip(sides) {
        store(to, side);
    }
    Parted { left, centroids }
}
