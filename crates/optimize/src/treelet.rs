//! Treelet restructuring (Karras and Aila 2013).

use crate::bottom_up::{Part, bottom_up};
use crate::pass::{rearrange, rearrange_memory};
use crate::rotation::sweep_memory;
use crate::tree::{Node, Tree};
use crate::{Budget, OptimizeError, Optimizer, Report};
use niwaki_core::{Bvh, SahConstants};

/// The largest treelets: all 3^8 ways to part 8 leaves and their subsets take some 10 µs.
const MAX_LEAVES: usize = 8;

/// Replaces the top of every subtree by the best possible one (Karras and Aila, *Fast parallel
/// construction of high-quality bounding volume hierarchies*, High-Performance Graphics 2013,
/// section 3).
///
/// A *treelet* is a node and the nodes reached by opening the largest one again and again, until
/// its number of leaves is [`Treelets::leaves`]. Of all trees over these leaves the one with the
/// least sum of areas is found by dynamic programming over subsets. An iteration visits all nodes
/// from the leaves up, subtrees in parallel.
///
/// Unlike the paper, which chooses leaves of the whole tree on the way, this leaves those to
/// [`crate::CollapseLeaves`], and treelets near the leaves may be smaller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Treelets {
    /// Sweeps over the tree; 3 by default, as in the paper. Ends early after one that changed
    /// nothing.
    pub budget: Budget,
    /// Leaves of a treelet, n in the paper: from 3 to 8, 7 by default. Time grows as 3ⁿ.
    pub leaves: u32,
    /// Costs of [`Report`]. Treelets lower the areas of inner nodes, which all costs gain from.
    pub constants: SahConstants,
}

impl Default for Treelets {
    fn default() -> Self {
        Self { budget: Budget::iterations(3), leaves: 7, constants: SahConstants::default() }
    }
}

impl Treelets {
    fn run(&self, tree: &mut Tree) -> (u32, u64) {
        let clock = self.budget.start();
        let (mut iterations, mut changes) = (0, 0);
        let leaves = self.leaves as usize;
        while iterations < self.budget.iterations && !clock.is_over() {
            iterations += 1;
            let changed = bottom_up(tree, |part, _, node| restructure(part, node, leaves));
            if changed == 0 {
                break;
            }
            changes += changed;
        }
        (iterations, changes)
    }
}

/// Makes the treelet at a node the best one; 1 if it was not before.
fn restructure(part: &mut Part<'_>, root: &Node, leaves: usize) -> u64 {
    let treelet = Treelet::open(part, root, leaves);
    if treelet.count < 3 {
        return 0;
    }
    let (split, area) = treelet.best(part);
    // A gain within rounding is none; without this, equal trees would be swapped for ever.
    let better = area < treelet.area * (1.0 - 1e-6);
    if better {
        treelet.rebuild(part, root, &split);
    }
    u64::from(better)
}

struct Treelet {
    leaves: [Node; MAX_LEAVES],
    count: usize,
    /// The pairs in use, by their first node: that of the root and those of inner nodes below.
    pairs: [u32; MAX_LEAVES],
    /// Sum of the areas of inner nodes below the root.
    area: f32,
}

impl Treelet {
    fn open(part: &Part<'_>, root: &Node, leaves: usize) -> Self {
        let [a, b] = *part.pair(root.first());
        let mut treelet = Self {
            leaves: [a; MAX_LEAVES],
            count: 2,
            pairs: [root.first(); MAX_LEAVES],
            area: 0.0,
        };
        treelet.leaves[1] = b;
        // Leaves of the tree cannot be opened.
        let openable =
            |n: &Node| if n.is_leaf() { f32::NEG_INFINITY } else { part.area(n.bounds()) };
        let mut areas = [f32::NEG_INFINITY; MAX_LEAVES];
        areas[0] = openable(&a);
        areas[1] = openable(&b);
        while treelet.count < leaves {
            let mut largest = 0;
            for i in 1..treelet.count {
                if areas[i] > areas[largest] {
                    largest = i;
                }
            }
            if areas[largest] == f32::NEG_INFINITY {
                break;
            }
            let first = treelet.leaves[largest].first();
            let [a, b] = *part.pair(first);
            treelet.area += areas[largest];
            treelet.pairs[treelet.count - 1] = first;
            treelet.leaves[largest] = a;
            areas[largest] = openable(&a);
            treelet.leaves[treelet.count] = b;
            areas[treelet.count] = openable(&b);
            treelet.count += 1;
        }
        treelet
    }

