//! How hard a decision is for `f32` arithmetic.

use crate::contact::plane_t;
use glam::{DVec2, DVec3};
use niwaki_core::{Ray, Triangle, float::UNIT_ROUNDOFF};

/// How near the line of a ray passes to the border of a triangle, measured across the ray, in
/// `f32` ulp of the largest coordinate involved: that of a corner, of the origin, or of a corner
/// seen from the origin. (An ulp of `x` is the step from `|x|` to the next larger `f32`.)
///
/// This is the distance that rounding would have to move something by to change what the ray
/// hits: kernels translate corners to the origin and project them along the ray, and each step
/// rounds by half an ulp of such a coordinate. Computed in `f64`, good to 10⁻⁶ ulp. Infinite for
/// input that is not finite and for a zero direction.
#[must_use]
pub fn border_distance_ulps(ray: &Ray, triangle: &Triangle) -> f64 {
    View::of(ray).map_or(f64::INFINITY, |view| view.border_distance_ulps(triangle))
}

/// The corner of a triangle from which a kernel measures the distance to the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Anchor {
    /// Whichever makes the error least: kernels that weight the distances of all corners by the
    /// barycentric coordinates, such as Woop's, come close to that. The default.
    #[default]
    Best,
    /// The first, as Möller and Trumbore's: the error of the normal counts with the distance from
    /// the origin to that corner, which is much where a needle's far end comes first.
    First,
}

/// A bound on the error of `t` in `f32` kernels for a ray that passes through or next to a
/// triangle, in the unit of `t`: 16 units of roundoff (2⁻²⁴) times the condition of Möller and
/// Trumbore's quotient, anchored as given, plus what a shift of the ray by 16 units of the largest
/// coordinate seen from the origin does to `t` (this is what shearing kernels such as Woop's add).
/// It grows without limit as the ray comes to lie in the plane, and is infinite there and for input
/// that is not finite.
#[must_use]
pub fn t_error_bound(ray: &Ray, triangle: &Triangle, anchor: Anchor) -> f64 {
    let origin = ray.origin.as_dvec3();
    let direction = ray.direction.as_dvec3();
    let corners = triangle.vertices().map(|v| v.as_dvec3());
    let [a, b, c] = corners.map(|corner| corner - origin);
    // Not from the corners as seen from the origin, which f64 may take for one point.
    let (ab, ac) = (corners[1] - corners[0], corners[2] - corners[0]);
    let normal = ab.cross(ac);
    let Some(t) = plane_t(ray, triangle) else { return f64::INFINITY };
    // The sums of the absolute values of all products: what relative rounding errors scale with.
    let (ab, ac) = (ab.abs(), ac.abs());
    let products =
        DVec3::new(ab.y * ac.z + ab.z * ac.y, ab.z * ac.x + ab.x * ac.z, ab.x * ac.y + ab.y * ac.x);
    let far = [a, b, c].map(|p| p.abs().dot(products));
    let far = match anchor {
        Anchor::First => far[0],
        Anchor::Best => far.into_iter().fold(f64::INFINITY, f64::min),
    };
    // What f64 cannot tell from 0 is a plane that the ray may lie in.
    let sum = direction.abs().dot(products);
    let det = direction.dot(normal).abs() - sum * 2.0_f64.powi(-48);
    // False for NaN, too.
    let is_clear = det > 0.0;
    if !is_clear {
        return f64::INFINITY;
    }
    let quotient = far + t.abs() * sum;
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let shift = largest * normal.length();
    16.0 * f64::from(UNIT_ROUNDOFF) * (quotient + shift) / det
}

/// The plane across a ray, for measuring distances to its line.
pub(crate) struct View {
    origin: DVec3,
    right: DVec3,
    up: DVec3,
    largest: f64,
}

