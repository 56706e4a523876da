//! The shading model of the Whitted integrator: plain functions on plain values, without chance,
//! so that a GPU can compute the same.
//!
//! At a point let *o* be the unit direction to the viewer, *n* the unit shading normal on the
//! viewer's side, μ = n·o, and from the material with its textures: base colour *c*, metallic *m*,
//! perceptual roughness ρ, transmission τ, index of refraction η. The *limit* r is
//! [`SceneFacts::mirror_roughness`](niwaki_scene::SceneFacts). A point is shared out between three
//! lobes,
//!
//! | lobe | weight | reflectance |
//! |---|---|---|
//! | metal | wₘ = m | Fₘ(x) = c + (1 − c)(1 − x)⁵, Schlick 1994 |
//! | interface between dielectrics | wₜ = (1 − m) τ | F(x, η from the viewer's side to beyond), Fresnel's equations |
//! | diffuse base under a dielectric coat | w_d = (1 − m)(1 − τ) | F(x, η), and c below it |
//!
//! and metal and coat between a *mirror* of share s, s' and a *highlight* of the rest. With
//! p = clamp(2 − 2ρ/r, 0, 1) ([`mirror_share`]), metals have s = p · clamp(4m − 2, 0, 1)
//! ([`metal_mirror_share`]), so that noise in a texture of metallic calls for no rays, and coats
//! have s' = p if the material is [polished](niwaki_scene::MaterialFacts::polished) throughout,
//! else 0. Then the radiance towards the viewer is
//!
//! L = e + L_a + Σ_l f(l) E_l V_l + K_r L(reflected) + K_t L(refracted)
//!
//! - e is the emission, on both sides of a surface.
//! - K_r = wₘ s Fₘ(μ) + w_d s' F(μ) + wₜ F(μ) ([`reflected`])
//! - K_t = wₜ (1 − F(μ)) c ([`refracted`]); past the critical angle F = 1, so K_t = 0
//! - f(l) = w_d c/π · (1 − F(μ))(1 − F(μ_l))/(1 − F̄) · μ_l
//!   \+ [wₘ (1 − s) Fₘ(h·o) + w_d (1 − s') F(h·o)] · D(h) G(o, l)/(4 μ) ([`direct`]), where l is the
//!   unit direction to a light, μ_l = n·l (0 if negative), h the half vector, D and G those of GGX
//!   (Walter et al. 2007, eq. 33; Heitz 2014, eq. 99) of width α = max(ρ, 0.1)², and
//!   F̄ = 2 ∫ F(x) x dx ([`mean_fresnel`]). The base gets exactly what a smooth coat lets through,
//!   both ways, which is reciprocal and loses nothing (Kelemen and Szirmay-Kalos 2001).
//! - E_l is the irradiance from light l on a surface that faces it (`niwaki_scene::Light`), V_l
//!   the share that alpha lets through: surfaces that transmit cast whole shadows.
//! - L_a = A(n) · [w_d c (1 − F(μ)) + wₘ (1 − s) Fₘ(μ) + w_d (1 − s') F(μ)] ([`ambient`]): what a
//!   uniform surrounding of radiance A would send, were nothing in its way. A blends from
//!   below to above with n_y ([`Ambient`]).
//!
//! On the way through a material that transmits, Beer's law takes exp(−σ d) of radiance, d being
//! the length of a segment that ends on the inside. Alpha α mixes: α L + (1 − α) L(straight on);
//! a mask is α of 0 or 1.
//!
//! Left out, and why: the factor 1/η² of radiance inside denser media, which cancels for all that
//! leaves what it entered, and would darken what lies behind panes modelled as one sheet; rough
//! interfaces, which are taken as smooth; what highlights reflect other than lights, which the
//! ambient term stands for.

use crate::fresnel::{conductor, dielectric};
use glam::Vec3;
use niwaki_core::glam;
use niwaki_scene::Environment;
use std::f32::consts::{FRAC_1_PI, PI};

/// Highlights are never narrower than that of this perceptual roughness: where a texture is
/// smoother in places, `f32` and a pixel both have too few digits.
pub const LEAST_GLOSS: f32 = 0.1;

/// A material at one point, textures looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMaterial {
    /// Base colour c, linear RGB, 0 to 1.
    pub base: Vec3,
    /// Metallic m, 0 to 1.
    pub metallic: f32,
    /// Perceptual roughness ρ, 0 to 1.
    pub roughness: f32,
    /// Transmission τ, 0 to 1.
    pub transmission: f32,
    /// Index of refraction of the inside over the outside, at least 1.
    pub ior: f32,
    /// [`mean_fresnel`] of `ior`; the same for all points of a material.
    pub mean_fresnel: f32,
    /// Mirror share s of a metal here: [`metal_mirror_share`].
    pub mirror: f32,
    /// Mirror share s' of a coat here: [`mirror_share`], or 0 if the material is not polished
    /// throughout.
    pub coat_mirror: f32,
    /// Seen from outside.
    pub front: bool,
}

