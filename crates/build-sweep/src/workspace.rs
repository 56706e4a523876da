//! The serial engine: one small tree at a time in memory that is reused.

use crate::kernel::{Kernel, PAD, Split, grow};
use crate::rule::{Decision, SplitRule};
#[cfg(target_arch = "x86_64")]
use crate::{avx2, avx2_partition};
use crate::{scalar, small_sort};
#[cfg(target_arch = "x86_64")]
use niwaki_core::bins::Corners;
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
    /// The boxes of `prims` as [`avx2`] takes them.
    #[cfg(target_arch = "x86_64")]
    boxes: Vec<Corners>,
    /// Primitives sorted along each axis, from [`PAD`] on; a node is the same range in all three.
    /// The padding before is zero, a valid index, because vector kernels read past the ends of
    /// nodes.
    order: [Vec<u32>; 3],
    keys: small_sort::Keys,
    /// 1 for primitives on the right of the split at hand.
    side: Vec<u8>,
    scratch: Vec<u32>,
    /// Areas of the boxes from the start of the node to each position, and from there to its end.
    areas: [Vec<f32>; 6],
    /// The result.
    nodes: Vec<BvhNode>,
    /// Right siblings that wait: node, first, end.
    stack: Vec<(u32, u32, u32)>,
}

impl SweepWorkspace {
    /// An empty workspace. Falls back to [`Kernel::Scalar`] where the machine lacks `kernel`.
    #[must_use]
    pub fn new(kernel: Kernel) -> Self {
        Self {
            prims: Vec::new(),
            kernel: kernel.or_fallback(),
            #[cfg(target_arch = "x86_64")]
            boxes: Vec::new(),
            order: [const { Vec::new() }; 3],
            keys: small_sort::Keys::default(),
            side: Vec::new(),
            scratch: Vec::new(),
            areas: [const { Vec::new() }; 6],
            nodes: Vec::new(),
            stack: Vec::new(),
        }
    }

    /// A workspace with room for trees of up to `count` primitives, which then allocate nothing,
    /// except for trees of more than 64 levels.
    #[must_use]
    pub fn with_capacity(kernel: Kernel, count: usize) -> Self {
        let mut workspace = Self::new(kernel);
        workspace.prims.reserve_exact(count);
        #[cfg(target_arch = "x86_64")]
        workspace.boxes.reserve_exact(count);
        workspace.keys.reserve(count);
        workspace.stack.reserve_exact(66);
        workspace.make_room(count);
        workspace
    }

    /// Bytes that a workspace for trees of up to `count` primitives takes at most.
    #[must_use]
    pub const fn bytes(count: usize) -> usize {
        let lists = 2 * size_of::<PrimRef>() + 12 + 32 + 1 + 4 + 24 + 2 * size_of::<BvhNode>();
        // A list that doubles its room while a chain as deep as it is long is built.
        let stack = 3 * 12 * count;
        (count + 2 * PAD) * lists + stack + 1024
    }

    /// Makes all lists but those of keys and primitives long enough.
    fn make_room(&mut self, count: usize) {
        fn to_length<T: bytemuck::Zeroable + Clone>(list: &mut Vec<T>, length: usize) {
            if list.len() < length {
                list.reserve_exact(length - list.len());
                list.resize(length, T::zeroed());
            }
        }
        to_length(&mut self.side, count + PAD);
        to_length(&mut self.scratch, count + PAD);
        to_length(&mut self.nodes, (2 * count).saturating_sub(1));
        for order in &mut self.order {
            to_length(order, count + 2 * PAD);
        }
        for areas in &mut self.areas {
            to_length(areas, count + 2 * PAD);
        }
    }

    /// Builds a tree over [`SweepWorkspace::prims`] and returns its nodes, in memory of the
    /// workspace: the root comes first, siblings are adjacent, and everything below a node is one
    /// contiguous range that starts at its children, that of a left child before that of its
    /// sibling. Leaves count from `first_prim` on; `ids` receives the `prim_id`s in leaf order.
    ///
    /// # Panics
    /// If there are no primitives or `ids` is not as long as they are.
    pub fn build(&mut self, rule: &SplitRule, ids: &mut [u32], first_prim: usize) -> &[BvhNode] {
        self.sort();
        self.build_sorted(rule, ids, first_prim)
    }

    /// Builds a tree over primitives that are already sorted along each axis. Otherwise like
    /// [`SweepWorkspace::build`].
    pub(crate) fn build_ordered(
        &mut self,
        rule: &SplitRule,
        sorted: [&[u32]; 3],
        ids: &mut [u32],
        first_prim: usize,
    ) -> &[BvhNode] {
        let count = self.prims.len();
        self.make_room(count);
        for (order, sorted) in self.order.iter_mut().zip(sorted) {
            assert!(sorted.iter().all(|&p| (p as usize) < count), "positions in `prims`");
            order[PAD..PAD + count].copy_from_slice(sorted);
        }
        self.build_sorted(rule, ids, first_prim)
    }

    fn sort(&mut self) {
        self.make_room(self.prims.len());
        let count = self.prims.len();
        let order = self.order.each_mut().map(|order| &mut order[PAD..PAD + count]);
        self.keys.sort(&self.prims, order);
    }

