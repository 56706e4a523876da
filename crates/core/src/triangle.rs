//! Triangles and conservative split clipping.

use crate::{
    Aabb,
    float::{round_down, round_up},
};
use glam::{BVec4A, Vec3, Vec4};
use std::array;

/// A triangle by its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// First corner, weight 1 − u − v.
    pub v0: Vec3,
    /// Second corner, weight u.
    pub v1: Vec3,
    /// Third corner, weight v.
    pub v2: Vec3,
}

impl Triangle {
    /// A triangle by its corners.
    #[must_use]
    pub const fn new(v0: Vec3, v1: Vec3, v2: Vec3) -> Self {
        Self { v0, v1, v2 }
    }

    /// The corners in order.
    #[must_use]
    pub const fn vertices(&self) -> [Vec3; 3] {
        [self.v0, self.v1, self.v2]
    }

    /// The smallest box around it.
    #[must_use]
    #[inline]
    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.v0.min(self.v1).min(self.v2), max: self.v0.max(self.v1).max(self.v2) }
    }

    /// Area in `f64`.
    #[must_use]
    pub fn area(&self) -> f64 {
        let [a, b, c] = self.vertices().map(|v| v.as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    }

    /// Cuts the part of the triangle inside `bounds` at the plane `p[axis] = position` and
    /// returns the boxes of what lies on the lower and on the upper side (Havran and Bittner
    /// 2002, split clipping). A side with nothing in it is [`Aabb::EMPTY`].
    ///
    /// The boxes are conservative: in exact arithmetic each covers the triangle's part within
    /// `bounds` on its side of the plane, whatever rounding did, because crossings are computed
    /// in `f64`, widened by their error bound, and rounded outward. Both stay within `bounds`.
    ///
    /// # Panics
    /// If `axis` is not 0, 1 or 2.
    #[must_use]
    pub fn split(&self, bounds: &Aabb, axis: usize, position: f32) -> (Aabb, Aabb) {
        assert!(axis < 3, "an axis is 0, 1 or 2");
        // No branch on which corners are where, because that cannot be predicted.
        let corners = self.vertices().map(|v| v.extend(0.0));
        let along = corners.map(|v| v.as_ref()[axis]);
        let mut lower = [Vec4::INFINITY, Vec4::NEG_INFINITY];
        let mut upper = lower;
        let grow = |side: &mut [Vec4; 2], is_in: bool, corner: Vec4| {
            let is_in = BVec4A::new(is_in, is_in, is_in, is_in);
            side[0] = side[0].min(Vec4::select(is_in, corner, Vec4::INFINITY));
            side[1] = side[1].max(Vec4::select(is_in, corner, Vec4::NEG_INFINITY));
        };
        let mut crossing = [0; 4];
        let mut count = 0;
        for i in 0..3 {
            grow(&mut lower, along[i] <= position, corners[i]);
            grow(&mut upper, along[i] >= position, corners[i]);
            let (a, b) = (along[i], along[(i + 1) % 3]);
            crossing[count] = i;
            count += usize::from((a < position) & (b > position) | (a > position) & (b < position));
        }
        for &i in &crossing[..count] {
            let cut = edge_crossing(corners[i], corners[(i + 1) % 3], axis, position);
            lower = [lower[0].min(cut[0]), lower[1].max(cut[1])];
            upper = [upper[0].min(cut[0]), upper[1].max(cut[1])];
        }
        let [mut lower, mut upper] =
            [lower, upper].map(|[min, max]| Aabb::new(min.truncate(), max.truncate()));
        // On the plane itself the cut is known exactly.
        if !lower.is_empty() {
            lower.max[axis] = lower.max[axis].min(position);
        }
        if !upper.is_empty() {
            upper.min[axis] = upper.min[axis].max(position);
        }
        let clip = |b: Aabb| {
            let b = b.intersection(*bounds);
            if b.is_empty() { Aabb::EMPTY } else { b }
        };
        (clip(lower), clip(upper))
    }

    /// Calls `part` with the box of each part of the triangle inside `bounds` between ascending
    /// planes `p[axis] = positions[i]`, numbered from 0 below the first plane; parts with nothing
    /// in them are left out, and fourth lanes have no meaning.
    ///
    /// Computed in `f32` and not widened, so that boxes may be too small by rounding: for the cost
    /// of splits (spatial bins, Stich et al. 2009), where [`Triangle::split`] costs too much.
    /// Adjacent parts share the two points where the edges cross their plane.
    ///
    /// # Panics
    /// If `axis` is not 0, 1 or 2.
    #[inline]
    pub fn chop(
        &self,
        bounds: &Aabb,
        axis: usize,
        positions: &[f32],
        mut part: impl FnMut(usize, [Vec4; 2]),
    ) {
        let [low, high] = [bounds.min.extend(0.0), bounds.max.extend(0.0)];
        let mut add = |number, [min, max]: [Vec4; 2]| {
            // In this order, what is not a number (of products that overflow) becomes the bound.
            let (min, max) = (min.max(low), max.min(high));
            if min.cmple(max).all() {
                part(number, [min, max]);
            }
        };
        let mut corners = self.vertices().map(|v| v.extend(0.0));
        let sort = |corners: &mut [Vec4; 3], i: usize, j: usize| {
            if corners[i][axis] > corners[j][axis] {
                corners.swap(i, j);
            }
        };
        sort(&mut corners, 0, 1);
        sort(&mut corners, 1, 2);
        sort(&mut corners, 0, 1);
        let [a, b, c] = corners;
        let along = [a[axis], b[axis], c[axis]];
        let [to_b, to_c, b_to_c] = [b - a, c - a, c - b];
        let inverse = [to_b[axis].recip(), to_c[axis].recip(), b_to_c[axis].recip()];
        let mut current = [a, a];
        let mut below = 0;
        for (number, &position) in positions.iter().enumerate() {
            while below < 3 && along[below] <= position {
                current = [current[0].min(corners[below]), current[1].max(corners[below])];
                below += 1;
            }
            match below {
                0 => continue,
                3 => return add(number, current),
                _ => {}
            }
            let on_long = a + to_c * ((position - along[0]) * inverse[1]).clamp(0.0, 1.0);
            let on_short = if below == 1 {
                a + to_b * ((position - along[0]) * inverse[0]).clamp(0.0, 1.0)
            } else {
                b + b_to_c * ((position - along[1]) * inverse[2]).clamp(0.0, 1.0)
            };
            let cut = [on_long.min(on_short), on_long.max(on_short)];
            add(number, [current[0].min(cut[0]), current[1].max(cut[1])]);
            current = cut;
        }
        for &corner in &corners[below..] {
            current = [current[0].min(corner), current[1].max(corner)];
        }
        add(positions.len(), current);
    }
}

