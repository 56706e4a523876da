//! Midpoints of boxes, and their selection into groups: halved in space, 16 bytes a primitive
//! (thesis paper IV, sections 5.1 and 5.2).
//!
//! ```
//! use niwaki_core::midpoint::{Midpoints, select};
//! use niwaki_core::{Aabb, PrimRef, glam::Vec3};
//!
//! let prims: Vec<PrimRef> = (0..100_u32)
//!     .map(|i| PrimRef::new(Aabb::from_points([Vec3::X * i as f32]), i))
//!     .collect();
//! let selection = select(Midpoints::of(&prims[..]), 30);
//! assert_eq!(selection.groups, [0..25, 25..50, 50..75, 75..100]);
//! ```
//!
//! Groups do not depend on the number of threads nor on the instruction set.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod partition;
mod select;

pub use select::{Selection, select};

use crate::memory::prefer_large_pages;
use crate::{Aabb, PrimRef, TriangleMesh, to_u32};
use rayon::prelude::*;

/// Something with boxes: a mesh computes them when they are asked for, which costs less than to
/// write and read a list.
pub trait Source: Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// One of them, by its place.
    ///
    /// # Panics
    /// If `index` is not below [`Source::count`].
    fn prim(&self, index: u32) -> PrimRef;
}

impl Source for TriangleMesh {
    fn count(&self) -> usize {
        self.len()
    }

    #[inline]
    fn prim(&self, index: u32) -> PrimRef {
        PrimRef::new(self.triangle(index as usize).bounds(), index)
    }
}

impl Source for [PrimRef] {
    fn count(&self) -> usize {
        self.len()
    }

    #[inline]
    fn prim(&self, index: u32) -> PrimRef {
        self[index as usize]
    }
}

/// The middle of a primitive's box ([`Aabb::center`]), with the primitive's place in its
/// [`Source`].
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(16))]
pub struct Midpoint {
    /// Coordinates.
    pub center: [f32; 3],
    /// Which primitive.
    pub index: u32,
}

/// All midpoints of a source.
#[derive(Clone, Debug, PartialEq)]
pub struct Midpoints {
    /// In the order of the source.
    pub midpoints: Vec<Midpoint>,
    /// Around the midpoints.
    pub bounds: Aabb,
    /// Around the boxes.
    pub scene: Aabb,
}

impl Midpoints {
    /// Those of every box of a source, whose boxes must be finite; on the current rayon pool.
    #[must_use]
    pub fn of<S: Source + ?Sized>(source: &S) -> Self {
        const CHUNK: usize = 4096;
        let mut midpoints: Vec<Midpoint> = bytemuck::zeroed_vec(source.count());
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
        Self { midpoints, bounds, scene }
    }
}

/// A plane `p[axis] = position`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// 0, 1 or 2.
    pub axis: usize,
    /// Where it crosses the axis.
    pub position: f32,
}

impl Plane {
    /// The middle of the bounds of midpoints on their longest axis; `None` where they are a point,
    /// so that no plane separates them. At least one midpoint is on either side.
    #[must_use]
    pub fn middle(midpoints: &Aabb) -> Option<Self> {
        let axis = midpoints.longest_axis();
        let (min, max) = (midpoints.min[axis], midpoints.max[axis]);
        if min >= max {
            return None;
        }
        // Between neighbouring numbers the middle may round down to the smaller, and nothing would
        // be left of it.
        let middle = min * 0.5 + max * 0.5;
        Some(Self { axis, position: if middle > min { middle } else { max } })
    }

    /// The ends of a box along the axis: two loads, where indexing vectors would branch.
    #[must_use]
    #[inline]
    pub fn extent(&self, prim: &PrimRef) -> [f32; 2] {
        let corners: &[[f32; 4]; 2] = bytemuck::cast_ref(prim);
        let axis = self.axis & 3;
        [corners[0][axis], corners[1][axis]]
    }

    /// True if the middle of the box is left of the plane, that is, below its position.
    #[must_use]
    #[inline]
    pub fn is_left(&self, prim: &PrimRef) -> bool {
        let [min, max] = self.extent(prim);
        min * 0.5 + max * 0.5 < self.position
    }

    /// True if the plane cuts the inside of the box.
    #[must_use]
    #[inline]
    pub fn overlaps(&self, prim: &PrimRef) -> bool {
        let [min, max] = self.extent(prim);
        // No branch, as sides are hard to predict.
        (min < self.position) & (max > self.position)
    }
}
