//! The serial engine: one small tree at a time in memory that is reused.

use crate::kernel::{Kernel, Split, grow};
use crate::rule::{Decision, SplitRule};
use crate::scalar;
use niwaki_core::float::sortable_bits;
use niwaki_core::{Aabb, BvhNode, PrimRef, to_u32};

/// Memory for building trees one after the other on one thread. Nothing is allocated for a tree
/// that is not larger than the largest before it.
///
/// Fill [`SweepWorkspace::prims`], then call [`SweepWorkspace::build`].
#[derive(Clone, Debug)]
pub struct SweepWorkspace {
    /// The primitives of the next tree. All bounds must be finite.
    pub prims: Vec<PrimRef>,
    kernel: Kernel,
    /// Primitives sorted along each axis; a node is the same range in all three.
    order: [Vec<u32>; 3],
    keys: Vec<u64>,
    /// 1 for primitives on the right of the split at hand.
    side: Vec<u8>,
    scratch: Vec<u32>,
    right: Vec<f32>,
    /// Right siblings that wait: node, first, end.
    stack: Vec<(u32, u32, u32)>,
}

impl SweepWorkspace {
    /// An empty workspace.
    #[must_use]
    pub fn new(kernel: Kernel) -> Self {
        Self {
            prims: Vec::new(),
            kernel: kernel.or_fallback(),
            order: [const { Vec::new() }; 3],
            keys: Vec::new(),
            side: Vec::new(),
            scratch: Vec::new(),
            right: Vec::new(),
            stack: Vec::new(),
        }
    }

    /// Bytes that a workspace for trees of up to `count` primitives takes.
    #[must_use]
    pub const fn bytes(count: usize) -> usize {
        count * (32 + 12 + 8 + 1 + 4 + 4 + 12)
    }

    /// Builds a tree over [`SweepWorkspace::prims`] and returns how many of `nodes` it uses: the
    /// root is `nodes[0]`, siblings are adjacent, and everything below a node is one contiguous
    /// range that starts at its children, that of a left child before that of its sibling. Leaves
    /// count from `first_prim` on; `ids` receives the `prim_id`s in leaf order.
    ///
    /// # Panics
    /// If there are no primitives, `ids` is not as long as they are, or `nodes` is shorter than
    /// `2·count − 1`.
    pub fn build(
        &mut self,
        rule: &SplitRule,
        nodes: &mut [BvhNode],
        ids: &mut [u32],
        first_prim: usize,
    ) -> usize {
        self.sort();
        self.build_sorted(rule, nodes, ids, first_prim)
    }

    fn sort(&mut self) {
        for (axis, order) in self.order.iter_mut().enumerate() {
            self.keys.clear();
            self.keys.extend(self.prims.iter().enumerate().map(|(i, p)| {
                u64::from(sortable_bits(p.min[axis] + p.max[axis])) << 32 | i as u64
            }));
            self.keys.sort_unstable();
            order.clear();
            #[expect(clippy::cast_possible_truncation, reason = "the low half is the index")]
            order.extend(self.keys.iter().map(|&key| key as u32));
        }
    }

    fn build_sorted(
        &mut self,
        rule: &SplitRule,
        nodes: &mut [BvhNode],
        ids: &mut [u32],
        first_prim: usize,
    ) -> usize {
        let count = self.prims.len();
        assert!(count > 0 && ids.len() == count && nodes.len() >= 2 * count - 1);
        self.side.resize(count, 0);
        self.scratch.resize(count, 0);
        self.right.resize(count, 0.0);
        let mut used = 1;
        self.stack.clear();
        self.stack.push((0, 0, to_u32(count)));
        while let Some((node, start, end)) = self.stack.pop() {
            let (start, end) = (start as usize, end as usize);
            let count = end - start;
            let (bounds, decision, split) = self.examine(rule, start, end);
            let left = match decision {
                Decision::Leaf => {
                    nodes[node as usize] =
                        BvhNode::leaf(bounds, to_u32(first_prim + start), to_u32(count));
                    continue;
                }
                Decision::Best => {
                    self.partition(split, start, end);
                    split.left
                }
                Decision::Halve => {
                    let axis = self.widest(start, end);
                    let left = count / 2;
                    self.partition(Split { axis, left, cost: 0.0 }, start, end);
                    left
                }
            };
            nodes[node as usize] = BvhNode::inner(bounds, used);
            self.stack.push((used + 1, to_u32(start + left), to_u32(end)));
            self.stack.push((used, to_u32(start), to_u32(start + left)));
            used += 2;
        }
        for (id, &i) in ids.iter_mut().zip(&self.order[0]) {
            *id = self.prims[i as usize].prim_id;
        }
        used as usize
    }

    fn examine(&mut self, rule: &SplitRule, start: usize, end: usize) -> (Aabb, Decision, Split) {
        let count = end - start;
        if rule.is_leaf_by_count(count) {
            let mut bounds = Aabb::EMPTY;
            for &i in &self.order[0][start..end] {
                grow(&mut bounds, &self.prims[i as usize]);
            }
            return (bounds, Decision::Leaf, Split::NONE);
        }
        let mut best = Split::NONE;
        let mut bounds = Aabb::EMPTY;
        for axis in 0..3 {
            let order = &self.order[axis][start..end];
            let b = scalar::sweep_axis(
                &self.prims,
                order,
                axis,
                rule,
                &mut self.right[..count],
                &mut best,
            );
            if axis == 0 {
                bounds = b;
            }
        }
        (bounds, rule.decide(count, bounds.half_area(rule.scale), best.cost), best)
    }

    /// The axis along which the centroids spread most.
    fn widest(&self, start: usize, end: usize) -> usize {
        let spread = |axis: usize| {
            let key = |i: usize| self.prims[self.order[axis][i] as usize].centroid2()[axis];
            key(end - 1) - key(start)
        };
        (1..3).fold(0, |best, axis| if spread(axis) > spread(best) { axis } else { best })
    }

    /// Moves the primitives that are left in the order of the split's axis to the left in the two
    /// other orders, keeping both sides sorted.
    fn partition(&mut self, split: Split, start: usize, end: usize) {
        let middle = start + split.left;
        for (i, &p) in self.order[split.axis][start..end].iter().enumerate() {
            self.side[p as usize] = u8::from(i >= split.left);
        }
        for axis in 0..3 {
            if axis == split.axis {
                continue;
            }
            let order = &mut self.order[axis][start..end];
            let (mut left, mut right) = (0, 0);
            for i in 0..order.len() {
                let p = order[i];
                let side = usize::from(self.side[p as usize]);
                order[left] = p;
                self.scratch[right] = p;
                left += 1 - side;
                right += side;
            }
            self.order[axis][middle..end].copy_from_slice(&self.scratch[..right]);
        }
    }
}
