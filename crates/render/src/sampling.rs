//! Mappings from the unit square to directions, and the frame they live in.

use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// An orthonormal basis whose third axis is the normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    tangent: Vec3,
    bitangent: Vec3,
    normal: Vec3,
}

impl Frame {
    /// A basis around a unit normal (Duff et al. 2017, "Building an Orthonormal Basis,
    /// Revisited", JCGT 6(1)).
    pub(crate) fn new(normal: Vec3) -> Self {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        Self { tangent, bitangent, normal }
    }

    pub(crate) fn to_world(self, v: Vec3) -> Vec3 {
        (self.tangent * v.x + self.bitangent * v.y + self.normal * v.z).normalize_or(self.normal)
    }

    pub(crate) fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.tangent), v.dot(self.bitangent), v.dot(self.normal))
    }
}

/// A direction around +z with density cos θ / π (Malley's method: a uniform point of the disc,
/// lifted to the hemisphere).
pub(crate) fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let radius = u.x.sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, (1.0 - u.x).sqrt())
}

/// A direction with density 1 / 4π.
pub(crate) fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, z)
}

/// Barycentric weights (u, v) of the second and third corner of a uniform point of a triangle
/// (Osada et al. 2002, "Shape distributions", section 4.2).
pub(crate) fn uniform_triangle(u: Vec2) -> (f32, f32) {
    let root = u.x.sqrt();
    ((1.0 - u.y) * root, u.y * root)
}

/// Weight of the strategy with density `a` when the other has density `b`: the power heuristic
/// with exponent 2 (Veach 1997, section 9.2.4), formed so that squares cannot overflow.
pub(crate) fn power_heuristic(a: f32, b: f32) -> f32 {
    if a.is_infinite() || b <= 0.0 {
        return 1.0;
    }
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}

/// Relative luminance of linear RGB with the primaries of sRGB (ITU-R BT.709).
#[must_use]
pub(crate) fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.212_6, 0.715_2, 0.072_2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_the_mappings_are_those_of_their_densities() {
        let n = 128;
        let mut cosine = 0.0;
        let mut sphere = Vec3::ZERO;
        let mut corners = (0.0, 0.0);
        for i in 0..n * n {
            let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
            cosine += cosine_hemisphere(u).z;
            sphere += uniform_sphere(u) * uniform_sphere(u);
            let (a, b) = uniform_triangle(u);
            assert!(a >= 0.0 && b >= 0.0 && a + b <= 1.0);
            corners = (corners.0 + a, corners.1 + b);
        }
        let count = (n * n) as f32;
        // E[cos θ] under cos θ / π is 2/3; each squared coordinate on the sphere has mean 1/3.
        assert!((cosine / count - 2.0 / 3.0).abs() < 1e-3);
        assert!((sphere / count - Vec3::splat(1.0 / 3.0)).abs().max_element() < 1e-3);
        assert!((corners.0 / count - 1.0 / 3.0).abs() < 1e-3);
        assert!((corners.1 / count - 1.0 / 3.0).abs() < 1e-3);
    }

    #[test]
    fn heuristic_weights_sum_to_one() {
        for (a, b) in [(1.0, 1.0), (1e30, 1e-30), (1e-30, 1e30), (3.0, 4.0), (1e38, 1e38)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6, "{a} {b}");
        }
        assert_eq!(power_heuristic(1.0, 0.0), 1.0);
        assert_eq!(power_heuristic(0.0, 1.0), 0.0);
    }

    #[test]
    fn frames_keep_lengths_and_return() {
        for normal in [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::new(0.6, 0.0, -0.8)] {
            let frame = Frame::new(normal);
            let v = Vec3::new(0.36, 0.48, 0.8);
            assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-6);
            assert!((frame.to_world(Vec3::Z) - normal).length() < 1e-6);
        }
    }
}
