//! Trees that are joined from the primitives up: what clustering builders share.
//!
//! A [`Cluster`] is a subtree that waits for a partner. Joining two fills a slot of a [`Forest`] and
//! makes a new cluster that names the slot; callers choose slots so that parallel tasks have their
//! own ([`Slots`]). A join also settles, by the surface area heuristic, whether the subtree is
//! cheaper as one leaf ([`LeafRule`]), so that no second pass over the tree is needed.
//! [`Forest::tree`] lays the nodes out.

mod finish;

use crate::builder::{check_max_leaf_size, check_sah};
use crate::{Aabb, AreaScale, BuildError, SahConstants};
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

/// Set in [`Cluster::size`] of subtrees that are not leaves, and in the links of a leaf that name
/// a primitive.
const FLAG: u32 = 1 << 31;

/// A finished subtree: 32 bytes, one 256-bit register. Lanes 0–2 hold the smallest coordinates,
/// lanes 4–6 the largest.
///
/// Aligned to 16 bytes, not 32: with more than `malloc` gives, an allocator cannot take zeroed
/// memory as it comes from the system, and all of it would be touched twice.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(16))]
pub struct Cluster {
    /// Smallest coordinates of everything below.
    pub min: Vec3,
    /// The place of its only primitive, or the slot of the join that made it.
    link: u32,
    /// Largest coordinates of everything below.
    pub max: Vec3,
    /// Primitives below; with [`FLAG`] for an inner node.
    size: u32,
}

/// The two children of an inner node.
type Pair = [Cluster; 2];

/// What else a slot holds. For an inner node its cost (as bits) and the number of inner nodes in
/// its subtree; for a leaf of several primitives the links of its two parts, with [`FLAG`] where
/// that is a single primitive's.
type Note = [u32; 2];

/// The note of a leaf one of whose parts was no leaf: the parts are in the slot's pair. No link,
/// as places are below [`crate::builder::MAX_PRIMS`].
const LEAF_OF_NODES: Note = [u32::MAX; 2];

impl Cluster {
    /// The primitive at `place`, which is below 2³¹.
    #[must_use]
    #[inline]
    pub const fn single(bounds: Aabb, place: u32) -> Self {
        Self { min: bounds.min, link: place, max: bounds.max, size: 1 }
    }

    /// The box.
    #[must_use]
    #[inline]
    pub const fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// Primitives below.
    #[must_use]
    #[inline]
    pub const fn prims(&self) -> u32 {
        self.size & !FLAG
    }

    const fn is_leaf(&self) -> bool {
        self.size & FLAG == 0
    }

    /// Its cost and number of inner nodes.
    #[inline]
    fn note(&self, notes: &[Note], first: usize, rule: &LeafRule) -> (f32, u32) {
        if self.is_leaf() {
            (rule.leaf_cost(self.aabb().half_area(rule.scale), self.size), 0)
        } else {
            let [cost, inner_nodes] = notes[self.link as usize - first];
            (f32::from_bits(cost), inner_nodes)
        }
    }

    /// What a leaf of several primitives keeps of its parts.
    const fn part_link(&self) -> u32 {
        if self.size == 1 { self.link | FLAG } else { self.link }
    }
}

/// All joins of a tree that is being made.
#[derive(Debug, Default)]
pub struct Forest {
    pairs: Vec<Pair>,
    notes: Vec<Note>,
}

/// Some slots of a [`Forest`], free or filled, that one task owns.
#[derive(Debug, Default)]
pub struct Slots<'a> {
    pairs: &'a mut [Pair],
    notes: &'a mut [Note],
    first: usize,
}

/// Slots that are filled and shared by tasks that fill others.
#[derive(Clone, Copy, Debug)]
pub struct Filled<'a> {
    notes: &'a [Note],
    first: usize,
}

impl Forest {
    /// Bytes of a slot.
    pub const SLOT_BYTES: usize = size_of::<Pair>() + size_of::<Note>();

    /// Room for `slots` joins; a tree over `n` primitives takes `n − 1`.
    #[must_use]
    pub fn new(slots: usize) -> Self {
        Self { pairs: bytemuck::zeroed_vec(slots), notes: bytemuck::zeroed_vec(slots) }
    }

    /// All slots, from number 0 on.
    #[must_use]
    pub fn slots(&mut self) -> Slots<'_> {
        Slots { pairs: &mut self.pairs, notes: &mut self.notes, first: 0 }
    }
}

