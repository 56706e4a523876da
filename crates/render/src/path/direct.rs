//! Next-event estimation: the light that a surface receives straight from the lights.

use super::{Stage, narrow};
use crate::{
    bsdf::{Bsdf, cosine_density},
    lights::sample_punctual,
    offset::offset_origin,
    query::{leave, shadow_ray},
    rng::Sampler,
    sampling::{Frame, cosine_hemisphere, power_heuristic},
    stats::Observer,
    surface::Surface,
};
use glam::Vec3;
use niwaki_core::{Intersector, Ray, glam};

/// A vertex of a path at which light is gathered.
pub(super) struct Vertex<'v> {
    pub(super) surface: &'v Surface<'v>,
    /// How the surface scatters.
    pub(super) bsdf: &'v Bsdf<'v>,
    /// Around the shading normal; `wo` is within it.
    pub(super) frame: &'v Frame,
    /// Back along the path.
    pub(super) wo: Vec3,
}

impl<I: Intersector + ?Sized> Stage<'_, I> {
    /// Light that arrives directly from one sample of each kind of light, scattered along the
    /// path.
    pub(super) fn direct(
        &self,
        vertex: &Vertex<'_>,
        sampler: &mut Sampler,
        observer: &mut impl Observer,
    ) -> Vec3 {
        // What is left out skips its random numbers, so that the others do not depend on it.
        let mut light = Vec3::ZERO;
        if self.runs.punctual {
            light += self.direct_punctual(vertex, sampler, observer);
        } else {
            sampler.skip(1);
        }
        if self.runs.area {
            light += self.direct_area(vertex, sampler, observer);
        } else {
            sampler.skip(2);
        }
        if self.runs.environment {
            light += self.direct_environment(vertex, sampler, observer);
        } else {
            sampler.skip(1);
        }
        light
    }

    fn direct_punctual(
        &self,
        vertex: &Vertex<'_>,
        sampler: &mut Sampler,
        observer: &mut impl Observer,
    ) -> Vec3 {
        let Vertex { surface, bsdf, frame, wo } = *vertex;
        let choice = sampler.next_1d();
        let Some((direction, distance, irradiance)) =
            sample_punctual(self.scene, surface.point.as_vec3(), choice)
        else {
            return Vec3::ZERO;
        };
        let wi = frame.to_local(direction);
        let (f, _) = bsdf.eval(wo, wi);
        if f == Vec3::ZERO && !self.runs.everything {
            return Vec3::ZERO;
        }
        let Some(ray) = shadow_ray(surface, direction, distance, wi.z > 0.0) else {
            return Vec3::ZERO;
        };
        f * irradiance * self.visibility(ray, observer)
    }

    fn direct_area(
        &self,
        vertex: &Vertex<'_>,
        sampler: &mut Sampler,
        observer: &mut impl Observer,
    ) -> Vec3 {
        let Vertex { surface, bsdf, frame, wo } = *vertex;
        let (choice, u) = (sampler.next_1d(), sampler.next_2d());
        let Some(light) = self.area_lights.sample(self.scene, choice, u) else {
            return Vec3::ZERO;
        };
        let to_light = light.point - surface.point;
        let distance_squared = to_light.length_squared();
        let Some(unit) = to_light.try_normalize() else { return Vec3::ZERO };
        let cosine = light.normal.dot(unit).abs();
        let wi = frame.to_local(unit.as_vec3());
        let (f, pdf_bsdf) = bsdf.eval(wo, wi);
        let pdf = light.pdf_area * distance_squared / cosine;
        let dark = f == Vec3::ZERO || light.radiance == Vec3::ZERO;
        if dark && !self.runs.everything || !(pdf > 0.0 && pdf.is_finite()) {
            return Vec3::ZERO;
        }
        let pdf = narrow(pdf);
        let Some(origin) = leave(surface, unit.as_vec3(), wi.z > 0.0) else {
            return Vec3::ZERO;
        };
        // The far end must stay clear of the light's own plane as seen from here, so its distance
        // to the corners counts from the ray's origin.
        let reach = self
            .scene
            .mesh
            .triangle(light.prim)
            .vertices()
            .map(|corner| corner.as_dvec3().distance(surface.point))
            .into_iter()
            .fold(0.0, f64::max);
        let facing = if light.normal.dot(unit) > 0.0 { -light.normal } else { light.normal };
        let end = offset_origin(light.point, facing.as_vec3(), reach);
        let span = end - origin;
        let distance = span.length();
        if !(distance > 0.0 && span.dot(unit.as_vec3()) > 0.0) {
            return Vec3::ZERO;
        }
        let ray = Ray::new(origin, span / distance).with_range(0.0, distance);
        let weight = power_heuristic(pdf, pdf_bsdf);
        f * light.radiance * (weight / pdf) * self.visibility(ray, observer)
    }

    fn direct_environment(
        &self,
        vertex: &Vertex<'_>,
        sampler: &mut Sampler,
        observer: &mut impl Observer,
    ) -> Vec3 {
        let Vertex { surface, bsdf, frame, wo } = *vertex;
        // Skies here are smooth, so the cosine is the part of the integrand worth following.
        let wi = cosine_hemisphere(sampler.next_2d());
        let (f, pdf_bsdf) = bsdf.eval(wo, wi);
        let pdf = cosine_density(wi.z);
        let direction = frame.to_world(wi);
        let arriving = self.scene.environment.radiance(direction);
        let dark = f == Vec3::ZERO || arriving == Vec3::ZERO;
        if dark && !self.runs.everything || pdf <= 0.0 {
            return Vec3::ZERO;
        }
        let Some(origin) = leave(surface, direction, true) else { return Vec3::ZERO };
        let weight = power_heuristic(pdf, pdf_bsdf);
        let ray = Ray::new(origin, direction);
        f * arriving * (weight / pdf) * self.visibility(ray, observer)
    }

    /// The share of light that nothing in the ray's range holds back.
    fn visibility(&self, ray: Ray, observer: &mut impl Observer) -> f32 {
        observer.shadow(&ray);
        self.query.visibility(ray, observer)
    }
}
