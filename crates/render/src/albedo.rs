//! How much a rough dielectric coat reflects in all, tabulated, so that the base below it gets
//! exactly the rest.

use crate::{
    fresnel::dielectric,
    microfacet::{SMOOTH, masking, masking_shadowing, sample_visible},
};
use glam::{Vec2, Vec3};

/// Nodes over the cosine of the viewing angle, denser towards grazing angles.
const COSINES: usize = 33;
/// Nodes over perceptual roughness, 0 to 1.
const ROUGHNESSES: usize = 17;
/// Strata per axis of the integral at a node.
const STRATA: usize = 16;

/// Directional albedo E(μ) of a GGX coat with dielectric Fresnel reflection and its
/// cosine-weighted mean, for one index of refraction.
///
/// With these, the diffuse base is scaled by (1 − E(μₒ))(1 − E(μᵢ)) / (1 − E_avg), which is
/// reciprocal and loses nothing (Kelemen and Szirmay-Kalos 2001, section 3; Kulla and Conty 2017).
#[derive(Clone, Debug)]
pub(crate) struct CoatAlbedo {
    directional: Vec<[f32; COSINES]>,
    mean: [f32; ROUGHNESSES],
}

/// The cosine of node `i`: squares of equal steps.
fn node_cosine(i: usize) -> f32 {
    let t = i as f32 / (COSINES - 1) as f32;
    t * t
}

/// Cell and fraction of `t` in 0 to 1 on `nodes` equal steps.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the number of nodes first"
)]
fn cell(t: f32, nodes: usize) -> (usize, f32) {
    let x = t.clamp(0.0, 1.0) * (nodes - 1) as f32;
    let i = (x as usize).min(nodes - 2);
    (i, x - i as f32)
}

impl CoatAlbedo {
    /// Tabulates the coat of this index of refraction (relative to outside).
    pub(crate) fn new(ior: f32) -> Self {
        let mut directional = vec![[0.0; COSINES]; ROUGHNESSES];
        let mut mean = [0.0; ROUGHNESSES];
        for (r, row) in directional.iter_mut().enumerate() {
            let roughness = r as f32 / (ROUGHNESSES - 1) as f32;
            for (c, albedo) in row.iter_mut().enumerate() {
                *albedo = integrate(node_cosine(c), roughness * roughness, ior);
            }
            mean[r] = cosine_mean(row);
        }
        Self { directional, mean }
    }

    /// E(μ) at cosine `cosine` for perceptual roughness `roughness`, and its cosine-weighted mean
    /// over the hemisphere (of the interpolated table itself, so that energy is conserved to
    /// rounding).
    pub(crate) fn get(&self, cosine: f32, roughness: f32) -> (f32, f32) {
        let (r, fr) = cell(roughness, ROUGHNESSES);
        let (c, _) = cell(cosine.max(0.0).sqrt(), COSINES);
        let (low, high) = (node_cosine(c), node_cosine(c + 1));
        let fc = ((cosine - low) / (high - low)).clamp(0.0, 1.0);
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |r: usize| lerp(self.directional[r][c], self.directional[r][c + 1], fc);
        (lerp(row(r), row(r + 1), fr), lerp(self.mean[r], self.mean[r + 1], fr))
    }
}

/// 2 ∫ E(μ) μ dμ of the piecewise linear E.
fn cosine_mean(row: &[f32; COSINES]) -> f32 {
    let mut sum = 0.0_f64;
    for c in 0..COSINES - 1 {
        let (a, b) = (f64::from(node_cosine(c)), f64::from(node_cosine(c + 1)));
        let (ea, eb) = (f64::from(row[c]), f64::from(row[c + 1]));
        // Simpson's rule is exact for the product of two linear functions.
        sum += (b - a) / 6.0 * (a * ea + 2.0 * (a + b) * 0.5 * (ea + eb) + b * eb);
    }
    #[expect(clippy::cast_possible_truncation, reason = "a mean of f32 values in 0 to 1")]
    let mean = (2.0 * sum) as f32;
    mean
}

fn integrate(cosine: f32, alpha: f32, ior: f32) -> f32 {
    if alpha < SMOOTH {
        return dielectric(cosine, ior);
    }
    let cosine = cosine.max(1e-4);
    let wo = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let mut sum = 0.0;
    for i in 0..STRATA * STRATA {
        let u = Vec2::new((i % STRATA) as f32 + 0.5, (i / STRATA) as f32 + 0.5) / STRATA as f32;
        let m = sample_visible(wo, alpha, u);
        let wi = crate::fresnel::reflect(wo, m);
        if wi.z > 0.0 {
            sum +=
                dielectric(wo.dot(m), ior) * masking_shadowing(wo, wi, alpha) / masking(wo, alpha);
        }
    }
    sum / (STRATA * STRATA) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_coats_reflect_as_fresnel_says() {
        let table = CoatAlbedo::new(1.5);
        assert!((table.get(1.0, 0.0).0 - 0.04).abs() < 1e-5);
        assert!((table.get(0.0, 0.0).0 - 1.0).abs() < 1e-5);
        for i in 1..50 {
            let cosine = i as f32 / 50.0;
            assert!((table.get(cosine, 0.0).0 - dielectric(cosine, 1.5)).abs() < 6e-3, "{cosine}");
        }
        // The diffuse reflectance of a smooth interface of index 1.5 from outside is 0.0918
        // (d'Eon and Irving 2011, eq. 5: 0.0919 by their fit).
        assert!((table.get(1.0, 0.0).1 - 0.0918).abs() < 1e-3, "{}", table.get(1.0, 0.0).1);
    }

    #[test]
    fn no_interface_reflects_nothing() {
        let table = CoatAlbedo::new(1.0);
        let (directional, mean) = table.get(0.5, 0.5);
        assert!(directional < 1e-6 && mean < 1e-6, "{directional} {mean}");
    }
}
