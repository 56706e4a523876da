//! Agglomerative clustering without approximation (Walter et al. 2008).

use crate::combine::combine;
use niwaki_core::bottom_up::{Cluster, Forest, LeafRule};
use niwaki_core::{
    BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, scene_bounds, to_u32,
};

/// The agglomerative clustering builder: joins the two clusters with the smallest common surface,
/// of all that there are, until one is left. On one thread, and for small inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agglomerative {
    /// The most primitives that it accepts: [`BuildError::TooManyPrimitives`] names it for more.
    pub max_prims: usize,
    /// The most primitives of a leaf, at least 1. Default 4. Subtrees that are no larger become
    /// leaves where [`Agglomerative::sah`] says that this is not dearer.
    pub max_leaf_size: usize,
    /// Costs that decide which subtrees become leaves. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for Agglomerative {
    fn default() -> Self {
        Self { max_prims: 1 << 18, max_leaf_size: 4, sah: SahConstants::default() }
    }
}

impl Agglomerative {
    fn run(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        let scene = scene_bounds(prims)?;
        let rule = LeafRule::new(self.max_leaf_size, self.sah, scene.area_scale)?;
        if prims.len() > self.max_prims {
            return Err(BuildError::TooManyPrimitives { count: prims.len(), max: self.max_prims });
        }
        if prims.is_empty() {
            return Ok(Bvh::default());
        }
        let mut clusters: Vec<_> = (0..to_u32(prims.len()))
            .map(|i| (Cluster::single(prims[i as usize].aabb(), i), i))
            .collect();
        let mut forest = Forest::new(prims.len());
        combine(&mut clusters, 1, &mut forest.slots(), &rule);
        Ok(forest.tree(&clusters[0].0, |place| prims[place as usize].prim_id))
    }
}

impl Builder for Agglomerative {
    fn name(&self) -> &str {
        "agglomerative"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.run(prims)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.run(&mesh.prim_refs())
    }

    fn memory_bound(&self, count: usize) -> usize {
        let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
        count * (size_of::<PrimRef>() + Forest::SLOT_BYTES + size_of::<Cluster>() + 32)
            + nodes
            + (1 << 20)
    }
}
