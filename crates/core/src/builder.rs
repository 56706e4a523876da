//! What all builders share: the trait, its errors and the check of the input.

use crate::{Aabb, AreaScale, Bvh, PrimRef, SahConstants, TriangleMesh};
use rayon::prelude::*;

/// Why a tree was not built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A primitive's bounds are NaN, infinite or inverted. Remedy: drop or repair the primitive;
    /// [`TriangleMesh::new`] and the loaders of `niwaki-scene` do so before a builder sees it.
    #[error("primitive {index} (id {prim_id}) has bounds {bounds:?}, which are not finite")]
    NonFiniteBounds {
        /// Position in the slice that was given: the first such.
        index: usize,
        /// Its id.
        prim_id: u32,
        /// Its bounds.
        bounds: Aabb,
    },
    /// More primitives than 31 bits can count, so that nodes cannot be addressed by 32. Remedy:
    /// build several trees.
    #[error("{count} primitives are more than the {max} that one tree can hold")]
    TooManyPrimitives {
        /// How many were given.
        count: usize,
        /// How many are allowed.
        max: usize,
    },
    /// A setting is out of its range. Remedy: see the field's documentation.
    #[error("builder setting `{setting}` is {value}: {remedy}")]
    BadSetting {
        /// The field.
        setting: &'static str,
        /// What it holds.
        value: String,
        /// What it may hold.
        remedy: &'static str,
    },
    /// A builder that works on the tree of another one was given a tree that is not sound.
    /// Remedy: report a bug in the inner builder; `niwaki_metrics::validate` names all faults.
    #[error("the inner builder's tree is broken at node {node}: {fault}")]
    BrokenTree {
        /// Index of the node.
        node: usize,
        /// What is wrong there.
        fault: &'static str,
    },
}

/// Builds a binary BVH. Implementations run on the current rayon pool
/// ([`rayon::ThreadPool::install`] chooses another) and return the same bytes for every number of
/// threads.
pub trait Builder: Sync {
    /// The name in tables and on the command line, such as `bonsai_p`.
    fn name(&self) -> &str;

    /// Builds a tree over `prims`; its leaves hold their `prim_id`s.
    ///
    /// # Errors
    /// [`BuildError::NonFiniteBounds`] names the first bad primitive;
    /// [`BuildError::TooManyPrimitives`] and [`BuildError::BadSetting`] as documented there.
    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError>;

    /// Builds a tree over the triangles of a mesh; builders that gain from it skip the list of
    /// references.
    ///
    /// # Errors
    /// As [`Builder::build`].
    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.build(&mesh.prim_refs())
    }

    /// An upper bound on the bytes that [`Builder::build_mesh`] allocates at once for `count`
    /// triangles, the result and any list of references included, the mesh not.
    fn memory_bound(&self, count: usize) -> usize;
}

/// The most primitives of one tree: `2·count − 1` nodes need 32-bit indices.
pub const MAX_PRIMS: usize = (u32::MAX / 2) as usize;

/// The boxes that top-down builders start from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneBounds {
    /// Around all primitives.
    pub bounds: Aabb,
    /// Around [`PrimRef::centroid2`] of all primitives: twice the centroid bounds.
    pub centroid2_bounds: Aabb,
    /// Keeps areas of parts of `bounds` in the range of `f32`.
    pub area_scale: AreaScale,
}

impl SceneBounds {
    /// Of nothing.
    pub const EMPTY: Self =
        Self { bounds: Aabb::EMPTY, centroid2_bounds: Aabb::EMPTY, area_scale: AreaScale::ONE };
}

