//! Splits between references: at borders of bins or by a full sweep.

use crate::boxes::Box4;
use crate::partition::{BOTH, LEFT, RIGHT};
use crate::weight::Weights;
use crate::{ObjectSplit, Sbvh};
use niwaki_core::bins::{Bins, CHUNK, Corners, Kernel, MAX_BINS, Mapping};
use niwaki_core::float::sortable_bits;
use niwaki_core::{Aabb, AreaScale, PrimRef, radix, to_u32};
use rayon::prelude::*;

/// A split between references that [`Finder::find`] found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Split {
    /// A(left)·w(left) + A(right)·w(right), in scaled half areas, with [`Weights::of`].
    pub(crate) cost: f32,
    /// The boxes of both sides.
    pub(crate) boxes: [Aabb; 2],
    how: How,
}

#[derive(Clone, Copy, Debug)]
enum How {
    Bins(Mapping, niwaki_core::bins::Split),
    /// The first so many of the order that the finder holds go left.
    Sweep(usize),
}

/// Looks for splits; holds the memory for it.
pub(crate) struct Finder {
    kernel: Kernel,
    bins: Box<Bins>,
    /// Of the best axis: centroids in the high half, positions in the low.
    order: Vec<u64>,
    /// Of the axis at hand.
    keys: Vec<u64>,
    spare: Vec<u64>,
    /// Half areas of what lies from a position on.
    right: Vec<f32>,
}

/// Nodes larger than this are sorted by radix.
const RADIX_FROM: usize = 1 << 12;

impl Finder {
    pub(crate) fn new(kernel: Kernel) -> Self {
        let [order, keys, spare] = [const { Vec::new() }; 3];
        Self { kernel, bins: Bins::new(), order, keys, spare, right: Vec::new() }
    }

    /// Bytes that grow with the largest node of `count` references that is swept.
    pub(crate) const fn bytes(count: usize) -> usize {
        count * (3 * size_of::<u64>() + size_of::<f32>())
    }

    /// The cheapest split of a node; `None` if none has references on both sides.
    pub(crate) fn find(
        &mut self,
        refs: &[PrimRef],
        centroids: &Aabb,
        scale: AreaScale,
        config: &Sbvh,
        weights: &Weights,
        parallel: bool,
    ) -> Option<Split> {
        let count = refs.len();
        let bins = match config.object_split {
            ObjectSplit::Sweep { up_to } if count <= up_to => {
                return self.sweep(refs, scale, weights);
            }
            ObjectSplit::Sweep { .. } => MAX_BINS,
            // Few references would leave most bins empty.
            ObjectSplit::Bins(bins) => bins.min(4 + count / 2),
        };
        let mapping = Mapping::new(centroids, bins);
        if parallel {
            *self.bins = *self.kernel.fill_parallel(refs, &mapping);
        } else {
            self.bins.clear(bins);
            self.kernel.fill(&mut self.bins, refs, &mapping);
        }
        let split = if config.count_exponent == 1.0 {
            self.kernel.best(&self.bins, bins, scale, &config.sah)
        } else {
            best_border(&self.bins, bins, scale, weights)
        }?;
        let boxes = self.bins.sides(&split, bins);
        Some(Split { cost: split.cost, boxes, how: How::Bins(mapping, split) })
    }

