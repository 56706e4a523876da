//! All inner nodes at once (Karras 2012).

use crate::chunk::Source;
use crate::part::Part;
use niwaki_core::glam::Vec3;
use niwaki_core::layout::divide;
use niwaki_core::morton::common_prefix;
use niwaki_core::{Aabb, BvhNode, to_u32};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

const CHUNK: usize = 1024;
const NO_PARENT: u32 = u32::MAX;

/// Bytes of temporary memory for each place.
pub(crate) const NODE_BYTES: usize = size_of::<Inner>() + size_of::<AtomicU32>();

/// Inner node `i` of a radix tree: it covers places from or to `i`.
struct Inner {
    /// The last place of its first child; its second child begins one after.
    split: u32,
    /// First place of all.
    first: u32,
    /// Last place of all.
    last: u32,
    parent: AtomicU32,
    /// Children that are finished.
    arrived: AtomicU32,
    /// Inner nodes of the subtree that are kept; 0 for a leaf of several primitives.
    kept: AtomicU32,
    cost: AtomicU32,
    bounds: [AtomicU32; 6],
}

impl Inner {
    fn left_is_place(&self) -> bool {
        self.split == self.first
    }

    fn right_is_place(&self) -> bool {
        self.split + 1 == self.last
    }

    fn aabb(&self) -> Aabb {
        let f = |i: usize| f32::from_bits(self.bounds[i].load(Ordering::Relaxed));
        Aabb::new(Vec3::new(f(0), f(1), f(2)), Vec3::new(f(3), f(4), f(5)))
    }

    /// The finished subtree; its children are at nodes `pair` and `pair + 1`.
    fn part(&self, pair: u32) -> Part {
        let bounds = self.aabb();
        let count = self.last - self.first + 1;
        let node = if self.kept.load(Ordering::Relaxed) == 0 {
            BvhNode::leaf(bounds, self.first, count)
        } else {
            BvhNode::inner(bounds, pair)
        };
        let cost = f32::from_bits(self.cost.load(Ordering::Relaxed));
        Part { node, cost, first: self.first, count }
    }
}

/// Range and split of inner node `i`, from its own position alone (section 3, figure 4).
fn inner(codes: &[u64], i: usize) -> (usize, usize, usize) {
    let len = codes.len();
    // δ(i, i + offset) in the direction of growth; −1 outside.
    let up =
        i == 0 || (i + 1 < len && common_prefix(codes, i, i + 1) > common_prefix(codes, i, i - 1));
    let delta = |offset: usize| -> i64 {
        let j = if up { i.checked_add(offset).filter(|&j| j < len) } else { i.checked_sub(offset) };
        j.map_or(-1, |j| i64::from(common_prefix(codes, i, j)))
    };
    let behind = if i == 0 {
        -1
    } else if up {
        i64::from(common_prefix(codes, i, i - 1))
    } else if i + 1 < len {
        i64::from(common_prefix(codes, i, i + 1))
    } else {
        -1
    };
    // All places of the node share more than the place behind does.
    let mut bound = 2;
    while delta(bound) > behind {
        bound *= 2;
    }
    let mut extent = 0;
    let mut step = bound / 2;
    while step > 0 {
        if delta(extent + step) > behind {
            extent += step;
        }
        step /= 2;
    }
    // The places of its first half share more than the whole.
    let whole = delta(extent);
    let mut half = 0;
    let mut step = extent;
    loop {
        step = step.div_ceil(2);
        if delta(half + step) > whole {
            half += step;
        }
        if step == 1 {
            break;
        }
    }
    if up { (i, i + half, i + extent) } else { (i - extent, i - half - 1, i) }
}

