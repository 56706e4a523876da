//! What references are boxes of, as far as splitting them needs to know.

use crate::{Aabb, PrimRef, TriangleMesh};
use glam::Vec4;

/// Cuts references at axis planes. Builders and pre-splitters that split primitives are generic
/// over it: a mesh gives tight boxes, [`BoxClip`] works where there are only boxes.
pub trait Clip: Sync {
    /// The boxes of the parts of `prim` on the lower and on the upper side of the plane
    /// `p[axis] = position`. Each lies within the reference's box and covers what the primitive
    /// has of it on that side; a side with nothing in it is [`Aabb::EMPTY`].
    ///
    /// # Panics
    /// If `axis` is not 0, 1 or 2, or the reference is not one of these primitives.
    #[must_use]
    fn clip(&self, prim: &PrimRef, axis: usize, position: f32) -> [Aabb; 2];

    /// Calls `part` with the box of each part of `prim` between ascending planes
    /// `p[axis] = positions[i]`: number 0 is below the first plane, number 1 between the first two,
    /// and so on. Parts with nothing in them are left out. Fourth lanes have no meaning.
    ///
    /// Meant for the cost of splits, not for the boxes of nodes: implementations may be off by
    /// rounding. This one clips part after part.
    ///
    /// # Panics
    /// As [`Clip::clip`].
    fn chop(
        &self,
        prim: &PrimRef,
        axis: usize,
        positions: &[f32],
        mut part: impl FnMut(usize, [Vec4; 2]),
    ) where
        Self: Sized,
    {
        let mut rest = *prim;
        for (i, &position) in positions.iter().enumerate() {
            let [lower, upper] = self.clip(&rest, axis, position);
            if !lower.is_empty() {
                part(i, [lower.min.extend(0.0), lower.max.extend(0.0)]);
            }
            if upper.is_empty() {
                return;
            }
            (rest.min, rest.max) = (upper.min, upper.max);
        }
        part(positions.len(), [rest.min.extend(0.0), rest.max.extend(0.0)]);
    }
}

impl Clip for TriangleMesh {
    /// Split clipping of the triangle [`PrimRef::prim_id`]: [`crate::Triangle::split`].
    #[inline]
    fn clip(&self, prim: &PrimRef, axis: usize, position: f32) -> [Aabb; 2] {
        let (lower, upper) =
            self.triangle(prim.prim_id as usize).split(&prim.aabb(), axis, position);
        [lower, upper]
    }

    /// [`crate::Triangle::chop`].
    #[inline]
    fn chop(
        &self,
        prim: &PrimRef,
        axis: usize,
        positions: &[f32],
        part: impl FnMut(usize, [Vec4; 2]),
    ) {
        self.triangle(prim.prim_id as usize).chop(&prim.aabb(), axis, positions, part);
    }
}

/// Cuts boxes as if they were full: for primitives of which nothing but the box is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoxClip;

impl Clip for BoxClip {
    #[inline]
    fn clip(&self, prim: &PrimRef, axis: usize, position: f32) -> [Aabb; 2] {
        let whole = prim.aabb();
        if whole.max[axis] < position {
            return [whole, Aabb::EMPTY];
        }
        if whole.min[axis] > position {
            return [Aabb::EMPTY, whole];
        }
        let (mut lower, mut upper) = (whole, whole);
        lower.max[axis] = position;
        upper.min[axis] = position;
        [lower, upper]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_full_box_is_wider_than_the_triangle_in_it() {
        let corners = vec![Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 4.0, 0.0)];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).unwrap();
        let prim = mesh.prim_refs()[0];
        let [lower, upper] = mesh.clip(&prim, 0, 1.0);
        assert_eq!((lower.max.x, upper.min.x), (1.0, 1.0));
        assert!(upper.max.y >= 3.0 && upper.max.y < 3.001, "cut at y = 3");
        let [box_lower, box_upper] = BoxClip.clip(&prim, 0, 1.0);
        assert!(box_lower.contains(&lower) && box_upper.contains(&upper));
        assert_eq!(box_upper.max.y, 4.0);
    }

    #[test]
    fn a_plane_outside_leaves_one_side_empty() {
        let prim = PrimRef::new(Aabb::new(Vec3::ZERO, Vec3::ONE), 0);
        assert_eq!(BoxClip.clip(&prim, 1, 2.0), [prim.aabb(), Aabb::EMPTY]);
        assert_eq!(BoxClip.clip(&prim, 1, -2.0), [Aabb::EMPTY, prim.aabb()]);
    }
}