impl PointMaterial {
    /// wₘ, wₜ and w_d.
    #[must_use]
    pub const fn weights(&self) -> (f32, f32, f32) {
        let rest = 1.0 - self.metallic;
        (self.metallic, rest * self.transmission, rest * (1.0 - self.transmission))
    }

    /// The index beyond the surface over that on the viewer's side.
    #[must_use]
    pub fn eta(&self) -> f32 {
        if self.front { self.ior } else { self.ior.recip() }
    }
}

/// p: 1 up to half of the limit of roughness, 0 from the limit on, linear between. A limit of 0
/// leaves perfect mirrors.
#[must_use]
pub fn mirror_share(roughness: f32, limit: f32) -> f32 {
    (2.0 - 2.0 * roughness / limit.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0)
}

/// s: [`mirror_share`], but none up to a metallic of 1/2, and all of it only from 3/4 on.
#[must_use]
pub fn metal_mirror_share(roughness: f32, metallic: f32, limit: f32) -> f32 {
    mirror_share(roughness, limit) * (4.0 * metallic - 2.0).clamp(0.0, 1.0)
}

/// F̄: the share of uniform light that a smooth dielectric of index `ior` (at least 1) reflects on
/// its outside, 2 ∫ F(x) x dx. 0 at 1; 0.0918 for glass.
///
/// The closed form of Walsh 1926, as Duntley 1942 gives it, in `f64` because its terms cancel near
/// 1; below 1.02, where they cancel too far, the leading terms of F itself are integrated.
///
/// ```
/// assert!((niwaki_render::shading::mean_fresnel(1.5) - 0.0918).abs() < 5e-5);
/// ```
#[must_use]
pub fn mean_fresnel(ior: f32) -> f32 {
    let n = f64::from(ior);
    let mean = if n < 1.02 { midpoints(ior) } else { walsh(n) };
    #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
    let mean = mean.clamp(0.0, 1.0) as f32;
    mean
}

/// The closed form.
fn walsh(n: f64) -> f64 {
    let n2 = n * n;
    let (sum, difference) = (n2 + 1.0, n2 - 1.0);
    0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0) * (n + 1.0))
        + n2 * difference * difference / sum.powi(3) * ((n - 1.0) / (n + 1.0)).ln()
        - 2.0 * n * n2 * (n2 + 2.0 * n - 1.0) / (sum * (n2 * n2 - 1.0))
        + 8.0 * n2 * n2 * (n2 * n2 + 1.0) / (sum * (n2 * n2 - 1.0).powi(2)) * n.ln()
}

/// The integral by midpoints, which crowd towards grazing angles.
fn midpoints(ior: f32) -> f64 {
    const STEPS: u16 = 512;
    let sum: f64 = (0..STEPS)
        .map(|i| {
            let t = (f32::from(i) + 0.5) / f32::from(STEPS);
            // x = t², dx = 2 t dt.
            f64::from(dielectric(t * t, ior) * 4.0 * t * t * t)
        })
        .sum();
    sum / f64::from(STEPS)
}

/// K_r: what a reflected ray's radiance counts. `cosine` is μ, 0 to 1.
#[must_use]
pub fn reflected(m: &PointMaterial, cosine: f32) -> Vec3 {
    let (metal, interface, base) = m.weights();
    let coat = base * m.coat_mirror * dielectric(cosine, m.ior);
    let interface = interface * dielectric(cosine, m.eta());
    conductor(cosine, m.base) * (metal * m.mirror) + Vec3::splat(coat + interface)
}

/// K_t: what a refracted ray's radiance counts.
#[must_use]
pub fn refracted(m: &PointMaterial, cosine: f32) -> Vec3 {
    let (_, interface, _) = m.weights();
    m.base * (interface * (1.0 - dielectric(cosine, m.eta())))
}

