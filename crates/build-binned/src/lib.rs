//! Binned SAH BVH builder: the surface area heuristic evaluated over a few bins of centroids a
//! node (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies").
//!
//! ```
//! use niwaki_build_binned::Binned;
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! let mesh = TriangleMesh::new(
//!     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(9.0), Vec3::splat(8.0)],
//!     vec![[0, 1, 2], [2, 1, 0], [3, 4, 4]],
//! )?;
//! let bvh = Binned::default().build_mesh(&mesh)?;
//! // Two triangles on one spot share a leaf, the far one has its own.
//! assert_eq!(bvh.nodes.len(), 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! There are no feature flags.

mod parallel;
mod top_down;

#[cfg(test)]
#[path = "../../build-median/tests/support/mod.rs"]
mod support;
#[cfg(test)]
mod tests;

use niwaki_core::bins::{Kernel, MAX_BINS};
use niwaki_core::builder::{check_max_leaf_size, check_sah};
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, SahConstants, TriangleMesh};

/// The binned SAH builder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binned {
    /// Bins per axis, 2 to 64. Default 16, as in the paper: more cost time and gain little.
    pub bins: usize,
    /// The most primitives of a leaf, at least 1. Default 8. Smaller nodes become leaves where
    /// [`Binned::sah`] says that splitting costs more.
    pub max_leaf_size: usize,
    /// Costs that decide where splitting ends. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for Binned {
    fn default() -> Self {
        Self { bins: 16, max_leaf_size: 8, sah: SahConstants::default() }
    }
}

impl Binned {
    /// The bins per axis of a node over `count` primitives: [`Binned::bins`], or fewer where there
    /// are so few primitives that most bins would be empty.
    #[must_use]
    pub fn bins_for(&self, count: usize) -> usize {
        self.bins.min(4 + count / 2)
    }

    fn check(&self) -> Result<(), BuildError> {
        if !(2..=MAX_BINS).contains(&self.bins) {
            return Err(BuildError::BadSetting {
                setting: "bins",
                value: self.bins.to_string(),
                remedy: "use 2 to 64",
            });
        }
        check_max_leaf_size(self.max_leaf_size)?;
        check_sah(&self.sah)
    }
}

impl Builder for Binned {
    fn name(&self) -> &str {
        "binned"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.check()?;
        top_down::build(prims.to_vec(), self, Kernel::fastest())
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.check()?;
        top_down::build(mesh.prim_refs(), self, Kernel::fastest())
    }

    fn memory_bound(&self, count: usize) -> usize {
        top_down::memory_bound(count)
    }
}

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
