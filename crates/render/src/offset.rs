//! Ray origins that lie surely on their own side of the surface they leave.
//!
//! A ray that leaves a triangle must not hit it again through rounding. A fixed epsilon fails as
//! soon as the scene is scaled (Wächter and Binder 2019 need constants that depend on the scene's
//! size; see their section 6.2.2), so the distance is derived from the error of the intersection
//! test instead, in the manner of Pharr, Jakob and Humphreys 2023, section 6.8.6, with two
//! changes:
//!
//! 1. The hit point is formed from the corners in `f64` and rounded to `f32` *away* from the
//!    plane in each axis ([`offset_origin`]). Its own rounding, which grows with the distance
//!    from the coordinate origin, thus adds to the clearance and needs no bound.
//! 2. What remains is the error of the next intersection test. Kernels subtract the ray's origin
//!    from the corners first, so their error does not depend on where the scene lies, only on how
//!    far the corners are from the hit point: with `reach` the largest such distance, edge
//!    functions and scaled distances err by at most γ(n)·reach per unit of the determinant's
//!    scale (for Woop, Benthin and Wald's test n ≈ 15: one subtraction, a shear of 2 operations,
//!    an edge function of 3, and a sum of three products). Both that error and the true distance
//!    of the plane behind the origin grow by 1 / cos θ at grazing angles, so a clearance of
//!    γ(32)·reach along the normal covers all angles.
//!
//! For a 1 m triangle the clearance is 2 µm, for one of 1 km 2 mm, wherever it lies.

use niwaki_core::{
    float::{gamma, round_down, round_up},
    glam::{DVec3, Vec3},
};

/// Relative clearance: twice the longest chain of roundings in the triangle tests in use.
pub const CLEARANCE: f32 = gamma(32);

/// An origin for rays that leave a surface point on the side that `normal` shows to.
///
/// `point` lies on the surface, `normal` is its unit geometric normal on the side of departure,
/// `reach` the largest distance from the point to a corner of the triangle (or of whatever else
/// lies in the same plane and must not be hit). In exact arithmetic the result is at least
/// [`CLEARANCE`]·`reach` off the plane.
///
/// ```
/// use niwaki_render::offset::offset_origin;
/// use niwaki_core::glam::{DVec3, Vec3};
/// let origin = offset_origin(DVec3::new(1e6, 0.1, 3.0), Vec3::Y, 2.0);
/// assert!(origin.y > 0.1 && origin.y < 0.100_01);
/// assert_eq!(origin.x, 1e6);
/// ```
#[must_use]
pub fn offset_origin(point: DVec3, normal: Vec3, reach: f64) -> Vec3 {
    let moved = point + normal.as_dvec3() * (f64::from(CLEARANCE) * reach);
    let outward = |x: f64, from: f64, n: f32| {
        if n == 0.0 {
            // Parallel to the plane: either side will do, take the nearest.
            let (low, high) = (round_down(x), round_up(x));
            return if x - f64::from(low) <= f64::from(high) - x { low } else { high };
        }
        // Far from the origin a tiny clearance vanishes even in `f64`; one step must remain.
        let rounded = if n > 0.0 { round_up(x) } else { round_down(x) };
        match (f64::from(rounded) == from, n > 0.0) {
            (true, true) => rounded.next_up(),
            (true, false) => rounded.next_down(),
            (false, _) => rounded,
        }
    };
    Vec3::new(
        outward(moved.x, point.x, normal.x),
        outward(moved.y, point.y, normal.y),
        outward(moved.z, point.z, normal.z),
    )
}
