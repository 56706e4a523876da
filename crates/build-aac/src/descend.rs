//! Down the Morton tree and up again.

use crate::Aac;
use crate::combine::{Named, Set};
use niwaki_core::bottom_up::{Cluster, Forest, LeafRule, Slots};
use niwaki_core::morton::{Sorted, split};
use niwaki_core::{PrimRef, to_u32};

/// Primitives from which on both children of a node are tasks of their own.
const GRAIN: usize = 2048;

struct Context<'a> {
    prims: &'a [PrimRef],
    sorted: &'a Sorted,
    rule: &'a LeafRule,
    config: &'a Aac,
}

impl Aac {
    /// How many clusters a node of `prims` primitives hands on: f of section 3.2.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and of the order of the number of primitives"
    )]
    pub(crate) fn kept(&self, prims: usize) -> usize {
        let epsilon = f64::from(self.epsilon);
        let delta = self.delta as f64;
        let factor = delta.powf(0.5 + epsilon) / 2.0;
        // A share of rounding error must not add a cluster.
        ((factor * (prims as f64).powf(0.5 - epsilon) - 1e-6).ceil() as usize).max(1)
    }
}

impl Context<'_> {
    /// The clusters that places `first ..= last` hand on. Recursion is as deep as codes and places
    /// have bits: 95 at most.
    fn node(&self, first: usize, last: usize, mut slots: Slots<'_>) -> Set {
        let count = last - first + 1;
        let mut set = if count <= self.config.delta {
            let single = |place: usize| {
                let prim = &self.prims[self.sorted.order[place] as usize];
                let name = to_u32(place);
                Named { cluster: Cluster::single(prim.aabb(), name), name }
            };
            Set::new((first..=last).map(single).collect(), self.rule.scale)
        } else {
            let middle = split(&self.sorted.codes, first, last);
            let (left_slots, right_slots) = slots.reborrow().split_at(middle - first);
            let left = || self.node(first, middle - 1, left_slots);
            let right = || self.node(middle, last, right_slots);
            let (left, right) =
                if count >= GRAIN { rayon::join(left, right) } else { (left(), right()) };
            Set::union(&left, &right, self.rule.scale)
        };
        let whole = count == self.prims.len();
        let target = if whole { 1 } else { self.config.kept(count.max(self.config.delta)) };
        set.join(target, &mut slots, self.rule);
        set
    }
}

/// Joins all primitives, at least one, to one cluster.
pub(crate) fn join_all(
    prims: &[PrimRef],
    sorted: &Sorted,
    config: &Aac,
    rule: &LeafRule,
) -> (Cluster, Forest) {
    let mut forest = Forest::new(prims.len());
    let context = Context { prims, sorted, rule, config };
    let set = context.node(0, prims.len() - 1, forest.slots());
    (set.clusters[0].cluster, forest)
}