/// Builds the tree.
pub(crate) fn build(source: Source<'_>) -> Vec<BvhNode> {
    let codes = &source.sorted.codes;
    let count = codes.len();
    if count == 0 {
        return Vec::new();
    }
    if count == 1 {
        return vec![source.leaf(0).node];
    }
    let nodes: Vec<Inner> = (0..count - 1)
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|i| {
            let (first, split, last) = inner(codes, i);
            Inner {
                split: to_u32(split),
                first: to_u32(first),
                last: to_u32(last),
                parent: AtomicU32::new(NO_PARENT),
                arrived: AtomicU32::new(0),
                kept: AtomicU32::new(0),
                cost: AtomicU32::new(0),
                bounds: Default::default(),
            }
        })
        .collect();
    let leaf_parents: Vec<AtomicU32> =
        (0..count).into_par_iter().with_min_len(CHUNK).map(|_| AtomicU32::new(NO_PARENT)).collect();
    nodes.par_iter().with_min_len(CHUNK).enumerate().for_each(|(i, node)| {
        let left = node.split as usize;
        let to = if node.left_is_place() { &leaf_parents[left] } else { &nodes[left].parent };
        to.store(to_u32(i), Ordering::Relaxed);
        let to =
            if node.right_is_place() { &leaf_parents[left + 1] } else { &nodes[left + 1].parent };
        to.store(to_u32(i), Ordering::Relaxed);
    });
    boxes(source, &nodes, &leaf_parents);
    drop(leaf_parents);
    layout(source, &nodes)
}

/// Finishes nodes from the places up: the second child to arrive goes on.
fn boxes(source: Source<'_>, nodes: &[Inner], leaf_parents: &[AtomicU32]) {
    leaf_parents.par_iter().with_min_len(CHUNK).for_each(|parent| {
        let mut parent = parent.load(Ordering::Relaxed);
        while let Some(node) = nodes.get(parent as usize) {
            // Release what was written below, acquire what the other child's thread wrote.
            if node.arrived.fetch_add(1, Ordering::AcqRel) == 0 {
                return;
            }
            let split = node.split as usize;
            let (left, left_kept) = if node.left_is_place() {
                (source.leaf(split), 0)
            } else {
                (nodes[split].part(1), nodes[split].kept.load(Ordering::Relaxed))
            };
            let (right, right_kept) = if node.right_is_place() {
                (source.leaf(split + 1), 0)
            } else {
                (nodes[split + 1].part(1), nodes[split + 1].kept.load(Ordering::Relaxed))
            };
            let part = Part::join(&left, &right, 1, source.rule);
            let bounds = [part.node.min.to_array(), part.node.max.to_array()];
            for (to, value) in node.bounds.iter().zip(bounds.as_flattened()) {
                to.store(value.to_bits(), Ordering::Relaxed);
            }
            node.cost.store(part.cost.to_bits(), Ordering::Relaxed);
            let kept = if part.node.is_leaf() { 0 } else { 1 + left_kept + right_kept };
            node.kept.store(kept, Ordering::Relaxed);
            parent = node.parent.load(Ordering::Relaxed);
        }
    });
}

/// A subtree to write: its inner node, the slots for all below it, and the index of the first.
struct Task<'a> {
    index: usize,
    slots: &'a mut [BvhNode],
    base: usize,
}

/// Writes nodes depth first with siblings adjacent.
fn layout(source: Source<'_>, nodes: &[Inner]) -> Vec<BvhNode> {
    let kept = |i: usize| nodes[i].kept.load(Ordering::Relaxed) as usize;
    let mut result: Vec<BvhNode> = bytemuck::zeroed_vec(1 + 2 * kept(0));
    let (root, slots) = result.split_at_mut(1);
    root[0] = nodes[0].part(1).node;
    if slots.is_empty() {
        return result;
    }
    divide(
        Task { index: 0, slots, base: 1 },
        4096,
        |task| task.slots.len(),
        || (),
        |task, ()| {
            let Task { index, slots, base } = task;
            if slots.is_empty() {
                return None;
            }
            let node = &nodes[index];
            let split = node.split as usize;
            let (pair, rest) = slots.split_at_mut(2);
            let left_slots = if node.left_is_place() { 0 } else { 2 * kept(split) };
            let right_base = base + 2 + left_slots;
            pair[0] = if node.left_is_place() {
                source.leaf(split).node
            } else {
                nodes[split].part(to_u32(base + 2)).node
            };
            pair[1] = if node.right_is_place() {
                source.leaf(split + 1).node
            } else {
                nodes[split + 1].part(to_u32(right_base)).node
            };
            let (left, right) = rest.split_at_mut(left_slots);
            Some([
                Task { index: split, slots: left, base: base + 2 },
                Task { index: split + 1, slots: right, base: right_base },
            ])
        },
    );
    result
}
