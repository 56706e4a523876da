//! The tree in depth-first order: what every metric walks.

use niwaki_core::{Aabb, Bvh, to_u32};
use std::ops::Range;

/// A node in depth-first order; its subtree is the nodes from itself up to `end`.
pub(crate) struct Node {
    pub(crate) bounds: Aabb,
    /// Position after the last node of the subtree.
    pub(crate) end: u32,
    /// Index in [`Bvh::nodes`].
    pub(crate) index: u32,
}

/// All nodes that can be reached from the root, parents before children, first child first.
///
/// Links out of range or to a node that was already reached are left out, so that a walk ends for
/// every input.
pub(crate) struct Preorder {
    pub(crate) nodes: Vec<Node>,
    /// For each node, how many ancestors it has.
    pub(crate) depths: Vec<u32>,
}

impl Preorder {
    pub(crate) fn of(bvh: &Bvh) -> Self {
        let count = bvh.nodes.len();
        let mut seen = vec![false; count];
        let mut nodes: Vec<Node> = Vec::with_capacity(count);
        let mut depths: Vec<u32> = Vec::with_capacity(count);
        let mut stack = Vec::new();
        if count > 0 {
            stack.push((0_usize, 0_u32));
        }
        // Nodes whose subtree is not finished yet, by position.
        let mut open: Vec<usize> = Vec::new();
        while let Some((index, depth)) = stack.pop() {
            if index >= count || std::mem::replace(&mut seen[index], true) {
                continue;
            }
            let position = nodes.len();
            while open.last().is_some_and(|&above| depths[above] >= depth) {
                close(&mut nodes, &mut open, position);
            }
            let node = &bvh.nodes[index];
            nodes.push(Node { bounds: node.aabb(), end: 0, index: to_u32(index) });
            depths.push(depth);
            open.push(position);
            if !node.is_leaf() {
                let [first, second] = node.children();
                stack.push((second, depth + 1));
                stack.push((first, depth + 1));
            }
        }
        let total = nodes.len();
        while !open.is_empty() {
            close(&mut nodes, &mut open, total);
        }
        Self { nodes, depths }
    }
}

fn close(nodes: &mut [Node], open: &mut Vec<usize>, end: usize) {
    if let Some(position) = open.pop() {
        nodes[position].end = to_u32(end);
    }
}

/// The part of a leaf's range that exists; empty for an inner node.
pub(crate) fn prim_range(bvh: &Bvh, index: u32) -> Range<usize> {
    let range = bvh.nodes[index as usize].prim_range();
    let len = bvh.prim_ids.len();
    range.start.min(len)..range.end.min(len)
}

/// For each primitive, the positions (in [`Preorder::nodes`]) of the leaves that reference it, in
/// ascending order, packed one primitive after the other.
pub(crate) struct LeavesOfPrims {
    starts: Vec<u32>,
    leaves: Vec<u32>,
}

impl LeavesOfPrims {
    /// Ids of `prims` and above are left out.
    pub(crate) fn of(bvh: &Bvh, order: &Preorder, prims: usize) -> Self {
        let ids = |node: &Node| {
            bvh.prim_ids[prim_range(bvh, node.index)]
                .iter()
                .map(|&id| id as usize)
                .filter(move |&id| id < prims)
        };
        let mut starts = vec![0_u32; prims + 1];
        for id in order.nodes.iter().flat_map(ids) {
            starts[id + 1] += 1;
        }
        for i in 0..prims {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut leaves = vec![0; starts[prims] as usize];
        for (position, node) in order.nodes.iter().enumerate() {
            for id in ids(node) {
                leaves[next[id] as usize] = to_u32(position);
                next[id] += 1;
            }
        }
        Self { starts, leaves }
    }

    pub(crate) fn of_prim(&self, prim: usize) -> &[u32] {
        &self.leaves[self.starts[prim] as usize..self.starts[prim + 1] as usize]
    }
}
