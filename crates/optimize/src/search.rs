//! Where a subtree would better be: branch and bound over the whole tree (Meister and Bittner
//! 2018, section 3.1).

use crate::moves::MAX_DEPTH;
use crate::tree::{Bounds, Node, Tree};
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
        if visits > max_visits {
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
        if pivot == 0 {
            break;
        }
        other = pivot ^ 1;
        pivot = tree.parent(pivot);
    }
    (best.target != node).then_some(best)
}

/// A tree as it would be without an inner node and its parent, for [`best_place`].
#[derive(Debug, Default)]
pub(crate) struct Without {
    /// From the parent, whose place its other child takes, up to the root: nodes and the boxes
    /// that they would have.
    path: Vec<(u32, Bounds)>,
    sibling: Option<Node>,
}

impl Without {
    /// Takes out `node`, whose parent must not be the root; false if it is too deep.
    pub(crate) fn set(&mut self, tree: &Tree, node: u32) -> bool {
        let nodes = tree.nodes();
        let sibling = nodes[node as usize ^ 1];
        self.sibling = Some(sibling);
        self.path.clear();
        let (mut at, mut left) = (tree.parent(node), sibling.bounds());
        loop {
            self.path.push((at, left));
            if at == 0 {
                return true;
            }
            if self.path.len() == MAX_DEPTH {
                return false;
            }
            left = left.union(nodes[at as usize ^ 1].bounds());
            at = tree.parent(at);
        }
    }
}

/// The node that a subtree with these bounds costs least as a sibling of, in a tree without
/// another node, looking at the most promising places first and at no more than `max_visits` pairs
/// (Bittner, Hapala and Havran 2013, section 3.1). `open` is only for reuse of its memory.
pub(crate) fn best_place(
    tree: &Tree,
    without: &Without,
    bounds: Bounds,
    max_visits: u32,
    open: &mut BinaryHeap<Reverse<(u32, u32)>>,
) -> u32 {
    let nodes = tree.nodes();
    let scale = tree.scale;
    let area = bounds.area(scale);
    // How many nodes of the path have not been passed.
    let mut ahead = without.path.len().saturating_sub(1);
    let root = without.path.last().map_or(nodes[0].bounds(), |last| last.1);
    let merged = root.union(bounds).area(scale);
    let mut best = (merged, 0_u32);
    // What boxes passed grow by is not negative, so that its bits sort as it does.
    let key = |above: f32| above.max(0.0).to_bits();
    open.clear();
    open.push(Reverse((key(merged - root.area(scale)), nodes[0].first())));
    let mut visits = 0;
    while let Some(Reverse((above, pair))) = open.pop() {
        let above = f32::from_bits(above);
        if above + area >= best.0 || visits == max_visits {
            break;
        }
        visits += 1;
        for child in [pair, pair + 1] {
            let mut x = nodes[child as usize];
            if ahead > 0 && without.path[ahead - 1].0 == child {
                ahead -= 1;
                match without.sibling {
                    Some(sibling) if ahead == 0 => x = sibling,
                    _ => x.set_bounds(without.path[ahead].1),
                }
            }
            let total = above + x.bounds().union(bounds).area(scale);
            if total < best.0 {
                best = (total, child);
            }
            let below = total - x.bounds().area(scale);
            if !x.is_leaf() && below + area < best.0 {
                open.push(Reverse((key(below), x.first())));
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_hard_cases::{median_tree, soup_mesh};

    fn trees() -> impl Iterator<Item = Tree> {
        (3..60).map(|count| {
            let mesh = soup_mesh(count, 0.3, count as u64);
            Tree::new(&median_tree(&mesh, 1)).unwrap().unwrap()
        })
    }

    #[test]
    fn the_best_move_is_the_best_of_all() {
        for tree in trees() {
            let count = u32::try_from(tree.nodes().len()).unwrap();
            for node in 2..count {
                let gains = (0..count).filter_map(|target| tree.clone().try_move(node, target));
                let best = gains.fold(0.0, f32::max);
                let found = best_move(&tree, node, u32::MAX, &mut Vec::new());
                let gain = found.map_or(0.0, |found| found.gain);
                // Sums in another order.
                assert!((gain - best).abs() < 1e-4, "{node}: {gain} {best}");
                if let Some(found) = found.filter(|found| found.gain > 1e-4) {
                    let made = tree.clone().try_move(node, found.target).unwrap();
                    assert!((made - found.gain).abs() < 1e-4, "{found:?} {made}");
                }
            }
        }
    }

    #[test]
    fn the_best_place_is_the_best_of_all() {
        let mut without = Without::default();
        for mut tree in trees() {
            let count = u32::try_from(tree.nodes().len()).unwrap();
            for node in 2..count {
                let inner = tree.nodes()[node as usize];
                if inner.is_leaf() || tree.parent(node) == 0 {
                    continue;
                }
                assert!(without.set(&tree, node));
                let child = inner.first();
                let bounds = tree.nodes()[child as usize].bounds();
                let place = best_place(&tree, &without, bounds, u32::MAX, &mut BinaryHeap::new());
                let parent = tree.parent(node);
                tree.remove(child);
                tree.remove(node);
                // Everything that can be reached is a place.
                let mut best = f32::NEG_INFINITY;
                let mut stack = vec![0];
                while let Some(i) = stack.pop() {
                    best = best.max(tree.clone().insert(child, i));
                    let x = &tree.nodes()[i as usize];
                    if !x.is_leaf() {
                        stack.extend([x.first(), x.first() + 1]);
                    }
                }
                let gain = tree.clone().insert(child, place);
                assert!((gain - best).abs() < 1e-4, "{node}: {gain} {best}");
                tree.insert(node, parent);
                tree.insert(child, node);
            }
        }
    }

    #[test]
    fn moves_change_the_sum_of_areas_by_what_they_say() {
        for mut tree in trees() {
            let count = u32::try_from(tree.nodes().len()).unwrap();
            for node in 2..count {
                for target in 0..count {
                    let before = tree.inner_area();
                    let gain = tree.try_move(node, target).unwrap_or(0.0);
                    let change = before - tree.inner_area();
                    assert!((change - f64::from(gain)).abs() < 1e-4, "{change} {gain}");
                }
            }
        }
    }
}
