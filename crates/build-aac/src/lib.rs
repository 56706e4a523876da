//! Agglomerative clustering: BVHs joined from the primitives up, nearest pair first.
//!
//! [`Aac`] joins within the nodes of a Morton tree, few clusters at a time (Gu, He, Fatahalian and
//! Blelloch 2013); [`Agglomerative`] joins the nearest of all pairs (Walter, Bala, Kulkarni and
//! Pingali 2008), the reference that it approximates.
//!
//! ```
//! use niwaki_build_aac::Aac;
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! let mesh = TriangleMesh::new(
//!     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
//!     vec![[0, 1, 2], [1, 2, 3]],
//! )?;
//! let bvh = Aac::hq().build_mesh(&mesh)?;
//! assert_eq!(bvh.bounds(), mesh.bounds());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! There are no feature flags.

mod agglomerative;
mod combine;
mod descend;

pub use agglomerative::Agglomerative;

use niwaki_core::bottom_up::{Forest, LeafRule};
use niwaki_core::{
    BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, morton, scene_bounds,
};

/// The approximate agglomerative clustering builder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aac {
    /// δ: a node of the Morton tree with at most this many primitives starts from single
    /// primitives, and hands on half as many clusters. 2 to 128. Default 20.
    pub delta: usize,
    /// ε: a node of `n` primitives hands on δ^(½ + ε)/2 · n^(½ − ε) clusters (section 3.2). Greater
    /// than 0, at most 0.5. Default 0.1. The smaller, the more pairs are looked at.
    pub epsilon: f32,
    /// The most primitives of a leaf, at least 1. Default 4. Subtrees that are no larger become
    /// leaves where [`Aac::sah`] says that this is not dearer.
    pub max_leaf_size: usize,
    /// Costs that decide which subtrees become leaves. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for Aac {
    fn default() -> Self {
        Self::hq()
    }
}

impl Aac {
    /// AAC-HQ: δ = 20, ε = 0.1. Named `aac_hq`.
    #[must_use]
    pub const fn hq() -> Self {
        Self { delta: 20, epsilon: 0.1, max_leaf_size: 4, sah: SahConstants::THESIS_IV }
    }

    /// AAC-LQ: δ = 4, ε = 0.2. Named `aac_lq`.
    #[must_use]
    pub const fn lq() -> Self {
        Self { delta: 4, epsilon: 0.2, ..Self::hq() }
    }

    fn check(&self) -> Result<(), BuildError> {
        if !(2..=128).contains(&self.delta) {
            return Err(BuildError::BadSetting {
                setting: "delta",
                value: self.delta.to_string(),
                remedy: "use 2 to 128",
            });
        }
        if !(self.epsilon > 0.0 && self.epsilon <= 0.5) {
            return Err(BuildError::BadSetting {
                setting: "epsilon",
                value: self.epsilon.to_string(),
                remedy: "use more than 0, at most 0.5",
            });
        }
        Ok(())
    }

    /// Builds from references that are dropped as soon as they are not needed.
    fn run(&self, prims: impl AsRef<[PrimRef]>) -> Result<Bvh, BuildError> {
        self.check()?;
        let refs = prims.as_ref();
        let scene = scene_bounds(refs)?;
        let rule = LeafRule::new(self.max_leaf_size, self.sah, scene.area_scale)?;
        if refs.is_empty() {
            return Ok(Bvh::default());
        }
        let sorted = morton::sort(refs, &scene, 63);
        let (root, forest) = descend::join_all(refs, &sorted, self, &rule);
        let order = sorted.order;
        Ok(forest.tree(&root, |place| refs[order[place as usize] as usize].prim_id))
    }
}

impl Builder for Aac {
    /// `aac_lq` for the δ and ε of [`Aac::lq`], `aac_hq` for those of [`Aac::hq`], otherwise `aac`.
    fn name(&self) -> &str {
        let is = |preset: Self| self.delta == preset.delta && self.epsilon == preset.epsilon;
        if is(Self::hq()) {
            "aac_hq"
        } else if is(Self::lq()) {
            "aac_lq"
        } else {
            "aac"
        }
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.run(prims)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.run(mesh.prim_refs())
    }

    fn memory_bound(&self, count: usize) -> usize {
        let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
        let forest = count * Forest::SLOT_BYTES;
        let source = count * (size_of::<PrimRef>() + size_of::<u64>() + size_of::<u32>());
        // Each thread joins one set, of the clusters of two, which are still there: (4 + 1 + 1)·f²
        // distances. Finished sets wait, at most one a level and thread. All of them together have
        // n primitives at most, and as f² grows slower than n, most distances if all are equal.
        let threads = rayon::current_num_threads() as f64;
        let most = |sets: f64| sets.powf(2.0 * f64::from(self.epsilon));
        let kept = self.kept(count.max(self.delta)) as f64;
        let distances = kept * kept * (6.0 * most(threads) + most(95.0 * threads));
        let matrices = distances * size_of::<f32>() as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and saturating"
        )]
        let matrices = matrices as usize;
        source + forest + matrices.max(nodes + count * size_of::<u32>()) + (1 << 20)
    }
}

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
