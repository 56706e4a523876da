//! Bins of centroids and the best split between them.

use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, AreaScale, PrimRef, SahConstants};

/// The most bins per axis.
pub(crate) const MAX_BINS: usize = 64;

/// Which bin of each axis a centroid falls into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BinMapping {
    /// Twice the smallest centroid.
    low: Vec3,
    /// Bins per unit of twice the centroid; +∞ where the extent is so small that the quotient
    /// overflows, 0 where the extent is.
    scale: Vec3,
    last: f32,
    pub(crate) bins: usize,
}

impl BinMapping {
    pub(crate) fn new(centroid2_bounds: &Aabb, bins: usize) -> Self {
        let extent = centroid2_bounds.extent();
        let scale = Vec3::from_array(extent.to_array().map(|e| {
            // An axis without extent has one bin; so has one whose extent overflowed.
            if e > 0.0 { bins as f32 / e } else { 0.0 }
        }));
        Self { low: centroid2_bounds.min, scale, last: (bins - 1) as f32, bins }
    }

    /// The bins of a primitive. Never out of range, whatever overflows: 0·∞ and ∞ − ∞ are NaN
    /// and count as bin 0, too much as the last bin. Where the extent is positive and finite,
    /// the smallest centroid is in the first bin and the largest in the last or the one before
    /// (where rounding takes it there), hence, for two bins or more, some split between bins has
    /// primitives on both sides or there are two bins and one is empty.
    #[inline]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ..= last < 64")]
    pub(crate) fn bin(&self, p: &PrimRef) -> [usize; 3] {
        let f = (p.centroid2() - self.low) * self.scale;
        f.to_array().map(|f| {
            let f = if f > 0.0 { f } else { 0.0 };
            (if f < self.last { f } else { self.last }) as usize
        })
    }
}

/// Bounds and numbers of the primitives in each bin of each axis.
#[derive(Clone)]
pub(crate) struct Bins {
    bounds: [[Aabb; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
}

/// The best split: primitives in bins below `bin` of `axis` go left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Split {
    pub(crate) axis: usize,
    pub(crate) bin: usize,
    /// A(left)·N(left) + A(right)·N(right), in scaled half areas.
    pub(crate) cost: f32,
    /// A(left) + A(right), in scaled half areas.
    pub(crate) areas: f32,
}

impl Bins {
    pub(crate) fn new() -> Self {
        Self { bounds: [[Aabb::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] }
    }

    pub(crate) fn clear(&mut self, bins: usize) {
        for axis in 0..3 {
            self.bounds[axis][..bins].fill(Aabb::EMPTY);
            self.counts[axis][..bins].fill(0);
        }
    }

    pub(crate) fn fill(&mut self, prims: &[PrimRef], mapping: &BinMapping) {
        self.clear(mapping.bins);
        for p in prims {
            let bin = mapping.bin(p);
            for axis in 0..3 {
                let bounds = &mut self.bounds[axis][bin[axis]];
                *bounds = bounds.union(p.aabb());
                self.counts[axis][bin[axis]] += 1;
            }
        }
    }

    /// The split of least cost; the first axis and bin among equals. `None` if no split between
    /// bins has primitives on both sides.
    pub(crate) fn best(&self, bins: usize, scale: AreaScale, sah: &SahConstants) -> Option<Split> {
        let mut best: Option<(f32, Split)> = None;
        for axis in 0..3 {
            let mut right = [(0.0_f32, 0_u32); MAX_BINS];
            let mut bounds = Aabb::EMPTY;
            let mut count = 0;
            for i in (1..bins).rev() {
                bounds = bounds.union(self.bounds[axis][i]);
                count += self.counts[axis][i];
                right[i] = (if count > 0 { bounds.half_area(scale) } else { 0.0 }, count);
            }
            let mut bounds = Aabb::EMPTY;
            let mut count = 0;
            for i in 1..bins {
                bounds = bounds.union(self.bounds[axis][i - 1]);
                count += self.counts[axis][i - 1];
                if count == 0 || right[i].1 == 0 {
                    continue;
                }
                let left_area = bounds.half_area(scale);
                let cost = left_area * count as f32 + right[i].0 * right[i].1 as f32;
                let areas = left_area + right[i].0;
                let total = sah.triangle * cost + sah.leaf * areas;
                if best.is_none_or(|(least, _)| total < least) {
                    best = Some((total, Split { axis, bin: i, cost, areas }));
                }
            }
        }
        best.map(|(_, split)| split)
    }
}
