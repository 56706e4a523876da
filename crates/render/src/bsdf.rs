//! Scattering at a surface point: a rough or smooth metal, a coated diffuse dielectric, or a rough
//! or smooth interface between dielectrics.
//!
//! Directions point away from the surface, in a frame whose z axis is the normal on the side of
//! the viewer, so that `wo.z` > 0.

use crate::{
    albedo::CoatAlbedo,
    fresnel::{conductor, dielectric, reflect, refract},
    microfacet::{
        SMOOTH, distribution, masking, masking_shadowing, sample_visible, visible_density,
    },
    rng::Sampler,
    sampling::cosine_hemisphere,
};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

/// What scatters light at one point. Materials between these kinds pick one by chance at each hit.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bsdf<'a> {
    /// A diffuse base under a dielectric coat.
    Plastic { base: Vec3, roughness: f32, ior: f32, coat: &'a CoatAlbedo },
    /// A metal with this reflectance at normal incidence.
    Metal { f0: Vec3, roughness: f32 },
    /// An interface; `eta` is the index beyond it over that on the viewer's side; `tint` is the
    /// share that passes of what is refracted.
    Interface { tint: Vec3, roughness: f32, eta: f32 },
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BsdfSample {
    /// The direction.
    pub(crate) wi: Vec3,
    /// f · |cos θ| / density.
    pub(crate) weight: Vec3,
    /// Density over solid angle of all lobes that are not perfect mirrors; meaningless if
    /// `specular`.
    pub(crate) pdf: f32,
    /// True if the lobe was a perfect mirror or a smooth interface.
    pub(crate) specular: bool,
    /// For refraction, how much 1/weight² of the weight is due to compressed radiance: eta², else
    /// 1. Russian roulette undoes it.
    pub(crate) compression: f32,
}

impl<'a> Bsdf<'a> {
    /// True if no light sample can ever contribute.
    pub(crate) fn is_specular(&self) -> bool {
        match *self {
            Self::Plastic { base, roughness, .. } => {
                roughness * roughness < SMOOTH && base.max_element() <= 0.0
            }
            Self::Metal { roughness, .. } => roughness * roughness < SMOOTH,
            // Without a step in the index nothing bends, whatever the roughness.
            Self::Interface { roughness, eta, .. } => roughness * roughness < SMOOTH || eta == 1.0,
        }
    }

    /// f · |cos θᵢ| and the density with which [`Bsdf::sample`] draws `wi`, both without
    /// perfect-mirror lobes.
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        const NONE: (Vec3, f32) = (Vec3::ZERO, 0.0);
        if wo.z <= 0.0 || self.is_specular() {
            return NONE;
        }
        match *self {
            Self::Plastic { base, roughness, ior, coat } => {
                if wi.z <= 0.0 {
                    return NONE;
                }
                let (probability, diffuse) = plastic_split(wo, base, roughness, coat);
                let (albedo_in, mean) = coat.get(wi.z, roughness);
                let mut f =
                    diffuse * ((1.0 - albedo_in) / (1.0 - mean).max(1e-6) * wi.z * FRAC_1_PI);
                let mut pdf = (1.0 - probability) * wi.z * FRAC_1_PI;
                let alpha = roughness * roughness;
                if alpha >= SMOOTH && probability > 0.0 {
                    let m = (wo + wi).normalize_or(Vec3::Z);
                    let (value, density) = reflection(wo, wi, m, alpha);
                    f += Vec3::splat(value * dielectric(wo.dot(m), ior));
                    pdf += probability * density;
                }
                (f, pdf)
            }
            Self::Metal { f0, roughness } => {
                if wi.z <= 0.0 {
                    return NONE;
                }
                let m = (wo + wi).normalize_or(Vec3::Z);
                let (value, density) = reflection(wo, wi, m, roughness * roughness);
                (conductor(wo.dot(m), f0) * value, density)
            }
            Self::Interface { tint, roughness, eta } => {
                let alpha = roughness * roughness;
                if wi.z > 0.0 {
                    let m = (wo + wi).normalize_or(Vec3::Z);
                    let (value, density) = reflection(wo, wi, m, alpha);
                    let fresnel = dielectric(wo.dot(m), eta);
                    (Vec3::splat(value * fresnel), density * fresnel)
                } else {
                    transmission(wo, wi, alpha, eta, tint)
                }
            }
        }
    }

    /// Draws a direction; `None` if the light is absorbed.
    pub(crate) fn sample(&self, wo: Vec3, sampler: &mut Sampler) -> Option<BsdfSample> {
        // Both draws always happen, so that the dimension does not depend on the kind.
        let (choice, u) = (sampler.next_1d(), sampler.next_2d());
        if wo.z <= 0.0 {
            return None;
        }
        let mirrored = Vec3::new(-wo.x, -wo.y, wo.z);
        match *self {
            Self::Plastic { base, roughness, ior, coat } => {
                let (probability, _) = plastic_split(wo, base, roughness, coat);
                let alpha = roughness * roughness;
                if choice < probability {
                    if alpha < SMOOTH {
                        let weight = Vec3::splat(dielectric(wo.z, ior) / probability);
                        return Some(BsdfSample::mirror(mirrored, weight));
                    }
                    self.weigh(wo, reflect(wo, sample_visible(wo, alpha, u)))
                } else {
                    self.weigh(wo, cosine_hemisphere(u))
                }
            }
            Self::Metal { f0, roughness } => {
                let alpha = roughness * roughness;
                if alpha < SMOOTH {
                    return Some(BsdfSample::mirror(mirrored, conductor(wo.z, f0)));
                }
                let m = sample_visible(wo, alpha, u);
                let wi = reflect(wo, m);
                if wi.z <= 0.0 {
                    return None;
                }
                // f · cos / density in closed form: all of the distribution cancels.
                let weight = conductor(wo.dot(m), f0)
                    * (masking_shadowing(wo, wi, alpha) / masking(wo, alpha));
                let (_, pdf) = reflection(wo, wi, m, alpha);
                Some(BsdfSample { wi, weight, pdf, specular: false, compression: 1.0 })
            }
            Self::Interface { tint, roughness, eta } => {
                let alpha = roughness * roughness;
                if self.is_specular() {
                    let fresnel = dielectric(wo.z, eta);
                    if choice < fresnel {
                        return Some(BsdfSample::mirror(mirrored, Vec3::ONE));
                    }
                    let wi = refract(wo, Vec3::Z, eta)?;
                    let compression = eta * eta;
                    let sample = BsdfSample::mirror(wi, tint / compression);
                    return Some(BsdfSample { compression, ..sample });
                }
                let m = sample_visible(wo, alpha, u);
                if choice < dielectric(wo.dot(m), eta) {
                    let wi = reflect(wo, m);
                    return if wi.z > 0.0 { self.weigh(wo, wi) } else { None };
                }
                let wi = refract(wo, m, eta)?;
                if wi.z >= 0.0 {
                    return None;
                }
                let sample = self.weigh(wo, wi)?;
                Some(BsdfSample { compression: eta * eta, ..sample })
            }
        }
    }

    /// The sample of direction `wi`, weighted by the density of all lobes together.
    fn weigh(&self, wo: Vec3, wi: Vec3) -> Option<BsdfSample> {
        let (f, pdf) = self.eval(wo, wi);
        let weight = f / pdf;
        (pdf > 0.0 && weight.is_finite()).then_some(BsdfSample {
            wi,
            weight,
            pdf,
            specular: false,
            compression: 1.0,
        })
    }
}

