//! Subtrees over a part of the order, each built by one thread.

use crate::part::Part;
use niwaki_core::bottom_up::LeafRule;
use niwaki_core::morton::Sorted;
use niwaki_core::morton::{common_prefix, split};
use niwaki_core::{Aabb, BvhNode, PrimRef, to_u32};

/// A part of the order, and where its nodes go.
pub(crate) struct Chunk<'a> {
    pub(crate) first: usize,
    pub(crate) last: usize,
    /// Two zeroed slots for each place but one.
    pub(crate) slots: &'a mut [BvhNode],
    /// Index of the first slot in the whole array.
    pub(crate) base: usize,
}

/// What every subtree is built from.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) prims: &'a [PrimRef],
    pub(crate) sorted: &'a Sorted,
    pub(crate) rule: &'a LeafRule,
}

impl Source<'_> {
    #[inline]
    pub(crate) fn leaf(&self, place: usize) -> Part {
        let prim = &self.prims[self.sorted.order[place] as usize];
        Part::leaf(prim.aabb(), to_u32(place), self.rule)
    }
}

/// Bytes of temporary memory for each slot.
pub(crate) const NOTE_BYTES: usize = size_of::<Note>();

/// What [`Part`] has beside the node: cost, first place, number of places.
type Note = (f32, u32, u32);

/// Builds the subtree top-down, then its boxes from the leaves up. Returns the root, which has no
/// slot of its own.
pub(crate) fn lauterbach(source: Source<'_>, chunk: Chunk<'_>) -> Part {
    let Chunk { first, last, slots, base } = chunk;
    if first == last {
        return source.leaf(first);
    }
    let mut notes: Vec<Note> = vec![(0.0, 0, 0); slots.len()];
    let mut stack = vec![(first, last, 0_usize)];
    while let Some((first, last, pair)) = stack.pop() {
        let middle = split(&source.sorted.codes, first, last);
        let children = [
            (pair, first, middle - 1, pair + 2),
            (pair + 1, middle, last, pair + 2 * (middle - first)),
        ];
        for (slot, first, last, below) in children {
            if first == last {
                let part = source.leaf(first);
                slots[slot] = part.node;
                notes[slot] = (part.cost, part.first, 1);
            } else {
                slots[slot] = BvhNode::inner(Aabb::EMPTY, to_u32(base + below));
                stack.push((first, last, below));
            }
        }
    }
    let join = |slots: &mut [BvhNode], notes: &[Note], pair: usize| {
        let part = |slot: usize| {
            let (cost, first, count) = notes[slot];
            Part { node: slots[slot], cost, first, count }
        };
        let joined = Part::join(&part(pair), &part(pair + 1), to_u32(base + pair), source.rule);
        if joined.node.is_leaf() {
            slots[pair..pair + 2 * (joined.count as usize - 1)].fill(bytemuck::Zeroable::zeroed());
        }
        joined
    };
    // Children come after their parents.
    for slot in (0..slots.len()).rev() {
        if !slots[slot].is_leaf() && slots[slot].first != 0 {
            let pair = slots[slot].first as usize - base;
            let part = join(slots, &notes, pair);
            slots[slot] = part.node;
            notes[slot] = (part.cost, part.first, part.count);
        }
    }
    join(slots, &notes, 0)
}

/// A subtree that waits for its neighbour on the left.
#[derive(Clone, Copy)]
struct Waiting {
    part: Part,
    /// Common prefix with the neighbour on the right.
    prefix: u32,
    /// Where the free slots ended before its nodes were written.
    free: usize,
}

/// Builds the subtree and its boxes in one pass from the last place to the first. Nodes go into
/// the slots from the end, so that parents, which are found after their children, come before
/// them. Returns the root, which has no slot of its own.
pub(crate) fn apetrei(source: Source<'_>, chunk: Chunk<'_>) -> Part {
    let Chunk { first, last, slots, base } = chunk;
    let codes = &source.sorted.codes;
    // Prefixes grow towards the top of the stack, and are at most 95.
    let mut stack: Vec<Waiting> = Vec::with_capacity(128);
    let mut free = slots.len();
    let mut lowest = free;
    let mut top = Waiting { part: source.leaf(last), prefix: 0, free };
    let mut merge = |left: &Waiting, right: &Waiting, free: &mut usize| {
        let pair = *free - 2;
        let part = Part::join(&left.part, &right.part, to_u32(base + pair), source.rule);
        if part.node.is_leaf() {
            *free = right.free;
        } else {
            slots[pair] = left.part.node;
            slots[pair + 1] = right.part.node;
            *free = pair;
            lowest = lowest.min(pair);
        }
        Waiting { part, prefix: right.prefix, free: right.free }
    };
    for place in (first..last).rev() {
        let prefix = common_prefix(codes, place, place + 1);
        while top.prefix > prefix
            && let Some(right) = stack.pop()
        {
            top = merge(&top, &right, &mut free);
        }
        stack.push(top);
        top = Waiting { part: source.leaf(place), prefix, free };
    }
    while let Some(right) = stack.pop() {
        top = merge(&top, &right, &mut free);
    }
    // Slots that were written before their subtree became a leaf.
    slots[lowest..free].fill(bytemuck::Zeroable::zeroed());
    top.part
}
