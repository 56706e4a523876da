//! Convex polygons and boxes in `f64`.

use glam::DVec3;
use niwaki_core::Aabb;

/// Appends to `out` the part of the convex polygon `polygon` with `p[axis] ≤ plane` if
/// `keep_lower`, otherwise with `p[axis] ≥ plane` (Sutherland and Hodgman 1974). Points on the
/// plane belong to both parts; crossings lie on it exactly.
pub(crate) fn clip_half_space(
    polygon: &[DVec3],
    axis: usize,
    plane: f64,
    keep_lower: bool,
    out: &mut Vec<DVec3>,
) {
    let Some(mut previous) = polygon.last().copied() else { return };
    let outside = |p: DVec3| if keep_lower { p[axis] > plane } else { p[axis] < plane };
    for &point in polygon {
        if outside(previous) != outside(point) && previous[axis] != plane && point[axis] != plane {
            let t = (plane - previous[axis]) / (point[axis] - previous[axis]);
            let mut crossing = previous + (point - previous) * t;
            crossing[axis] = plane;
            out.push(crossing);
        }
        if !outside(point) {
            out.push(point);
        }
        previous = point;
    }
}

/// The smallest box around a polygon, as corners.
pub(crate) fn bounds(polygon: &[DVec3]) -> (DVec3, DVec3) {
    polygon
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| (min.min(p), max.max(p)))
}

/// Area of a planar convex polygon; 0 if it is no more than its own rounding error.
pub(crate) fn area(polygon: &[DVec3]) -> f64 {
    let Some((&first, rest)) = polygon.split_first() else { return 0.0 };
    let mut sum = DVec3::ZERO;
    let mut longest: f64 = 0.0;
    for pair in rest.windows(2) {
        let (a, b) = (pair[0] - first, pair[1] - first);
        sum += a.cross(b);
        longest = longest.max(a.length_squared()).max(b.length_squared());
    }
    let area = 0.5 * sum.length();
    if area > 4.0 * f64::EPSILON * longest { area } else { 0.0 }
}

/// How a polygon lies to a box.
pub(crate) enum Overlap {
    /// No common point.
    Apart,
    /// Wholly inside the closed box.
    Inside,
    /// To be clipped.
    Partial,
}

/// Compares the bounds of a polygon with a closed box.
pub(crate) fn overlap((min, max): (DVec3, DVec3), bounds: &Aabb) -> Overlap {
    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    if !(min.cmple(high) & max.cmpge(low)).all() {
        Overlap::Apart
    } else if (min.cmpge(low) & max.cmple(high)).all() {
        Overlap::Inside
    } else {
        Overlap::Partial
    }
}

/// Replaces `polygon` by its part in the closed box between `low` and `high`; `scratch` is
/// overwritten.
pub(crate) fn clip_to_box(
    polygon: &mut Vec<DVec3>,
    low: DVec3,
    high: DVec3,
    scratch: &mut Vec<DVec3>,
) {
    for axis in 0..3 {
        for (plane, keep_lower) in [(low[axis], false), (high[axis], true)] {
            let cut = |p: &DVec3| if keep_lower { p[axis] > plane } else { p[axis] < plane };
            if polygon.iter().any(cut) {
                scratch.clear();
                clip_half_space(polygon, axis, plane, keep_lower, scratch);
                std::mem::swap(polygon, scratch);
            }
        }
    }
}
