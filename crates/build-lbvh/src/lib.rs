//! Linear BVH builders: a tree read off the Morton order of the primitives (Lauterbach et al.
//! 2009, Karras 2012). The fastest way to some tree; surface areas are looked at only where
//! leaves are merged.
//!
//! ```
//! use niwaki_build_lbvh::{Algorithm, Lbvh};
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! let mesh = TriangleMesh::new(
//!     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
//!     vec![[0, 1, 2], [1, 2, 3]],
//! )?;
//! let bvh = Lbvh::default().build_mesh(&mesh)?;
//! let karras = Lbvh { algorithm: Algorithm::Karras, ..Lbvh::default() };
//! assert_eq!(bvh, karras.build_mesh(&mesh)?, "one tree, several ways to it");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Every primitive gets a Morton code: the bits of its quantised centroid, interleaved. Sorted,
//! the codes are the leaves of a binary radix tree whose nodes are the common prefixes; equal
//! codes are told apart by their position in the order. [`Algorithm`] says how that tree is
//! found, not which tree: all give the same bytes.
//!
//! [`Hlbvh`] builds treelets that way and a better tree over them (Pantaleoni and Luebke 2010).
//!
//! There are no feature flags.

mod chunk;
mod hlbvh;
mod karras;
mod part;
mod top_down;

pub use hlbvh::Hlbvh;

use niwaki_core::bottom_up::LeafRule;
use niwaki_core::layout::finish;
use niwaki_core::{
    BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, morton, scene_bounds,
};
use rayon::prelude::*;

/// The linear BVH builder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lbvh {
    /// Bits of a Morton code: 30 (10 per axis) or 63 (21 per axis). Default 63. With 30 the sort
    /// is shorter, and primitives within a 1024th of the scene are left in arbitrary order.
    pub code_bits: u32,
    /// How the hierarchy is found. Default [`Algorithm::Apetrei`], the fastest.
    pub algorithm: Algorithm,
    /// The most primitives of a leaf, at least 1. Default 4. Subtrees that are no larger become
    /// leaves where [`Lbvh::sah`] says that this is not dearer.
    pub max_leaf_size: usize,
    /// Costs that decide which subtrees become leaves. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

/// How [`Lbvh`] finds the hierarchy of sorted codes. The tree is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Algorithm {
    /// Top-down: every node is divided where the most significant differing bit of its codes
    /// changes, found by binary search (Lauterbach et al. 2009, section 3.2); boxes follow in a
    /// second pass from the leaves up.
    Lauterbach,
    /// All inner nodes at once: the range of each is found from its own position in the order by
    /// exponential and binary search (Karras 2012, section 3). Boxes are computed from the leaves
    /// up, where the second child to arrive, by an atomic counter, goes on to the parent. Made
    /// for machines with many threads.
    Karras,
    /// Bottom-up in one pass over the codes, in which a subtree joins the neighbour with which it
    /// shares the longer prefix, hierarchy and boxes together (Apetrei 2014). Here it runs
    /// sequentially with a short stack in each of a few parts of the order: the fastest on CPUs,
    /// and the default.
    #[default]
    Apetrei,
}

impl Default for Lbvh {
    fn default() -> Self {
        Self {
            code_bits: 63,
            algorithm: Algorithm::default(),
            max_leaf_size: 4,
            sah: SahConstants::default(),
        }
    }
}

impl Lbvh {
    fn check(&self) -> Result<(), BuildError> {
        if self.code_bits != 30 && self.code_bits != 63 {
            return Err(BuildError::BadSetting {
                setting: "code_bits",
                value: self.code_bits.to_string(),
                remedy: "use 30 or 63",
            });
        }
        Ok(())
    }
}

impl Builder for Lbvh {
    fn name(&self) -> &str {
        "lbvh"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        let (nodes, prim_ids) = self.slots(prims)?;
        Ok(finish(nodes, prim_ids))
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        let prims = mesh.prim_refs();
        let (nodes, prim_ids) = self.slots(&prims)?;
        drop(prims); // Before the nodes are moved, where memory use peaks.
        Ok(finish(nodes, prim_ids))
    }

    fn memory_bound(&self, count: usize) -> usize {
        // References, codes and order; then what the algorithm adds to the nodes; or, at the end,
        // nodes at old and new places and 4 bytes a pair for the new place beside the order.
        let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
        let source = count * (size_of::<PrimRef>() + size_of::<u64>() + size_of::<u32>());
        let extra = match self.algorithm {
            Algorithm::Lauterbach => 2 * count * chunk::NOTE_BYTES,
            Algorithm::Karras => count * karras::NODE_BYTES,
            Algorithm::Apetrei => 0,
        };
        let building = source + nodes + extra;
        let closing = 2 * nodes + count * 2 * size_of::<u32>();
        building.max(closing) + (256 << 10) + count / 8
    }
}

impl Lbvh {
    /// Nodes, perhaps with holes, and the order of the leaves.
    fn slots(&self, prims: &[PrimRef]) -> Result<(Vec<BvhNode>, Vec<u32>), BuildError> {
        self.check()?;
        let scene = scene_bounds(prims)?;
        let rule = LeafRule::new(self.max_leaf_size, self.sah, scene.area_scale)?;
        let sorted = morton::sort(prims, &scene, self.code_bits);
        let source = chunk::Source { prims, sorted: &sorted, rule: &rule };
        let nodes = match self.algorithm {
            Algorithm::Lauterbach => top_down::build(source, chunk::lauterbach),
            Algorithm::Karras => karras::build(source),
            Algorithm::Apetrei => top_down::build(source, chunk::apetrei),
        };
        let mut prim_ids = sorted.order;
        prim_ids.par_iter_mut().with_min_len(4096).for_each(|i| *i = prims[*i as usize].prim_id);
        Ok((nodes, prim_ids))
    }
}

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
