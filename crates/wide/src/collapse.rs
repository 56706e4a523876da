//! Greedy collapse of a binary tree.

use crate::{
    Bvh8, Child, CollapseError, Node8,
    counts::{MANY, subtree_counts},
};
use niwaki_core::{AreaScale, Bvh, BvhNode, memory::prefer_large_pages, to_u32};
use rayon::prelude::*;

/// Settings of [`Bvh8::collapse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapseSettings {
    /// The most references of a leaf: 1 to 8. Default 8.
    pub max_leaf: usize,
    /// What a leaf's visit costs for each of its references, as a share of what the visit costs
    /// without them: at least 0. A subtree that fits into one leaf is opened all the same, while
    /// slots last, if that lowers the expected cost Σ area · (1 + this · references). Default
    /// 0.5: vectors make triangles cheap, but a leaf of eight is five cache lines and one of two
    /// is one or two.
    pub reference_cost: f32,
}

impl Default for CollapseSettings {
    fn default() -> Self {
        Self { max_leaf: Bvh8::MAX_LEAF, reference_cost: 0.5 }
    }
}

/// What becomes a slot of a wide node.
#[derive(Clone, Copy, Default)]
struct Item {
    /// A node of the binary tree.
    node: u32,
    /// Where `count > 0`, only this part of a leaf too large for one slot.
    first: u32,
    count: u32,
    /// References below: those of `count` where that is set, saturated at [`MANY`] otherwise.
    refs: u32,
}

/// The chosen children of one wide node.
#[derive(Clone, Copy, Default)]
struct Slots {
    items: [Item; 8],
    used: usize,
    /// How many are nodes, not leaves.
    inner: usize,
    /// References of those that are leaves.
    prims: usize,
}

/// Wide nodes that one task chooses children for.
const GRAIN: usize = 128;
/// Tasks in flight per thread between two rounds of handing out places.
const TASKS_PER_THREAD: usize = 8;

impl Bvh8 {
    /// Collapses a binary tree on the current rayon pool: the child with the largest surface area
    /// is opened until a node has eight. The result does not depend on the number of threads.
    ///
    /// Leaves with more references than [`CollapseSettings::max_leaf`] are divided evenly among
    /// nodes with equal boxes.
    ///
    /// # Errors
    /// [`CollapseError`]: a malformed tree, too many references, or a setting out of range.
    pub fn collapse(bvh: &Bvh, settings: &CollapseSettings) -> Result<Self, CollapseError> {
        if !(1..=Self::MAX_LEAF).contains(&settings.max_leaf) {
            return Err(CollapseError::BadSetting {
                setting: "max_leaf",
                value: settings.max_leaf.to_string(),
                remedy: "give 1 to 8",
            });
        }
        if !(settings.reference_cost >= 0.0 && settings.reference_cost.is_finite()) {
            return Err(CollapseError::BadSetting {
                setting: "reference_cost",
                value: settings.reference_cost.to_string(),
                remedy: "give a finite number of at least 0",
            });
        }
        if bvh.prim_ids.len() > Self::MAX_REFERENCES {
            return Err(CollapseError::TooManyReferences {
                count: bvh.prim_ids.len(),
                max: Self::MAX_REFERENCES,
            });
        }
        if bvh.nodes.is_empty() {
            return Ok(Self::default());
        }
        let collapse = Collapse {
            bvh,
            counts: subtree_counts(&bvh.nodes),
            settings: *settings,
            scale: AreaScale::of(&bvh.bounds()),
        };
        collapse.run()
    }
}

struct Collapse<'a> {
    bvh: &'a Bvh,
    counts: Vec<u8>,
    settings: CollapseSettings,
    scale: AreaScale,
}