/// f(l): what the irradiance of a light in the unit direction `to_light` counts; `normal` and
/// `to_viewer` are unit, the viewer on the normal's side.
#[must_use]
pub fn direct(m: &PointMaterial, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
    let (metal, _, base) = m.weights();
    let (cosine, light_cosine) = (normal.dot(to_viewer), normal.dot(to_light));
    if cosine <= 0.0 || light_cosine <= 0.0 {
        return Vec3::ZERO;
    }
    let passed = (1.0 - dielectric(cosine, m.ior)) * (1.0 - dielectric(light_cosine, m.ior));
    let mut f =
        m.base * (base * passed / (1.0 - m.mean_fresnel).max(1e-6) * light_cosine * FRAC_1_PI);
    let (metal, coat) = (metal * (1.0 - m.mirror), base * (1.0 - m.coat_mirror));
    if metal > 0.0 || (coat > 0.0 && m.ior > 1.0) {
        let half = (to_viewer + to_light).normalize_or(normal);
        let facing = half.dot(to_viewer).clamp(0.0, 1.0);
        let gloss = m.roughness.max(LEAST_GLOSS);
        let lobe = ggx(gloss * gloss, half.dot(normal), cosine, light_cosine);
        let coat = Vec3::splat(coat * dielectric(facing, m.ior));
        f += (conductor(facing, m.base) * metal + coat) * lobe;
    }
    f
}

/// D(h) G(o, l) / (4 μ): GGX of width `alpha` with height-correlated masking, times the cosine of
/// the light. All cosines are to the normal.
fn ggx(alpha: f32, half: f32, viewer: f32, light: f32) -> f32 {
    let a2 = alpha * alpha;
    let t = half * half * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * t * t);
    let lambda = |x: f32| 0.5 * ((1.0 + a2 * (1.0 - x * x).max(0.0) / (x * x)).sqrt() - 1.0);
    distribution / (1.0 + lambda(viewer) + lambda(light)) / (4.0 * viewer)
}

/// What ambient radiance counts: the share of uniform light that goes to the viewer by the lobes
/// that no ray follows.
#[must_use]
pub fn ambient(m: &PointMaterial, cosine: f32) -> Vec3 {
    let (metal, _, base) = m.weights();
    let fresnel = dielectric(cosine, m.ior);
    m.base * (base * (1.0 - fresnel))
        + conductor(cosine, m.base) * (metal * (1.0 - m.mirror))
        + Vec3::splat(base * (1.0 - m.coat_mirror) * fresnel)
}

/// Ambient radiance A: that of an upper and a lower half of the surroundings. Linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ambient {
    /// On surfaces that face up.
    pub up: Vec3,
    /// On surfaces that face down.
    pub down: Vec3,
}

impl Ambient {
    /// `share` of the cosine-weighted mean radiance of the upper and the lower half of an
    /// environment. A sky's falls off from the horizon h to the zenith z with the square of the
    /// height, which makes the mean h + 5/6 (z − h).
    #[must_use]
    pub fn of(environment: &Environment, share: f32) -> Self {
        let (up, down) = match *environment {
            Environment::Constant(radiance) => (radiance, radiance),
            Environment::Sky { zenith, horizon, ground } => {
                (horizon.lerp(zenith, 5.0 / 6.0), horizon.lerp(ground, 5.0 / 6.0))
            }
        };
        Self { up: up * share, down: down * share }
    }

    /// A(n) for a unit normal: exact where the two halves are uniform, because a surface sees
    /// (1 + n_y) / 2 of the upper one, weighted by the cosine.
    #[must_use]
    pub fn at(&self, normal: Vec3) -> Vec3 {
        self.down.lerp(self.up, 0.5 + 0.5 * normal.y)
    }

