//! Agglomerative clustering without approximation (Walter et al. 2008).

mod tree;

use niwaki_core::bottom_up::{Cluster, Forest, LeafRule};
use niwaki_core::{
    BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, morton, scene_bounds,
    to_u32,
};
use tree::SearchTree;

/// The agglomerative clustering builder: clusters that are nearest to each other, of all that
/// there are, become one, until one is left. The reference for the others, on one thread.
///
/// Pairs are found as by the locally-ordered algorithm of Walter et al. (2008, section 3.2): from a
/// cluster to its nearest, from that to its nearest, until two are each other's. As the distance,
/// the area of the common box, cannot shrink by a join, that gives the tree of joining the nearest
/// pair of all first, but for the order among equal distances. The nearest is found by descent in a
/// tree over the Morton order with a bound on the distance to everything below a node, in the
/// place of their kd-tree.
///
/// Time is near linear for even scenes; where boxes of very different size overlap, the bound
/// excludes little and time grows with the square of the number of primitives. So
/// [`Agglomerative::max_prims`] limits it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agglomerative {
    /// The most primitives that it accepts; for more, [`BuildError::TooManyPrimitives`] names it.
    /// Default 2¹⁸ = 262,144.
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
        let order = morton::sort(prims, &scene, 63).order;
        let clusters: Vec<_> = (0..to_u32(order.len()))
            .map(|place| Cluster::single(prims[order[place as usize] as usize].aabb(), place))
            .collect();
        let (root, forest) = join_all(clusters, &rule);
        Ok(forest.tree(&root, |place| prims[order[place as usize] as usize].prim_id))
    }
}

/// Joins the clusters, at least one, to one.
fn join_all(clusters: Vec<Cluster>, rule: &LeafRule) -> (Cluster, Forest) {
    let count = clusters.len();
    let mut forest = Forest::new(count - 1);
    let mut slots = forest.slots();
    let mut tree = SearchTree::new(clusters, rule.scale);
    // Each is the nearest of the one before, and nearer to it than that is to the one before it.
    let mut chain: Vec<(usize, f32)> = Vec::new();
    for slot in 0..to_u32(count - 1) {
        let [first, second] = loop {
            let (place, bound) = *chain.last().unwrap_or(&(tree.any(), f32::INFINITY));
            if chain.is_empty() {
                chain.push((place, bound));
            }
            match tree.nearer(place, bound) {
                Some(next) => chain.push(next),
                // None is nearer than the one that led here.
                None => {
                    let last = [chain.pop(), chain.pop()];
                    break last.map(|link| link.map_or(place, |(place, _)| place));
                }
            }
        };
        let (lower, upper) = (first.min(second), first.max(second));
        let (left, right) = (tree.cluster(lower), tree.cluster(upper));
        let joined = slots.join(&left, &right, slot, rule);
        tree.replace(lower, upper, joined);
        if tree.is_sparse() {
            let moved = tree.compact();
            for (place, _) in &mut chain {
                *place = moved[*place] as usize;
            }
        }
    }
    (tree.cluster(tree.any()), forest)
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

    /// For what it accepts; nothing for more.
    fn memory_bound(&self, count: usize) -> usize {
        if count > self.max_prims {
            return count * size_of::<PrimRef>();
        }
        let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
        let forest = count * Forest::SLOT_BYTES;
        let source = count * (size_of::<PrimRef>() + size_of::<u32>());
        let search = tree::bytes(count);
        // The chain visits each cluster at most once at a time, and grows by doubling.
        let chain = 3 * count * size_of::<(usize, f32)>();
        source + forest + (search + chain).max(nodes + count * size_of::<u32>()) + (1 << 20)
    }
}
