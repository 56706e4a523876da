//! Simulated annealing by tree rotations (Kensler 2008).

use crate::bottom_up::bottom_up;
use crate::pass::{rearrange, rearrange_memory};
use crate::rotation::{Rotations, apply, for_each_swap, sweep_memory};
use crate::tree::Tree;
use crate::{Budget, OptimizeError, Optimizer, Report};
use fastrand::Rng;
use niwaki_core::{Bvh, SahConstants};

/// Tree rotations that now and then accept a worse tree, to leave local minima (Kensler, *Tree
/// rotations for improving bounding volume hierarchies*, Symposium on Interactive Ray Tracing
/// 2008, section 3.2).
///
/// An iteration visits all inner nodes from the leaves up and, at each, draws one of the rotations
/// or none with probability proportional to exp(g / T): g is what the rotation lowers the cost by,
/// 0 for none, relative to the area of the node, so that the shape of the tree and not its place
/// decides. (The paper tries one rotation at a time; this *heat bath* leads to the same
/// distribution, and to plain hill climbing as T falls.) T falls to a hundredth from the first
/// iteration to the last. Hill climbing ([`Rotations`]) follows, and the best tree that was seen is
/// the result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annealing {
    /// Sweeps over the tree while T falls, 100 by default. Time spent counts for the hill climbing
    /// as well.
    pub budget: Budget,
    /// T of the first iteration. Finite, above 0; 0.1 by default.
    pub temperature: f32,
    /// Seed of all draws. The same seed gives the same tree for every number of threads.
    pub seed: u64,
    /// Costs of [`Report`].
    pub constants: SahConstants,
}

impl Default for Annealing {
    fn default() -> Self {
        Self {
            budget: Budget::iterations(100),
            temperature: 0.1,
            seed: 0,
            constants: SahConstants::default(),
        }
    }
}

/// Sweeps of hill climbing that follow the annealing.
const CLIMBS: u32 = 20;

impl Annealing {
    fn run(&self, tree: &mut Tree) -> (u32, u64) {
        let clock = self.budget.start();
        let (mut iterations, mut changes) = (0, 0);
        let mut best = (tree.inner_area(), tree.clone());
        let mut keep = |tree: &Tree| {
            let area = tree.inner_area();
            if area < best.0 {
                best = (area, tree.clone());
            }
        };
        let steps = self.budget.iterations.max(2) - 1;
        while iterations < self.budget.iterations && !clock.is_over() {
            let cooled = 0.01_f32.powf(iterations as f32 / steps as f32);
            let temperature = self.temperature * cooled;
            let salt = self.seed ^ u64::from(iterations).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            changes += bottom_up(tree, |part, index, node| {
                let mut rng = Rng::with_seed(salt.wrapping_add(u64::from(index) << 32));
                // Neighbouring seeds give neighbouring first numbers.
                rng.u64(..);
                let unit = part.area(node.bounds()) * temperature;
                // The largest of weights with Gumbel noise is a draw by the exponentials. Where
                // areas are 0 or not finite, weights are NaN and nothing is drawn.
                let mut noise = || -(-rng.f32().max(f32::MIN_POSITIVE).ln()).ln();
                let mut best = (noise(), None);
                for_each_swap(part, node, |swap| {
                    let weight = swap.gain / unit + noise();
                    if weight > best.0 {
                        best = (weight, Some(swap));
                    }
                });
                if let Some(swap) = best.1 {
                    apply(part, node, swap);
                }
                u64::from(best.1.is_some())
            });
            iterations += 1;
            keep(tree);
        }
        if changes > 0 {
            for _ in 0..CLIMBS {
                if clock.is_over() {
                    break;
                }
                let (_, rotated) = Rotations::run(Budget::iterations(1), tree);
                changes += rotated;
                if rotated == 0 {
                    break;
                }
            }
            keep(tree);
        }
        *tree = best.1;
        (iterations, changes)
    }
}

impl Optimizer for Annealing {
    fn name(&self) -> &str {
        "anneal"
    }

    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        if !(self.temperature.is_finite() && self.temperature > 0.0) {
            return Err(OptimizeError::BadSetting {
                setting: "temperature",
                value: self.temperature.to_string(),
                remedy: "a finite number above 0",
            });
        }
        rearrange(bvh, &self.constants, |tree| self.run(tree))
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        let copy = 68 * (nodes / 2 + 1);
        rearrange_memory(nodes, references) + sweep_memory(nodes) + 2 * copy
    }
}
