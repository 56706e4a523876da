//! Parallel locally-ordered clustering (PLOC): a BVH joined from the primitives up, each with its
//! nearest neighbour along the Morton curve (Meister and Bittner 2018).
//!
//! ```
//! use niwaki_build_ploc::Ploc;
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! let mesh = TriangleMesh::new(
//!     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
//!     vec![[0, 1, 2], [1, 2, 3]],
//! )?;
//! let bvh = Ploc::default().build_mesh(&mesh)?;
//! assert_eq!(bvh.bounds(), mesh.bounds());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Primitives stand in Morton order, each a cluster. In each round every cluster looks at the
//! [`Ploc::radius`] clusters before and behind it for the one with which it would have the smallest
//! surface area; two that choose each other are joined, the list is closed up, and the next round
//! begins. The list shrinks by a third or so each time, so a few dozen rounds make the tree.
//!
//! There are no feature flags.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod crowd;
mod rounds;
mod search;

use niwaki_core::bottom_up::{Cluster, Forest, LeafRule};
use niwaki_core::{
    BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, morton, scene_bounds,
    to_u32,
};
use rayon::prelude::*;

/// The largest [`Ploc::radius`].
pub const MAX_RADIUS: usize = 64;

/// The PLOC builder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ploc {
    /// How many clusters on either side in Morton order are looked at for the nearest: 1 to
    /// [`MAX_RADIUS`]. Default 14. Time grows with it, and the cost of the tree falls a little.
    pub radius: usize,
    /// The most primitives of a leaf, at least 1. Default 4. Subtrees that are no larger become
    /// leaves where [`Ploc::sah`] says that this is not dearer.
    pub max_leaf_size: usize,
    /// Costs that decide which subtrees become leaves. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for Ploc {
    fn default() -> Self {
        Self { radius: 14, max_leaf_size: 4, sah: SahConstants::default() }
    }
}

impl Ploc {
    /// Radius 6: the fastest that is worth it.
    #[must_use]
    pub const fn fast() -> Self {
        Self { radius: 6, max_leaf_size: 4, sah: SahConstants::THESIS_IV }
    }

    /// Radius 32: past it, cost hardly falls.
    #[must_use]
    pub const fn high() -> Self {
        Self { radius: 32, ..Self::fast() }
    }

    fn check(&self) -> Result<(), BuildError> {
        if !(1..=MAX_RADIUS).contains(&self.radius) {
            return Err(BuildError::BadSetting {
                setting: "radius",
                value: self.radius.to_string(),
                remedy: "use 1 to 64 neighbours on either side",
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
        let mut order = morton::sort(refs, &scene, 63).order;
        let clusters: Vec<Cluster> = order
            .par_iter()
            .with_min_len(4096)
            .enumerate()
            .map(|(place, &i)| Cluster::single(refs[i as usize].aabb(), to_u32(place)))
            .collect();
        order.par_iter_mut().with_min_len(4096).for_each(|i| *i = refs[*i as usize].prim_id);
        drop(prims);
        let (root, forest) = rounds::join_all(clusters, self.radius, &rule);
        Ok(forest.tree(&root, |place| order[place as usize]))
    }
}

impl Builder for Ploc {
    fn name(&self) -> &str {
        "ploc"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.run(prims)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.run(mesh.prim_refs())
    }

    fn memory_bound(&self, count: usize) -> usize {
        // Two lists of clusters, nearest neighbours, joins, order; at the end joins and nodes.
        let joins = count * Forest::SLOT_BYTES;
        let ids = count * 2 * size_of::<u32>();
        let joining = 2 * count * size_of::<Cluster>() + joins + ids;
        let closing = joins + (2 * count).saturating_sub(1) * size_of::<BvhNode>() + ids;
        joining.max(closing) + (1 << 20)
    }
}

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