    /// For each set of leaves, one of the two sets that it is best split into, and the least sum
    /// of inner areas below the root. Sets are bit masks.
    fn best(&self, part: &Part<'_>) -> ([u8; 1 << MAX_LEAVES], f32) {
        let all = (1_usize << self.count) - 1;
        let mut bounds = [self.leaves[0].bounds(); 1 << MAX_LEAVES];
        let mut costs = [0.0_f32; 1 << MAX_LEAVES];
        let mut split = [0_u8; 1 << MAX_LEAVES];
        for set in 1..=all {
            let lowest = set & set.wrapping_neg();
            let leaf = self.leaves[lowest.trailing_zeros() as usize].bounds();
            let rest = set ^ lowest;
            if rest == 0 {
                bounds[set] = leaf;
                continue;
            }
            bounds[set] = bounds[rest].union(leaf);
            // Every way to split once: subsets of the rest go to the side without the lowest.
            let (mut least, mut side) = (f32::INFINITY, rest);
            let mut subset = rest;
            while subset != 0 {
                let cost = costs[subset] + costs[set ^ subset];
                if cost < least {
                    (least, side) = (cost, subset);
                }
                subset = (subset - 1) & rest;
            }
            #[expect(clippy::cast_possible_truncation, reason = "8 leaves make masks of 8 bits")]
            let side = side as u8;
            split[set] = side;
            // The root's own area is the same for all trees.
            costs[set] = least + if set == all { 0.0 } else { part.area(bounds[set]) };
        }
        (split, costs[all])
    }

    /// Writes the tree that `split` describes into the pairs that the old one had.
    fn rebuild(&self, part: &mut Part<'_>, root: &Node, split: &[u8; 1 << MAX_LEAVES]) {
        let all = (1_usize << self.count) - 1;
        let mut next = 1;
        let mut stack = [(0_usize, 0_u32); MAX_LEAVES];
        stack[0] = (all, root.first());
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (set, pair) = stack[height];
            let other = usize::from(split[set]);
            for (set, place) in [(set ^ other, pair), (other, pair + 1)] {
                let mut leaves = (0..self.count).filter(|i| set >> i & 1 == 1);
                let Some(first) = leaves.next() else { continue };
                let mut node = self.leaves[first];
                if !set.is_power_of_two() {
                    let bounds =
                        leaves.fold(node.bounds(), |b, i| b.union(self.leaves[i].bounds()));
                    node.set_bounds(bounds);
                    node.make_inner(self.pairs[next]);
                    stack[height] = (set, self.pairs[next]);
                    height += 1;
                    next += 1;
                }
                *part.node_mut(place) = node;
            }
        }
    }
}

impl Optimizer for Treelets {
    fn name(&self) -> &str {
        "treelets"
    }

    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        if !(3..=MAX_LEAVES).contains(&(self.leaves as usize)) {
            return Err(OptimizeError::BadSetting {
                setting: "leaves",
                value: self.leaves.to_string(),
                remedy: "from 3 to 8",
            });
        }
        rearrange(bvh, &self.constants, |tree| self.run(tree))
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        rearrange_memory(nodes, references) + sweep_memory(nodes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_hard_cases::{median_tree, soup_mesh};

    /// The least sum of the areas of inner nodes of any tree over `leaves`, by joining any two
    /// first.
    fn least(leaves: &[crate::tree::Bounds], scale: f32) -> f32 {
        if leaves.len() == 1 {
            return 0.0;
        }
        let mut best = f32::INFINITY;
        for i in 0..leaves.len() {
            for j in 0..i {
                let joined = leaves[i].union(leaves[j]);
                let mut rest: Vec<_> =
                    (0..leaves.len()).filter(|&k| k != i && k != j).map(|k| leaves[k]).collect();
                rest.push(joined);
                best = best.min(joined.area(scale) + least(&rest, scale));
            }
        }
        best
    }

    #[test]
    fn small_trees_become_the_best_ones() {
        for (count, seed) in (3..7).flat_map(|count| (0..10).map(move |seed| (count, seed))) {
            let bvh = median_tree(&soup_mesh(count, 0.5, seed), 1);
            let mut tree = Tree::new(&bvh).unwrap().unwrap();
            let leaves: Vec<_> =
                tree.nodes().iter().filter(|n| n.is_leaf()).map(Node::bounds).collect();
            // Node 1, which is not used, is all zeros and so counts as an inner node.
            assert_eq!(leaves.len(), count);
            Treelets::default().run(&mut tree);
            let area = tree.inner_area();
            let best = f64::from(least(&leaves, tree.scale));
            assert!((area - best).abs() < 1e-5 * best, "{count} {seed}: {area} {best}");
        }
    }
}