impl<'a> Slots<'a> {
    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.notes.len()
    }

    /// True if there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.notes.is_empty()
    }

    /// The number of the first.
    #[must_use]
    pub const fn first(&self) -> usize {
        self.first
    }

    /// The same slots for a shorter time.
    #[must_use]
    pub const fn reborrow(&mut self) -> Slots<'_> {
        Slots { pairs: self.pairs, notes: self.notes, first: self.first }
    }

    /// The first `count` slots, and the rest.
    ///
    /// # Panics
    /// If there are fewer.
    #[must_use]
    pub const fn split_at(self, count: usize) -> (Self, Self) {
        let (left_pairs, right_pairs) = self.pairs.split_at_mut(count);
        let (left_notes, right_notes) = self.notes.split_at_mut(count);
        (
            Self { pairs: left_pairs, notes: left_notes, first: self.first },
            Self { pairs: right_pairs, notes: right_notes, first: self.first + count },
        )
    }

    /// Gives up filling these.
    #[must_use]
    pub const fn into_filled(self) -> Filled<'a> {
        Filled { notes: self.notes, first: self.first }
    }

    /// Joins two clusters whose own joins are in these slots, and keeps them in free slot number
    /// `slot`.
    ///
    /// # Panics
    /// If one of the slots is not one of these.
    #[inline]
    pub fn join(&mut self, left: &Cluster, right: &Cluster, slot: u32, rule: &LeafRule) -> Cluster {
        let notes = [left, right].map(|c| c.note(self.notes, self.first, rule));
        self.put(left, right, notes, slot, rule)
    }

    /// Joins two clusters whose own joins are in `filled`, which come before these slots, or in
    /// these, and keeps them in free slot number
    /// `slot`.
    ///
    /// # Panics
    /// If `slot` is not one of these, or a slot of the clusters in neither.
    #[inline]
    pub fn join_filled(
        &mut self,
        filled: Filled<'_>,
        left: &Cluster,
        right: &Cluster,
        slot: u32,
        rule: &LeafRule,
    ) -> Cluster {
        let notes = [left, right].map(|c| {
            if (c.link as usize) < self.first {
                c.note(filled.notes, filled.first, rule)
            } else {
                c.note(self.notes, self.first, rule)
            }
        });
        self.put(left, right, notes, slot, rule)
    }

    #[inline]
    fn put(
        &mut self,
        left: &Cluster,
        right: &Cluster,
        [(left_cost, left_nodes), (right_cost, right_nodes)]: [(f32, u32); 2],
        slot: u32,
        rule: &LeafRule,
    ) -> Cluster {
        let bounds = left.aabb().union(right.aabb());
        let prims = left.prims() + right.prims();
        let (cost, is_leaf) =
            rule.join(bounds.half_area(rule.scale), prims, left_cost + right_cost);
        let at = slot as usize - self.first;
        let size = if is_leaf && left.is_leaf() && right.is_leaf() {
            self.notes[at] = [left.part_link(), right.part_link()];
            prims
        } else {
            self.pairs[at] = [*left, *right];
            if is_leaf {
                self.notes[at] = LEAF_OF_NODES;
                prims
            } else {
                self.notes[at] = [cost.to_bits(), left_nodes + right_nodes + 1];
                prims | FLAG
            }
        };
        Cluster { min: bounds.min, link: slot, max: bounds.max, size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: LeafRule =
        LeafRule { max_leaf_size: 1, sah: SahConstants::THESIS_IV, scale: AreaScale::ONE };

    fn unit(place: u32) -> Cluster {
        let low = Vec3::X * place as f32;
        Cluster::single(Aabb::new(low, low + Vec3::ONE), place)
    }

    /// Joins the clusters one after the other to the first.
    fn chain(count: u32, rule: &LeafRule) -> (Forest, Cluster) {
        let mut forest = Forest::new(count as usize - 1);
        let mut slots = forest.slots();
        let root =
            (1..count).fold(unit(0), |all, place| slots.join(&all, &unit(place), place - 1, rule));
        (forest, root)
    }

    #[test]
    fn chains_of_a_million_do_not_overflow_the_stack() {
        for max_leaf_size in [1, usize::MAX] {
            // With free primitives everything is one leaf, if leaves may be as large.
            let sah = SahConstants { inner: 1.0, leaf: 0.0, triangle: 0.0 };
            let (forest, root) = chain(1_000_000, &LeafRule { max_leaf_size, sah, ..RULE });
            let bvh = forest.tree(&root, |place| place);
            assert_eq!(bvh.nodes.len(), if max_leaf_size == 1 { 1_999_999 } else { 1 });
            assert!(bvh.prim_ids.iter().copied().eq(0..1_000_000));
        }
    }

    #[test]
    fn nodes_follow_each_other_depth_first() {
        let (forest, root) = chain(4, &RULE);
        let bvh = forest.tree(&root, |place| place + 10);
        assert_eq!(bvh.prim_ids, [10, 11, 12, 13]);
        let links: Vec<_> = bvh.nodes.iter().map(|n| (n.first, n.count)).collect();
        assert_eq!(links, [(1, 0), (3, 0), (3, 1), (5, 0), (2, 1), (0, 1), (1, 1)]);
        assert_eq!(bvh.bounds(), Aabb::new(Vec3::ZERO, Vec3::new(4.0, 1.0, 1.0)));
    }

    /// A subtree that is cheaper as a leaf absorbs one that was not.
    #[test]
    fn leaves_may_hold_what_were_inner_nodes() {
        let rule = LeafRule { max_leaf_size: 3, ..RULE };
        let small = |x: f32, place| {
            let low = Vec3::X * x;
            Cluster::single(Aabb::new(low, low + Vec3::splat(0.1)), place)
        };
        let mut forest = Forest::new(3);
        let mut slots = forest.slots();
        // Two small boxes far apart stay two; with a box around both, one leaf is cheapest.
        let sah = SahConstants { inner: 1.5, ..SahConstants::THESIS_IV };
        let rule = LeafRule { sah, ..rule };
        let apart = slots.join(&small(0.0, 0), &small(9.9, 1), 0, &rule);
        assert!(!apart.is_leaf());
        let around = Cluster::single(apart.aabb(), 2);
        let all = slots.join(&apart, &around, 1, &rule);
        assert!(all.is_leaf() && all.prims() == 3);
        let more = Forest::tree(&forest, &all, |place| place);
        assert_eq!((more.nodes.len(), &more.prim_ids[..]), (1, &[0, 1, 2][..]));
    }
}
