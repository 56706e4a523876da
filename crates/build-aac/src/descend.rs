//! Down the Morton tree and up again.

use crate::Aac;
use crate::combine::combine;
use niwaki_core::bottom_up::{Cluster, Forest, LeafRule, Slots};
use niwaki_core::morton::{Sorted, split};
use niwaki_core::{PrimRef, to_u32};

/// Primitives from which on both children of a node are tasks of their own.
const GRAIN: usize = 2048;

/// A cluster and the place that names it: the first of its primitives'. A join gives the slot of
/// the pair the name of the second cluster, which ends there, so tasks need no common counter.
pub(crate) type Named = (Cluster, u32);

struct Context<'a> {
    prims: &'a [PrimRef],
    sorted: &'a Sorted,
    rule: &'a LeafRule,
    delta: usize,
    exponent: f64,
    factor: f64,
}

impl Context<'_> {
    /// How many clusters a node of `prims` primitives hands on: f of section 3.2.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive and below the number of primitives"
    )]
    fn kept(&self, prims: usize) -> usize {
        ((self.factor * (prims as f64).powf(self.exponent)).ceil() as usize).max(1)
    }

    /// The clusters that places `first ..= last` hand on. Recursion is as deep as codes and places
    /// have bits: 95 at most.
    fn node(&self, first: usize, last: usize, mut slots: Slots<'_>) -> Vec<Named> {
        let count = last - first + 1;
        let mut clusters = if count <= self.delta {
            (first..=last)
                .map(|place| {
                    let prim = &self.prims[self.sorted.order[place] as usize];
                    (Cluster::single(prim.aabb(), to_u32(place)), to_u32(place))
                })
                .collect()
        } else {
            let middle = split(&self.sorted.codes, first, last);
            let (left_slots, right_slots) = slots.reborrow().split_at(middle - first);
            let left = || self.node(first, middle - 1, left_slots);
            let right = || self.node(middle, last, right_slots);
            let (mut left, right) =
                if count >= GRAIN { rayon::join(left, right) } else { (left(), right()) };
            left.extend(right);
            left
        };
        combine(&mut clusters, self.kept(count.max(self.delta)), &mut slots, self.rule);
        clusters
    }
}

/// Joins all primitives, at least one, to one cluster; the pair of places is the place that ended.
pub(crate) fn join_all(
    prims: &[PrimRef],
    sorted: &Sorted,
    config: &Aac,
    rule: &LeafRule,
) -> (Cluster, Forest) {
    let epsilon = f64::from(config.epsilon);
    let delta = config.delta;
    let context = Context {
        prims,
        sorted,
        rule,
        delta,
        exponent: 0.5 - epsilon,
        factor: (delta as f64).powf(0.5 + epsilon) / 2.0,
    };
    let mut forest = Forest::new(prims.len());
    let mut clusters = context.node(0, prims.len() - 1, forest.slots());
    combine(&mut clusters, 1, &mut forest.slots(), rule);
    (clusters[0].0, forest)
}
