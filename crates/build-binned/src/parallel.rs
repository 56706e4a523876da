//! Partitioning of large nodes with all threads. Chunks have a fixed size and are combined in
//! order, so the number of threads does not show.

use niwaki_core::PrimRef;
use niwaki_core::bins::{CHUNK, Corners, Kernel, Mapping, Parted, Split};
use niwaki_core::partition::join_chunks;
use rayon::prelude::*;

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
    let centroids = chunks.iter().fold([Corners::EMPTY; 2], |sum, chunk| {
        [0, 1].map(|side| sum[side].union(&chunk.centroids[side]))
    });

    let fronts: Vec<usize> = chunks.iter().map(|c| c.left).collect();
    let left = join_chunks(prims, CHUNK, &fronts);
    Parted { left, centroids }
}