    fn sweep(&mut self, refs: &[PrimRef], scale: AreaScale, weights: &Weights) -> Option<Split> {
        let count = refs.len();
        let grow = |vector: &mut Vec<u64>| {
            vector.clear();
            vector.reserve_exact(count);
        };
        grow(&mut self.order);
        self.right.clear();
        self.right.reserve_exact(count);
        self.right.resize(count, 0.0);
        let mut best: Option<(f32, usize)> = None;
        for axis in 0..3 {
            grow(&mut self.keys);
            self.keys.extend(
                refs.iter()
                    .zip(0_u64..)
                    .map(|(p, i)| u64::from(sortable_bits(p.min[axis] + p.max[axis])) << 32 | i),
            );
            if count > RADIX_FROM {
                grow(&mut self.spare);
                self.spare.resize(count, 0);
                // SAFETY: the key is computed from the item alone.
                unsafe { radix::sort_by_key(&mut self.keys, &mut self.spare, 32, |key| key >> 32) };
            } else {
                self.keys.sort_unstable();
            }
            let mut bounds = Box4::EMPTY;
            for (&key, right) in self.keys.iter().zip(&mut self.right).rev() {
                bounds = bounds.union(Box4::of(&refs[index(key)]));
                *right = bounds.half_area(scale);
            }
            bounds = Box4::EMPTY;
            let mut found = None;
            let number = to_u32(count);
            for ((i, &right), &key) in (1..number).zip(&self.right[1..]).zip(&self.keys) {
                bounds = bounds.union(Box4::of(&refs[index(key)]));
                let left = bounds.half_area(scale);
                let cost = left * weights.of(i) + right * weights.of(number - i);
                if cost < best.map_or(f32::INFINITY, |(cost, _)| cost) {
                    best = Some((cost, i as usize));
                    found = Some(i);
                }
            }
            if found.is_some() {
                std::mem::swap(&mut self.order, &mut self.keys);
            }
        }
        let (cost, left) = best?;
        let around = |keys: &[u64]| {
            let boxes = keys.iter().map(|&key| Box4::of(&refs[index(key)]));
            boxes.fold(Box4::EMPTY, Box4::union).aabb()
        };
        let boxes = [around(&self.order[..left]), around(&self.order[left..])];
        Some(Split { cost, boxes, how: How::Sweep(left) })
    }

    /// Writes to which side each reference goes. `split` must be the one that was found last.
    pub(crate) fn sides(&self, split: &Split, refs: &[PrimRef], sides: &mut [u8], parallel: bool) {
        match &split.how {
            How::Bins(mapping, split) => {
                let side = |p: &PrimRef| {
                    if mapping.is_below(p, split.axis, split.bin) { LEFT } else { RIGHT }
                };
                let write = |refs: &[PrimRef], sides: &mut [u8]| {
                    for (to, p) in sides.iter_mut().zip(refs) {
                        *to = side(p);
                    }
                };
                if parallel {
                    sides
                        .par_chunks_mut(CHUNK)
                        .zip(refs.par_chunks(CHUNK))
                        .for_each(|(sides, refs)| write(refs, sides));
                } else {
                    write(refs, sides);
                }
            }
            How::Sweep(left) => {
                sides.fill(RIGHT);
                for &key in &self.order[..*left] {
                    sides[index(key)] = LEFT;
                }
            }
        }
        debug_assert!(!sides.contains(&BOTH));
    }
}

/// As [`Kernel::best`] with other weights.
fn best_border(
    bins: &Bins,
    number: usize,
    scale: AreaScale,
    weights: &Weights,
) -> Option<niwaki_core::bins::Split> {
    let mut best: Option<niwaki_core::bins::Split> = None;
    for axis in 0..3 {
        let mut right = [0.0_f32; MAX_BINS];
        let mut bounds = Corners::EMPTY;
        let mut count = 0;
        for i in (1..number).rev() {
            bounds = bounds.union(&bins.bounds[i][axis]);
            count += bins.counts[i][axis];
            if count > 0 {
                right[i] = bounds.half_area(scale) * weights.of(count);
            }
        }
        let total = count + bins.counts[0][axis];
        bounds = Corners::EMPTY;
        count = 0;
        for (i, &right) in right.iter().enumerate().take(number).skip(1) {
            bounds = bounds.union(&bins.bounds[i - 1][axis]);
            count += bins.counts[i - 1][axis];
            if count == 0 || count == total {
                continue;
            }
            let cost = bounds.half_area(scale) * weights.of(count) + right;
            if cost < best.map_or(f32::INFINITY, |b| b.cost) {
                best = Some(niwaki_core::bins::Split { axis, bin: i, cost });
            }
        }
    }
    best
}

/// The position in the low half of a key.
#[expect(clippy::cast_possible_truncation, reason = "the low half is the position")]
const fn index(key: u64) -> usize {
    key as u32 as usize
}

/// Halves by order of centroids along the longest axis of their bounds: where no split has
/// references on both sides, or none is wanted.
pub(crate) fn halve(refs: &[PrimRef], centroids: &Aabb, sides: &mut [u8]) {
    let axis = centroids.longest_axis();
    let mut order: Vec<u32> = (0..to_u32(refs.len())).collect();
    let middle = refs.len() / 2;
    order.select_nth_unstable_by_key(middle, |&i| {
        (sortable_bits(refs[i as usize].centroid2()[axis]), i)
    });
    sides.fill(RIGHT);
    for &i in &order[..middle] {
        sides[i as usize] = LEFT;
    }
}
