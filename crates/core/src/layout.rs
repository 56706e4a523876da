//! Where top-down builders put nodes, so that the result never depends on threads.
//!
//! A subtree over `k` primitives has at most `2k − 1` nodes. Each [`Subtree`] owns that many
//! slots of one array: its own node, and `2k − 2` below it, of which a split takes the first two
//! for the children and divides the rest between them. The place of every node is thus known
//! from sizes alone, tasks write to disjoint slices without locks or `unsafe`, and [`compact`]
//! closes the holes that leaves of several primitives leave.

use crate::{Aabb, Bvh, BvhNode, to_u32};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// The slots of a subtree that has not been built yet.
#[derive(Debug)]
pub struct Subtree<'a> {
    node: &'a mut BvhNode,
    below: &'a mut [BvhNode],
    /// Index of `below[0]` in the whole array.
    base: usize,
}

/// Zeroed slots for a tree over `prims` primitives, for [`Subtree::root`].
#[must_use]
pub fn slots(prims: usize) -> Vec<BvhNode> {
    bytemuck::zeroed_vec((2 * prims).saturating_sub(1))
}

impl<'a> Subtree<'a> {
    /// The whole tree; `None` for zero primitives. Every node must be fresh from [`slots`].
    #[must_use]
    pub fn root(slots: &'a mut [BvhNode]) -> Option<Self> {
        let (node, below) = slots.split_first_mut()?;
        Some(Self { node, below, base: 1 })
    }

    /// How many primitives the slots suffice for.
    #[must_use]
    pub const fn capacity(&self) -> usize {
        self.below.len() / 2 + 1
    }

    /// Makes this a leaf over `prim_ids[first .. first + count]`.
    pub fn leaf(self, bounds: Aabb, first: usize, count: usize) {
        *self.node = BvhNode::leaf(bounds, to_u32(first), to_u32(count));
    }

    /// Puts a finished tree here: `nodes[0]` is its root, its inner nodes name children by index in
    /// `nodes`, siblings stand adjacent at odd indices, and its leaves stay as they are.
    ///
    /// # Panics
    /// If `nodes` is empty or larger than what the slots suffice for.
    pub fn fill(self, nodes: &[BvhNode]) {
        let moved = |node: &BvhNode| BvhNode {
            first: if node.is_leaf() { node.first } else { node.first + to_u32(self.base - 1) },
            ..*node
        };
        *self.node = moved(&nodes[0]);
        for (slot, node) in self.below[..nodes.len() - 1].iter_mut().zip(&nodes[1..]) {
            *slot = moved(node);
        }
    }

    /// Makes this an inner node and returns the slots of its children, the first with room for
    /// `left` primitives, the second for the rest.
    ///
    /// # Panics
    /// Unless `0 < left < capacity`.
    #[must_use]
    pub fn split(self, bounds: Aabb, left: usize) -> [Self; 2] {
        let capacity = self.capacity();
        assert!(left > 0 && left < capacity, "both children need a primitive");
        *self.node = BvhNode::inner(bounds, to_u32(self.base));
        let (children, rest) = self.below.split_at_mut(2);
        let (left_node, right_node) = children.split_at_mut(1);
        let (left_below, right_below) = rest.split_at_mut(2 * left - 2);
        let base = self.base + 2;
        [
            Self { node: &mut left_node[0], base, below: left_below },
            Self { node: &mut right_node[0], base: base + 2 * left - 2, below: right_below },
        ]
    }
}

/// Runs a recursive subdivision on the current rayon pool without recursion: `step` turns a task
/// into two smaller ones or finishes it. A first child with `size` over `grain` becomes a task of
/// its own that any thread may take; other tasks stay on the thread's own list. `scratch` makes
/// the state that one thread's list of tasks shares.
pub fn divide<T: Send, S>(
    root: T,
    grain: usize,
    size: impl Fn(&T) -> usize + Sync,
    scratch: impl Fn() -> S + Sync,
    step: impl Fn(T, &mut S) -> Option<[T; 2]> + Sync,
) {
    struct Context<Size, Scratch, Step> {
        grain: usize,
        size: Size,
        scratch: Scratch,
        step: Step,
    }
    fn run<'s, T: Send + 's, S>(
        scope: &rayon::Scope<'s>,
        task: T,
        context: &'s Context<
            impl Fn(&T) -> usize + Sync,
            impl Fn() -> S + Sync,
            impl Fn(T, &mut S) -> Option<[T; 2]> + Sync,
        >,
    ) {
        let mut scratch = (context.scratch)();
        let mut tasks = vec![task];
        while let Some(task) = tasks.pop() {
            let Some([first, second]) = (context.step)(task, &mut scratch) else { continue };
            tasks.push(second);
            if (context.size)(&first) > context.grain {
                scope.spawn(move |scope| run(scope, first, context));
            } else {
                tasks.push(first);
            }
        }
    }
    let context = Context { grain, size, scratch, step };
    let context = &context;
    rayon::scope(|scope| run(scope, root, context));
}

