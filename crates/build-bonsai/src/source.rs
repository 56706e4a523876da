//! Where primitives come from, and their midpoints (thesis paper IV, section 5.1).

use niwaki_core::builder::MAX_PRIMS;
use niwaki_core::memory::prefer_large_pages;
use niwaki_core::{Aabb, AreaScale, BuildError, PrimRef, TriangleMesh, to_u32};
use rayon::prelude::*;

/// Something with boxes: a mesh computes them when they are asked for, which costs less than to
/// write and read a list.
pub(crate) trait Source: Sync {
    fn len(&self) -> usize;
    fn prim(&self, index: u32) -> PrimRef;
}

impl Source for TriangleMesh {
    fn len(&self) -> usize {
        self.len()
    }

    #[inline]
    fn prim(&self, index: u32) -> PrimRef {
        PrimRef::new(self.triangle(index as usize).bounds(), index)
    }
}

impl Source for [PrimRef] {
    fn len(&self) -> usize {
        self.len()
    }

    #[inline]
    fn prim(&self, index: u32) -> PrimRef {
        self[index as usize]
    }
}

/// The middle of a primitive's box, with the primitive's index.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(16))]
pub(crate) struct Midpoint {
    pub(crate) center: [f32; 3],
    pub(crate) index: u32,
}

pub(crate) const fn check_count(count: usize) -> Result<(), BuildError> {
    if count > MAX_PRIMS {
        return Err(BuildError::TooManyPrimitives { count, max: MAX_PRIMS });
    }
    Ok(())
}

/// All midpoints.
pub(crate) struct Midpoints {
    pub(crate) midpoints: Vec<Midpoint>,
    /// Around them.
    pub(crate) bounds: Aabb,
    /// The scale of areas of the scene.
    pub(crate) scale: AreaScale,
}

impl Midpoints {
    pub(crate) fn of<S: Source + ?Sized>(source: &S) -> Self {
        const CHUNK: usize = 4096;
        let mut midpoints: Vec<Midpoint> = bytemuck::zeroed_vec(source.len());
        prefer_large_pages(&midpoints);
        let empty = (Aabb::EMPTY, Aabb::EMPTY);
        let (scene, bounds) = midpoints
            .par_chunks_mut(CHUNK)
            .enumerate()
            .map(|(chunk, midpoints)| {
                let (mut scene, mut bounds) = empty;
                for (index, midpoint) in (to_u32(chunk * CHUNK)..).zip(midpoints) {
                    let aabb = source.prim(index).aabb();
                    let center = aabb.center();
                    scene = scene.union(aabb);
                    bounds = bounds.grow(center);
                    *midpoint = Midpoint { center: center.to_array(), index };
                }
                (scene, bounds)
            })
            .reduce(|| empty, |a, b| (a.0.union(b.0), a.1.union(b.1)));
        Self { midpoints, bounds, scale: AreaScale::of(&scene) }
    }
}
