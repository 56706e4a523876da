//! The GGX distribution of microfacet normals with visible-normal sampling.
//!
//! All directions are unit vectors in a frame whose z axis is the surface normal. `alpha` is the
//! GGX width, the square of perceptual roughness.

use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Below this width a lobe is treated as a perfect mirror: its density would need more digits of
/// the half vector than `f32` has, and it is narrower than a pixel (roughness under 0.032).
pub(crate) const SMOOTH: f32 = 1e-3;

/// The density D of normals `m` (Walter et al. 2007, eq. 33), written by components so that
/// narrow lobes do not cancel.
pub(crate) fn distribution(m: Vec3, alpha: f32) -> f32 {
    let scaled = (m.x * m.x + m.y * m.y) / (alpha * alpha) + m.z * m.z;
    if m.z <= 0.0 { 0.0 } else { 1.0 / (PI * alpha * alpha * scaled * scaled) }
}

/// Smith's Λ (Heitz 2014, eq. 72).
pub(crate) fn lambda(w: Vec3, alpha: f32) -> f32 {
    let tan_squared = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    if tan_squared.is_finite() {
        0.5 * ((1.0 + alpha * alpha * tan_squared).sqrt() - 1.0)
    } else {
        f32::INFINITY
    }
}

/// Share of facets visible from `w`.
pub(crate) fn masking(w: Vec3, alpha: f32) -> f32 {
    1.0 / (1.0 + lambda(w, alpha))
}

/// Share of facets visible from both, with height correlation (Heitz 2014, eq. 99).
pub(crate) fn masking_shadowing(wo: Vec3, wi: Vec3, alpha: f32) -> f32 {
    1.0 / (1.0 + lambda(wo, alpha) + lambda(wi, alpha))
}

/// Density of normals visible from `wo`: what [`sample_visible`] draws from.
pub(crate) fn visible_density(wo: Vec3, m: Vec3, alpha: f32) -> f32 {
    masking(wo, alpha) * distribution(m, alpha) * wo.dot(m).max(0.0) / wo.z.max(f32::MIN_POSITIVE)
}

/// A normal visible from `wo` (`wo.z` > 0), by spherical caps (Dupuy and Benyoub 2023, "Sampling
/// Visible GGX Normals with Spherical Caps", algorithm 3).
pub(crate) fn sample_visible(wo: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let stretched = Vec3::new(wo.x * alpha, wo.y * alpha, wo.z).normalize_or(Vec3::Z);
    let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.x).sin_cos();
    let h = Vec3::new(radius * cos, radius * sin, z) + stretched;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::uniform_sphere;

    fn grid(n: usize) -> impl Iterator<Item = Vec2> {
        (0..n * n).map(move |i| Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32)
    }

    #[test]
    fn densities_integrate_to_one() {
        for alpha in [0.25, 0.5, 1.0] {
            for wo in [Vec3::Z, Vec3::new(0.8, 0.0, 0.6), Vec3::new(0.0, 0.995, 0.0999)] {
                let n = 512;
                let (mut visible, mut projected) = (0.0_f64, 0.0_f64);
                for u in grid(n) {
                    let m = uniform_sphere(u);
                    visible += f64::from(visible_density(wo, m, alpha));
                    projected += f64::from(distribution(m, alpha) * m.z.max(0.0));
                }
                let scale = 4.0 * std::f64::consts::PI / (n * n) as f64;
                assert!((visible * scale - 1.0).abs() < 0.02, "{alpha} {wo}: {}", visible * scale);
                assert!((projected * scale - 1.0).abs() < 0.02, "{alpha}: {}", projected * scale);
            }
        }
    }

    #[test]
    fn samples_follow_the_visible_density() {
        // The mean of any function over samples must equal its integral against the density; the
        // three components of m fix orientation and spread.
        let (alpha, n) = (0.5, 512);
        for wo in [Vec3::Z, Vec3::new(0.8, 0.0, 0.6), Vec3::new(-0.5, 0.8, 0.33).normalize()] {
            let sampled: Vec3 =
                grid(n).map(|u| sample_visible(wo, alpha, u)).sum::<Vec3>() / (n * n) as f32;
            let integrated: Vec3 = grid(n)
                .map(uniform_sphere)
                .map(|m| m * visible_density(wo, m, alpha))
                .sum::<Vec3>()
                * (4.0 * PI / (n * n) as f32);
            assert!((sampled - integrated).length() < 0.01, "{wo}: {sampled} {integrated}");
        }
    }
}