/// Checks the input of a builder and returns its bounds, in one parallel pass.
///
/// # Errors
/// [`BuildError::NonFiniteBounds`] for the first bad primitive, or
/// [`BuildError::TooManyPrimitives`].
pub fn scene_bounds(prims: &[PrimRef]) -> Result<SceneBounds, BuildError> {
    if prims.len() > MAX_PRIMS {
        return Err(BuildError::TooManyPrimitives { count: prims.len(), max: MAX_PRIMS });
    }
    // min and max drop NaN operands, so a fault has to be looked for explicitly; subtraction of
    // a non-finite number from itself is NaN and cheap to accumulate.
    let (bounds, centroid2_bounds, ok) = prims
        .par_chunks(4096)
        .map(|chunk| {
            let mut bounds = Aabb::EMPTY;
            let mut centroids = Aabb::EMPTY;
            let mut ok = true;
            for p in chunk {
                bounds = bounds.union(p.aabb());
                centroids = centroids.grow(p.centroid2());
                ok &= is_good(p);
            }
            (bounds, centroids, ok)
        })
        .reduce(
            || (Aabb::EMPTY, Aabb::EMPTY, true),
            |a, b| (a.0.union(b.0), a.1.union(b.1), a.2 && b.2),
        );
    if !ok && let Some(index) = prims.iter().position(|p| !is_good(p)) {
        return Err(BuildError::NonFiniteBounds {
            index,
            prim_id: prims[index].prim_id,
            bounds: prims[index].aabb(),
        });
    }
    Ok(SceneBounds { bounds, centroid2_bounds, area_scale: AreaScale::of(&bounds) })
}

/// Checks the setting `max_leaf_size` of a builder.
///
/// # Errors
/// [`BuildError::BadSetting`] if leaves may hold nothing.
pub fn check_max_leaf_size(max_leaf_size: usize) -> Result<(), BuildError> {
    if max_leaf_size == 0 {
        return Err(BuildError::BadSetting {
            setting: "max_leaf_size",
            value: "0".into(),
            remedy: "a leaf holds at least 1 primitive",
        });
    }
    Ok(())
}

/// Checks the setting `sah` of a builder.
///
/// # Errors
/// [`BuildError::BadSetting`] if a cost is negative or not finite.
pub fn check_sah(sah: &SahConstants) -> Result<(), BuildError> {
    if ![sah.inner, sah.leaf, sah.triangle].iter().all(|c| c.is_finite() && *c >= 0.0) {
        return Err(BuildError::BadSetting {
            setting: "sah",
            value: format!("{sah:?}"),
            remedy: "costs are finite and not negative",
        });
    }
    Ok(())
}

#[inline]
fn is_good(p: &PrimRef) -> bool {
    p.min.cmple(p.max).all() && p.min.is_finite() && p.max.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_first_bad_primitive_is_named() {
        let good = PrimRef::new(Aabb::new(Vec3::ZERO, Vec3::ONE), 7);
        let mut prims = vec![good; 10_000];
        assert_eq!(scene_bounds(&prims).unwrap().bounds, good.aabb());
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            prims[9000].max.y = bad;
            prims[9000].prim_id = 3;
            let error = scene_bounds(&prims).unwrap_err();
            assert!(
                matches!(error, BuildError::NonFiniteBounds { index: 9000, prim_id: 3, .. }),
                "{error}"
            );
        }
    }

    #[test]
    fn settings_are_checked() {
        assert_eq!(check_max_leaf_size(1), Ok(()));
        assert!(check_max_leaf_size(0).is_err());
        assert_eq!(check_sah(&SahConstants { inner: 0.0, leaf: -0.0, triangle: f32::MAX }), Ok(()));
        for bad in [-1e-30, f32::NAN, f32::INFINITY] {
            for i in 0..3 {
                let mut costs = [1.0; 3];
                costs[i] = bad;
                let [inner, leaf, triangle] = costs;
                let error = check_sah(&SahConstants { inner, leaf, triangle }).unwrap_err();
                assert!(matches!(error, BuildError::BadSetting { setting: "sah", .. }), "{error}");
            }
        }
    }

    #[test]
    fn nothing_has_empty_bounds() {
        assert_eq!(scene_bounds(&[]).unwrap(), SceneBounds::EMPTY);
    }
}
