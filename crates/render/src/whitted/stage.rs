//! What one ray from the camera brings back.

use super::{WhittedSettings, plan};
use crate::{
    fresnel::{reflect, refract},
    occlusion::{Place, open_share},
    offset::offset_origin,
    plan::{Effect, Planning},
    query::{Found, Passed, Query, beyond, shadow_ray},
    shading::{self, Ambient, PointMaterial},
    stats::{Observer, RenderStats},
    surface::Surface,
};
use glam::Vec3;
use niwaki_core::{Intersector, Ray, glam};
use niwaki_scene::{Scene, SceneFacts};

/// A ray that waits to be traced.
struct Task {
    ray: Ray,
    /// What its radiance counts in the pixel; zero only where everything is forced.
    weight: Vec3,
    /// Reflections and refractions so far.
    depth: u32,
    /// Surfaces that it passed by their alpha.
    passed: Passed,
}

/// A point that is shaded.
struct Lit<'a> {
    surface: Surface<'a>,
    material: PointMaterial,
    to_viewer: Vec3,
}

/// A scene made ready.
pub(super) struct Stage<'a, I: Intersector + ?Sized> {
    scene: &'a Scene,
    query: Query<'a, I>,
    settings: &'a WhittedSettings,
    /// One a material: whether its coat is polished, and [`shading::mean_fresnel`].
    coats: Vec<(bool, f32)>,
    ambient: Ambient,
    runs: Runs,
}

/// The plan as the inner loops read it.
#[derive(Clone, Copy)]
struct Runs {
    punctual: bool,
    ambient: bool,
    occlusion: bool,
    sky: bool,
    emission: bool,
    reflection: bool,
    refraction: bool,
    absorption: bool,
    /// Rays that count nothing are traced too.
    everything: bool,
}

impl<'a, I: Intersector + ?Sized> Stage<'a, I> {
    pub(super) fn new(
        scene: &'a Scene,
        facts: &SceneFacts,
        intersector: &'a I,
        settings: &'a WhittedSettings,
    ) -> Self {
        let plan = plan(scene, facts, settings);
        let coat = |(facts, material): (&niwaki_scene::MaterialFacts, &niwaki_scene::Material)| {
            (facts.polished, shading::mean_fresnel(material.index_of_refraction()))
        };
        Self {
            scene,
            query: Query { scene, intersector, alpha: plan.runs(Effect::Alpha) },
            settings,
            coats: facts.materials.iter().zip(&scene.materials).map(coat).collect(),
            ambient: settings.ambient.radiance(scene),
            runs: Runs {
                punctual: plan.runs(Effect::PunctualLight),
                ambient: plan.runs(Effect::Ambient),
                occlusion: plan.runs(Effect::Occlusion),
                sky: plan.runs(Effect::Sky),
                emission: plan.runs(Effect::Emission),
                reflection: plan.runs(Effect::Reflection),
                refraction: plan.runs(Effect::Refraction),
                absorption: plan.runs(Effect::Absorption),
                everything: settings.planning == Planning::Everything,
            },
        }
    }

    /// The radiance that arrives along a camera ray; `number` is that of the ray.
    pub(super) fn trace(&self, ray: Ray, number: u32, stats: &mut RenderStats) -> Vec3 {
        let mut radiance = Vec3::ZERO;
        let mut add = |weight: Vec3, light: Vec3| {
            // What counts nothing may be infinite.
            if weight != Vec3::ZERO {
                radiance += weight * light;
            }
        };
        let first = Task { ray, weight: Vec3::ONE, depth: 0, passed: Passed::default() };
        let mut waiting = vec![first];
        let mut counted = 0;
        let mut place = Place { pixel: number, first: 0, seed: 0 };
        while let Some(task) = waiting.pop() {
            if task.weight != Vec3::ZERO {
                if counted == self.settings.max_rays {
                    let due = waiting.iter().filter(|t| t.weight != Vec3::ZERO).count();
                    stats.cut_rays += 1 + due as u64;
                    break;
                }
                counted += 1;
            }
            stats.closest(task.depth, &task.ray);
            // A surface that is partly there is shaded, and the ray goes on behind it.
            let found = self.query.closest(task.ray, task.passed, stats, |_| true);
            let Some(Found { surface, passed, opacity }) = found else {
                if self.runs.sky {
                    add(task.weight, self.scene.environment.radiance(task.ray.direction));
                }
                continue;
            };
            let mut weight = task.weight;
            if opacity < 1.0 {
                let rest = Passed { surfaces: passed.surfaces + 1, ..passed };
                let ray = beyond(&surface, task.ray.direction);
                let task = Task { ray, weight: weight * (1.0 - opacity), passed: rest, ..task };
                if self.counts(task.weight) {
                    stats.continued_rays += 1;
                    waiting.push(task);
                }
                weight *= opacity;
            }
            let inside = !surface.front && surface.material.transmission > 0.0;
            if self.runs.absorption && inside {
                // Beer and Lambert: the segment that ends on the inside ran through it.
                weight *= (-surface.material.absorption.max(Vec3::ZERO) * passed.distance).exp();
            }
            let hit =
                Lit { material: self.material(&surface), surface, to_viewer: -task.ray.direction };
            add(weight, self.shade(&hit, place, stats));
            place.first = place.first.wrapping_add(self.settings.occlusion_rays);
            if task.depth < self.settings.max_depth {
                self.spawn(&hit, weight, task.depth + 1, &mut waiting, stats);
            }
        }
        radiance
    }