impl BsdfSample {
    const fn mirror(wi: Vec3, weight: Vec3) -> Self {
        Self { wi, weight, pdf: f32::INFINITY, specular: true, compression: 1.0 }
    }
}

/// Probability of sampling the coat, and the diffuse albedo that is left on the viewer's side.
fn plastic_split(wo: Vec3, base: Vec3, roughness: f32, coat: &CoatAlbedo) -> (f32, Vec3) {
    let (albedo, _) = coat.get(wo.z, roughness);
    let diffuse = base * (1.0 - albedo);
    let total = albedo + diffuse.max_element();
    (if total > 0.0 { albedo / total } else { 0.0 }, diffuse)
}

/// D·G / (4 cos θₒ) (that is, f·cos θᵢ without Fresnel) and the density of reflected visible
/// normals (Walter et al. 2007, eq. 20; Heitz 2018, eq. 17).
fn reflection(wo: Vec3, wi: Vec3, m: Vec3, alpha: f32) -> (f32, f32) {
    if wo.dot(m) <= 0.0 {
        return (0.0, 0.0);
    }
    let common = distribution(m, alpha) / (4.0 * wo.z);
    (common * masking_shadowing(wo, wi, alpha), common * masking(wo, alpha))
}

/// The refracting half of a rough interface (Walter et al. 2007, eq. 21), for radiance.
fn transmission(wo: Vec3, wi: Vec3, alpha: f32, eta: f32, tint: Vec3) -> (Vec3, f32) {
    if wi.z >= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    // The generalised half vector, on the viewer's side.
    let Some(m) = (wo + wi * eta).try_normalize() else { return (Vec3::ZERO, 0.0) };
    let m = if m.z < 0.0 { -m } else { m };
    let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
    // Facets that either side sees from behind do not count.
    if cos_o <= 0.0 || cos_i >= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    let denominator = (cos_i + cos_o / eta).powi(2);
    let passed = 1.0 - dielectric(cos_o, eta);
    let pdf = visible_density(wo, m, alpha) * cos_i.abs() / denominator * passed;
    let f = passed
        * distribution(m, alpha)
        * masking_shadowing(wo, wi, alpha)
        * (cos_i * cos_o / (wo.z * denominator)).abs()
        / (eta * eta);
    if f.is_finite() && pdf.is_finite() { (tint * f, pdf) } else { (Vec3::ZERO, 0.0) }
}

/// Density of [`cosine_hemisphere`] around the z axis.
pub(crate) fn cosine_density(cosine: f32) -> f32 {
    cosine.max(0.0) / PI
}
