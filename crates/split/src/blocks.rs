//! References in an order in which neighbours in space are near each other, and the boxes of short
//! runs of them: a plane cuts few of those, and what is in the others need not be looked at.

use niwaki_core::glam::{BVec4A, Vec3, Vec4};
use niwaki_core::memory::prefer_large_pages;
use niwaki_core::midpoint::{Plane, Selection, Source};
use niwaki_core::{Aabb, PrimRef, to_u32};
use rayon::prelude::*;

/// References of a new block, at most.
pub(crate) const BLOCK: usize = 64;

/// Blocks that one task gathers.
const CHUNK: usize = 256;

/// The box of some references and that of their midpoints.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) aabb: Aabb,
    pub(crate) midpoints: Aabb,
}

impl Bounds {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, midpoints: Aabb::EMPTY };

    /// Around some references.
    pub(crate) fn of(prims: impl Iterator<Item = PrimRef>) -> Self {
        const XYZ: BVec4A = BVec4A::new(true, true, true, false);
        let (mut low, mut high) = ([Vec4::INFINITY; 2], [Vec4::NEG_INFINITY; 2]);
        for prim in prims {
            let [min, max]: [Vec4; 2] = bytemuck::cast(prim);
            // Ids look like denormals, which make arithmetic slow; comparisons do not mind.
            let [a, b] = [min, max].map(|corner| Vec4::select(XYZ, corner, Vec4::ZERO));
            let middle = a * 0.5 + b * 0.5;
            low = [low[0].min(min), low[1].min(middle)];
            high = [high[0].max(max), high[1].max(middle)];
        }
        let aabb = |i: usize| Aabb::new(low[i].truncate(), high[i].truncate());
        Self { aabb: aabb(0), midpoints: aabb(1) }
    }

    /// Where a plane is.
    #[inline]
    pub(crate) fn place(&self, plane: Plane) -> Place {
        let at = |corner: &Vec3| corner.as_ref()[plane.axis];
        let position = plane.position;
        if at(&self.midpoints.max) < position {
            if at(&self.aabb.max) <= position { Place::Apart(0) } else { Place::Near(0) }
        } else if at(&self.midpoints.min) >= position {
            if at(&self.aabb.min) >= position { Place::Apart(1) } else { Place::Near(1) }
        } else {
            Place::Astride
        }
    }
}

/// Where references are beside a plane; 0 is left of it, 1 right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// All of them are on one side.
    Apart(u8),
    /// All midpoints are on one side.
    Near(u8),
    /// Midpoints are on both sides.
    Astride,
}

/// Some references and their bounds.
#[derive(Debug)]
pub(crate) struct Block<'a> {
    pub(crate) bounds: Bounds,
    pub(crate) prims: &'a mut [PrimRef],
    /// Place of the first of them in the whole list.
    pub(crate) first: u32,
}

impl<'a> Block<'a> {
    /// Measures references, of which the first has place `first`.
    pub(crate) fn new(prims: &'a mut [PrimRef], first: u32) -> Self {
        Self { bounds: Bounds::of(prims.iter().copied()), prims, first }
    }

    /// Measures references that have changed.
    pub(crate) fn refresh(&mut self) {
        self.bounds = Bounds::of(self.prims.iter().copied());
    }

    /// The references up to a border and those after it.
    pub(crate) fn split_at(self, border: usize) -> [Self; 2] {
        let (left, right) = self.prims.split_at_mut(border);
        [Self::new(left, self.first), Self::new(right, self.first + to_u32(border))]
    }
}

/// The references of a source in the order of a selection, and the bounds of blocks of them: a block
/// does not reach from one group into the next.
pub(crate) fn gather<S: Source + ?Sized>(
    source: &S,
    selection: &Selection,
) -> (Vec<PrimRef>, Vec<(usize, Bounds)>) {
    let ids = &selection.ids[..];
    let count = selection.groups.iter().map(|group| group.len().div_ceil(BLOCK)).sum();
    let mut blocks: Vec<(usize, Bounds)> = Vec::with_capacity(count);
    for group in &selection.groups {
        let full = group.len() / BLOCK;
        blocks.extend((0..full).map(|_| (BLOCK, Bounds::EMPTY)));
        if group.len() > full * BLOCK {
            blocks.push((group.len() - full * BLOCK, Bounds::EMPTY));
        }
    }
    let mut prims: Vec<PrimRef> = Vec::with_capacity(ids.len());
    prefer_large_pages(prims.spare_capacity_mut());
    let mut places = &mut prims.spare_capacity_mut()[..ids.len()];
    let mut tasks = Vec::with_capacity(blocks.len().div_ceil(CHUNK));
    let mut ids_left = ids;
    for blocks in blocks.chunks_mut(CHUNK) {
        let len = blocks.iter().map(|(len, _)| len).sum();
        let (here, ids_here);
        (here, places) = places.split_at_mut(len);
        (ids_here, ids_left) = ids_left.split_at(len);
        tasks.push((blocks, here, ids_here));
    }
    tasks.into_par_iter().for_each(|(blocks, places, ids)| {
        let mut places = places.iter_mut().zip(ids);
        for (len, bounds) in blocks {
            let here = places.by_ref().take(*len);
            *bounds = Bounds::of(here.map(|(place, &id)| *place.write(source.prim(id))));
        }
    });
    assert_eq!(blocks.iter().map(|(len, _)| len).sum::<usize>(), ids.len());
    // SAFETY: blocks cover the list, as just checked, and every place of each was written.
    unsafe { prims.set_len(ids.len()) };
    (prims, blocks)
}

/// Blocks of these lengths.
pub(crate) fn attach<'a>(
    mut prims: &'a mut [PrimRef],
    bounds: Vec<(usize, Bounds)>,
) -> Vec<Block<'a>> {
    let mut first = 0;
    let mut blocks = Vec::with_capacity(bounds.len());
    for (len, bounds) in bounds {
        let here;
        (here, prims) = prims.split_at_mut(len);
        blocks.push(Block { bounds, prims: here, first: to_u32(first) });
        first += len;
    }
    blocks
}
