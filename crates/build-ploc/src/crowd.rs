//! What to do where few clusters choose each other.
//!
//! Among nested boxes the nearest neighbour of each is a smaller one, down to the smallest two,
//! which alone choose each other: a round that joins one pair costs as much as one that joins a
//! third of all. Such a round is followed by one that halves the list for certain: blocks of
//! consecutive clusters are joined by themselves, nearest pair first, until half are left.

use crate::search::distance;
use niwaki_core::bottom_up::{Cluster, Filled, LeafRule, Slots};
use niwaki_core::to_u32;
use rayon::prelude::*;

/// Clusters of a block.
const BLOCK: usize = 256;

/// Halves each block; returns how many pairs were joined.
pub(crate) fn halve(
    clusters: &[Cluster],
    radius: usize,
    next: &mut [Cluster],
    filled: Filled<'_>,
    mut slots: Slots<'_>,
    rule: &LeafRule,
) -> usize {
    // Each full block makes as many pairs as it keeps clusters; the last one pair fewer if odd.
    let joined: usize = clusters.chunks(BLOCK).map(|block| block.len() / 2).sum();
    let kept = next[..clusters.len() - joined].chunks_mut(BLOCK / 2);
    let tasks: Vec<_> = clusters
        .chunks(BLOCK)
        .zip(kept)
        .map(|(block, to)| {
            let own;
            (own, slots) = std::mem::take(&mut slots).split_at(block.len() / 2);
            (block, to, own)
        })
        .collect();
    tasks.into_par_iter().for_each(|(block, to, slots)| {
        halve_block(block, radius, to, filled, slots, rule);
    });
    joined
}

/// Joins the nearest pair within the radius until as many pairs are made as there is room for.
fn halve_block(
    block: &[Cluster],
    radius: usize,
    to: &mut [Cluster],
    filled: Filled<'_>,
    mut slots: Slots<'_>,
    rule: &LeafRule,
) {
    let mut live = block.to_vec();
    // Distance to the nearest of those behind within the radius, and how far behind it stands.
    let nearest = |live: &[Cluster], place: usize| {
        let mut best = (f32::INFINITY, usize::MAX);
        for offset in 1..=radius.min(live.len() - 1 - place) {
            // Neither infinite nor NaN, so that every pair is better than none.
            let d = distance(&live[place], &live[place + offset], rule.scale);
            let d = if d < f32::MAX { d } else { f32::MAX };
            if d < best.0 {
                best = (d, offset);
            }
        }
        best
    };
    let mut best: Vec<_> = (0..live.len()).map(|place| nearest(&live, place)).collect();
    for slot in slots.first()..slots.first() + slots.len() {
        let mut lower = 0;
        for place in 1..best.len() {
            if best[place].0 < best[lower].0 {
                lower = place;
            }
        }
        let upper = lower + best[lower].1;
        live[lower] = slots.join_filled(filled, &live[lower], &live[upper], to_u32(slot), rule);
        live.remove(upper);
        best.remove(upper);
        // All that saw either, or see one more now.
        let seen = lower.saturating_sub(radius)..upper.min(live.len());
        for (place, best) in seen.clone().zip(&mut best[seen]) {
            *best = nearest(&live, place);
        }
    }
    to.copy_from_slice(&live);
}
