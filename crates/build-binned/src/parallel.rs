//! Partitioning of large nodes with all threads. Chunks have a fixed size and are combined in
//! order, so the number of threads does not show.

use niwaki_core::PrimRef;
use niwaki_core::bins::{CHUNK, Corners, Kernel, Mapping, Parted, Split};
use rayon::prelude::*;
use std::ops::Range;

/// As [`Kernel::partition`], in place: every chunk is partitioned, then what stands on the wrong
/// side of the common border is exchanged.
pub(crate) fn partition(
    kernel: Kernel,
    prims: &mut [PrimRef],
    mapping: &Mapping,
    split: &Split,
) -> Parted {
    let chunks: Vec<Parted> =
        prims.par_chunks_mut(CHUNK).map(|chunk| kernel.partition(chunk, mapping, split)).collect();
    let left = chunks.iter().map(|c| c.left).sum();
    let centroids = chunks.iter().fold([Corners::EMPTY; 2], |sum, chunk| {
        [0, 1].map(|side| sum[side].union(&chunk.centroids[side]))
    });

    // Runs on the wrong side: above the split in front of the border, and below it behind.
    let runs = |wrong: fn(usize, usize, usize, usize) -> Range<usize>| {
        let starts = (0..).step_by(CHUNK);
        let bounds = chunks.iter().zip(starts).map(move |(c, start)| (start, start + c.left));
        bounds.map(move |(start, middle)| wrong(start, middle, start + CHUNK, left))
    };
    let in_front = runs(|_, middle, end, left| middle..end.min(left));
    let behind = runs(|start, middle, _, left| start.max(left)..middle);
    let (front, back) = prims.split_at_mut(left);
    let mut back = carve(back, left, behind).into_iter();
    let mut to: &mut [PrimRef] = &mut [];
    let mut exchanges = Vec::new();
    for mut from in carve(front, 0, in_front) {
        while !from.is_empty() {
            if to.is_empty() {
                // Both sides have the same number of primitives on the wrong side.
                let Some(next) = back.next() else { break };
                to = next;
            }
            let len = from.len().min(to.len());
            let (a, b);
            (a, from) = from.split_at_mut(len);
            (b, to) = to.split_at_mut(len);
            exchanges.push((a, b));
        }
    }
    exchanges.into_par_iter().for_each(|(a, b)| a.swap_with_slice(b));
    Parted { left, centroids }
}

/// The ranges, ascending and disjoint, of a slice that begins at index `base`. Ranges that are
/// empty or reversed are left out.
fn carve(
    mut slice: &mut [PrimRef],
    mut base: usize,
    ranges: impl Iterator<Item = Range<usize>>,
) -> Vec<&mut [PrimRef]> {
    let mut parts = Vec::new();
    for range in ranges.filter(|range| !range.is_empty()) {
        let (_, after) = slice.split_at_mut(range.start - base);
        let part;
        (part, slice) = after.split_at_mut(range.len());
        base = range.end;
        parts.push(part);
    }
    parts
}
