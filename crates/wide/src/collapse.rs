//! Collapse of a binary tree, whichever way the children of a wide node are chosen.

use crate::{
    Bvh16, Child, CollapseError, CollapseMethod, CollapseSettings, WideBvh, WideNode,
    bottom_up::{MANY, subtree_counts},
    optimal::Costs,
};
use niwaki_core::{AreaScale, Bvh, memory::prefer_large_pages, to_u32};
use rayon::prelude::*;

/// What becomes a slot of a wide node.
#[derive(Clone, Copy, Default)]
pub(crate) struct Item {
    /// A node of the binary tree.
    pub(crate) node: u32,
    /// Where `count > 0`, only this part of a leaf too large for one slot.
    pub(crate) first: u32,
    pub(crate) count: u32,
    /// References below: those of `count` where that is set, saturated at [`MANY`] otherwise.
    pub(crate) refs: u32,
    /// Becomes a leaf, not a node.
    pub(crate) is_leaf: bool,
}

/// The chosen children of one wide node.
#[derive(Clone, Copy)]
pub(crate) struct Slots<const W: usize> {
    pub(crate) items: [Item; W],
    pub(crate) used: usize,
    /// How many are nodes, not leaves.
    inner: usize,
    /// References of those that are leaves.
    prims: usize,
}

impl<const W: usize> Default for Slots<W> {
    fn default() -> Self {
        Self { items: [Item::default(); W], used: 0, inner: 0, prims: 0 }
    }
}

impl<const W: usize> Slots<W> {
    /// Takes the next slot; there must be one.
    pub(crate) fn push(&mut self, item: Item) {
        self.items[self.used] = item;
        self.used += 1;
    }
}

/// Wide nodes that one task chooses children for.
const GRAIN: usize = 128;
/// Tasks in flight per thread between two rounds of handing out places.
const TASKS_PER_THREAD: usize = 8;

impl<const W: usize> WideBvh<W> {
    /// Collapses a binary tree on the current rayon pool: which nodes of it become the children of
    /// a wide node, [`CollapseSettings::method`] says. The result does not depend on the number of
    /// threads.
    ///
    /// Leaves with more references than a wide tree's may hold are divided evenly among nodes with
    /// equal boxes.
    ///
    /// # Errors
    /// [`CollapseError`]: a malformed tree, too many references, or a setting out of range.
    pub fn collapse(bvh: &Bvh, settings: &CollapseSettings) -> Result<Self, CollapseError> {
        settings.check()?;
        if bvh.prim_ids.len() > Self::MAX_REFERENCES {
            return Err(CollapseError::TooManyReferences {
                count: bvh.prim_ids.len(),
                max: Self::MAX_REFERENCES,
            });
        }
        if bvh.nodes.is_empty() {
            return Ok(Self::default());
        }
        let mut collapse = Collapse {
            bvh,
            counts: subtree_counts(&bvh.nodes),
            settings: *settings,
            max_leaf: settings.max_leaf.min(Self::MAX_LEAF),
            scale: AreaScale::of(&bvh.bounds()),
            least_weight: 0.0,
            least_costs: Vec::new(),
        };
        if settings.method == CollapseMethod::Optimal {
            collapse.least_weight = collapse.find_least_weight();
            collapse.least_costs = collapse.least_costs();
        }
        collapse.run()
    }
}

pub(crate) struct Collapse<'a, const W: usize> {
    pub(crate) bvh: &'a Bvh,
    /// References below each node, saturated.
    pub(crate) counts: Vec<u8>,
    pub(crate) settings: CollapseSettings,
    /// The most references of a leaf of this width.
    pub(crate) max_leaf: usize,
    scale: AreaScale,
    /// For [`CollapseMethod::Optimal`]: what every visit weighs at least.
    pub(crate) least_weight: f32,
    /// For [`CollapseMethod::Optimal`], one a binary node.
    least_costs: Vec<Costs<W>>,
}

