//! Insertion-based optimization (Bittner, Hapala and Havran 2013).

use crate::pass::{check_count, check_fraction, rearrange, rearrange_memory};
use crate::search::{Without, best_place};
use crate::tree::Tree;
use crate::{Budget, OptimizeError, Optimizer, Report};
use fastrand::Rng;
use niwaki_core::{Bvh, SahConstants, to_u32};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Takes out nodes that are inefficient, and puts both of their subtrees where they cost least,
/// one node after the other (Bittner, Hapala and Havran, *Fast insertion-based optimization of
/// bounding volume hierarchies*, Computer Graphics Forum 32(1), 2013).
///
/// Moving two subtrees at a time leaves local minima in which [`crate::Reinsertion`], which moves
/// one, gets stuck; run some of this first.
///
/// The paper searches for one subtree after the other. Here [`Insertion::group_size`] nodes are
/// searched for at the same time, each as if it alone were taken out, then moved one after the
/// other, and whatever did not lower the cost is undone.
///
/// The inefficiency of a node n is M_SUM · M_MIN · M_AREA (equation 7 of the paper): its area over
/// the mean area of its children, its area over the least area of a child, and its area. An
/// iteration takes the worst [`Insertion::batch_fraction`] of all nodes; after one that gained
/// less than a ten-thousandth, the next takes nodes at random; two such in a row end the pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Insertion {
    /// Batches, 50 by default.
    pub budget: Budget,
    /// The share of all nodes in one batch: above 0, at most 1; 0.01 by default, as in the paper.
    pub batch_fraction: f32,
    /// Nodes that are searched for at the same time. Part of the result; at least 1. 64 by default.
    pub group_size: u32,
    /// Seed of the random choices.
    pub seed: u64,
    /// The most nodes that one search looks at, in pairs; at least 1. 512 by default.
    pub max_visits: u32,
    /// Costs of [`Report`]. Insertions lower the areas of inner nodes, which all costs gain from.
    pub constants: SahConstants,
}

impl Default for Insertion {
    fn default() -> Self {
        Self {
            budget: Budget::iterations(50),
            batch_fraction: 0.01,
            group_size: 64,
            seed: 0,
            max_visits: 512,
            constants: SahConstants::default(),
        }
    }
}

impl Insertion {
    fn check(&self) -> Result<(), OptimizeError> {
        check_fraction("batch_fraction", self.batch_fraction)?;
        check_count("group_size", self.group_size)?;
        check_count("max_visits", self.max_visits)
    }

    fn run(&self, tree: &mut Tree) -> (u32, u64) {
        let clock = self.budget.start();
        let mut rng = Rng::with_seed(self.seed);
        let mut found = Vec::new();
        let (mut iterations, mut changes) = (0, 0);
        let (mut cost, mut at_random) = (tree.inner_area(), false);
        while iterations < self.budget.iterations && !clock.is_over() {
            iterations += 1;
            let batch = self.batch(tree, at_random, &mut rng);
            for group in batch.chunks(self.group_size as usize) {
                group
                    .par_iter()
                    .with_min_len(4)
                    .map_init(Scratch::default, |scratch, &node| self.search(tree, node, scratch))
                    .collect_into_vec(&mut found);
                changes += found.iter().flatten().filter(|found| found.make(tree)).count() as u64;
                if clock.is_over() {
                    break;
                }
            }
            let before = std::mem::replace(&mut cost, tree.inner_area());
            let stuck = before - cost <= 1e-4 * before;
            if stuck && at_random {
                break;
            }
            at_random = stuck;
        }
        (iterations, changes)
    }

    fn batch(&self, tree: &Tree, at_random: bool, rng: &mut Rng) -> Vec<u32> {
        let nodes = tree.nodes();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count, at least 0"
        )]
        let size = (nodes.len() as f64 * f64::from(self.batch_fraction)).ceil() as usize;
        if at_random {
            return (0..size).map(|_| rng.u32(0..to_u32(nodes.len()))).collect();
        }
        let inefficiency = |i: usize| {
            let first = nodes[i].first() as usize;
            let area = |i: usize| f64::from(nodes[i].bounds().area(tree.scale));
            let [a, b] = [area(first), area(first + 1)];
            let whole = area(i);
            let product = (2.0 * whole / (a + b)) * (whole / a.min(b)) * whole;
            // 0/0 for areas of 0: nothing to gain.
            if product.is_nan() { 0.0 } else { product }
        };
        let mut keyed: Vec<_> = (2..nodes.len())
            .into_par_iter()
            .filter(|&i| !nodes[i].is_leaf())
            // Not negative, so that the bits sort as the numbers do.
            .map(|i| (Reverse(inefficiency(i).to_bits()), to_u32(i)))
            .collect();
        if size < keyed.len() {
            keyed.select_nth_unstable(size);
            keyed.truncate(size);
        }
        keyed.par_sort_unstable();
        keyed.into_iter().map(|(_, node)| node).collect()
    }
}

/// Memory that the searches of one thread share.
#[derive(Default)]
struct Scratch {
    without: Without,
    open: BinaryHeap<Reverse<(u32, u32)>>,
}

/// Where the children of a node would better be.
#[derive(Clone, Copy, Debug)]
struct Places {
    node: u32,
    /// Its larger child, which is inserted first.
    large: u32,
    /// The new siblings of the larger and of the smaller child.
    targets: [u32; 2],
}

impl Insertion {
    fn search(&self, tree: &Tree, node: u32, scratch: &mut Scratch) -> Option<Places> {
        let inner = tree.nodes()[node as usize];
        if node < 2 || inner.is_leaf() || tree.parent(node) == 0 {
            return None;
        }
        if !scratch.without.set(tree, node) {
            return None;
        }
        let bounds = |i: u32| tree.nodes()[i as usize].bounds();
        let [a, b] = [inner.first(), inner.first() + 1];
        let larger = bounds(a).area(tree.scale) >= bounds(b).area(tree.scale);
        let (large, small) = if larger { (a, b) } else { (b, a) };
        let mut place = |i: u32| {
            best_place(tree, &scratch.without, bounds(i), self.max_visits, &mut scratch.open)
        };
        Some(Places { node, large, targets: [place(large), place(small)] })
    }
}

impl Places {
    /// Takes the node and its parent out and inserts both children. False if nothing was gained or
    /// moves made since the search stand in the way, and then nothing changed.
    fn make(&self, tree: &mut Tree) -> bool {
        let Self { node, large, targets } = *self;
        let inner = tree.nodes()[node as usize];
        let parent = tree.parent(node);
        if inner.is_leaf() || parent == 0 || inner.first() != large & !1 {
            return false;
        }
        // The parent's slot is that of the sibling once the node is out.
        let targets = targets.map(|target| if target == node ^ 1 { parent } else { target });
        if targets.iter().any(|&target| tree.is_within(target, node)) {
            return false;
        }
        // Taking the large child out puts the small one into the slot of `node`.
        let mut gain = tree.remove(large);
        gain += tree.remove(node);
        gain += tree.insert(large, targets[0]);
        gain += tree.insert(node, targets[1]);
        if gain > 0.0 {
            return true;
        }
        tree.remove(node);
        tree.remove(large);
        tree.insert(node, parent);
        tree.insert(large, node);
        false
    }
}

impl Optimizer for Insertion {
    fn name(&self) -> &str {
        "insert"
    }

    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        self.check()?;
        rearrange(bvh, &self.constants, |tree| self.run(tree))
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        rearrange_memory(nodes, references) + (2 * 16 + 4) * nodes + 16 * self.max_visits as usize
    }
}
