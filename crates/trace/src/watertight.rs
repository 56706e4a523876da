//! The triangle test that no ray passes between two triangles of a closed surface.
//!
//! # The test
//!
//! Every corner is brought into the space of the ray (Woop, Benthin and Wald 2013): translated by
//! the origin, and sheared along the longest component of the direction so that the ray becomes
//! the line x = y = 0. What a corner becomes depends on its bits and on the ray alone, so triangles
//! that share it see the same point. The edge functions w of the three pairs of projected corners
//! then tell on which side of each edge the ray passes, and the triangle is hit if all are ≥ 0 or
//! all ≤ 0 and not all are zero. From here on nothing may be wrong by rounding:
//!
//! - w = p.x·q.y − p.y·q.x is computed by Kahan's algorithm, whose relative error is at most 2u
//!   (Jeannerod, Louvet and Muller 2013, theorem 3.1; u = 2⁻²⁴): its *sign* is exact, and so is
//!   zero. (A fused multiply-subtract alone is not even antisymmetric: the two triangles at an
//!   edge could both find the ray outside.)
//! - That holds while nothing underflows or overflows. Underflow changes w by less than 2⁻¹⁴⁰, so a
//!   weight of magnitude below [`CERTAIN`] = 2⁻¹⁰⁰ is taken for unknown, as is a sum that
//!   overflowed; [`decide`] then settles the triangle in `f64`, where products of `f32` are exact
//!   and sums of two have exact signs.
//!
//! # Why nothing leaks
//!
//! The test is exact for a mesh whose corners have been moved by rounding: by at most 5u·L across
//! the ray and u·L along it, L being the largest coordinate of the corner as seen from the origin
//! in each axis (see [`slabs`]). Corners move as one in all triangles that share them, so a closed
//! surface stays closed. If no triangle swept over the origin in that motion, the moved surface
//! still winds around the origin, so that every half line from there meets a closed triangle of
//! it. That one of these triangles has an area in projection, so that the test accepts it, follows
//! by moving the line a little sideways: lines that miss the projections of all edges are dense,
//! each meets such a triangle, there are finitely many of them, and closed ones contain limits.
//! Its distance is positive up to rounding for the same reason.
//!
//! So for every ray whose origin is further inside than rounding moves the surface, this holds
//! with certainty, for edges and corners, at every scale and offset. It holds for corners at equal
//! positions, whether or not they share an index.
//!
//! Triangles without area count where they close a seam (`flat`); the test itself treats them as
//! all others.

use crate::{
    scale::SceneScale,
    setup::{RaySetup, Slabs},
};
use niwaki_core::{Hit, glam::Vec3, glam::Vec3A};

/// Edge functions of at least this magnitude have the right sign.
pub(crate) const CERTAIN: f32 = f32::from_bits((127 - 100) << 23);

/// A ray as the test wants it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheared {
    /// Two axes across the ray, and the one of the longest component of its direction.
    pub(crate) axes: [usize; 3],
    /// In the order of `axes`.
    pub(crate) origin: [f32; 3],
    /// The slopes of the ray; at most 1 by magnitude.
    pub(crate) shear: [f32; 2],
    /// The longest component of the direction.
    pub(crate) along: f32,
}

impl Sheared {
    #[inline(always)]
    pub(crate) fn new(ray: &RaySetup) -> Self {
        let length = ray.direction.abs();
        let axes = if length.z >= length.x && length.z >= length.y {
            [0, 1, 2]
        } else if length.x >= length.y {
            [1, 2, 0]
        } else {
            [2, 0, 1]
        };
        let [x, y, z] = axes.map(|axis| ray.direction[axis]);
        Self { axes, origin: axes.map(|axis| ray.origin[axis]), shear: [x / z, y / z], along: z }
    }

    /// Replaces `hit` if the triangle is met from `t_min` on and before it, or at the same
    /// distance with a smaller id. The SIMD kernels do the same operations in the same order.
    #[inline(always)]
    pub(crate) fn intersect(&self, corners: [Vec3; 3], prim_id: u32, t_min: f32, hit: &mut Hit) {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = corners.map(|v| self.project(v));
        let wa = det2(bx, cy, by, cx);
        let wb = det2(cx, ay, cy, ax);
        let wc = det2(ax, by, ay, bx);
        let (least, most) = (min(wa, min(wb, wc)), max(wa, max(wb, wc)));
        if !(-CERTAIN <= least || most <= CERTAIN) {
            return; // Two have opposite signs for certain.
        }
        let (wa, wb, wc) = (wa.abs(), wb.abs(), wc.abs());
        let det = wa + (wb + wc);
        let depth = wa.mul_add(az, wb.mul_add(bz, wc * cz));
        let sure = CERTAIN <= min(wa, min(wb, wc)) && depth.abs() <= f32::MAX;
        let found = if sure {
            // Adding a positive zero leaves no negative one, whose bits sort wrong.
            let t = depth / (det * self.along) + 0.0;
            Hit { t, u: wb / det, v: wc / det, prim_id }
        } else {
            match decide([ax, ay, az, bx, by, bz, cx, cy, cz], self.along) {
                Some(found) => Hit { prim_id, ..found },
                None => return,
            }
        };
        let before = found.t < hit.t || (found.t == hit.t && prim_id < hit.prim_id);
        if found.t >= t_min && before {
            *hit = found;
        }
    }

