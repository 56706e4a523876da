//! Mini tree pruning (thesis paper IV, section 5.4).

use crate::Pruning;
use crate::mini::MiniTree;
use niwaki_core::{AreaScale, BvhNode, PrimRef, to_u32};
use rayon::prelude::*;
use std::ops::Range;

/// A subtree that the top tree is built over: a whole mini tree or a piece of one.
#[derive(Clone, Debug)]
pub(crate) struct Root {
    /// Slot of the root itself.
    pub(crate) node: u32,
    /// Slot that the child indices of its mini tree count from.
    pub(crate) base: u32,
    /// Slots of everything below the root.
    pub(crate) below: Range<u32>,
    /// Places in the list of ids.
    pub(crate) prims: Range<u32>,
}

/// The roots in the order of the mini trees.
pub(crate) fn roots(
    minis: &[MiniTree],
    nodes: &[BvhNode],
    pruning: Pruning,
    scale: AreaScale,
) -> Vec<Root> {
    let area = |mini: &MiniTree| nodes[2 * mini.prims.start as usize].aabb().half_area(scale);
    let threshold = threshold(pruning, minis.iter().map(|mini| f64::from(area(mini))));
    let parts: Vec<Vec<Root>> = minis
        .par_chunks(64)
        .map(|minis| {
            let mut found = Vec::with_capacity(minis.len());
            for mini in minis {
                cut(mini, nodes, threshold, scale, &mut found);
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
fn cut(
    mini: &MiniTree,
    nodes: &[BvhNode],
    threshold: f32,
    scale: AreaScale,
    found: &mut Vec<Root>,
) {
    let base = 2 * mini.prims.start;
    let first = found.len();
    let at = |node: u32| &nodes[(base + node) as usize];
    // A node and the end of what is below it; left children are on top.
    let mut stack = vec![(0_u32, mini.nodes)];
    while let Some((index, end)) = stack.pop() {
        let node = at(index);
        if node.is_leaf() {
            found.push(Root {
                node: base + index,
                base,
                below: 0..0,
                prims: node.first..node.first + node.count,
            });
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
                node: base + index,
                base,
                below: base + node.first..base + end,
                prims: leftmost.first..leftmost.first,
            });
        }
    }
    // Subtrees were found from left to right, so each ends where the next begins.
    let mut end = mini.prims.end;
    for root in found[first..].iter_mut().rev() {
        root.prims.end = end;
        end = root.prims.start;
    }
}

/// What the top tree is built over: references whose ids are positions in `roots`.
pub(crate) fn references(roots: &[Root], nodes: &[BvhNode]) -> Vec<PrimRef> {
    roots
        .par_iter()
        .enumerate()
        .with_min_len(1024)
        .map(|(i, root)| PrimRef::new(nodes[root.node as usize].aabb(), to_u32(i)))
        .collect()
}