impl View {
    /// `None` for a ray whose line is not defined.
    pub(crate) fn of(ray: &Ray) -> Option<Self> {
        let origin = ray.origin.as_dvec3();
        // Squares of f32 values neither overflow nor vanish in f64.
        let forward = ray.direction.as_dvec3().try_normalize()?;
        if !origin.is_finite() {
            return None;
        }
        let (right, up) = forward.any_orthonormal_pair();
        Some(Self { origin, right, up, largest: origin.abs().max_element() })
    }

    fn project(&self, triangle: &Triangle) -> ([DVec2; 3], f64) {
        let corners = triangle.vertices().map(|v| v.as_dvec3());
        let mut largest = self.largest;
        let projected = corners.map(|corner| {
            let seen = corner - self.origin;
            largest = largest.max(corner.abs().max(seen.abs()).max_element());
            DVec2::new(seen.dot(self.right), seen.dot(self.up))
        });
        (projected, largest)
    }

    pub(crate) fn border_distance_ulps(&self, triangle: &Triangle) -> f64 {
        let ([a, b, c], largest) = self.project(triangle);
        let distance =
            segment_distance(a, b).min(segment_distance(b, c)).min(segment_distance(c, a));
        if triangle.vertices().iter().all(|v| v.is_finite()) {
            distance / ulp(largest)
        } else {
            f64::INFINITY
        }
    }

    /// False only if the line passes the triangle at more than `ulps` in the sense of
    /// [`border_distance_ulps`]: a cheap filter.
    pub(crate) fn may_come_near(&self, triangle: &Triangle, ulps: f64) -> bool {
        let ([a, b, c], largest) = self.project(triangle);
        // 2⁻⁴⁶ is over 60 units of f64 roundoff for the projection.
        let margin = ulps * ulp(largest) + largest * 2.0_f64.powi(-46);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        low.x <= margin && low.y <= margin && high.x >= -margin && high.y >= -margin
    }
}

/// The step from an `f32` of magnitude `x` to the next larger one, for every positive `f64` in
/// the range of normal `f32` and, extended, above; the step between denormals below.
fn ulp(x: f64) -> f64 {
    // The power of two at or below x: its bits without the fraction.
    let power = f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000);
    (power * f64::from(f32::EPSILON)).max(2.0_f64.powi(-149))
}

/// Distance of the segment from `a` to `b` to the point 0.
fn segment_distance(a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let length_squared = along.length_squared();
    let s =
        if length_squared > 0.0 { (-a.dot(along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (a + along * s).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::glam::Vec3;

    #[test]
    fn distances_count_in_ulps_of_the_largest_coordinate() {
        let triangle =
            Triangle::new(Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 4.0, 0.0));
        let ray = |x: f32, z: f32| Ray::new(Vec3::new(x, 1.0, z), Vec3::NEG_Z);
        let ulp4 = 4.0_f32.next_up() - 4.0;
        for n in [0_u8, 1, 5, 100] {
            let n = f32::from(n);
            assert_eq!(border_distance_ulps(&ray(n * ulp4, 1.0), &triangle), f64::from(n));
            assert_eq!(border_distance_ulps(&ray(-n * ulp4, 1.0), &triangle), f64::from(n));
            // From 256 times as far, one step is 256 times as wide.
            let far = border_distance_ulps(&ray(n * ulp4, 1024.0), &triangle);
            assert_eq!(far, f64::from(n) / 256.0);
        }
        assert_eq!(
            border_distance_ulps(&Ray::new(Vec3::ZERO, Vec3::ZERO), &triangle),
            f64::INFINITY
        );
    }

    #[test]
    fn the_step_is_that_of_f32() {
        for x in [1.0_f32, 1.5, 0.1, 3e38, 1e-45, 1e-38, 2e-38, 7.0] {
            let expected = f64::from(x) - f64::from(x.next_down());
            // A power of two has the smaller step below it: look above where that exists.
            let above = f64::from(x.next_up()) - f64::from(x);
            let step = ulp(f64::from(x));
            assert!(step == above || (x == 3e38 && step == expected), "{x}: {step} {above}");
        }
    }
}
