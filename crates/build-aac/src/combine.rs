//! Joining the nearest pairs of a few clusters.

use crate::descend::Named;
use niwaki_core::bottom_up::{LeafRule, Slots};

/// Joins the nearest pair until `target` clusters are left. The join of two takes the
/// slot of the name of the second.
pub(crate) fn combine(
    clusters: &mut Vec<Named>,
    target: usize,
    slots: &mut Slots<'_>,
    rule: &LeafRule,
) {
    while clusters.len() > target.max(1) {
        let mut best = (f32::INFINITY, 0, 1);
        for upper in 1..clusters.len() {
            for lower in 0..upper {
                let bounds = clusters[lower].0.aabb().union(clusters[upper].0.aabb());
                let d = bounds.half_area(rule.scale);
                if d < best.0 {
                    best = (d, lower, upper);
                }
            }
        }
        let (_, lower, upper) = best;
        let (right, slot) = clusters.remove(upper);
        clusters[lower].0 = slots.join(&clusters[lower].0, &right, slot, rule);
    }
}
