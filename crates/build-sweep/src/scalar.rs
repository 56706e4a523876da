//! The portable sweep, and the reference for the vector kernels.

use crate::kernel::{Split, grow};
use crate::rule::SplitRule;
use niwaki_core::{Aabb, PrimRef};

/// Sweeps one axis. `order` lists the primitives of the node along `axis`; `right` has the same
/// length and is overwritten. Returns the box of the node and improves `best`.
pub(crate) fn sweep_axis(
    prims: &[PrimRef],
    order: &[u32],
    axis: usize,
    rule: &SplitRule,
    right: &mut [f32],
    best: &mut Split,
) -> Aabb {
    let count = order.len();
    let mut bounds = Aabb::EMPTY;
    for (&i, area) in order.iter().zip(&mut *right).rev() {
        grow(&mut bounds, &prims[i as usize]);
        *area = bounds.half_area(rule.scale);
    }
    bounds = Aabb::EMPTY;
    for left in 1..count {
        grow(&mut bounds, &prims[order[left - 1] as usize]);
        let cost = bounds.half_area(rule.scale) * rule.weight(left)
            + right[left] * rule.weight(count - left);
        if cost < best.cost {
            *best = Split { cost, axis, left };
        }
    }
    grow(&mut bounds, &prims[order[count - 1] as usize]);
    bounds
}