    /// The corner in the space of the ray. The last coordinate is not divided by the direction's.
    #[inline(always)]
    fn project(&self, corner: Vec3) -> [f32; 3] {
        let [x, y, z] = [0, 1, 2].map(|i| corner[self.axes[i]] - self.origin[i]);
        [(-self.shear[0]).mul_add(z, x), (-self.shear[1]).mul_add(z, y), z]
    }
}

/// a·b − c·d by Kahan's algorithm.
#[inline(always)]
fn det2(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let q = c * d;
    a.mul_add(b, -q) + (-c).mul_add(d, q)
}

/// As the instruction: the second if either is NaN.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// As the instruction: the second if either is NaN.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Tests the projected corners (x, y and z of each) in `f64`; the range of t is not considered,
/// and there is no id.
#[cold]
#[inline(never)]
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the purpose")]
pub(crate) fn decide(corners: [f32; 9], along: f32) -> Option<Hit> {
    let [ax, ay, az, bx, by, bz, cx, cy, cz] = corners.map(f64::from);
    let (wa, wb, wc) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
    let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
    let (wa, wb, wc) = (wa.abs(), wb.abs(), wc.abs());
    let det = wa + wb + wc;
    if !(inside && det > 0.0) {
        return None;
    }
    let t = (wa * az + wb * bz + wc * cz) / (det * f64::from(along)) + 0.0;
    Some(Hit { t: t as f32 + 0.0, u: (wb / det) as f32, v: (wc / det) as f32, ..Hit::MISS })
}

/// The slabs that contain whatever the test accepts.
///
/// Let L be the largest difference between a coordinate of the scene and the origin's. A corner v
/// is projected to x' = fl(x − s·z), with x = fl(v.x − o.x), z = fl(v.z − o.z) and s = fl(d.x/d.z),
/// |s| ≤ 1: the four roundings amount to at most (1 + 1 + 1 + 2)·u·L to first order. If p is the
/// point of the triangle whose weights are the exact edge functions of the rounded projections,
/// where x' is zero, then p.x − o.x and (p.z − o.z)·d.x/d.z therefore differ by at most 5u·L: the
/// ray at p's own t is within that of p. The computed t is Σ|w|z / (Σ|w|·d.z), with 2u in each
/// weight twice, 3u for the sum of products, 2u for the sum of weights, u for z, the last product and
/// the quotient each: t·d.z is within 12u·L of p.z − o.z, and the ray at the computed t within
/// 17u·L of p in every axis.
///
/// The slabs' own arithmetic errs by less than u·(5.1M + 5|o|) for coordinates up to M ([`Slabs`]
/// has the terms). With that and 5u·L in the offsets, every box that contains p is entered before
/// it is left; with that and 17u·L in those of the planes where the ray enters, it is also
/// entered no later than at the computed t, so that no hit found before hides it. Traversal
/// therefore finds what testing every triangle finds, to the last bit, whatever the tree, except
/// where p lies before `t_min` and the computed t not. That holds for split triangles too, as p
/// lies in the box of one of the parts.
///
/// The planes where the ray leaves get no more than they must, because bounce rays start on a
/// surface that every box behind them touches.
#[inline(always)]
pub(crate) fn slabs(ray: &RaySetup, scale: &SceneScale) -> Slabs {
    // Each a little more, for the terms of second order and forming the offsets.
    const OWN: f32 = 3.0 * f32::EPSILON; // 6u
    const NEAR: f32 = 9.0 * f32::EPSILON; // 18u
    const FAR: f32 = 3.0 * f32::EPSILON; // 6u
    let reach = reach(ray, scale);
    let own = (ray.origin.abs() + scale.magnitude) * OWN;
    Slabs::padded(ray, own + reach * NEAR, own + reach * FAR)
}

/// As [`slabs`], for a slab test of a difference and a product, which has relative errors only:
/// those of four roundings more, of at most the reach.
#[inline(always)]
pub(crate) fn pads(ray: &RaySetup, scale: &SceneScale) -> [f32; 2] {
    [12.0, 6.0].map(|epsilons| epsilons * f32::EPSILON * reach(ray, scale))
}

/// The largest difference between a coordinate of the scene and the origin's.
#[inline(always)]
fn reach(ray: &RaySetup, scale: &SceneScale) -> f32 {
    let origin = ray.origin;
    let (min, max) = (Vec3A::from(scale.bounds.min), Vec3A::from(scale.bounds.max));
    (max - origin).abs().max((min - origin).abs()).max_element()
}
