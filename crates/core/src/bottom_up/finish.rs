//! Lays the nodes of a finished tree out.

use super::{Cluster, FLAG, Forest, LEAF_OF_NODES};
use crate::layout::divide;
use crate::{Bvh, BvhNode, to_u32};

/// A subtree to lay out, and where.
struct Task<'a> {
    cluster: Cluster,
    /// For all nodes below it.
    slots: &'a mut [BvhNode],
    /// Index of `slots[0]`.
    base: usize,
    /// For its primitives.
    ids: &'a mut [u32],
    /// Index of `ids[0]`.
    first: usize,
}

/// What one thread's tasks share.
#[derive(Default)]
struct Stacks {
    /// Inner nodes: slot of the join, place of its children among the task's slots, place of its
    /// first primitive among the task's.
    inner: Vec<[u32; 3]>,
    /// Parts of a leaf.
    parts: Vec<Part>,
}

/// A part of a leaf.
enum Part {
    /// A cluster.
    Cluster(Cluster),
    /// As in a [`Note`].
    Link(u32),
}

impl Forest {
    /// Lays out the tree below `root`: depth first with siblings adjacent, without holes. `prim_id`
    /// gives the id of the primitive at a place.
    ///
    /// Neither the depth of the tree nor the number of threads matters.
    ///
    /// # Panics
    /// If `root` was not joined in this forest.
    #[must_use]
    pub fn tree(&self, root: &Cluster, prim_id: impl Fn(u32) -> u32 + Sync) -> Bvh {
        const GRAIN: usize = 4096;
        let mut nodes: Vec<BvhNode> = bytemuck::zeroed_vec(1 + 2 * self.inner_nodes(root));
        let mut prim_ids = vec![0; root.prims() as usize];
        let (top, slots) = nodes.split_at_mut(1);
        top[0] = node(root, 1, 0);
        divide(
            Task { cluster: *root, slots, base: 1, ids: &mut prim_ids, first: 0 },
            GRAIN,
            |task| task.ids.len(),
            Stacks::default,
            |task, stacks| {
                let Task { cluster, slots, base, ids, first } = task;
                if cluster.is_leaf() {
                    self.fill_leaf(&cluster, ids, &prim_id, &mut stacks.parts);
                    return None;
                }
                if ids.len() <= GRAIN {
                    self.fill(&cluster, slots, base, ids, first, &prim_id, stacks);
                    return None;
                }
                let [left, right] = self.pairs[cluster.link as usize];
                let (pair, below) = slots.split_at_mut(2);
                let (left_slots, right_slots) = below.split_at_mut(2 * self.inner_nodes(&left));
                let right_base = base + 2 + left_slots.len();
                let (left_ids, right_ids) = ids.split_at_mut(left.prims() as usize);
                let right_first = first + left_ids.len();
                pair[0] = node(&left, base + 2, first);
                pair[1] = node(&right, right_base, right_first);
                Some([
                    Task { cluster: left, slots: left_slots, base: base + 2, ids: left_ids, first },
                    Task {
                        cluster: right,
                        slots: right_slots,
                        base: right_base,
                        ids: right_ids,
                        first: right_first,
                    },
                ])
            },
        );
        Bvh { nodes, prim_ids }
    }

    fn inner_nodes(&self, cluster: &Cluster) -> usize {
        if cluster.is_leaf() { 0 } else { self.notes[cluster.link as usize][1] as usize }
    }

    /// Lays out the subtree of an inner node on one thread.
    #[expect(clippy::too_many_arguments, reason = "the parts of a task")]
    fn fill(
        &self,
        cluster: &Cluster,
        slots: &mut [BvhNode],
        base: usize,
        ids: &mut [u32],
        first: usize,
        prim_id: &(impl Fn(u32) -> u32 + Sync),
        Stacks { inner, parts }: &mut Stacks,
    ) {
        inner.push([cluster.link, 0, 0]);
        while let Some([link, place, first_id]) = inner.pop() {
            let (mut next, mut next_id) = (place as usize + 2, first_id as usize);
            let before = inner.len();
            for (i, child) in self.pairs[link as usize].iter().enumerate() {
                slots[place as usize + i] = node(child, base + next, first + next_id);
                let prims = child.prims() as usize;
                if child.is_leaf() {
                    self.fill_leaf(child, &mut ids[next_id..next_id + prims], prim_id, parts);
                } else {
                    inner.push([child.link, to_u32(next), to_u32(next_id)]);
                    next += 2 * self.inner_nodes(child);
                }
                next_id += prims;
            }
            // The first child's subtree comes next.
            inner[before..].reverse();
        }
    }

    /// Writes the ids of a leaf, left to right.
    fn fill_leaf(
        &self,
        leaf: &Cluster,
        ids: &mut [u32],
        prim_id: &(impl Fn(u32) -> u32 + Sync),
        stack: &mut Vec<Part>,
    ) {
        if let [id] = ids {
            *id = prim_id(leaf.link);
            return;
        }
        let mut ids = ids.iter_mut();
        stack.push(Part::Link(leaf.link));
        while let Some(part) = stack.pop() {
            let slot = match part {
                Part::Link(link) if link & FLAG != 0 => {
                    if let Some(id) = ids.next() {
                        *id = prim_id(link & !FLAG);
                    }
                    continue;
                }
                Part::Cluster(cluster) if !cluster.is_leaf() => {
                    let [left, right] = self.pairs[cluster.link as usize];
                    stack.extend([Part::Cluster(right), Part::Cluster(left)]);
                    continue;
                }
                Part::Cluster(cluster) if cluster.size == 1 => {
                    stack.push(Part::Link(cluster.part_link()));
                    continue;
                }
                Part::Link(slot) => slot as usize,
                Part::Cluster(cluster) => cluster.link as usize,
            };
            let note = self.notes[slot];
            if note == LEAF_OF_NODES {
                let [left, right] = self.pairs[slot];
                stack.extend([Part::Cluster(right), Part::Cluster(left)]);
            } else {
                let [left, right] = note;
                stack.extend([Part::Link(right), Part::Link(left)]);
            }
        }
    }
}

/// The node of a cluster: a leaf of the ids from `first` on, or an inner node with children at
/// `base`.
fn node(cluster: &Cluster, base: usize, first: usize) -> BvhNode {
    if cluster.is_leaf() {
        BvhNode::leaf(cluster.aabb(), to_u32(first), cluster.size)
    } else {
        BvhNode::inner(cluster.aabb(), to_u32(base))
    }
}
