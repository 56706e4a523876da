//! Mini tree pruning (thesis paper IV, section 5.4).

use crate::Pruning;
use crate::mini::{Batch, MiniTree};
use niwaki_core::{AreaScale, BvhNode, PrimRef, to_u32};
use rayon::prelude::*;
use std::ops::Range;

/// A subtree that the top tree is built over: a whole mini tree or a piece of one.
#[derive(Clone, Debug)]
pub(crate) struct Root<'a> {
    /// The root itself.
    pub(crate) node: BvhNode,
    /// Everything below the root.
    pub(crate) below: &'a [BvhNode],
    /// How child indices name the first node of `below`.
    pub(crate) first: u32,
    /// Places in the list of ids.
    pub(crate) prims: Range<u32>,
}

/// The roots in the order of the mini trees.
pub(crate) fn roots(batches: &[Batch], pruning: Pruning, scale: AreaScale) -> Vec<Root<'_>> {
    let areas: Vec<f64> = batches
        .iter()
        .flat_map(Batch::trees)
        .map(|mini| f64::from(mini.nodes[0].aabb().half_area(scale)))
        .collect();
    let threshold = threshold(pruning, areas.iter().copied());
    let parts: Vec<Vec<Root<'_>>> = batches
        .par_iter()
        .map(|batch| {
            let mut found = Vec::new();
            for mini in batch.trees() {
                cut(mini, threshold, scale, &mut found);
            }
            found
        })
        .collect();
    parts.concat()
}

/// T, in the unit of the areas given; infinite without pruning.
fn threshold(pruning: Pruning, areas: impl ExactSizeIterator<Item = f64> + Clone) -> f32 {
    let count = areas.len() as f64;
    let mean = areas.clone().sum::<f64>() / count;
    let threshold = match pruning {
        Pruning::Off => return f32::INFINITY,
        Pruning::Mean(fraction) => f64::from(fraction) * mean,
        Pruning::Deviation(factor) => {
            let variance = areas.map(|area| (area - mean) * (area - mean)).sum::<f64>() / count;
            (mean + f64::from(factor) * variance.sqrt()).max(0.0)
        }
    };
    #[expect(clippy::cast_possible_truncation, reason = "compared with areas that are f32")]
    let threshold = threshold as f32;
    threshold
}

/// Finds the first nodes from the root down that are not larger than `threshold`, or leaves.
fn cut<'a>(mini: MiniTree<'a>, threshold: f32, scale: AreaScale, found: &mut Vec<Root<'a>>) {
    let start = found.len();
    let at = |node: u32| &mini.nodes[node as usize];
    // A node and the end of what is below it; left children are on top.
    let mut stack = vec![(0_u32, to_u32(mini.nodes.len()))];
    while let Some((index, end)) = stack.pop() {
        let node = at(index);
        if node.is_leaf() {
            let prims = node.first..node.first + node.count;
            found.push(Root { node: *node, below: &[], first: 0, prims });
        } else if node.aabb().half_area(scale) > threshold {
            let [left, right] = [node.first, node.first + 1];
            let middle = if at(right).is_leaf() { end } else { at(right).first };
            stack.push((right, end));
            stack.push((left, middle));
        } else {
            let mut leftmost = node;
            while !leftmost.is_leaf() {
                leftmost = at(leftmost.first);
            }
            found.push(Root {
                node: *node,
                below: &mini.nodes[node.first as usize..end as usize],
                first: node.first,
                prims: leftmost.first..leftmost.first,
            });
        }
    }
    // Subtrees were found from left to right, so each ends where the next begins.
    let mut end = mini.end;
    for root in found[start..].iter_mut().rev() {
        root.prims.end = end;
        end = root.prims.start;
    }
}

/// What the top tree is built over: references whose ids are positions in `roots`.
pub(crate) fn references(roots: &[Root<'_>]) -> Vec<PrimRef> {
    roots
        .par_iter()
        .enumerate()
        .with_min_len(1024)
        .map(|(i, root)| PrimRef::new(root.node.aabb(), to_u32(i)))
        .collect()
}
