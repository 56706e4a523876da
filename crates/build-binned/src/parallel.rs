//! Binning and partitioning of large nodes with all threads. Chunks have a fixed size and are
//! combined in order, so the number of threads does not show.

use crate::bins::{Bins, Corners, Mapping, Parted, Split};
use crate::kernel::Kernel;
use niwaki_core::PrimRef;
use niwaki_core::partition::join_chunks;
use rayon::prelude::*;

/// Primitives of one piece of work: half a megabyte.
pub(crate) const CHUNK: usize = 1 << 14;

/// As [`Kernel::fill`] on bins that are empty.
pub(crate) fn fill(kernel: Kernel, prims: &[PrimRef], mapping: &Mapping) -> Box<Bins> {
    prims
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut bins = Bins::new();
            kernel.fill(&mut bins, chunk, mapping);
            bins
        })
        .reduce_with(|mut a, b| {
            a.merge(&b, mapping.bins);
            a
        })
        .unwrap_or_else(Bins::new)
}

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
