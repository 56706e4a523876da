//! Trees that are joined from the primitives up: what clustering builders share.
//!
//! A [`Cluster`] is a subtree that waits for a partner; joining two puts both into a list of
//! [`Pair`]s and makes a new cluster that names it. A join also settles, by the surface area
//! heuristic, whether the subtree is cheaper as one leaf ([`LeafRule`]), so that no second pass
//! over the tree is needed. [`tree`] lays the nodes out.

use crate::builder::{check_max_leaf_size, check_sah};
use crate::layout::divide;
use crate::{Aabb, AreaScale, BuildError, Bvh, BvhNode, SahConstants, to_u32};
use glam::Vec3;

/// Which subtrees become leaves: those of few primitives that cost no more as a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafRule {
    /// The most primitives of a leaf.
    pub max_leaf_size: usize,
    /// Costs of nodes and primitives.
    pub sah: SahConstants,
    /// Keeps areas in range.
    pub scale: AreaScale,
}

impl LeafRule {
    /// A rule for leaves of up to `max_leaf_size` primitives in a scene that `scale` belongs to.
    ///
    /// # Errors
    /// [`BuildError::BadSetting`] as [`check_max_leaf_size`] and [`check_sah`] say.
    pub fn new(
        max_leaf_size: usize,
        sah: SahConstants,
        scale: AreaScale,
    ) -> Result<Self, BuildError> {
        check_max_leaf_size(max_leaf_size)?;
        check_sah(&sah)?;
        Ok(Self { max_leaf_size, sah, scale })
    }

    /// Cost of a leaf of `count` primitives, in scaled half areas.
    #[must_use]
    #[inline]
    pub fn leaf_cost(&self, half_area: f32, count: u32) -> f32 {
        (self.sah.leaf + self.sah.triangle * count as f32) * half_area
    }

    /// Cost of a subtree of `count` primitives whose two children cost `below` together, and
    /// whether it is one leaf: allowed by the size and no dearer than an inner node.
    #[must_use]
    #[inline]
    pub fn join(&self, half_area: f32, count: u32, below: f32) -> (f32, bool) {
        let inner = self.sah.inner * half_area + below;
        let leaf = self.leaf_cost(half_area, count);
        if leaf <= inner && count as usize <= self.max_leaf_size {
            (leaf, true)
        } else {
            (inner, false)
        }
    }
}

/// A finished subtree: 40 bytes.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Cluster {
    /// Smallest coordinates of everything below.
    pub min: Vec3,
    /// Largest coordinates of everything below.
    pub max: Vec3,
    /// The place of its only primitive, or the index of its [`Pair`] if it has several.
    pub link: u32,
    /// Primitives below.
    pub prims: u32,
    /// Inner nodes that it has in the tree; 0 for a leaf, be it of several primitives.
    pub inner_nodes: u32,
    /// SAH cost in scaled half areas.
    pub cost: f32,
}

/// The two children of a cluster.
pub type Pair = [Cluster; 2];

impl Cluster {
    /// The primitive at `place`.
    #[must_use]
    #[inline]
    pub fn single(bounds: Aabb, place: u32, rule: &LeafRule) -> Self {
        let cost = rule.leaf_cost(bounds.half_area(rule.scale), 1);
        Self { min: bounds.min, max: bounds.max, link: place, prims: 1, inner_nodes: 0, cost }
    }

    /// Both as one, to be kept as the children of pair number `pair`.
    #[must_use]
    #[inline]
    pub fn join(left: &Self, right: &Self, pair: u32, rule: &LeafRule) -> Self {
        let bounds = left.aabb().union(right.aabb());
        let prims = left.prims + right.prims;
        let below = left.cost + right.cost;
        let (cost, is_leaf) = rule.join(bounds.half_area(rule.scale), prims, below);
        let inner_nodes = if is_leaf { 0 } else { left.inner_nodes + right.inner_nodes + 1 };
        Self { min: bounds.min, max: bounds.max, link: pair, prims, inner_nodes, cost }
    }

    /// The box.
    #[must_use]
    #[inline]
    pub const fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// Its node: a leaf of the ids from `first` on, or an inner node with children at `base`.
    #[inline]
    fn node(&self, base: usize, first: usize) -> BvhNode {
        if self.inner_nodes == 0 {
            BvhNode::leaf(self.aabb(), to_u32(first), self.prims)
        } else {
            BvhNode::inner(self.aabb(), to_u32(base))
        }
    }
}

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

/// Lays out the tree below `root`: depth first with siblings adjacent, without holes. `prim_id`
/// gives the id of the primitive at a place.
///
/// Neither the depth of the tree nor the number of threads matters.
///
/// # Panics
/// If a cluster's pair is not one of `pairs`, or its counts are not those of its children.
#[must_use]
pub fn tree(root: &Cluster, pairs: &[Pair], prim_id: impl Fn(u32) -> u32 + Sync) -> Bvh {
    const GRAIN: usize = 4096;
    let mut nodes: Vec<BvhNode> = bytemuck::zeroed_vec(1 + 2 * root.inner_nodes as usize);
    let mut prim_ids = vec![0; root.prims as usize];
    let (top, slots) = nodes.split_at_mut(1);
    top[0] = root.node(1, 0);
    divide(
        Task { cluster: *root, slots, base: 1, ids: &mut prim_ids, first: 0 },
        GRAIN,
        |task| task.ids.len(),
        Vec::new,
        |task, stack| {
            let Task { cluster, slots, base, ids, first } = task;
            if cluster.inner_nodes == 0 {
                fill_leaf(&cluster, pairs, ids, &prim_id, stack);
                return None;
            }
            let [left, right] = pairs[cluster.link as usize];
            let (pair, below) = slots.split_at_mut(2);
            let (left_slots, right_slots) = below.split_at_mut(2 * left.inner_nodes as usize);
            let right_base = base + 2 + left_slots.len();
            let (left_ids, right_ids) = ids.split_at_mut(left.prims as usize);
            let right_first = first + left_ids.len();
            pair[0] = left.node(base + 2, first);
            pair[1] = right.node(right_base, right_first);
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

/// Writes the ids of a leaf, left to right.
fn fill_leaf(
    leaf: &Cluster,
    pairs: &[Pair],
    ids: &mut [u32],
    prim_id: impl Fn(u32) -> u32,
    stack: &mut Vec<Cluster>,
) {
    let mut ids = ids.iter_mut();
    stack.push(*leaf);
    while let Some(cluster) = stack.pop() {
        if cluster.prims == 1 {
            if let Some(id) = ids.next() {
                *id = prim_id(cluster.link);
            }
        } else {
            let [left, right] = pairs[cluster.link as usize];
            stack.push(right);
            stack.push(left);
        }
    }
}
