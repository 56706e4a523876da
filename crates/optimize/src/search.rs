//! Where a subtree would better be: branch and bound over the whole tree (Meister and Bittner
//! 2018, section 3.1).

use crate::tree::Tree;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A move that pays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Move {
    /// The subtree that moves.
    pub(crate) node: u32,
    /// Its new sibling.
    pub(crate) target: u32,
    /// By how much the sum of the areas of inner nodes falls.
    pub(crate) gain: f32,
}

/// Finds the best new sibling for `node`, if any pays, looking at no more than `max_visits` pairs
/// of nodes. `stack` is only for reuse of its memory.
///
/// Goes up from the parent. At each *pivot*, an ancestor of `node`, the subtree on the other side
/// is searched: if `node` moved there, everything from the pivot up would keep its box. `saved` is
/// what taking `node` out saves below the pivot, the parent that vanishes included; every step
/// down pays by how much the box passed grows, and the new parent pays its whole area. A subtree
/// is left out if even a new parent no larger than `node` would cost more than the best move found.
pub(crate) fn best_move(
    tree: &Tree,
    node: u32,
    max_visits: u32,
    stack: &mut Vec<(f32, u32)>,
) -> Option<Move> {
    let nodes = tree.nodes();
    let scale = tree.scale;
    let bounds = nodes[node as usize].bounds();
    let area = bounds.area(scale);
    let mut pivot = tree.parent(node);
    // What would be left at the pivot, and what has been saved strictly below it.
    let mut left = nodes[node as usize ^ 1].bounds();
    let mut saved = nodes[pivot as usize].bounds().area(scale);
    let mut other = node ^ 1;
    let mut best = Move { node, target: node, gain: 0.0 };
    let mut visits = 0;
    loop {
        stack.clear();
        let first = &nodes[other as usize];
        // The sibling itself is where `node` already is: only what is below it counts.
        let merged = first.bounds().union(bounds).area(scale);
        if other != node ^ 1 && saved - merged > best.gain {
            best = Move { node, target: other, gain: saved - merged };
        }
        let below = saved - merged + first.bounds().area(scale);
        if !first.is_leaf() && below - area > best.gain {
            stack.push((below, first.first()));
        }
        while let Some((left_over, pair)) = stack.pop() {
            if left_over - area <= best.gain {
                continue;
            }
            visits += 1;
            if visits > max_visits {
                break;
            }
            let mut open = [(f32::NEG_INFINITY, 0_u32); 2];
            for (child, open) in [pair, pair + 1].into_iter().zip(&mut open) {
                let x = &nodes[child as usize];
                let gain = left_over - x.bounds().union(bounds).area(scale);
                if gain > best.gain {
                    best = Move { node, target: child, gain };
                }
                if !x.is_leaf() {
                    *open = (gain + x.bounds().area(scale), x.first());
                }
            }
            // The better one goes on top.
            let [a, b] = open;
            let (near, far) = if a.0 >= b.0 { (a, b) } else { (b, a) };
            for next in [far, near] {
                if next.0 - area > best.gain {
                    stack.push(next);
                }
            }
        }
        if pivot == 0 || visits > max_visits {
            break;
        }
        visits += 1;
        // Up one level. `node` could become the sibling of what is left of the pivot.
        let whole = nodes[pivot as usize].bounds().area(scale);
        if pivot != tree.parent(node) {
            left = left.union(nodes[other as usize].bounds());
            saved += whole - left.area(scale);
            if saved - whole > best.gain {
                best = Move { node, target: pivot, gain: saved - whole };
            }
        }
        other = pivot ^ 1;
        pivot = tree.parent(pivot);
    }
    (best.target != node).then_some(best)
}

/// The place where a subtree that was taken out costs least, looking at the most promising nodes
/// first and at no more than `max_visits` (Bittner, Hapala and Havran 2013, section 3.1).
pub(crate) fn best_place(tree: &Tree, node: u32, max_visits: u32) -> u32 {
    let nodes = tree.nodes();
    let scale = tree.scale;
    let bounds = nodes[node as usize].bounds();
    let area = bounds.area(scale);
    let mut best = (f32::INFINITY, 0_u32);
    // What the boxes above grow by is not negative, so that its bits sort as it does.
    let mut open = BinaryHeap::from([Reverse((0_u32, 0_u32))]);
    let mut visits = 0;
    while let Some(Reverse((above, place))) = open.pop() {
        let above = f32::from_bits(above);
        if above + area >= best.0 || visits == max_visits {
            break;
        }
        visits += 1;
        let x = &nodes[place as usize];
        let merged = x.bounds().union(bounds).area(scale);
        if above + merged < best.0 {
            best = (above + merged, place);
        }
        let below = (above + merged - x.bounds().area(scale)).max(0.0);
        if !x.is_leaf() && below + area < best.0 {
            open.push(Reverse((below.to_bits(), x.first())));
            open.push(Reverse((below.to_bits(), x.first() + 1)));
        }
    }
    best.1
}
