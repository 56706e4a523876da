//! Tree rotations (Kensler 2008).

use crate::bottom_up::{Part, bottom_up};
use crate::pass::{rearrange, rearrange_memory};
use crate::tree::{Node, Tree};
use crate::{Budget, OptimizeError, Optimizer, Report};
use niwaki_core::{Bvh, SahConstants};

/// A swap of two subtrees below a node, each given by its slot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Swap {
    pub(crate) a: u32,
    pub(crate) b: u32,
    /// By how much the sum of inner areas falls; negative if it grows.
    pub(crate) gain: f32,
}

/// The rotations at an inner node: a child with a grandchild on the other side, and grandchildren
/// with each other (Kensler 2008, figure 2); six at most. `f` is called with each.
#[inline]
pub(crate) fn for_each_swap(part: &Part<'_>, node: &Node, mut f: impl FnMut(Swap)) {
    let first = node.first();
    let [left, right] = *part.pair(first);
    // One side is rebuilt from a child of the other side and one of its own children.
    for (child, other) in [(first, right), (first + 1, left)] {
        if other.is_leaf() {
            continue;
        }
        let moved = part.node(child).bounds();
        let area = part.area(other.bounds());
        for grandchild in [other.first(), other.first() + 1] {
            let stays = part.node(grandchild ^ 1).bounds();
            let gain = area - part.area(moved.union(stays));
            f(Swap { a: child, b: grandchild, gain });
        }
    }
    if left.is_leaf() || right.is_leaf() {
        return;
    }
    let before = part.area(left.bounds()) + part.area(right.bounds());
    let [ll, lr] = part.pair(left.first()).map(|n| n.bounds());
    let [rl, rr] = part.pair(right.first()).map(|n| n.bounds());
    let gain = before - part.area(ll.union(rr)) - part.area(lr.union(rl));
    f(Swap { a: left.first() + 1, b: right.first() + 1, gain });
    let gain = before - part.area(ll.union(rl)) - part.area(lr.union(rr));
    f(Swap { a: left.first() + 1, b: right.first(), gain });
}

/// Swaps and makes the boxes of the children of `node` fit.
pub(crate) fn apply(part: &mut Part<'_>, node: &Node, swap: Swap) {
    let (a, b) = (*part.node(swap.a), *part.node(swap.b));
    *part.node_mut(swap.a) = b;
    *part.node_mut(swap.b) = a;
    for child in [node.first(), node.first() + 1] {
        let inner = *part.node(child);
        if !inner.is_leaf() {
            let [x, y] = part.pair(inner.first());
            let bounds = x.bounds().union(y.bounds());
            part.node_mut(child).set_bounds(bounds);
        }
    }
}

/// Makes the best rotation at a node if it pays; 1 if it did.
pub(crate) fn rotate(part: &mut Part<'_>, node: &Node) -> u64 {
    let mut best = Swap { a: 0, b: 0, gain: 0.0 };
    for_each_swap(part, node, |swap| {
        if swap.gain > best.gain {
            best = swap;
        }
    });
    if best.gain > 0.0 {
        apply(part, node, best);
        return 1;
    }
    0
}

/// Hill climbing by tree rotations (Kensler, *Tree rotations for improving bounding volume
/// hierarchies*, Symposium on Interactive Ray Tracing 2008, section 3): one iteration visits all
/// inner nodes from the leaves up and makes the best rotation at each, if one pays.
///
/// Cheap, and ends in the first local minimum; see [`crate::Annealing`] for a way on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotations {
    /// Sweeps over the tree. Ends early after one that changed nothing. 10 by default.
    pub budget: Budget,
    /// Costs of [`Report`]. Rotations lower the areas of inner nodes, which all costs gain from.
    pub constants: SahConstants,
}

impl Default for Rotations {
    fn default() -> Self {
        Self { budget: Budget::iterations(10), constants: SahConstants::default() }
    }
}

impl Rotations {
    pub(crate) fn run(budget: Budget, tree: &mut Tree) -> (u32, u64) {
        let clock = budget.start();
        let (mut iterations, mut changes) = (0, 0);
        while iterations < budget.iterations && !clock.is_over() {
            iterations += 1;
            let rotated = bottom_up(tree, |part, _, node| rotate(part, node));
            if rotated == 0 {
                break;
            }
            changes += rotated;
        }
        (iterations, changes)
    }
}

impl Optimizer for Rotations {
    fn name(&self) -> &str {
        "rotate"
    }

    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        rearrange(bvh, &self.constants, |tree| Self::run(self.budget, tree))
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        rearrange_memory(nodes, references) + sweep_memory(nodes)
    }
}

/// Bytes that [`bottom_up`] takes: the plan, or the tree in its new order and a stack.
pub(crate) const fn sweep_memory(nodes: usize) -> usize {
    64 * (nodes / 2 + 1) + 32 * nodes
}
