//! Values that nodes take from their children.

use niwaki_core::BvhNode;
use rayon::prelude::*;

const CHUNK: usize = 1 << 14;

/// A value for each node: `visit` makes it of the node's index and, for an inner node with two
/// children behind it, their values. It sees `None` for a leaf and for an inner node whose
/// children lie outside the tree or before it; the collapse reports the latter.
///
/// Children stand after their parents, so one backward pass suffices, without recursion. Chunks
/// run in parallel; what depends on a later chunk gets the value `pending` first and is finished
/// in a second pass by one thread, which is short for trees laid out depth first. A value that
/// equals `pending` by chance only lengthens the second pass. The result does not depend on the
/// number of threads.
pub(crate) fn bottom_up<T: Copy + Send + Sync>(
    nodes: &[BvhNode],
    values: &mut [T],
    pending: T,
    is_pending: impl Fn(&T) -> bool + Sync,
    visit: impl Fn(usize, Option<[&T; 2]>) -> T + Sync,
) {
    let late: Vec<Vec<usize>> = values
        .par_chunks_mut(CHUNK)
        .zip(nodes.par_chunks(CHUNK))
        .enumerate()
        .map(|(chunk, (values, nodes))| {
            let base = chunk * CHUNK;
            let mut late = Vec::new();
            for i in (0..nodes.len()).rev() {
                let node = &nodes[i];
                values[i] = if node.is_leaf() {
                    visit(base + i, None)
                } else {
                    let child = (node.first as usize).wrapping_sub(base);
                    match values.get(child..).and_then(|v| v.get(..2)) {
                        Some([a, b]) if child > i && !is_pending(a) && !is_pending(b) => {
                            visit(base + i, Some([a, b]))
                        }
                        _ => {
                            late.push(base + i);
                            pending
                        }
                    }
                };
            }
            late
        })
        .collect();
    for i in late.into_iter().rev().flatten() {
        let child = nodes[i].first as usize;
        let children = if child > i { values.get(child..).and_then(|v| v.get(..2)) } else { None };
        values[i] = match children {
            Some([a, b]) => visit(i, Some([a, b])),
            _ => visit(i, None),
        };
    }
}

/// A count over this is not told apart from it.
pub(crate) const MANY: u8 = 254;
/// Not known yet.
const PENDING: u8 = 255;

/// References below each node, at most [`MANY`]. Inner nodes without proper children count as
/// [`MANY`].
pub(crate) fn subtree_counts(nodes: &[BvhNode]) -> Vec<u8> {
    let saturate = |count: usize| u8::try_from(count).map_or(MANY, |c| c.min(MANY));
    let mut counts = vec![0_u8; nodes.len()];
    bottom_up(
        nodes,
        &mut counts,
        PENDING,
        |&c| c == PENDING,
        |i, children| match children {
            Some([&a, &b]) => saturate(usize::from(a) + usize::from(b)),
            None if nodes[i].is_leaf() => saturate(nodes[i].count as usize),
            None => MANY,
        },
    );
    counts
}
