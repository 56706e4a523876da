//! Rounds of choosing and joining until one cluster is left.

use crate::crowd;
use crate::search::{CHUNK, Kernel, Scratch, partner};
use niwaki_core::bottom_up::{Cluster, Filled, Forest, LeafRule, Slots};
use niwaki_core::to_u32;
use rayon::prelude::*;

/// Clusters that are closed up together.
const PART: usize = 1024;
/// A round over fewer clusters is too short to share.
const SHARED_FROM: usize = 4 * PART;
/// A round that joins fewer than one in this many clusters is followed by one that halves.
const SLOW: usize = 32;

/// Joins the clusters, at least one, to one.
pub(crate) fn join_all(
    mut clusters: Vec<Cluster>,
    radius: usize,
    rule: &LeafRule,
) -> (Cluster, Forest) {
    let count = clusters.len();
    let mut forest = Forest::new(count - 1);
    let mut next: Vec<Cluster> = bytemuck::zeroed_vec(count);
    let mut best = vec![0_u32; count];
    let kernel = Kernel::fastest();
    let scratch = || Scratch::new(radius, rule.scale, kernel);
    let mut own_scratch = scratch();
    let threads = rayon::current_num_threads();
    let mut made = 0;
    while made + 1 < count {
        clusters.truncate(count - made);
        let best = &mut best[..clusters.len()];
        let shared = threads > 1 && clusters.len() >= SHARED_FROM;
        if shared {
            best.par_chunks_mut(CHUNK).enumerate().for_each_init(scratch, |scratch, (i, best)| {
                scratch.nearest(&clusters, i * CHUNK, best);
            });
        } else {
            for (i, best) in best.chunks_mut(CHUNK).enumerate() {
                own_scratch.nearest(&clusters, i * CHUNK, best);
            }
        }
        let (filled, free) = forest.slots().split_at(made);
        let round = Round { clusters: &clusters, best, filled: filled.into_filled(), rule };
        let joined =
            if shared { round.join_shared(&mut next, free) } else { round.join(&mut next, free) };
        let slow = joined * SLOW < clusters.len();
        std::mem::swap(&mut clusters, &mut next);
        made += joined;
        if slow && made + 1 < count {
            clusters.truncate(count - made);
            let (filled, free) = forest.slots().split_at(made);
            made += crowd::halve(&clusters, radius, &mut next, filled.into_filled(), free, rule);
            std::mem::swap(&mut clusters, &mut next);
        }
    }
    (clusters[0], forest)
}

/// Clusters that have chosen.
struct Round<'a> {
    clusters: &'a [Cluster],
    best: &'a [u32],
    filled: Filled<'a>,
    rule: &'a LeafRule,
}

/// Lists for one part.
struct Lists {
    /// Places of clusters that stay, if only as the first of a pair.
    kept: Box<[u32; PART]>,
    /// Pairs: the new place of the first, and the old place of the second.
    pairs: Box<[[u32; 2]; PART]>,
}

impl Lists {
    fn new() -> Self {
        Self { kept: Box::new([0; PART]), pairs: Box::new([[0; 2]; PART]) }
    }
}

impl Round<'_> {
    /// Whether the cluster at a place is the first or the second of two that chose each other.
    #[inline]
    fn state(&self, place: usize) -> (bool, bool, usize) {
        let number = self.best[place];
        let other = partner(place, number);
        let mutual = self.best[other] == number;
        (mutual & (other > place), mutual & (other < place), other)
    }

    /// Joins all pairs that chose each other; returns how many.
    fn join(&self, mut next: &mut [Cluster], mut slots: Slots<'_>) -> usize {
        let mut lists = Lists::new();
        let first = slots.first();
        for start in (0..self.clusters.len()).step_by(PART) {
            let (kept, joined) = self.join_part(start, next, slots.reborrow(), &mut lists);
            next = &mut next[kept..];
            slots = slots.split_at(joined).1;
        }
        slots.first() - first
    }

    /// As [`Round::join`], on all threads.
    fn join_shared(&self, mut next: &mut [Cluster], mut slots: Slots<'_>) -> usize {
        let first = slots.first();
        let counts: Vec<usize> = (0..self.clusters.len().div_ceil(PART))
            .into_par_iter()
            .map(|i| {
                let places = i * PART..self.clusters.len().min((i + 1) * PART);
                let states = places.map(|place| {
                    let (begins, ends, _) = self.state(place);
                    usize::from(begins) << 32 | usize::from(ends)
                });
                states.sum()
            })
            .collect();
        let mut tasks = Vec::with_capacity(counts.len());
        for (part, count) in self.clusters.chunks(PART).zip(counts) {
            let (begun, ended) = (count >> 32, count & 0xffff_ffff);
            let (to, after) = next.split_at_mut(part.len() - ended);
            let (to_slots, slots_after) = slots.split_at(begun);
            tasks.push((to, to_slots));
            (next, slots) = (after, slots_after);
        }
        let joined = slots.first() - first;
        tasks.into_par_iter().enumerate().for_each_init(Lists::new, |lists, (i, (to, slots))| {
            self.join_part(i * PART, to, slots, lists);
        });
        joined
    }

    /// Closes up the part that begins at `start`; returns how many clusters it keeps and how many
    /// pairs it joins. What comes next cannot be guessed, so loops take no branches on it.
    fn join_part(
        &self,
        start: usize,
        to: &mut [Cluster],
        mut slots: Slots<'_>,
        lists: &mut Lists,
    ) -> (usize, usize) {
        let (mut kept, mut joined) = (0, 0);
        for place in start..self.clusters.len().min(start + PART) {
            let (begins, ends, other) = self.state(place);
            lists.kept[kept] = to_u32(place);
            lists.pairs[joined] = [to_u32(kept), to_u32(other)];
            joined += usize::from(begins);
            kept += usize::from(!ends);
        }
        for (to, &place) in to.iter_mut().zip(&lists.kept[..kept]) {
            *to = self.clusters[place as usize];
        }
        let first = to_u32(slots.first());
        for (&[place, other], slot) in lists.pairs[..joined].iter().zip(first..) {
            let to = &mut to[place as usize];
            let other = &self.clusters[other as usize];
            *to = slots.join_filled(self.filled, to, other, slot, self.rule);
        }
        (kept, joined)
    }
}
