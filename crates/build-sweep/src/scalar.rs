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

/// Stable partition of one order: primitives with `side` 0 go to the front, those with 1
/// follow. `scratch` is as long as `order`.
pub(crate) fn partition(order: &mut [u32], scratch: &mut [u32], side: impl Fn(usize) -> u8) {
    let (mut left, mut right) = (0, 0);
    for i in 0..order.len() {
        let p = order[i];
        let goes_right = usize::from(side(p as usize));
        // Both are written and one counts: cheaper than a branch that cannot be predicted.
        order[left] = p;
        scratch[right] = p;
        left += 1 - goes_right;
        right += goes_right;
    }
    order[left..].copy_from_slice(&scratch[..right]);
}
