//! Split BVH builder: object splits and spatial splits by the surface area heuristic (Stich,
//! Friedrich and Dietrich 2009, "Spatial Splits in Bounding Volume Hierarchies"; thesis section
//! 3.9).
//!
//! ```
//! use niwaki_build_sbvh::Sbvh;
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! // Thin triangles side by side, diagonal to all axes: no object split keeps their boxes apart.
//! let corners = (0..100).flat_map(|i| {
//!     let from = Vec3::X * (i as f32 * 0.05);
//!     [from, from + Vec3::ONE, from + Vec3::ONE * 0.5 + Vec3::X * 0.002]
//! });
//! let indices = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
//! let mesh = TriangleMesh::new(corners.collect(), indices)?;
//! let sbvh = Sbvh { max_references: 4.0, ..Sbvh::default() };
//! let bvh = sbvh.build_mesh(&mesh)?;
//! assert!(bvh.prim_ids.len() > mesh.len(), "triangles are referenced from several leaves");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A node is divided either between references, as in any SAH builder, or by a plane, and
//! references that straddle the plane go to both sides, each with the box of its part. Planes are
//! tried where the children of the best object split overlap by more than [`Sbvh::alpha`] of the
//! root's area. The number of references, and with it the memory, never passes
//! [`Sbvh::max_references`].
//!
//! | item | for |
//! |---|---|
//! | [`Sbvh`] | the builder: `Sbvh::default()` is fast, [`Sbvh::sweep`] makes the better trees |
//! | [`ObjectSplit`] | how splits between references are looked for |
//!
//! There are no feature flags.

mod boxes;
mod object;
mod partition;
mod spatial;
mod top_down;
mod weight;

use niwaki_core::bins::MAX_BINS;
use niwaki_core::builder::{check_max_leaf_size, check_sah};
use niwaki_core::{BoxClip, BuildError, Builder, Bvh, Clip, PrimRef, SahConstants, TriangleMesh};

/// How splits between references are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectSplit {
    /// At the borders of this many bins of centroids along each axis, 2 to 64 (Wald 2007).
    Bins(usize),
    /// At every reference along each axis (MacDonald and Booth 1990) in nodes of at most `up_to`
    /// references; in larger nodes at the borders of 64 bins, which lose next to nothing there.
    Sweep {
        /// The largest node that is swept; `usize::MAX` for all.
        up_to: usize,
    },
}

/// The split BVH builder (Stich et al. 2009).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sbvh {
    /// How splits between references are looked for. Default 16 bins.
    pub object_split: ObjectSplit,
    /// Bins along each axis between which planes for spatial splits lie, 2 to 256. Default 16.
    pub spatial_bins: usize,
    /// Spatial splits are tried where the boxes of the children of the best object split overlap
    /// in a box of more than this share of the root's area; finite, not negative. Default 1e-5,
    /// as in the paper (section 4.5).
    pub alpha: f32,
    /// The most references of the tree, relative to the number of primitives; 1 (no spatial
    /// splits) to 16. Default 1.5. What is left is shared between children by
    /// number of references times area.
    pub max_references: f32,
    /// How the expected cost of a child grows with its number N of references above
    /// [`Sbvh::max_leaf_size`]: as N to this power, 0.25 to 1. The surface area heuristic takes
    /// every child for a leaf, hence 1; but the cost of trees over real scenes grows more slowly,
    /// and counting it so weighs areas more. Default 0.8. (Not in the paper.)
    pub count_exponent: f32,
    /// The most primitives of a leaf, at least 1. Default 8. Smaller nodes become leaves where
    /// [`Sbvh::sah`] says that splitting costs more.
    pub max_leaf_size: usize,
    /// Costs that decide where to split and when to stop. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for Sbvh {
    fn default() -> Self {
        Self {
            object_split: ObjectSplit::Bins(16),
            spatial_bins: 16,
            alpha: 1e-5,
            max_references: 1.5,
            count_exponent: 0.8,
            max_leaf_size: 8,
            sah: SahConstants::default(),
        }
    }
}

/// The most bins for spatial splits.
const MAX_SPATIAL_BINS: usize = 256;

impl Sbvh {
    /// The preset for the best trees: object splits by sweep, more planes, more references.
    #[must_use]
    pub fn sweep() -> Self {
        Self {
            object_split: ObjectSplit::Sweep { up_to: 1 << 10 },
            spatial_bins: 32,
            max_references: 2.0,
            count_exponent: 0.7,
            ..Self::default()
        }
    }

    /// Builds a tree over `prims`, which `clip` cuts: what [`Builder::build`] does with boxes and
    /// [`Builder::build_mesh`] with triangles.
    ///
    /// # Errors
    /// As [`Builder::build`].
    pub fn build_with<C: Clip>(&self, prims: &[PrimRef], clip: &C) -> Result<Bvh, BuildError> {
        self.check()?;
        top_down::build(prims, self, clip)
    }

    /// The most references of a tree over `count` primitives, by [`Sbvh::max_references`].
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "counts are exact in f64, and the factor is at least 1"
    )]
    pub fn reference_bound(&self, count: usize) -> usize {
        let bound = (count as f64 * f64::from(self.max_references)) as usize;
        bound.clamp(count, niwaki_core::builder::MAX_PRIMS.max(count))
    }

    fn check(&self) -> Result<(), BuildError> {
        let bad =
            |setting, value: String, remedy| Err(BuildError::BadSetting { setting, value, remedy });
        if let ObjectSplit::Bins(bins) = self.object_split
            && !(2..=MAX_BINS).contains(&bins)
        {
            return bad("object_split", format!("{:?}", self.object_split), "use 2 to 64 bins");
        }
        if !(2..=MAX_SPATIAL_BINS).contains(&self.spatial_bins) {
            return bad("spatial_bins", self.spatial_bins.to_string(), "use 2 to 256");
        }
        if !(self.alpha.is_finite() && self.alpha >= 0.0) {
            return bad("alpha", self.alpha.to_string(), "finite and not negative");
        }
        if !(1.0..=16.0).contains(&self.max_references) {
            return bad("max_references", self.max_references.to_string(), "use 1 to 16");
        }
        if !(0.25..=1.0).contains(&self.count_exponent) {
            return bad("count_exponent", self.count_exponent.to_string(), "use 0.25 to 1");
        }
        check_max_leaf_size(self.max_leaf_size)?;
        check_sah(&self.sah)
    }
}

impl Builder for Sbvh {
    fn name(&self) -> &str {
        match self.object_split {
            ObjectSplit::Bins(_) => "sbvh",
            ObjectSplit::Sweep { .. } => "sbvh_sweep",
        }
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.build_with(prims, &BoxClip)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.check()?;
        top_down::build(&mesh.prim_refs(), self, mesh)
    }

    fn memory_bound(&self, count: usize) -> usize {
        top_down::memory_bound(self, count)
    }
}

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
