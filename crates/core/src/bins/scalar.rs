//! The kernels for any processor: the reference of [`super::avx2`].

use super::{Bins, Corners, MAX_BINS, Mapping, Parted, Split};
use crate::{Aabb, AreaScale, PrimRef, SahConstants};

/// Adds primitives to the bins.
pub(super) fn fill(bins: &mut Bins, prims: &[PrimRef], mapping: &Mapping) {
    for p in prims {
        let corners = Corners::of(&p.aabb());
        for (axis, bin) in mapping.bins_of(p).into_iter().enumerate() {
            let bounds = &mut bins.bounds[bin][axis];
            *bounds = bounds.union(&corners);
            bins.counts[bin][axis] += 1;
        }
    }
}

/// The split of least cost, the first axis and then the first bin among equals. `None` if no
/// split between bins has primitives on both sides.
pub(super) fn best(
    bins: &Bins,
    number: usize,
    scale: AreaScale,
    sah: &SahConstants,
) -> Option<Split> {
    let mut best: Option<Split> = None;
    for axis in 0..3 {
        let area = |bounds: &Corners, count| if count > 0 { bounds.half_area(scale) } else { 0.0 };
        let mut right = [(0.0_f32, 0_u32); MAX_BINS];
        let mut bounds = Corners::EMPTY;
        let mut count = 0;
        for i in (1..number).rev() {
            bounds = bounds.union(&bins.bounds[i][axis]);
            count += bins.counts[i][axis];
            right[i] = (area(&bounds, count), count);
        }
        bounds = Corners::EMPTY;
        count = 0;
        for (i, &(right_area, right_count)) in right.iter().enumerate().take(number).skip(1) {
            bounds = bounds.union(&bins.bounds[i - 1][axis]);
            count += bins.counts[i - 1][axis];
            if count == 0 || right_count == 0 {
                continue;
            }
            let left_area = area(&bounds, count);
            let cost = sah.triangle * (left_area * count as f32 + right_area * right_count as f32)
                + sah.leaf * (left_area + right_area);
            if cost < best.map_or(f32::INFINITY, |b| b.cost) {
                best = Some(Split { axis, bin: i, cost });
            }
        }
    }
    best
}

/// Moves primitives below the split to the front.
pub(super) fn partition(prims: &mut [PrimRef], mapping: &Mapping, split: &Split) -> Parted {
    let mut left = 0;
    let mut centroids = [Corners::EMPTY; 2];
    for i in 0..prims.len() {
        let p = prims[i];
        let below = mapping.is_below(&p, split.axis, split.bin);
        let centroid = p.centroid2();
        let side = &mut centroids[usize::from(!below)];
        *side = side.union(&Corners::of(&Aabb::new(centroid, centroid)));
        // Without a branch that could be mispredicted: what lies from `left` to `i` is all above.
        prims[i] = prims[left];
        prims[left] = p;
        left += usize::from(below);
    }
    Parted { left, centroids }
}