impl Collapse<'_> {
    fn run(&self) -> Result<Bvh8, CollapseError> {
        // Room for twice the nodes that are usual.
        let mut nodes = Vec::with_capacity(self.bvh.nodes.len() / 6 + 1);
        prefer_large_pages(nodes.spare_capacity_mut());
        let mut result = Bvh8 {
            nodes,
            prim_ids: Vec::with_capacity(self.bvh.prim_ids.len()),
            bounds: Some(self.bvh.bounds()),
            levels: 0,
        };
        let threads = rayon::current_num_threads();
        let round = if threads == 1 { GRAIN } else { GRAIN * threads * TASKS_PER_THREAD };
        let mut level = vec![self.item(0)?];
        let mut next = Vec::new();
        let mut slots: Vec<Slots> = Vec::with_capacity(round);
        while !level.is_empty() {
            result.levels += 1;
            // The next level starts where this one ends.
            let mut next_node = result.nodes.len() + level.len();
            for items in level.chunks(round) {
                slots.clear();
                slots.resize(items.len(), Slots::default());
                for_each_chunk(&mut slots, items, |slot, &item| {
                    *slot = self.choose(item)?;
                    Ok(())
                })?;
                self.place(&slots, &mut result, &mut next, &mut next_node)?;
            }
            std::mem::swap(&mut level, &mut next);
            next.clear();
        }
        Ok(result)
    }

    fn item(&self, node: usize) -> Result<Item, CollapseError> {
        let refs = u32::from(*self.counts.get(node).ok_or_else(|| self.malformed(node))?);
        Ok(Item { node: to_u32(node), first: 0, count: 0, refs })
    }

    fn malformed(&self, node: usize) -> CollapseError {
        CollapseError::Malformed { node, nodes: self.bvh.nodes.len() }
    }

    fn fits(&self, item: &Item) -> bool {
        item.refs as usize <= self.settings.max_leaf
    }

    fn area(&self, node: &BvhNode) -> f32 {
        node.aabb().half_area(self.scale)
    }

    /// The checked children of an inner node.
    fn children(&self, node: usize) -> Result<[usize; 2], CollapseError> {
        let first = self.bvh.nodes[node].first as usize;
        if first > node && first + 1 < self.bvh.nodes.len() {
            Ok([first, first + 1])
        } else {
            Err(self.malformed(node))
        }
    }

    /// What is gained by opening an item where it stands; not positive if it should stay.
    fn gain(&self, item: &Item) -> Result<f32, CollapseError> {
        let node = &self.bvh.nodes[item.node as usize];
        if node.is_leaf() {
            return Ok(0.0);
        }
        let area = self.area(node);
        if !self.fits(item) {
            // Opened by area alone; a degenerate box still has to be opened some time.
            return Ok(area.max(f32::MIN_POSITIVE));
        }
        let cost = |area: f32, refs: u32| area * (1.0 + self.settings.reference_cost * refs as f32);
        let mut gain = cost(area, item.refs);
        for child in self.children(item.node as usize)? {
            gain -= cost(self.area(&self.bvh.nodes[child]), u32::from(self.counts[child]));
        }
        // Areas beyond f32 give NaN: no gain.
        Ok(gain.max(0.0))
    }

    /// Chooses up to eight children for the wide node that stands for `root`.
    fn choose(&self, root: Item) -> Result<Slots, CollapseError> {
        let mut slots = Slots::default();
        let mut gains = [0.0_f32; 8];
        let root_node = &self.bvh.nodes[root.node as usize];
        if root_node.is_leaf() {
            self.divide_leaf(root, root_node, &mut slots)?;
        } else {
            slots.items[0] = root;
            slots.used = 1;
            gains[0] = f32::INFINITY;
            while slots.used < 8 {
                let mut best = 0;
                for i in 1..slots.used {
                    if gains[i] > gains[best] {
                        best = i;
                    }
                }
                if gains[best] <= 0.0 {
                    break;
                }
                let [a, b] = self.children(slots.items[best].node as usize)?;
                slots.items[best] = self.item(a)?;
                slots.items[slots.used] = self.item(b)?;
                gains[best] = self.gain(&slots.items[best])?;
                gains[slots.used] = self.gain(&slots.items[slots.used])?;
                slots.used += 1;
            }
        }
        for item in &slots.items[..slots.used] {
            if self.fits(item) {
                slots.prims += item.refs as usize;
            } else {
                slots.inner += 1;
            }
        }
        Ok(slots)
    }

    /// Shares a leaf, or a part of one, evenly among the slots.
    fn divide_leaf(
        &self,
        item: Item,
        node: &BvhNode,
        slots: &mut Slots,
    ) -> Result<(), CollapseError> {
        let (first, count) =
            if item.count > 0 { (item.first, item.count) } else { (node.first, node.count) };
        if (first as usize).saturating_add(count as usize) > self.bvh.prim_ids.len() {
            return Err(self.malformed(item.node as usize));
        }
        let parts = count.div_ceil(to_u32(self.settings.max_leaf)).min(8);
        for part in 0..parts {
            let (whole, rest) = (count / parts, count % parts);
            let split = |i: u32| whole * i + rest.min(i);
            let count = split(part + 1) - split(part);
            slots.items[part as usize] =
                Item { node: item.node, first: first + split(part), count, refs: count };
        }
        slots.used = parts as usize;
        Ok(())
    }

    /// Appends the nodes of `slots`, their references and the next level's items, in order.
    fn place(
        &self,
        slots: &[Slots],
        result: &mut Bvh8,
        next: &mut Vec<Item>,
        next_node: &mut usize,
    ) -> Result<(), CollapseError> {
        let (mut inner, mut prims) = (0, 0);
        for s in slots {
            inner += s.inner;
            prims += s.prims;
        }
        // Each node has at least one binary node or leaf part of its own, and every reference
        // one leaf: more means that something is reached twice.
        if result.prim_ids.len() + prims > self.bvh.prim_ids.len()
            || *next_node + inner > self.bvh.nodes.len() + self.bvh.prim_ids.len()
        {
            return Err(self.malformed(slots[0].items[0].node as usize));
        }
        let node_base = result.nodes.len();
        let prim_base = result.prim_ids.len();
        let next_base = next.len();
        result.nodes.resize(node_base + slots.len(), Node8::empty(0));
        result.prim_ids.resize(prim_base + prims, 0);
        next.resize(next_base + inner, Item::default());
        // One task's share of each array.
        let mut nodes = &mut result.nodes[node_base..];
        let mut ids = &mut result.prim_ids[prim_base..];
        let mut items = &mut next[next_base..];
        let mut first_prim = prim_base;
        let mut tasks = Vec::with_capacity(slots.len().div_ceil(GRAIN));
        for chunk in slots.chunks(GRAIN) {
            let inner = chunk.iter().map(|s| s.inner).sum();
            let prims: usize = chunk.iter().map(|s| s.prims).sum();
            let (node_share, rest) = nodes.split_at_mut(chunk.len());
            nodes = rest;
            let (id_share, rest) = ids.split_at_mut(prims);
            ids = rest;
            let (item_share, rest) = items.split_at_mut(inner);
            items = rest;
            tasks.push(Share {
                slots: chunk,
                nodes: node_share,
                prim_ids: id_share,
                next: item_share,
                first_prim,
                first_node: *next_node,
            });
            first_prim += prims;
            *next_node += inner;
        }
        if tasks.len() == 1 {
            return tasks.into_iter().try_for_each(|task| self.emit(task));
        }
        tasks.into_par_iter().try_for_each(|task| self.emit(task))
    }

    fn emit(&self, share: Share<'_>) -> Result<(), CollapseError> {
        let mut prim = 0;
        let mut inner = 0;
        for (slots, out) in share.slots.iter().zip(share.nodes) {
            let mut node = Node8::empty(to_u32(share.first_prim + prim));
            node.prim_count = to_u32(slots.prims);
            for item in &slots.items[..slots.used] {
                let source = &self.bvh.nodes[item.node as usize];
                let child = if self.fits(item) {
                    let count = item.refs as usize;
                    self.gather(item, &mut share.prim_ids[prim..prim + count])?;
                    let first = to_u32(share.first_prim + prim);
                    prim += count;
                    Child::Leaf { first, count: item.refs }
                } else {
                    share.next[inner] = *item;
                    inner += 1;
                    Child::Node(to_u32(share.first_node + inner - 1))
                };
                node.push(source.min, source.max, child);
            }
            *out = node;
        }
        Ok(())
    }

    /// Writes the ids below an item that fits into a leaf, from left to right.
    fn gather(&self, item: &Item, ids: &mut [u32]) -> Result<(), CollapseError> {
        let fault = || self.malformed(item.node as usize);
        let source = |first: u32, count: u32| {
            self.bvh.prim_ids.get(first as usize..).and_then(|ids| ids.get(..count as usize))
        };
        if item.count > 0 {
            ids.copy_from_slice(source(item.first, item.count).ok_or_else(fault)?);
            return Ok(());
        }
        // Every pending subtree holds a reference, and there are at most eight.
        let mut stack = [0; Bvh8::MAX_LEAF + 1];
        stack[0] = item.node as usize;
        let mut pending = 1;
        let mut done = 0;
        while pending > 0 {
            pending -= 1;
            let node = &self.bvh.nodes[stack[pending]];
            if node.is_leaf() {
                let from = source(node.first, node.count).ok_or_else(fault)?;
                ids.get_mut(done..done + from.len()).ok_or_else(fault)?.copy_from_slice(from);
                done += from.len();
            } else {
                let [a, b] = self.children(stack[pending])?;
                *stack.get_mut(pending).ok_or_else(fault)? = b;
                *stack.get_mut(pending + 1).ok_or_else(fault)? = a;
                pending += 2;
            }
        }
        Ok(())
    }
}

/// One task's part of a round.
struct Share<'a> {
    slots: &'a [Slots],
    nodes: &'a mut [Node8],
    prim_ids: &'a mut [u32],
    next: &'a mut [Item],
    /// Place of `prim_ids[0]` in the whole tree.
    first_prim: usize,
    /// Index of the node that `next[0]` will become.
    first_node: usize,
}

/// Applies `f` to pairs, in parallel if there is more than one chunk of them.
fn for_each_chunk<A: Send, B: Sync>(
    out: &mut [A],
    input: &[B],
    f: impl Fn(&mut A, &B) -> Result<(), CollapseError> + Sync,
) -> Result<(), CollapseError> {
    let chunk =
        |(out, input): (&mut [A], &[B])| out.iter_mut().zip(input).try_for_each(|(a, b)| f(a, b));
    if out.len() <= GRAIN {
        return chunk((out, input));
    }
    out.par_chunks_mut(GRAIN).zip(input.par_chunks(GRAIN)).try_for_each(chunk)
}

const _: () = assert!(Bvh8::MAX_LEAF < MANY as usize);
