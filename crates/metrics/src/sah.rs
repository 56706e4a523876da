//! The surface area heuristic.

use niwaki_core::{Aabb, Bvh, BvhNode, SahConstants};
use rayon::prelude::*;

/// Expected cost of a long random ray that hits the root: thesis section 3.4, equation 3
/// (Goldsmith and Salmon 1987; MacDonald and Booth 1990),
///
/// `C_I·ΣA(n)/A(n₀)` over inner nodes + `C_L·ΣA(n)/A(n₀)` + `C_T·ΣA(n)·N(n)/A(n₀)` over leaves,
///
/// summed in `f64`, which holds areas of every finite `f32` box, over all of [`Bvh::nodes`].
/// Same tree, same bits, for every number of threads. A tree without nodes costs 0.
///
/// Where the root has no area, all boxes are points or segments of one line, and the ratio is
/// taken in the limit of boxes that grow by the same small margin: the ratio of lengths, or 1 if
/// the root is a point. The cost is thus finite for every tree of finite boxes that lie within
/// the root's.
#[must_use]
pub fn sah(bvh: &Bvh, constants: &SahConstants) -> f64 {
    let Some(root) = bvh.nodes.first() else { return 0.0 };
    let measure = Measure::of(&root.aabb());
    // Fixed chunks, added in order: the sum does not depend on the number of threads.
    let sums: Vec<f64> = bvh
        .nodes
        .par_chunks(1 << 14)
        .map(|nodes| {
            nodes
                .iter()
                .map(|node| node_cost(node, constants) * measure.relative(&node.aabb()))
                .sum()
        })
        .collect();
    sums.iter().sum()
}

/// C_I for an inner node, C_L + C_T·N for a leaf.
pub(crate) fn node_cost(node: &BvhNode, constants: &SahConstants) -> f64 {
    if node.is_leaf() {
        f64::from(constants.leaf) + f64::from(constants.triangle) * f64::from(node.count)
    } else {
        f64::from(constants.inner)
    }
}

/// What boxes are measured by, so that the root measures more than zero where it can.
enum Measure {
    Area(f64),
    Length(f64),
    Count,
}

impl Measure {
    fn of(root: &Aabb) -> Self {
        let (area, length) = (root.area(), length(root));
        if area > 0.0 {
            Self::Area(area)
        } else if length > 0.0 {
            Self::Length(length)
        } else {
            Self::Count
        }
    }

    fn relative(&self, b: &Aabb) -> f64 {
        match self {
            Self::Area(root) => b.area() / root,
            Self::Length(root) => length(b) / root,
            Self::Count => 1.0,
        }
    }
}

/// The sum of the edge lengths along the axes; 0 for the empty box.
fn length(b: &Aabb) -> f64 {
    if b.is_empty() { 0.0 } else { (b.max.as_dvec3() - b.min.as_dvec3()).element_sum() }
}
