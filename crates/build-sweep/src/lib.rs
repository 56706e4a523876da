//! Full-sweep SAH BVH builder (MacDonald and Booth 1990; thesis paper IV, section 4).
//!
//! ```
//! use niwaki_build_sweep::Sweep;
//! use niwaki_core::{Aabb, Builder, PrimRef, glam::Vec3};
//!
//! let prims: Vec<PrimRef> = (0..100_u32)
//!     .map(|i| {
//!         let corner = Vec3::new(i as f32, (i * i % 17) as f32, 0.0);
//!         PrimRef::new(Aabb::new(corner, corner + Vec3::splat(0.5)), i)
//!     })
//!     .collect();
//! let bvh = Sweep::default().build(&prims)?;
//! assert_eq!(bvh.prim_ids.len(), 100);
//! # Ok::<(), niwaki_core::BuildError>(())
//! ```
//!
//! Every split is the cheapest of all `3·(n − 1)` object splits of its node by the surface area
//! heuristic: the reference for tree quality among top-down greedy builders. Primitives are sorted
//! once along each axis; a stable partition keeps the three orders sorted from node to node, so a
//! build takes O(n log n) time.
//!
//! | item | for |
//! |---|---|
//! | [`Sweep`] | the builder |
//! | [`SplitRule`] | when to split and what a split costs; shared by both engines below |
//! | [`build_tree`] | the parallel engine: from a list of references to a tree |
//! | [`SweepWorkspace`] | the serial engine with reusable memory, for many small trees |
//! | [`WorkspacePool`] | workspaces for parallel loops over small trees |
//! | [`Kernel`] | the instruction set of the sweep; every kernel gives the same tree |
//!
//! There are no feature flags.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod kernel;
mod parallel;
mod pool;
mod rule;
mod scalar;
mod small_sort;
mod workspace;

pub use kernel::Kernel;
pub use parallel::{build_tree, tree_memory_bound};
pub use pool::{PooledWorkspace, WorkspacePool};
pub use rule::SplitRule;
pub use workspace::SweepWorkspace;

use niwaki_core::{BuildError, Builder, Bvh, PrimRef, SahConstants, scene_bounds};

/// The sweep builder: exact greedy SAH (thesis paper IV, section 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Costs that decide where to split and when to stop. All must be finite and not negative.
    /// [`SahConstants::THESIS_IV`] by default.
    pub constants: SahConstants,
    /// A node with more primitives is split even where a leaf would be cheaper; at least 1.
    /// 8 by default, which bounds the triangles of one leaf without touching its SAH in practice.
    pub max_leaf_size: u32,
    /// Instruction set; by default the best that this machine has. Trees do not depend on it.
    pub kernel: Kernel,
}

impl Default for Sweep {
    fn default() -> Self {
        Self {
            constants: SahConstants::default(),
            max_leaf_size: SplitRule::DEFAULT_MAX_LEAF_SIZE,
            kernel: Kernel::best(),
        }
    }
}

impl Builder for Sweep {
    fn name(&self) -> &str {
        "sweep"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        let rule = SplitRule::by_cost(self.constants, self.max_leaf_size)?;
        let scene = scene_bounds(prims)?;
        Ok(build_tree(prims, rule.with_scale(scene.area_scale), self.kernel))
    }

    fn memory_bound(&self, count: usize) -> usize {
        size_of::<PrimRef>() * count + tree_memory_bound(count)
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
