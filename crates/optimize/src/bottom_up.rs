//! Visits inner nodes from the leaves up, in parallel, for passes that rearrange what is below a
//! node.

use crate::tree::{Bounds, Node, Pair, Tree};
use niwaki_core::to_u32;
use rayon::prelude::*;
use std::ops::Range;

/// Subtrees of at most so many pairs are one task.
const GRAIN: usize = 2048;

/// The pairs of a tree that a visit may touch: all below the node that is visited.
pub(crate) struct Part<'a> {
    pairs: &'a mut [Pair],
    /// Index of the first node.
    base: u32,
    pub(crate) scale: f32,
}

impl Part<'_> {
    #[inline]
    pub(crate) fn pair(&self, first: u32) -> &[Node; 2] {
        &self.pairs[(first - self.base) as usize / 2].0
    }

    #[inline]
    pub(crate) fn pair_mut(&mut self, first: u32) -> &mut [Node; 2] {
        &mut self.pairs[(first - self.base) as usize / 2].0
    }

    #[inline]
    pub(crate) fn node(&self, node: u32) -> &Node {
        &self.pair(node & !1)[node as usize % 2]
    }

    #[inline]
    pub(crate) fn node_mut(&mut self, node: u32) -> &mut Node {
        &mut self.pair_mut(node & !1)[node as usize % 2]
    }

    #[inline]
    pub(crate) fn area(&self, bounds: Bounds) -> f32 {
        bounds.area(self.scale)
    }
}

/// Calls `visit` for every inner node, children first, with its index and itself; returns the sum
/// of what it returns. `visit` may rearrange what is below the node, parents and children staying
/// linked by [`Node::first`] alone, but not the node itself.
///
/// Needs the tree in depth-first order, and brings it back into that order. The result does not
/// depend on the number of threads.
pub(crate) fn bottom_up(
    tree: &mut Tree,
    visit: impl Fn(&mut Part<'_>, u32, &Node) -> u64 + Sync,
) -> u64 {
    // In depth-first order what is below a node is a range. Visits to nodes of a range permute
    // nodes within it, so that going through it backwards reaches children before parents
    // whatever was done before.
    let scale = tree.scale;
    let Plan { tasks, spine } = plan(tree);
    let mut parts = Vec::with_capacity(tasks.len());
    let (mut rest, mut at) = (&mut tree.pairs[..], 0);
    for Task { root, node, pairs } in tasks {
        let (_, after) = std::mem::take(&mut rest).split_at_mut(pairs.start - at);
        let (part, after) = after.split_at_mut(pairs.len());
        (rest, at) = (after, pairs.end);
        parts.push((root, node, Part { pairs: part, base: to_u32(2 * pairs.start), scale }));
    }
    let in_parts: u64 = parts
        .into_par_iter()
        .with_max_len(1)
        .map(|(root, node, mut part)| {
            let nodes = part.base..part.base + 2 * to_u32(part.pairs.len());
            visit_all(&mut part, nodes.rev(), &visit) + visit(&mut part, root, &node)
        })
        .sum();
    let mut whole = Part { pairs: &mut tree.pairs, base: 0, scale };
    let above = visit_all(&mut whole, spine.into_iter().rev(), &visit);
    if in_parts + above > 0 {
        tree.relayout();
    }
    in_parts + above
}

fn visit_all(
    part: &mut Part<'_>,
    nodes: impl Iterator<Item = u32>,
    visit: &impl Fn(&mut Part<'_>, u32, &Node) -> u64,
) -> u64 {
    let mut sum = 0;
    for i in nodes {
        let node = *part.node(i);
        if !node.is_leaf() {
            sum += visit(part, i, &node);
        }
    }
    sum
}

struct Task {
    root: u32,
    node: Node,
    /// Everything below the root.
    pairs: Range<usize>,
}

struct Plan {
    /// In the order of their ranges.
    tasks: Vec<Task>,
    /// Inner nodes above those, parents first.
    spine: Vec<u32>,
}

fn plan(tree: &Tree) -> Plan {
    let mut plan = Plan { tasks: Vec::new(), spine: Vec::new() };
    let mut stack = vec![(0_u32, tree.pairs.len())];
    while let Some((root, end)) = stack.pop() {
        let node = tree.nodes()[root as usize];
        if node.is_leaf() {
            continue;
        }
        let pairs = node.first() as usize / 2..end;
        if pairs.len() <= GRAIN {
            plan.tasks.push(Task { root, node, pairs });
            continue;
        }
        plan.spine.push(root);
        let right = &tree.nodes()[node.first() as usize + 1];
        let middle = if right.is_leaf() { end } else { right.first() as usize / 2 };
        stack.push((node.first() + 1, end));
        stack.push((node.first(), middle));
    }
    plan
}
