//! Finished subtrees, and how two of them become one.

use niwaki_core::bottom_up::LeafRule;
use niwaki_core::{Aabb, BvhNode};

/// The root of a finished subtree and what its parent has to know.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) node: BvhNode,
    /// SAH cost in scaled half areas.
    pub(crate) cost: f32,
    /// Its first place in the order.
    pub(crate) first: u32,
    /// How many places it has.
    pub(crate) count: u32,
}

impl Part {
    /// A leaf of the one primitive at a place.
    #[inline]
    pub(crate) fn leaf(bounds: Aabb, place: u32, rule: &LeafRule) -> Self {
        let cost = rule.leaf_cost(bounds.half_area(rule.scale), 1);
        Self { node: BvhNode::leaf(bounds, place, 1), cost, first: place, count: 1 }
    }

    /// Two neighbours as one subtree: an inner node whose children are nodes `pair` and
    /// `pair + 1`, or one leaf where that is allowed and costs no more.
    #[inline]
    pub(crate) fn join(left: &Self, right: &Self, pair: u32, rule: &LeafRule) -> Self {
        let bounds = left.node.aabb().union(right.node.aabb());
        let count = left.count + right.count;
        let below = left.cost + right.cost;
        let (cost, is_leaf) = rule.join(bounds.half_area(rule.scale), count, below);
        let first = left.first;
        let node = if is_leaf {
            BvhNode::leaf(bounds, first, count)
        } else {
            BvhNode::inner(bounds, pair)
        };
        Self { node, cost, first, count }
    }
}
