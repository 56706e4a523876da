//! One array from the top tree and the subtrees below it.

use crate::prune::Root;
use niwaki_core::{Bvh, BvhNode, memory::prefer_large_pages, to_u32};
use rayon::prelude::*;

/// Where the parts of a root go.
struct Place<'a> {
    root: &'a Root<'a>,
    /// Index of the first node below the root.
    below: u32,
    /// Index of the first primitive.
    prims: u32,
    nodes_out: &'a mut [BvhNode],
    ids_out: &'a mut [u32],
}

/// Memory that a root takes while trees are put together.
pub(crate) const PLACE_BYTES: usize = size_of::<Place<'_>>();

impl Place<'_> {
    fn moved(&self, node: &BvhNode) -> BvhNode {
        let first = if node.is_leaf() {
            node.first - self.root.prims.start + self.prims
        } else {
            node.first - self.root.first + self.below
        };
        BvhNode { first, ..*node }
    }
}

/// The nodes of the top tree come first, then what is below its leaves, from left to right.
pub(crate) fn assemble(top: &Bvh, roots: &[Root<'_>], ids: &[u32]) -> Bvh {
    let below: usize = roots.iter().map(|root| root.below.len()).sum();
    let mut result = Bvh {
        nodes: bytemuck::zeroed_vec(top.nodes.len() + below),
        prim_ids: bytemuck::zeroed_vec(ids.len()),
    };
    prefer_large_pages(&result.nodes);
    let (top_out, mut nodes_rest) = result.nodes.split_at_mut(top.nodes.len());
    let mut ids_rest = &mut result.prim_ids[..];
    let (mut next_node, mut next_prim) = (top.nodes.len(), 0);
    let mut places = Vec::with_capacity(roots.len());
    for &root in &top.prim_ids {
        let root = &roots[root as usize];
        let (nodes_out, nodes_after) = nodes_rest.split_at_mut(root.below.len());
        let (ids_out, ids_after) = ids_rest.split_at_mut(root.prims.len());
        places.push(Place {
            root,
            below: to_u32(next_node),
            prims: to_u32(next_prim),
            nodes_out,
            ids_out,
        });
        next_node += root.below.len();
        next_prim += root.prims.len();
        (nodes_rest, ids_rest) = (nodes_after, ids_after);
    }
    places.par_iter_mut().with_min_len(16).for_each(|place| {
        let out = std::mem::take(&mut place.nodes_out);
        for (out, node) in out.iter_mut().zip(place.root.below) {
            *out = place.moved(node);
        }
        let prims = &place.root.prims;
        place.ids_out.copy_from_slice(&ids[prims.start as usize..prims.end as usize]);
    });
    top_out.par_iter_mut().zip(&top.nodes).with_min_len(4096).for_each(|(out, node)| {
        *out = *node;
        if node.is_leaf() {
            let place = &places[node.first as usize];
            *out = place.moved(&place.root.node);
        }
    });
    result
}
