//! How many references small subtrees hold.

use niwaki_core::BvhNode;
use rayon::prelude::*;

/// A count over this is not told apart from it.
pub(crate) const MANY: u8 = 254;
/// Not known yet: a child lies outside the chunk.
const PENDING: u8 = 255;
const CHUNK: usize = 1 << 14;

/// References below each node, at most [`MANY`]. Children outside the tree or before their
/// parent count as [`MANY`]; the collapse reports them.
///
/// Children stand after their parents, so one backward pass suffices. Chunks run in parallel;
/// what depends on a later chunk is finished in a second, short pass.
pub(crate) fn subtree_counts(nodes: &[BvhNode]) -> Vec<u8> {
    let mut counts = vec![0_u8; nodes.len()];
    let pending: Vec<Vec<usize>> = counts
        .par_chunks_mut(CHUNK)
        .zip(nodes.par_chunks(CHUNK))
        .enumerate()
        .map(|(chunk, (counts, nodes))| {
            let base = chunk * CHUNK;
            let mut pending = Vec::new();
            for i in (0..nodes.len()).rev() {
                let node = &nodes[i];
                counts[i] = if node.is_leaf() {
                    saturate(node.count as usize)
                } else {
                    let child = (node.first as usize).wrapping_sub(base);
                    match counts.get(child..).and_then(|c| c.get(..2)) {
                        Some(&[a, b]) if child > i && a != PENDING && b != PENDING => {
                            saturate(usize::from(a) + usize::from(b))
                        }
                        _ => {
                            pending.push(base + i);
                            PENDING
                        }
                    }
                };
            }
            pending
        })
        .collect();
    for i in pending.into_iter().rev().flatten() {
        let child = nodes[i].first as usize;
        counts[i] = match counts.get(child..).and_then(|c| c.get(..2)) {
            Some(&[a, b]) if child > i => saturate(usize::from(a) + usize::from(b)),
            _ => MANY,
        };
    }
    counts
}

fn saturate(count: usize) -> u8 {
    u8::try_from(count).map_or(MANY, |c| c.min(MANY))
}