    /// True if there is none.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        self.up.max(self.down).max_element() <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(metallic: f32, transmission: f32, roughness: f32) -> PointMaterial {
        PointMaterial {
            base: Vec3::new(0.9, 0.5, 0.2),
            metallic,
            roughness,
            transmission,
            ior: 1.5,
            mean_fresnel: mean_fresnel(1.5),
            mirror: metal_mirror_share(roughness, metallic, 0.3),
            coat_mirror: mirror_share(roughness, 0.3),
            front: true,
        }
    }

    #[test]
    fn the_mean_of_fresnel_is_its_integral() {
        assert_eq!(mean_fresnel(1.0), 0.0);
        for ior in [1.001, 1.019, 1.021, 1.1, 1.333, 1.5, 2.4, 10.0] {
            let (closed, integral) = (mean_fresnel(ior), midpoints(ior));
            assert!((f64::from(closed) - integral).abs() < 2e-5, "{ior}: {closed} {integral}");
        }
    }

    #[test]
    fn nothing_is_lost_or_made() {
        for roughness in [0.0, 0.2, 0.3, 1.0] {
            for (metallic, transmission) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.3, 0.6)] {
                let m = PointMaterial {
                    base: Vec3::ONE,
                    ..material(metallic, transmission, roughness)
                };
                for cosine in [0.05, 0.5, 1.0] {
                    // In a uniform surrounding a white surface looks like the surrounding.
                    let all = reflected(&m, cosine) + refracted(&m, cosine) + ambient(&m, cosine);
                    assert!((all - Vec3::ONE).abs().max_element() < 1e-6, "{m:?}: {all}");
                }
            }
        }
    }

    #[test]
    fn the_base_under_a_coat_integrates_to_its_ambient_share() {
        // Direct light from all directions is what the ambient term stands for.
        let m = PointMaterial { coat_mirror: 1.0, ..material(0.0, 0.0, 0.0) };
        let cosine: f32 = 0.7;
        let viewer = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let n = 400;
        let mut sum = glam::DVec3::ZERO;
        for i in 0..n {
            let (t, dt) = ((i as f32 + 0.5) / n as f32, 1.0 / n as f32);
            let z = t * t;
            let light = Vec3::new(0.0, (1.0 - z * z).sqrt(), z);
            sum += (direct(&m, Vec3::Z, viewer, light) * (2.0 * PI * 2.0 * t * dt)).as_dvec3();
        }
        let expected = ambient(&m, cosine);
        assert!((sum.as_vec3() - expected).abs().max_element() < 1e-4, "{sum} {expected}");
    }

    #[test]
    fn highlights_integrate_to_no_more_than_fresnel() {
        for roughness in [0.3, 0.6, 1.0] {
            let m = PointMaterial { base: Vec3::ONE, ..material(1.0, 0.0, roughness) };
            let viewer = Vec3::new(0.6, 0.0, 0.8);
            let n = 300;
            let mut sum = 0.0_f64;
            for i in 0..n {
                for j in 0..n {
                    let (z, phi) = ((i as f32 + 0.5) / n as f32, 2.0 * PI * j as f32 / n as f32);
                    let ring = (1.0 - z * z).sqrt();
                    let light = Vec3::new(ring * phi.cos(), ring * phi.sin(), z);
                    sum += f64::from(direct(&m, Vec3::Z, viewer, light).x);
                }
            }
            let albedo = sum * 2.0 * std::f64::consts::PI / f64::from(n * n);
            // What scatters twice between facets is lost: little on smooth surfaces.
            let least = if roughness < 0.5 { 0.97 } else { 0.3 };
            assert!(albedo < 1.001 && albedo > least, "{roughness}: {albedo}");
        }
    }

    #[test]
    fn light_is_exchanged_both_ways_alike() {
        let (a, b) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.2, 0.7, 0.4).normalize());
        for (metallic, roughness) in [(0.0, 0.5), (1.0, 0.4), (0.5, 0.2)] {
            let m = material(metallic, 0.2, roughness);
            let (forth, back) = (direct(&m, Vec3::Z, a, b) * a.z, direct(&m, Vec3::Z, b, a) * b.z);
            assert!((forth - back).abs().max_element() < 1e-6 * forth.max_element().max(1.0));
        }
    }

    #[test]
    fn lights_at_grazing_angles_and_broken_directions_give_numbers() {
        let m = material(0.5, 0.5, 0.0);
        for light in [Vec3::X, Vec3::new(1.0, 0.0, 1e-30), Vec3::NEG_Z, Vec3::Z] {
            for viewer in [Vec3::Z, Vec3::new(1.0, 0.0, 1e-20), Vec3::X] {
                let f = direct(&m, Vec3::Z, viewer, light);
                assert!(f.is_finite() && f.min_element() >= 0.0, "{light} {viewer}: {f}");
            }
        }
    }

    #[test]
    fn ambient_light_is_that_of_the_sky() {
        let n = 2000;
        for sky in [Environment::DAYLIGHT, Environment::Constant(Vec3::new(1.0, 2.0, 3.0))] {
            let ambient = Ambient::of(&sky, 0.5);
            for (sign, expected) in [(1.0, ambient.at(Vec3::Y)), (-1.0, ambient.at(Vec3::NEG_Y))] {
                let mean: Vec3 = (0..n)
                    .map(|i| {
                        let y = (i as f32 + 0.5) / n as f32;
                        sky.radiance(Vec3::new((1.0 - y * y).sqrt(), sign * y, 0.0)) * (2.0 * y)
                    })
                    .sum::<Vec3>()
                    / n as f32;
                assert!((mean * 0.5 - expected).abs().max_element() < 1e-3, "{mean} {expected}");
            }
        }
        assert!(Ambient::of(&Environment::DARK, 1.0).is_dark());
    }
}
