//! Tubes around curves.

use super::math::circle;
use glam::DVec3;

/// A point on the surface of a tube: `around` turns about the curve point `center` with unit
/// tangent `tangent`, at distance `radius`. `reference` must not be parallel to the tangent; the
/// same reference along a curve gives a surface without twist.
pub(super) fn tube(
    center: DVec3,
    tangent: DVec3,
    reference: DVec3,
    around: f64,
    radius: f64,
) -> DVec3 {
    let side = tangent.cross(reference).normalize();
    let up = side.cross(tangent);
    let c = circle(around);
    center + (side * c.x + up * c.z) * radius
}

/// The unit tangent of a curve by central difference.
pub(super) fn tangent(curve: impl Fn(f64) -> DVec3, t: f64) -> DVec3 {
    const H: f64 = 1e-5;
    (curve(t + H) - curve(t - H)).normalize()
}
