//! Divides one large set with all threads. Chunks have a fixed size and are combined in order, so
//! the number of threads does not show.

use crate::divide::{Halves, Rule, Task, clip_all, is_empty, may_split, partition, replace, share};
use crate::sets::{Plane, Set, Sides};
use niwaki_core::partition::join_chunks;
use niwaki_core::{Clip, PrimRef};
use rayon::prelude::*;

/// References of one piece of work: half a megabyte.
const CHUNK: usize = 1 << 14;

/// As the step of one thread.
pub(crate) fn step<'a, C: Clip + ?Sized>(task: Task<'a>, rule: &Rule, clip: &C) -> [Task<'a>; 2] {
    // Only small sets have their references at the end.
    let Task { region, mut len, first, centroids, .. } = task;
    let Some(plane) = Plane::middle(&centroids) else {
        return share(region, len, first, len / 2, [centroids; 2], copy);
    };
    let chunks: Vec<(Sides, Vec<u32>)> = region[..len]
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut overlapping = Vec::new();
            let sides = Sides::measure(chunk, plane, &mut overlapping);
            (sides, overlapping)
        })
        .collect();
    let sides = chunks.iter().fold(Sides::EMPTY, |sum, (sides, _)| sum.union(sides));
    let mut chosen = sides.unsplit();
    if may_split(&sides, plane, rule, len, region.len()) {
        let clipped: Vec<([Set; 2], Vec<Halves>)> = region[..len]
            .par_chunks(CHUNK)
            .zip(&chunks)
            .map(|(chunk, (_, overlapping))| {
                let mut halves = Vec::new();
                let sets = clip_all(chunk, overlapping, plane, clip, &mut halves);
                (sets, halves)
            })
            .collect();
        let sets = clipped
            .iter()
            .fold([Set::EMPTY; 2], |sum, (sets, _)| [sum[0].union(sets[0]), sum[1].union(sets[1])]);
        let split = sides.split(&sets);
        if rule.prefers(&split, &chosen) {
            chosen = split;
            len += apply(region, len, &chunks, &clipped);
        }
    }
    let fronts: Vec<usize> =
        region[..len].par_chunks_mut(CHUNK).map(|chunk| partition(chunk, plane)).collect();
    let left = join_chunks(&mut region[..len], CHUNK, &fronts);
    share(region, len, first, left, chosen.map(|set| set.centroids()), copy)
}

/// Splits the overlapping references of all chunks; returns how many that adds.
fn apply(
    region: &mut [PrimRef],
    len: usize,
    chunks: &[(Sides, Vec<u32>)],
    clipped: &[([Set; 2], Vec<Halves>)],
) -> usize {
    let (prims, mut room) = region.split_at_mut(len);
    let mut added = 0;
    let mut places = Vec::with_capacity(chunks.len());
    for (_, halves) in clipped {
        let count = halves.iter().filter(|halves| !halves.iter().any(is_empty)).count();
        let here;
        (here, room) = room.split_at_mut(count);
        places.push(here);
        added += count;
    }
    prims.par_chunks_mut(CHUNK).zip(chunks).zip(clipped).zip(places).for_each(
        |(((prims, (_, overlapping)), (_, halves)), room)| {
            replace(prims, room, overlapping, halves);
        },
    );
    added
}

fn copy(from: &[PrimRef], to: &mut [PrimRef]) {
    to.par_chunks_mut(CHUNK).zip(from.par_chunks(CHUNK)).for_each(|(to, from)| {
        to.copy_from_slice(from);
    });
}