    /// True if a ray of this weight is traced.
    fn counts(&self, weight: Vec3) -> bool {
        let most = weight.max_element();
        // Written so that NaN counts: it must reach the pixel to be noticed.
        self.runs.everything && most <= 0.0 || !(most <= 0.0 || most < self.settings.cutoff)
    }

    /// The material at a point.
    fn material(&self, surface: &Surface<'_>) -> PointMaterial {
        let (metallic, roughness) = surface.metallic_roughness(self.scene);
        let (polished, mean_fresnel) =
            self.coats.get(surface.material_id).copied().unwrap_or_default();
        let limit = self.settings.mirror_roughness;
        let transmission = surface.material.transmission;
        PointMaterial {
            base: surface.base_color(self.scene),
            metallic,
            roughness,
            transmission: if transmission.is_nan() { 0.0 } else { transmission.clamp(0.0, 1.0) },
            ior: surface.material.index_of_refraction(),
            mean_fresnel,
            mirror: shading::metal_mirror_share(roughness, metallic, limit),
            coat_mirror: if polished { shading::mirror_share(roughness, limit) } else { 0.0 },
            front: surface.front,
        }
    }

    /// What a surface sends back along a ray, reflected and refracted rays aside.
    fn shade(&self, hit: &Lit<'_>, place: Place, stats: &mut RenderStats) -> Vec3 {
        let Lit { surface, material, to_viewer } = hit;
        let (normal, to_viewer) = (surface.normal, *to_viewer);
        let mut light = Vec3::ZERO;
        if self.runs.emission {
            light += surface.emission(self.scene);
        }
        if self.runs.ambient {
            let cosine = normal.dot(to_viewer).clamp(0.0, 1.0);
            let mut ambient = self.ambient.at(normal) * shading::ambient(material, cosine);
            if self.runs.occlusion && (ambient != Vec3::ZERO || self.runs.everything) {
                let WhittedSettings { occlusion_rays, occlusion_radius, .. } = *self.settings;
                ambient *= open_share(
                    &self.query,
                    surface,
                    occlusion_rays,
                    occlusion_radius,
                    place,
                    stats,
                );
            }
            light += ambient;
        }
        if self.runs.punctual {
            let point = surface.point.as_vec3();
            for lamp in &self.scene.lights {
                let Some((to_light, distance, irradiance)) = lamp.illuminate(point) else {
                    continue;
                };
                let sent = shading::direct(material, normal, to_viewer, to_light) * irradiance;
                if sent == Vec3::ZERO && !self.runs.everything {
                    continue;
                }
                let reflected = normal.dot(to_light) > 0.0;
                let Some(ray) = shadow_ray(surface, to_light, distance, reflected) else {
                    continue;
                };
                stats.shadow(&ray);
                let visible = self.query.visibility(ray, stats);
                if visible > 0.0 {
                    light += sent * visible;
                }
            }
        }
        light
    }

    /// Lets the reflected and the refracted ray wait, the reflected one in front.
    fn spawn(
        &self,
        hit: &Lit<'_>,
        weight: Vec3,
        depth: u32,
        waiting: &mut Vec<Task>,
        stats: &mut RenderStats,
    ) {
        if !self.runs.reflection && !self.runs.refraction {
            return;
        }
        let Lit { surface, material, to_viewer } = hit;
        let (normal, geometric) = (surface.normal, surface.geometric_normal);
        let to_viewer = *to_viewer;
        let cosine = normal.dot(to_viewer).clamp(0.0, 1.0);
        let mut go = |direction: Vec3, side: Vec3, weight: Vec3| {
            let origin = offset_origin(surface.point, side, surface.reach);
            let ray = Ray::new(origin, direction.normalize_or(side));
            waiting.push(Task { ray, weight, depth, passed: Passed::default() });
        };
        if self.runs.refraction {
            let weight = weight * shading::refracted(material, cosine);
            // Shading normals may bend a ray back to the side that it came from; the true normal
            // then shows where it goes.
            let eta = material.eta();
            let bent = refract(to_viewer, normal, eta)
                .filter(|d| d.dot(geometric) < 0.0)
                .or_else(|| refract(to_viewer, geometric, eta));
            if let Some(bent) = bent.filter(|_| self.counts(weight)) {
                stats.scattered(true);
                go(bent, -geometric, weight);
            }
        }
        if self.runs.reflection {
            let weight = weight * shading::reflected(material, cosine);
            if self.counts(weight) {
                let mirrored = reflect(to_viewer, normal);
                let through = mirrored.dot(geometric) <= 0.0;
                stats.scattered(false);
                go(
                    if through { reflect(to_viewer, geometric) } else { mirrored },
                    geometric,
                    weight,
                );
            }
        }
    }
}
