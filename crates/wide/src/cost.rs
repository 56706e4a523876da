//! The expected cost of a wide tree.

use crate::{Child, WideBvh, WideCosts};
use rayon::prelude::*;

impl<const W: usize> WideBvh<W> {
    /// What a long random ray that hits the root is expected to cost: the sum over nodes of
    /// `node · A(n)/A(root)` and over leaves of `(leaf + reference · N) · A(n)/A(root)` (Ylitie,
    /// Karras and Laine 2017, equation 1, with a constant term for leaves), in `f64`. It is what
    /// [`crate::CollapseMethod::Optimal`] minimises.
    ///
    /// Where the root has no area, every box counts as much as the root. A tree without nodes
    /// costs 0. Same tree, same bits, for every number of threads.
    #[must_use]
    pub fn cost(&self, costs: &WideCosts) -> f64 {
        let root = self.bounds().area();
        let [inner, leaf, reference] = [costs.node, costs.leaf, costs.reference].map(f64::from);
        let relative = |area: f64| if root > 0.0 { area / root } else { 1.0 };
        // Fixed chunks, added in order: the sum does not depend on the number of threads.
        let sums: Vec<f64> = self
            .nodes()
            .par_chunks(1 << 12)
            .map(|nodes| {
                let mut sum = 0.0;
                for node in nodes {
                    for (slot, child) in node.iter().enumerate() {
                        let cost = match child {
                            Child::Node(_) => inner,
                            Child::Leaf { count, .. } => leaf + reference * f64::from(count),
                        };
                        sum += cost * relative(node.aabb(slot).area());
                    }
                }
                sum
            })
            .collect();
        if self.nodes().is_empty() { 0.0 } else { inner + sums.iter().sum::<f64>() }
    }
}
