//! Divides the order into parts that one thread each builds.

use crate::chunk::{Chunk, Source};
use crate::part::Part;
use niwaki_core::BvhNode;
use niwaki_core::layout::slots;
use niwaki_core::morton::split;
use niwaki_core::to_u32;
use rayon::prelude::*;

/// A node of the tree over the parts.
enum Top {
    /// Its children's pair of slots and their places in the list.
    Inner { pair: usize, children: [usize; 2] },
    /// A part of the order, by number.
    Chunk(usize),
}

/// Builds the tree, with holes where leaves were merged. How the order is divided does not show
/// once they are closed.
pub(crate) fn build(
    source: Source<'_>,
    subtree: impl Fn(Source<'_>, Chunk<'_>) -> Part + Sync,
) -> Vec<BvhNode> {
    let codes = &source.sorted.codes;
    let count = codes.len();
    let mut nodes = slots(count);
    let Some((_, mut below)) = nodes.split_first_mut() else { return nodes };
    let threads = rayon::current_num_threads();
    // Several parts a thread even out their different sizes. Only parts may have merged leaves.
    let parts = if threads == 1 { 1 } else { 8 * threads };
    let largest = (count / parts).max(4096).max(source.rule.max_leaf_size);

    // Top-down to the parts, in the order of the slots.
    let mut top = Vec::new();
    let mut chunks = Vec::new();
    let mut base = 1;
    let mut stack = vec![(0, count - 1, 1, None)];
    while let Some((first, last, pair, parent)) = stack.pop() {
        let index = top.len();
        if let Some((parent, side)) = parent
            && let Top::Inner { children, .. } = &mut top[parent]
        {
            let children: &mut [usize; 2] = children;
            children[side] = index;
        }
        let len = last - first + 1;
        if len <= largest {
            // The parts' slots follow each other, with the pairs of the top tree between them.
            let (_, after) = below.split_at_mut(pair - base);
            let (slots, after) = after.split_at_mut(2 * (len - 1));
            chunks.push(Chunk { first, last, slots, base: pair });
            (below, base) = (after, pair + 2 * (len - 1));
            top.push(Top::Chunk(chunks.len() - 1));
        } else {
            let middle = split(codes, first, last);
            top.push(Top::Inner { pair, children: [0; 2] });
            let right_pair = pair + 2 * (middle - first);
            stack.push((middle, last, right_pair, Some((index, 1))));
            stack.push((first, middle - 1, pair + 2, Some((index, 0))));
        }
    }
    let parts: Vec<Part> = chunks.into_par_iter().map(|chunk| subtree(source, chunk)).collect();

    // Bottom-up over the top tree.
    let mut done: Vec<Option<Part>> = vec![None; top.len()];
    for index in (0..top.len()).rev() {
        done[index] = match top[index] {
            Top::Chunk(chunk) => Some(parts[chunk]),
            Top::Inner { pair, children: [left, right] } => match (done[left], done[right]) {
                (Some(left), Some(right)) => {
                    nodes[pair] = left.node;
                    nodes[pair + 1] = right.node;
                    Some(Part::join(&left, &right, to_u32(pair), source.rule))
                }
                _ => None,
            },
        };
    }
    if let Some(Some(part)) = done.first() {
        nodes[0] = part.node;
    }
    nodes
}
