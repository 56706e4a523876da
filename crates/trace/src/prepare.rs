//! What a kernel outside of this crate needs of a scene.

use crate::{
    Mode, SceneError,
    binary::{check_ids, check_tree},
    flat::{NEVER_HIT, closing, is_flat},
    scale::SceneScale,
    triangle::words,
};
use niwaki_core::{Aabb, Bvh, TriangleMesh, glam::Vec3};
use niwaki_wide::CollapseError;
use rayon::prelude::*;

/// The triangles of a tree's references, scaled and as the kernels of a [`Mode`] test them: the
/// layout of [`crate::BinaryScene`], for kernels elsewhere, a GPU's for example.
///
/// A kernel that does the operations of this crate's scalar kernels on these words, in nodes that
/// were multiplied by [`Prepared::factor`], gives their answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// Three words-of-three a reference, in the order of the leaves: a corner and the edges from it
    /// to the second and the third in [`Mode::Fast`], the corners in [`Mode::Watertight`]. All are
    /// NaN for a triangle that is never hit, because it has no area and closes no seam.
    pub triangles: Vec<[Vec3; 3]>,
    /// The power of two by which coordinates were multiplied, and nodes have to be.
    pub factor: f32,
    /// Of the scaled scene; a point for an empty one.
    pub bounds: Aabb,
    /// The largest scaled coordinate, by magnitude.
    pub magnitude: f32,
    /// Nothing was scaled, and no coordinate is above 10¹⁰: rays of moderate coordinates need no
    /// scaling.
    pub is_moderate: bool,
}

impl Prepared {
    /// The triangles of the references `prim_ids`, whose tree has these bounds; on the current
    /// rayon pool.
    ///
    /// # Errors
    /// [`SceneError::NoSuchTriangle`] if one of them is not in the mesh.
    pub fn new(
        mode: Mode,
        bounds: &Aabb,
        prim_ids: &[u32],
        mesh: &TriangleMesh,
    ) -> Result<Self, SceneError> {
        check_ids(prim_ids, mesh)?;
        let scale = SceneScale::of(bounds);
        let SceneScale { factor, bounds, magnitude, is_moderate } = scale;
        let triangles = scaled_words(mode, scale, prim_ids, mesh);
        Ok(Self { triangles, factor, bounds, magnitude, is_moderate })
    }
}

/// The words of references that exist.
pub(crate) fn scaled_words(
    mode: Mode,
    scale: SceneScale,
    prim_ids: &[u32],
    mesh: &TriangleMesh,
) -> Vec<[Vec3; 3]> {
    let triangle = |id: u32| mesh.triangle(id as usize);
    let ids = prim_ids.par_iter().with_min_len(4096);
    let flat = ids.clone().enumerate().filter(|&(_, &id)| is_flat(&triangle(id)));
    let flat: Vec<(usize, u32)> = flat.map(|(at, &id)| (at, id)).collect();
    let flat_ids: Vec<u32> = flat.iter().map(|&(_, id)| id).collect();
    let kept = closing(&flat_ids, mesh);
    let mut triangles: Vec<_> = ids.map(|&id| words(mode, &scale.triangle(triangle(id)))).collect();
    for (at, id) in flat {
        if kept.binary_search(&id).is_err() {
            triangles[at] = NEVER_HIT;
        }
    }
    triangles
}

/// Every inner node has two children after it that no other node has, and every leaf a range of
/// references that exists: what a traversal has to rely on.
///
/// # Errors
/// [`CollapseError::Malformed`] names the first node for which that is not so.
pub fn check_binary(bvh: &Bvh) -> Result<(), CollapseError> {
    check_tree(bvh)
}
