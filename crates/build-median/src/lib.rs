//! Object-median and spatial-median BVH builders: the two simplest heuristics, and the baselines
//! that every surface-area builder has to beat (thesis section 3.5).
//!
//! ```
//! use niwaki_build_median::{ObjectMedian, SpatialMedian};
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! let mesh = TriangleMesh::new(
//!     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
//!     vec![[0, 1, 2], [1, 2, 3]],
//! )?;
//! let bvh = ObjectMedian { max_leaf_size: 1 }.build_mesh(&mesh)?;
//! assert_eq!(bvh.nodes.len(), 3);
//! assert_eq!(SpatialMedian::default().build_mesh(&mesh)?.bounds(), mesh.bounds());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`ObjectMedian`] halves the primitives by number, [`SpatialMedian`] halves the box by size.
//! Neither looks at surface areas, so their trees are built fast and traced slowly. Both end for
//! every finite input and return the same bytes for every number of threads.
//!
//! There are no feature flags.

mod top_down;

use niwaki_core::{BuildError, Builder, Bvh, PrimRef, TriangleMesh};
use top_down::{Rule, build};

/// Halves the primitives by number: they are ordered by centroid along the longest axis of the
/// *centroid* bounds and divided at the middle. Equal centroids are ordered by
/// [`PrimRef::prim_id`]. The tree is as flat as a binary tree can be. O(n log n).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectMedian {
    /// The most primitives of a leaf, at least 1. Default 4.
    pub max_leaf_size: usize,
}

/// Halves the box by size: a primitive goes to the side of the middle of the node's *bounds*,
/// along their longest axis, on which its centroid lies (thesis section 3.5). Where that leaves
/// a side empty, the node is split as [`ObjectMedian`] would split it.
///
/// Some inputs make such splits peel off one primitive after the other (boxes `[0, i]`, say), so
/// that a tree over n primitives would be n levels deep and take n² steps. Nodes deeper than
/// [`SPATIAL_LEVELS`] are therefore halved by number, which bounds the depth by
/// `SPATIAL_LEVELS + log₂ n` and the time by O(n (`SPATIAL_LEVELS` + log n)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpatialMedian {
    /// The most primitives of a leaf, at least 1. Default 4.
    pub max_leaf_size: usize,
}

/// How many levels of a tree [`SpatialMedian`] splits in space before it halves by number. Halving
/// the box of a scene 64 times in each axis leaves cells of 10⁻¹⁹ of its size.
pub const SPATIAL_LEVELS: u32 = 192;

impl Default for ObjectMedian {
    fn default() -> Self {
        Self { max_leaf_size: 4 }
    }
}

impl Default for SpatialMedian {
    fn default() -> Self {
        Self { max_leaf_size: 4 }
    }
}

impl Builder for ObjectMedian {
    fn name(&self) -> &str {
        "median_object"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        build(prims.to_vec(), self.max_leaf_size, Rule::Object)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        build(mesh.prim_refs(), self.max_leaf_size, Rule::Object)
    }

    fn memory_bound(&self, count: usize) -> usize {
        top_down::memory_bound(count)
    }
}

impl Builder for SpatialMedian {
    fn name(&self) -> &str {
        "median_spatial"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        build(prims.to_vec(), self.max_leaf_size, Rule::Spatial)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        build(mesh.prim_refs(), self.max_leaf_size, Rule::Spatial)
    }

    fn memory_bound(&self, count: usize) -> usize {
        top_down::memory_bound(count)
    }
}

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
