//! Splits by planes: references are chopped into the bins that they overlap (Stich et al. 2009,
//! section 3.2).

use crate::boxes::Box4;
use crate::weight::Weights;
use niwaki_core::bins::CHUNK;
use niwaki_core::glam::Vec4;
use niwaki_core::{Aabb, AreaScale, Clip, PrimRef};
use rayon::prelude::*;

/// Equidistant planes through a node's box, `bins − 1` across each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planes {
    low: Vec4,
    width: Vec4,
    /// 1 / width; 0 where the axis has no planes because its extent vanishes or overflows.
    inverse: Vec4,
    bins: usize,
}

impl Planes {
    pub(crate) fn new(bounds: &Aabb, bins: usize) -> Self {
        let low = bounds.min.extend(0.0);
        let width = bounds.extent().extend(0.0).to_array().map(|extent| extent / bins as f32);
        let inverse = width.map(|width| {
            let inverse = width.recip();
            if inverse.is_normal() && width.is_normal() { inverse } else { 0.0 }
        });
        Self { low, width: Vec4::from_array(width), inverse: Vec4::from_array(inverse), bins }
    }

    fn has(&self, axis: usize) -> bool {
        self.inverse[axis] != 0.0
    }

    /// Where the plane below a bin lies.
    #[inline]
    pub(crate) fn position(&self, axis: usize, bin: usize) -> f32 {
        self.low[axis] + self.width[axis] * bin as f32
    }

    /// The first and the last bin that a reference overlaps by more than touching, by axis.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturating, and then clamped"
    )]
    fn ranges(&self, p: &Box4) -> [[usize; 2]; 3] {
        let low = ((p.min - self.low) * self.inverse).to_array();
        let high = ((p.max - self.low) * self.inverse).to_array();
        std::array::from_fn(|axis| {
            let last = self.bins - 1;
            let (mut low, mut high) =
                ((low[axis] as usize).min(last), (high[axis] as usize).min(last));
            if low < high {
                high -= usize::from(p.max[axis] <= self.position(axis, high));
            }
            if low < high {
                low += usize::from(p.min[axis] >= self.position(axis, low + 1));
            }
            [low, high]
        })
    }

    /// As [`Planes::ranges`], of one axis.
    #[inline]
    pub(crate) fn range(&self, axis: usize, p: &PrimRef) -> [usize; 2] {
        self.ranges(&Box4::without_ids(p))[axis]
    }
}

/// One bin of one axis.
#[derive(Clone, Copy, Debug)]
struct Bin {
    bounds: Box4,
    /// References whose first, and whose last bin it is.
    entries: u32,
    exits: u32,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Box4::EMPTY, entries: 0, exits: 0 };
}

/// The best plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Split {
    pub(crate) axis: usize,
    /// The first bin above the plane.
    pub(crate) bin: usize,
    /// As of object splits.
    pub(crate) cost: f32,
    /// Boxes of both sides and numbers of references that reach into them, by the bins.
    pub(crate) boxes: [Aabb; 2],
    pub(crate) counts: [usize; 2],
}

/// Bins along each axis.
#[derive(Clone)]
pub(crate) struct Bins {
    bins: [Vec<Bin>; 3],
    right: Vec<(f32, u32)>,
    positions: [Vec<f32>; 3],
}

impl Bins {
    pub(crate) const fn new() -> Self {
        Self {
            bins: [const { Vec::new() }; 3],
            right: Vec::new(),
            positions: [const { Vec::new() }; 3],
        }
    }

    /// Bytes of `bins` bins per axis.
    pub(crate) const fn bytes(bins: usize) -> usize {
        bins * (3 * size_of::<Bin>() + size_of::<(f32, u32)>() + 12)
    }

    fn clear(&mut self, bins: usize) {
        for axis in &mut self.bins {
            axis.clear();
            axis.resize(bins, Bin::EMPTY);
        }
    }

    /// Empties the bins and adds the references of a node.
    pub(crate) fn fill<C: Clip>(&mut self, refs: &[PrimRef], planes: &Planes, clip: &C) {
        self.clear(planes.bins);
        for (axis, positions) in self.positions.iter_mut().enumerate() {
            positions.clear();
            positions.extend((0..planes.bins).map(|bin| planes.position(axis, bin)));
        }
        for p in refs {
            let bounds = Box4::without_ids(p);
            for (axis, [first, last]) in planes.ranges(&bounds).into_iter().enumerate() {
                let bins = &mut self.bins[axis];
                bins[first].entries += 1;
                bins[last].exits += 1;
                if first == last {
                    let bin = &mut bins[first];
                    bin.bounds = bin.bounds.union(bounds);
                } else {
                    let bins = &mut bins[first..=last];
                    let positions = &self.positions[axis][first + 1..=last];
                    clip.chop(p, axis, positions, |i, [min, max]| {
                        bins[i].bounds = bins[i].bounds.union(Box4 { min, max });
                    });
                }
            }
        }
    }

    /// As [`Bins::fill`], with all threads.
    pub(crate) fn fill_parallel<C: Clip>(&mut self, refs: &[PrimRef], planes: &Planes, clip: &C) {
        let filled = refs
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut bins = Self::new();
                bins.fill(chunk, planes, clip);
                bins
            })
            .reduce_with(|mut a, b| {
                for (a, b) in a.bins.iter_mut().flatten().zip(b.bins.iter().flatten()) {
                    a.bounds = a.bounds.union(b.bounds);
                    a.entries += b.entries;
                    a.exits += b.exits;
                }
                a
            });
        if let Some(filled) = filled {
            *self = filled;
        }
    }

    /// The cheapest plane with references on both sides.
    pub(crate) fn best(
        &mut self,
        planes: &Planes,
        scale: AreaScale,
        weights: &Weights,
    ) -> Option<Split> {
        let mut best: Option<Split> = None;
        for axis in (0..3).filter(|&axis| planes.has(axis)) {
            let bins = &self.bins[axis];
            let mut bounds = Box4::EMPTY;
            let mut count = 0;
            self.right.clear();
            self.right.extend(bins.iter().rev().map(|bin| {
                bounds = bounds.union(bin.bounds);
                count += bin.exits;
                (bounds.half_area(scale), count)
            }));
            bounds = Box4::EMPTY;
            count = 0;
            let mut found = None;
            for (i, bin) in (1..bins.len()).zip(bins) {
                bounds = bounds.union(bin.bounds);
                count += bin.entries;
                let (right_area, right) = self.right[bins.len() - 1 - i];
                if count == 0 || right == 0 {
                    continue;
                }
                let left_area = bounds.half_area(scale);
                let cost = left_area * weights.of(count) + right_area * weights.of(right);
                if cost < best.map_or(f32::INFINITY, |best| best.cost) {
                    let counts = [count as usize, right as usize];
                    let boxes = [bounds.aabb(), Aabb::EMPTY];
                    best = Some(Split { axis, bin: i, cost, boxes, counts });
                    found = Some(i);
                }
            }
            if let (Some(best), Some(bin)) = (&mut best, found) {
                let right = bins[bin..].iter().fold(Box4::EMPTY, |b, bin| b.union(bin.bounds));
                best.boxes[1] = right.aabb();
            }
        }
        best
    }
}