/// A box that surely contains the point where the edge from `a` to `b`, whose ends lie strictly
/// on different sides, crosses the plane `p[axis] = plane`.
fn edge_crossing(a: Vec4, b: Vec4, axis: usize, plane: f32) -> [Vec4; 2] {
    // Differences of f32 values are within one rounding in f64, so t has three roundings, the
    // interpolation three more: 8u·(|a| + |b|) is a safe bound on the error of each coordinate.
    const ERROR: f64 = 8.0 * f64::EPSILON;
    // Order the edge by corner, not by direction, so that both triangles that share it cut it at
    // the same place.
    let (less, equal) = (a.cmplt(b).bitmask(), a.cmpeq(b).bitmask());
    let is_less = less & 1 | equal & 1 & (less >> 1 & 1 | equal >> 1 & 1 & (less >> 2 & 1)) != 0;
    let is_less = BVec4A::new(is_less, is_less, is_less, is_less);
    let (a, b) = (Vec4::select(is_less, a, b), Vec4::select(is_less, b, a));
    let (low_end, high_end) = (a.min(b).to_array(), a.max(b).to_array());
    let (a, b) = (a.to_array().map(f64::from), b.to_array().map(f64::from));
    let t = (f64::from(plane) - a[axis]) / (b[axis] - a[axis]);
    let point: [f64; 4] = array::from_fn(|i| a[i] + (b[i] - a[i]) * t);
    let error: [f64; 4] = array::from_fn(|i| (a[i].abs() + b[i].abs()) * ERROR);
    // The crossing lies between the ends, so the widened box need not leave theirs; these are f32,
    // so that rounding keeps the order.
    let mut low: [f32; 4] = array::from_fn(|i| round_down(point[i] - error[i]));
    let mut high: [f32; 4] = array::from_fn(|i| round_up(point[i] + error[i]));
    low[axis] = plane;
    high[axis] = plane;
    [Vec4::from(low).max(Vec4::from(low_end)), Vec4::from(high).min(Vec4::from(high_end))]
}