impl<const W: usize> Collapse<'_, W> {
    fn run(&self) -> Result<WideBvh<W>, CollapseError> {
        // Room for twice the nodes that are usual.
        let mut nodes = Vec::with_capacity(self.bvh.nodes.len() / 6 + 1);
        prefer_large_pages(nodes.spare_capacity_mut());
        let mut result = WideBvh {
            nodes,
            prim_ids: Vec::with_capacity(self.bvh.prim_ids.len()),
            bounds: Some(self.bvh.bounds()),
            levels: 0,
        };
        let threads = rayon::current_num_threads();
        let round = if threads == 1 { GRAIN } else { GRAIN * threads * TASKS_PER_THREAD };
        let mut level = vec![self.item(0)?];
        let mut next = Vec::new();
        let mut slots: Vec<Slots<W>> = Vec::with_capacity(round);
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

    /// The item for a node, a leaf if it fits into one.
    pub(crate) fn item(&self, node: usize) -> Result<Item, CollapseError> {
        let refs = u32::from(*self.counts.get(node).ok_or_else(|| self.malformed(node))?);
        Ok(Item { node: to_u32(node), first: 0, count: 0, refs, is_leaf: self.fits(node) })
    }

    fn malformed(&self, node: usize) -> CollapseError {
        CollapseError::Malformed { node, nodes: self.bvh.nodes.len() }
    }

    /// True if all references below a node fit into one leaf.
    pub(crate) fn fits(&self, node: usize) -> bool {
        usize::from(self.counts[node]) <= self.max_leaf
    }

    pub(crate) fn area(&self, node: usize) -> f32 {
        self.bvh.nodes[node].aabb().half_area(self.scale)
    }

    /// The checked children of an inner node.
    pub(crate) fn children(&self, node: usize) -> Result<[usize; 2], CollapseError> {
        let first = self.bvh.nodes[node].first as usize;
        if first > node && first + 1 < self.bvh.nodes.len() {
            Ok([first, first + 1])
        } else {
            Err(self.malformed(node))
        }
    }

    /// Chooses up to `W` children for the wide node that stands for `root`.
    fn choose(&self, root: Item) -> Result<Slots<W>, CollapseError> {
        let mut slots = if self.bvh.nodes[root.node as usize].is_leaf() {
            self.divide_leaf(root)?
        } else if self.settings.method == CollapseMethod::Optimal {
            self.choose_optimally(root, &self.least_costs)?
        } else {
            self.choose_greedily(root)?
        };
        // Rays that look for any hit try the last slot first, and a leaf may end the search at
        // once. (To order the leaves, or all children, by area as well did not pay on average.)
        slots.items[..slots.used].sort_by_key(|item| item.is_leaf);
        for item in &slots.items[..slots.used] {
            if item.is_leaf {
                slots.prims += item.refs as usize;
            } else {
                slots.inner += 1;
            }
        }
        Ok(slots)
    }

    /// Shares a leaf, or a part of one, evenly among the slots.
    fn divide_leaf(&self, item: Item) -> Result<Slots<W>, CollapseError> {
        let node = &self.bvh.nodes[item.node as usize];
        let (first, count) =
            if item.count > 0 { (item.first, item.count) } else { (node.first, node.count) };
        if (first as usize).saturating_add(count as usize) > self.bvh.prim_ids.len() {
            return Err(self.malformed(item.node as usize));
        }
        let parts = count.div_ceil(to_u32(self.max_leaf)).min(to_u32(W));
        let (whole, rest) = (count / parts, count % parts);
        let start = |part: u32| whole * part + rest.min(part);
        let mut slots = Slots::default();
        for part in 0..parts {
            let count = start(part + 1) - start(part);
            slots.push(Item {
                node: item.node,
                first: first + start(part),
                count,
                refs: count,
                is_leaf: count as usize <= self.max_leaf,
            });
        }
        Ok(slots)
    }

    /// Appends the nodes of `slots`, their references and the next level's items, in order.
    fn place(
        &self,
        slots: &[Slots<W>],
        result: &mut WideBvh<W>,
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
        result.nodes.resize(node_base + slots.len(), WideNode::empty(0));
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

    fn emit(&self, share: Share<'_, W>) -> Result<(), CollapseError> {
        let mut prim = 0;
        let mut inner = 0;
        for (slots, out) in share.slots.iter().zip(share.nodes) {
            let mut node = WideNode::empty(to_u32(share.first_prim + prim));
            node.prim_count = to_u32(slots.prims);
            for item in &slots.items[..slots.used] {
                let source = &self.bvh.nodes[item.node as usize];
                let child = if item.is_leaf {
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
        // Every pending subtree holds a reference, and there are at most W; never do all of them
        // wait while one is looked at.
        let mut stack = [0; W];
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
struct Share<'a, const W: usize> {
    slots: &'a [Slots<W>],
    nodes: &'a mut [WideNode<W>],
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

const _: () = assert!(Bvh16::MAX_LEAF < MANY as usize);
