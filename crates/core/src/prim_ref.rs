//! Primitive references: what builders sort, split and put into leaves.

use crate::Aabb;
use glam::Vec3;

/// The bounds of one primitive, or of a part of it, with the ids that lead back to it.
///
/// 32 bytes and 32-byte aligned, so that one 256-bit register holds it: lanes 0–2 the smallest
/// coordinates, lane 3 [`PrimRef::prim_id`], lanes 4–6 the largest coordinates, lane 7
/// [`PrimRef::geom_id`] (the layout of thesis paper IV, section 6, with ids where it has zeros).
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub struct PrimRef {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Which primitive: an index into the mesh. Splitting gives several references one id.
    pub prim_id: u32,
    /// Largest coordinates.
    pub max: Vec3,
    /// Which mesh, for callers that build over several; 0 otherwise.
    pub geom_id: u32,
}

impl PrimRef {
    /// A reference to primitive `prim_id` of mesh 0.
    #[must_use]
    #[inline]
    pub const fn new(bounds: Aabb, prim_id: u32) -> Self {
        Self { min: bounds.min, prim_id, max: bounds.max, geom_id: 0 }
    }

    /// The box.
    #[must_use]
    #[inline]
    pub const fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// Twice the centre of the box, the sort key of top-down builders: cheaper than the centre
    /// and in the same order. Overflows to ±∞ only beyond 1.7e38.
    #[must_use]
    #[inline]
    pub fn centroid2(&self) -> Vec3 {
        self.min + self.max
    }
}

const _: () = assert!(size_of::<PrimRef>() == 32 && align_of::<PrimRef>() == 32);
