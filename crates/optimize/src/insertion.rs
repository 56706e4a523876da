//! Insertion-based optimization (Bittner, Hapala and Havran 2013).

use crate::pass::{rearrange, rearrange_memory};
use crate::search::best_place;
use crate::tree::Tree;
use crate::{Budget, OptimizeError, Optimizer, Report};
use fastrand::Rng;
use niwaki_core::{Bvh, SahConstants, to_u32};
use rayon::prelude::*;
use std::cmp::Reverse;

/// Takes out nodes that are inefficient, and puts both of their subtrees where they cost least,
/// one node after the other (Bittner, Hapala and Havran, *Fast insertion-based optimization of
/// bounding volume hierarchies*, Computer Graphics Forum 32(1), 2013).
///
/// Serial, because each search sees what all before it did: good trees for their number of
/// searches, but [`crate::Reinsertion`] is faster with several threads.
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
    /// Seed of the random choices.
    pub seed: u64,
    /// The most nodes that one search looks at; at least 1.
    pub max_visits: u32,
    /// Costs of [`Report`]. Insertions lower the areas of inner nodes, which all costs gain from.
    pub constants: SahConstants,
}

impl Default for Insertion {
    fn default() -> Self {
        Self {
            budget: Budget::iterations(50),
            batch_fraction: 0.01,
            seed: 0,
            max_visits: 512,
            constants: SahConstants::default(),
        }
    }
}

impl Insertion {
    fn check(&self) -> Result<(), OptimizeError> {
        if !(self.batch_fraction > 0.0 && self.batch_fraction <= 1.0) {
            return Err(OptimizeError::BadSetting {
                setting: "batch_fraction",
                value: self.batch_fraction.to_string(),
                remedy: "above 0 and at most 1",
            });
        }
        if self.max_visits == 0 {
            let (setting, value, remedy) = ("max_visits", "0".into(), "at least 1");
            return Err(OptimizeError::BadSetting { setting, value, remedy });
        }
        Ok(())
    }

    fn run(&self, tree: &mut Tree) -> (u32, u64) {
        let clock = self.budget.start();
        let mut rng = Rng::with_seed(self.seed);
        let (mut iterations, mut changes) = (0, 0);
        let (mut cost, mut at_random) = (tree.inner_area(), false);
        while iterations < self.budget.iterations && !clock.is_over() {
            iterations += 1;
            for (i, node) in self.batch(tree, at_random, &mut rng).into_iter().enumerate() {
                changes += u64::from(reinsert_children(tree, node, self.max_visits));
                if i % 64 == 63 && clock.is_over() {
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

/// Takes the inner node in slot `node` and its parent out, and inserts both children of `node`
/// where they cost least, the larger first. False if nothing was gained, and then nothing changed.
fn reinsert_children(tree: &mut Tree, node: u32, max_visits: u32) -> bool {
    // The batch was chosen before its first insertion: the slot may hold another node now.
    if node < 2 || tree.nodes()[node as usize].is_leaf() || tree.parent(node) == 0 {
        return false;
    }
    let parent = tree.parent(node);
    let [a, b] = [tree.nodes()[node as usize].first(), tree.nodes()[node as usize].first() + 1];
    let area = |tree: &Tree, i: u32| tree.nodes()[i as usize].bounds().area(tree.scale);
    let large = if area(tree, a) >= area(tree, b) { a } else { b };
    // Taking the large child out puts the small one into the slot of `node`.
    let mut gain = tree.remove(large);
    gain += tree.remove(node);
    let mut places = [0; 2];
    for (subtree, place) in [large, node].into_iter().zip(&mut places) {
        *place = best_place(tree, subtree, max_visits);
        gain += tree.insert(subtree, *place);
    }
    if gain > 0.0 {
        return true;
    }
    tree.remove(node);
    tree.remove(large);
    tree.insert(node, parent);
    tree.insert(large, node);
    false
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