    fn build_sorted(&mut self, rule: &SplitRule, ids: &mut [u32], first_prim: usize) -> &[BvhNode] {
        let count = self.prims.len();
        assert!(count > 0 && ids.len() == count);
        assert!(count < 1 << 28, "vector kernels pack axis and position in 30 bits");
        #[cfg(target_arch = "x86_64")]
        if self.kernel == Kernel::Avx2 {
            self.boxes.clear();
            self.boxes.extend(self.prims.iter().map(|p| Corners::of(&p.aabb())));
        }
        let mut nodes = std::mem::take(&mut self.nodes);
        let mut used = 1;
        self.stack.clear();
        self.stack.push((0, 0, to_u32(count)));
        while let Some((node, start, end)) = self.stack.pop() {
            let (start, end) = (start as usize, end as usize);
            let count = end - start;
            if rule.is_leaf_by_count(count) {
                let bounds = self.bounds(start, end);
                nodes[node as usize] =
                    BvhNode::leaf(bounds, to_u32(first_prim + start), to_u32(count));
                continue;
            }
            let (bounds, mut split) = self.sweep(rule, start, end);
            match rule.decide(count, bounds.half_area(rule.scale), split.cost) {
                Decision::Leaf => {
                    nodes[node as usize] =
                        BvhNode::leaf(bounds, to_u32(first_prim + start), to_u32(count));
                    continue;
                }
                Decision::Best => {}
                Decision::Halve => {
                    split = Split { axis: self.widest(start, end), left: count / 2, cost: 0.0 };
                }
            }
            self.partition(split, start, end);
            let middle = to_u32(start + split.left);
            nodes[node as usize] = BvhNode::inner(bounds, used);
            self.stack.push((used + 1, middle, to_u32(end)));
            self.stack.push((used, to_u32(start), middle));
            used += 2;
        }
        for (id, &i) in ids.iter_mut().zip(&self.order[0][PAD..]) {
            *id = self.prims[i as usize].prim_id;
        }
        self.nodes = nodes;
        &self.nodes[..used as usize]
    }

    fn bounds(&self, start: usize, end: usize) -> Aabb {
        let order = &self.order[0][PAD + start..PAD + end];
        #[cfg(target_arch = "x86_64")]
        if self.kernel == Kernel::Avx2 && order.len() <= 2 {
            // SAFETY: a workspace has this kernel only where AVX2 is present, and orders hold
            // indices of primitives.
            return unsafe { avx2::bounds_of_two(&self.boxes, order[0], order[order.len() - 1]) };
        }
        let mut bounds = Aabb::EMPTY;
        for &i in order {
            grow(&mut bounds, &self.prims[i as usize]);
        }
        bounds
    }

    /// The box of a node and its cheapest split.
    fn sweep(&mut self, rule: &SplitRule, start: usize, end: usize) -> (Aabb, Split) {
        let count = end - start;
        #[cfg(target_arch = "x86_64")]
        if self.kernel == Kernel::Avx2 {
            assert!(self.order.iter().all(|order| end + 2 * PAD <= order.len()));
            assert!(self.areas.iter().all(|areas| count + 2 * PAD <= areas.len()));
            // SAFETY: a workspace has this kernel only where AVX2 is present; the lengths that
            // kernels ask for were just checked, and pointers are made from whole lists because
            // kernels read the padding before them too; orders and their padding hold indices of
            // primitives.
            let order = unsafe {
                let order = self.order.each_ref().map(|order| order.as_ptr().add(PAD + start));
                if count <= 4 {
                    return avx2::sweep_four(&self.boxes, order, count, rule);
                }
                if count <= 8 {
                    return avx2::sweep_eight(&self.boxes, order, count, rule);
                }
                order
            };
            let [a, b, c, d, e, f] = &mut self.areas;
            // SAFETY: as above.
            return unsafe {
                let [left, right] =
                    [[a, b, c], [d, e, f]].map(|areas| areas.map(|a| a.as_mut_ptr().add(PAD)));
                avx2::sweep(&self.boxes, order, count, rule, left, right)
            };
        }
        let mut best = Split::NONE;
        let bounds = [0, 1, 2].map(|axis| {
            let order = &self.order[axis][PAD + start..PAD + end];
            let right = &mut self.areas[0][..count];
            scalar::sweep_axis(&self.prims, order, axis, rule, right, &mut best)
        });
        (bounds[0], best)
    }

    /// The axis along which the centroids spread most.
    fn widest(&self, start: usize, end: usize) -> usize {
        let spread = |axis: usize| {
            let key = |i: usize| self.prims[self.order[axis][PAD + i] as usize].centroid2()[axis];
            key(end - 1) - key(start)
        };
        (1..3).fold(0, |best, axis| if spread(axis) > spread(best) { axis } else { best })
    }

    /// Moves the primitives that are left in the order of the split's axis to the left in the two
    /// other orders, keeping both sides sorted.
    fn partition(&mut self, split: Split, start: usize, end: usize) {
        let (start, end) = (PAD + start, PAD + end);
        let mut order = self.order.each_mut().map(|order| &mut order[start..]);
        order.rotate_left(split.axis);
        let [along, others @ ..] = order;
        let count = end - start;
        #[cfg(target_arch = "x86_64")]
        if self.kernel == Kernel::Avx2 {
            assert!(others.iter().all(|order| count + PAD <= order.len()));
            assert!(count + PAD <= self.scratch.len() && along.len() >= count + PAD);
            let others = others.map(|order| order.as_mut_ptr());
            // SAFETY: as in `sweep`; a node is the same range in all orders, and `side` has more
            // than three bytes after the last primitive's.
            unsafe {
                if count <= 8 {
                    avx2_partition::partition_eight(along.as_ptr(), others, count, split.left);
                    return;
                }
                avx2_partition::mark(&along[..count], split.left, self.side.as_mut_ptr());
                let (side, scratch) = (self.side.as_ptr(), self.scratch.as_mut_ptr());
                for order in others {
                    avx2_partition::partition(order, count, side, scratch);
                }
            }
            return;
        }
        for (i, &p) in along[..count].iter().enumerate() {
            self.side[p as usize] = u8::from(i >= split.left);
        }
        for order in others {
            scalar::partition(&mut order[..count], &mut self.scratch, |p| self.side[p]);
        }
    }
}
