//! Parallel reinsertion (Meister and Bittner 2018).

use crate::pass::{check_count, check_fraction, rearrange, rearrange_memory};
use crate::search::{Move, best_move};
use crate::tree::Tree;
use crate::{Budget, OptimizeError, Optimizer, Report};
use niwaki_core::{Bvh, SahConstants, to_u32};
use rayon::prelude::*;

/// Takes many subtrees out at a time and puts each where it costs least (Meister and Bittner,
/// *Parallel reinsertion for bounding volume hierarchy optimization*, Computer Graphics Forum
/// 37(2), 2018).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reinsertion {
    /// How many rounds, or how long.
    pub budget: Budget,
    /// The share of all nodes that one iteration tries to move, those of the largest area first.
    /// Above 0, at most 1.
    pub batch_fraction: f32,
    /// How fast the share falls: iteration i, from 0, tries `batch_fraction / (1 + falloff·i)`.
    /// What is large matters most and takes several rounds to settle. 0, the paper's choice,
    /// keeps the share. Finite, not negative.
    pub falloff: f32,
    /// Nodes that are searched for at the same time, before the moves found are made. Part of the
    /// result; at least 1.
    pub batch_size: u32,
    /// The most pairs of nodes that the search for one place looks at. At least 1.
    pub max_visits: u32,
    /// Costs of [`Report`]. Moves lower the areas of inner nodes, which all costs gain from.
    pub constants: SahConstants,
}

impl Default for Reinsertion {
    fn default() -> Self {
        Self {
            budget: Budget::iterations(8),
            batch_fraction: 0.2,
            falloff: 2.0,
            batch_size: 512,
            max_visits: 512,
            constants: SahConstants::default(),
        }
    }
}

impl Reinsertion {
    fn check(&self) -> Result<(), OptimizeError> {
        check_fraction("batch_fraction", self.batch_fraction)?;
        if !(self.falloff.is_finite() && self.falloff >= 0.0) {
            return Err(OptimizeError::BadSetting {
                setting: "falloff",
                value: self.falloff.to_string(),
                remedy: "a finite number, not negative",
            });
        }
        check_count("batch_size", self.batch_size)?;
        check_count("max_visits", self.max_visits)
    }

    fn run(&self, tree: &mut Tree) -> (u32, u64) {
        let clock = self.budget.start();
        let (mut iterations, mut changes) = (0, 0);
        let mut moves: Vec<Option<Move>> = Vec::new();
        while iterations < self.budget.iterations && !clock.is_over() {
            let fraction = self.batch_fraction / (1.0 + self.falloff * iterations as f32);
            iterations += 1;
            let before = changes;
            for batch in largest(tree, fraction).chunks(self.batch_size as usize) {
                batch
                    .par_iter()
                    .with_min_len(16)
                    .map_init(Vec::new, |stack, &node| {
                        best_move(tree, node, self.max_visits, stack)
                    })
                    .collect_into_vec(&mut moves);
                let mut found: Vec<Move> = moves.iter().flatten().copied().collect();
                found.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
                for m in found {
                    changes += u64::from(tree.try_move(m.node, m.target).is_some());
                }
                if clock.is_over() {
                    break;
                }
            }
            if changes == before {
                break;
            }
        }
        (iterations, changes)
    }
}

/// The nodes of largest area, largest first; equal ones in the order of their index.
fn largest(tree: &Tree, fraction: f32) -> Vec<u32> {
    let nodes = tree.nodes();
    let mut keyed: Vec<(u32, u32)> = (2..nodes.len())
        .into_par_iter()
        // Areas are not negative, so that their bits sort as they do.
        .map(|i| (!nodes[i].bounds().area(tree.scale).to_bits(), to_u32(i)))
        .collect();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count, at least 0"
    )]
    let count = (keyed.len() as f64 * f64::from(fraction)).ceil() as usize;
    if count < keyed.len() {
        keyed.select_nth_unstable(count);
        keyed.truncate(count);
    }
    keyed.par_sort_unstable();
    keyed.into_iter().map(|(_, node)| node).collect()
}

impl Optimizer for Reinsertion {
    fn name(&self) -> &str {
        "reinsert"
    }

    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        self.check()?;
        rearrange(bvh, &self.constants, |tree| self.run(tree))
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        rearrange_memory(nodes, references) + (8 + 4) * nodes + 32 * self.batch_size as usize
    }
}