/// Closes the holes between nodes: slots that are still zero. Keeps the order, which is depth
/// first with siblings adjacent. Trees without holes are returned as they are.
#[must_use]
pub fn compact(nodes: Vec<BvhNode>) -> Vec<BvhNode> {
    // Slot 0 is the root; a sibling pair stands at an odd slot and is used as a whole or not at
    // all. No child has index 0, so a zero `first` in an inner node means an unused slot.
    const PAIRS: usize = 4096;
    if nodes.len() < 3 {
        return nodes;
    }
    let is_used = |pair: &[BvhNode]| pair[0].is_leaf() || pair[0].first != 0;
    // New index of each pair, by counting used pairs in chunks and then inside the chunk.
    let counts: Vec<usize> = nodes[1..]
        .par_chunks(2 * PAIRS)
        .map(|chunk| chunk.chunks_exact(2).filter(|pair| is_used(pair)).count())
        .collect();
    let mut total = 0;
    let starts: Vec<usize> = counts
        .iter()
        .map(|&count| {
            let start = total;
            total += count;
            start
        })
        .collect();
    if 2 * total + 1 == nodes.len() {
        return nodes;
    }
    let mut places = vec![0_u32; (nodes.len() - 1) / 2];
    places.par_chunks_mut(PAIRS).zip(nodes[1..].par_chunks(2 * PAIRS)).zip(&starts).for_each(
        |((places, chunk), &start)| {
            let mut next = start;
            for (place, pair) in places.iter_mut().zip(chunk.chunks_exact(2)) {
                *place = to_u32(2 * next + 1);
                next += usize::from(is_used(pair));
            }
        },
    );
    let moved = |node: &BvhNode| BvhNode {
        first: if node.is_leaf() { node.first } else { places[(node.first as usize - 1) / 2] },
        ..*node
    };
    let mut result = bytemuck::zeroed_vec(2 * total + 1);
    let (root, mut rest) = result.split_at_mut(1);
    root[0] = moved(&nodes[0]);
    // Each chunk of the source has its own slice of the result.
    let mut targets = Vec::with_capacity(counts.len());
    for count in &counts {
        let (target, after) = rest.split_at_mut(2 * count);
        targets.push(target);
        rest = after;
    }
    targets.into_par_iter().zip(nodes[1..].par_chunks(2 * PAIRS)).for_each(|(target, chunk)| {
        let used = chunk.chunks_exact(2).filter(|pair| is_used(pair)).flatten();
        for (slot, node) in target.iter_mut().zip(used) {
            *slot = moved(node);
        }
    });
    result
}

/// A finished tree from slots and leaf-ordered primitive ids.
#[must_use]
pub fn finish(slots: Vec<BvhNode>, prim_ids: Vec<u32>) -> Bvh {
    Bvh { nodes: compact(slots), prim_ids }
}

