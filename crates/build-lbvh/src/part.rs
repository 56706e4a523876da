//! Finished subtrees, and how two of them become one.

use crate::Lbvh;
use niwaki_core::{Aabb, AreaScale, BvhNode, SahConstants};

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

/// Which subtrees become leaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafRule {
    pub(crate) max_leaf_size: usize,
    sah: SahConstants,
    scale: AreaScale,
}

impl LeafRule {
    pub(crate) const fn new(config: &Lbvh, scale: AreaScale) -> Self {
        Self { max_leaf_size: config.max_leaf_size, sah: config.sah, scale }
    }

    fn leaf_cost(&self, area: f32, count: u32) -> f32 {
        (self.sah.leaf + self.sah.triangle * count as f32) * area
    }

    /// A leaf of the one primitive at a place.
    #[inline]
    pub(crate) fn leaf(&self, bounds: Aabb, place: u32) -> Part {
        let cost = self.leaf_cost(bounds.half_area(self.scale), 1);
        Part { node: BvhNode::leaf(bounds, place, 1), cost, first: place, count: 1 }
    }

    /// Two neighbours as one subtree: an inner node whose children are nodes `pair` and
    /// `pair + 1`, or one leaf where that is allowed and costs no more.
    #[inline]
    pub(crate) fn join(&self, left: &Part, right: &Part, pair: u32) -> Part {
        let bounds = left.node.aabb().union(right.node.aabb());
        let area = bounds.half_area(self.scale);
        let count = left.count + right.count;
        let inner = self.sah.inner * area + (left.cost + right.cost);
        let leaf = self.leaf_cost(area, count);
        let first = left.first;
        if leaf <= inner && count as usize <= self.max_leaf_size {
            return Part { node: BvhNode::leaf(bounds, first, count), cost: leaf, first, count };
        }
        Part { node: BvhNode::inner(bounds, pair), cost: inner, first, count }
    }
}
