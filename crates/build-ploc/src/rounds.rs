//! Rounds of choosing and joining until one cluster is left.

use crate::crowd;
use crate::search::{CHUNK, Kernel, Scratch, partner};
use niwaki_core::bottom_up::{Cluster, LeafRule, Pair};
use niwaki_core::to_u32;
use rayon::prelude::*;

/// Clusters that one task closes up.
const PART: usize = 1024;
/// A round that joins fewer than one in this many clusters is followed by one that halves.
const SLOW: usize = 32;

/// Joins the clusters, at least one, to one; pairs are in the order in which they were made.
pub(crate) fn join_all(
    mut clusters: Vec<Cluster>,
    radius: usize,
    rule: &LeafRule,
) -> (Cluster, Vec<Pair>) {
    let count = clusters.len();
    let mut pairs: Vec<Pair> = bytemuck::zeroed_vec(count - 1);
    let mut next: Vec<Cluster> = bytemuck::zeroed_vec(count);
    let mut best = vec![0_u32; count];
    let kernel = Kernel::fastest();
    let scratch = || Scratch::new(radius, rule.scale, kernel);
    let mut made = 0;
    let mut live = count;
    while live > 1 {
        let best = &mut best[..live];
        best.par_chunks_mut(CHUNK).enumerate().for_each_init(scratch, |scratch, (i, best)| {
            scratch.nearest(&clusters[..live], i * CHUNK, best);
        });
        let joined = join(&clusters[..live], best, &mut next, &mut pairs[made..], made, rule);
        std::mem::swap(&mut clusters, &mut next);
        made += joined;
        live -= joined;
        if joined * SLOW < live {
            let halved =
                crowd::halve(&clusters[..live], radius, &mut next, &mut pairs[made..], made, rule);
            std::mem::swap(&mut clusters, &mut next);
            made += halved;
            live -= halved;
        }
    }
    (clusters[0], pairs)
}

/// Joins all pairs that chose each other; returns how many.
fn join(
    clusters: &[Cluster],
    best: &[u32],
    next: &mut [Cluster],
    pairs: &mut [Pair],
    made: usize,
    rule: &LeafRule,
) -> usize {
    // The other place of the pair, if both chose it.
    let mate = |place: usize| {
        let other = partner(place, best[place]);
        (best[other] == best[place]).then_some(other)
    };
    // Pairs that begin and that end in each part.
    let counts: Vec<[usize; 2]> = best
        .par_chunks(PART)
        .enumerate()
        .map(|(i, part)| {
            let mut counts = [0; 2];
            for place in i * PART..i * PART + part.len() {
                if let Some(other) = mate(place) {
                    counts[usize::from(other < place)] += 1;
                }
            }
            counts
        })
        .collect();
    let mut tasks = Vec::with_capacity(counts.len());
    let (mut next, mut pairs) = (next, pairs);
    let mut first_pair = made;
    for (part, &[begun, ended]) in clusters.chunks(PART).zip(&counts) {
        let (to, after) = next.split_at_mut(part.len() - ended);
        let (to_pairs, pairs_after) = pairs.split_at_mut(begun);
        tasks.push((to, to_pairs, first_pair));
        (next, pairs) = (after, pairs_after);
        first_pair += begun;
    }
    tasks.into_par_iter().enumerate().for_each(|(i, (to, to_pairs, first_pair))| {
        let (mut kept, mut joined) = (0, 0);
        for place in i * PART..(i * PART + PART).min(clusters.len()) {
            let cluster = &clusters[place];
            to[kept] = match mate(place) {
                Some(other) if other < place => continue,
                Some(other) => {
                    to_pairs[joined] = [*cluster, clusters[other]];
                    let pair = to_u32(first_pair + joined);
                    joined += 1;
                    Cluster::join(cluster, &clusters[other], pair, rule)
                }
                None => *cluster,
            };
            kept += 1;
        }
    });
    first_pair - made
}