/// A finished tree where leaves hold their ids at places with holes between them, as builders that
/// split primitives leave them: `ids[first .. first + count]` of each leaf move together, in the
/// order of their places, and what no leaf names is dropped.
///
/// # Panics
/// If a leaf's range is not within `ids`.
#[must_use]
pub fn finish_with_holes(slots: Vec<BvhNode>, ids: Vec<u32>) -> Bvh {
    const WORD: usize = 64;
    const MIN_LEN: usize = 4096;
    let mut nodes = compact(slots);
    // A bit for each place that a leaf names. Relaxed: bits are only read after the loop's end.
    let words: Vec<AtomicU64> =
        (0..ids.len().div_ceil(WORD)).into_par_iter().map(|_| AtomicU64::new(0)).collect();
    nodes.par_iter().with_min_len(MIN_LEN).for_each(|node| {
        for place in node.prim_range() {
            words[place / WORD].fetch_or(1 << (place % WORD), Ordering::Relaxed);
        }
    });
    let words: Vec<u64> = words.into_iter().map(AtomicU64::into_inner).collect();
    let mut total = 0;
    let before: Vec<u32> = words
        .iter()
        .map(|word| {
            let before = total;
            total += word.count_ones();
            before
        })
        .collect();
    if total as usize == ids.len() {
        return Bvh { nodes, prim_ids: ids };
    }
    nodes.par_iter_mut().with_min_len(MIN_LEN).filter(|node| node.is_leaf()).for_each(|node| {
        let place = node.first as usize;
        let lower = words[place / WORD] & ((1 << (place % WORD)) - 1);
        node.first = before[place / WORD] + lower.count_ones();
    });
    let mut prim_ids = Vec::with_capacity(total as usize);
    for (word, ids) in words.iter().zip(ids.chunks(WORD)) {
        let mut rest = *word;
        while rest != 0 {
            prim_ids.push(ids[rest.trailing_zeros() as usize]);
            rest &= rest - 1;
        }
    }
    Bvh { nodes, prim_ids }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Splits `count` primitives in unequal parts down to leaves of at most `leaf`.
    fn build(count: usize, leaf: usize, grain: usize) -> Bvh {
        let mut nodes = slots(count);
        if let Some(root) = Subtree::root(&mut nodes) {
            divide(
                (root, 0),
                grain,
                |(subtree, _)| subtree.capacity(),
                || (),
                |(subtree, first): (Subtree<'_>, usize), ()| {
                    let count = subtree.capacity();
                    if count <= leaf {
                        subtree.leaf(Aabb::EMPTY, first, count);
                        return None;
                    }
                    let left = (count / 3).max(1);
                    let [a, b] = subtree.split(Aabb::EMPTY, left);
                    Some([(a, first), (b, first + left)])
                },
            );
        }
        finish(nodes, (0..to_u32(count)).collect())
    }

    #[test]
    fn every_primitive_is_in_one_leaf_and_no_hole_is_left() {
        for (count, leaf) in [(0, 1), (1, 1), (2, 1), (3, 2), (1000, 1), (50_000, 3), (50_000, 7)] {
            let bvh = build(count, leaf, 100);
            let mut seen = vec![0; count];
            let mut stack = if count == 0 { vec![] } else { vec![0_usize] };
            let mut visited = 0;
            while let Some(i) = stack.pop() {
                visited += 1;
                let node = &bvh.nodes[i];
                for &p in bvh.leaf_prims(node) {
                    seen[p as usize] += 1;
                }
                if !node.is_leaf() {
                    stack.extend(node.children());
                }
            }
            assert_eq!(visited, bvh.nodes.len());
            assert!(seen.iter().all(|&n| n == 1));
            assert_eq!(bvh, build(count, leaf, usize::MAX), "places depend on sizes alone");
        }
    }

    #[test]
    fn a_finished_tree_fits_where_it_would_have_been_built() {
        let whole = build(1000, 2, usize::MAX);
        let mut nodes = slots(1001);
        let [left, right] = Subtree::root(&mut nodes).unwrap().split(Aabb::EMPTY, 1);
        left.leaf(Aabb::EMPTY, 1000, 1);
        right.fill(&whole.nodes);
        let nodes = compact(nodes);
        assert_eq!(nodes.len(), whole.nodes.len() + 2);
        // The copy starts at node 2; what is below its root follows at once.
        assert_eq!(nodes[2].first, whole.nodes[0].first + 2);
        for (node, copy) in whole.nodes[1..].iter().zip(&nodes[3..]) {
            let by = if node.is_leaf() { 0 } else { 2 };
            assert_eq!((copy.first, copy.count), (node.first + by, node.count));
        }
    }

    #[test]
    fn holes_between_ids_are_closed() {
        // Leaves of one to three ids with gaps between, over several words.
        let mut nodes = slots(400);
        let mut ids = vec![u32::MAX; 400];
        let mut rest = Subtree::root(&mut nodes);
        let mut expected = Vec::new();
        let mut first = 0;
        while let Some(subtree) = rest.take() {
            let count = 1 + first % 3;
            ids[first..first + count].fill(to_u32(first));
            expected.push(vec![to_u32(first); count]);
            if subtree.capacity() > 4 {
                let [a, b] = subtree.split(Aabb::EMPTY, 4);
                a.leaf(Aabb::EMPTY, first, count);
                rest = Some(b);
            } else {
                subtree.leaf(Aabb::EMPTY, first, count);
            }
            first += 4;
        }
        let bvh = finish_with_holes(nodes, ids);
        let leaves = bvh.nodes.iter().filter(|n| n.is_leaf());
        let mut found: Vec<Vec<u32>> = leaves.map(|n| bvh.leaf_prims(n).to_vec()).collect();
        found.sort();
        assert_eq!(found, expected);
        assert_eq!(bvh.prim_ids, expected.concat());
    }

    #[test]
    fn chains_of_any_depth_do_not_overflow_the_stack() {
        let count = 200_000;
        let mut nodes = slots(count);
        divide(
            (Subtree::root(&mut nodes).unwrap(), 0),
            1000,
            |(subtree, _)| subtree.capacity(),
            || (),
            |(subtree, first): (Subtree<'_>, usize), ()| {
                let count = subtree.capacity();
                if count == 1 {
                    subtree.leaf(Aabb::EMPTY, first, 1);
                    return None;
                }
                let [a, b] = subtree.split(Aabb::EMPTY, count - 1);
                Some([(a, first), (b, first + count - 1)])
            },
        );
        assert_eq!(compact(nodes).len(), 2 * count - 1);
    }
}
