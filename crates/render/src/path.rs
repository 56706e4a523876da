//! The path tracer: unidirectional path tracing with next-event estimation and multiple importance
//! sampling (Veach 1997, chapters 9 and 10).

mod direct;

use crate::{
    albedo::CoatAlbedo,
    bsdf::{Bsdf, cosine_density},
    image::Image,
    lights::AreaLights,
    plan::{Effect, EffectPlan, Planning},
    query::{Found, Passed, Query, leave},
    rng::Sampler,
    sampling::{Frame, power_heuristic},
    stats::{Observer, RenderStats},
    surface::Surface,
    tiles::render_tiles,
    view::View,
};
use direct::Vertex;
use glam::{DVec3, Vec3};
use niwaki_core::{Intersector, Ray, glam};
use niwaki_scene::{Camera, Scene, SceneFacts};
use rayon::prelude::*;

/// What to render and how exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSettings {
    /// Width of the image in pixels; 0 gives an empty image.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Paths per pixel; noise falls with its square root. 0 gives black.
    pub samples: u32,
    /// Most scattering events on a path: 0 shows emission only, 1 direct light, 2 one bounce.
    pub max_depth: u32,
    /// Scattering events before Russian roulette may end a path (which adds no bias).
    pub roulette_start: u32,
    /// Largest value that light which scattered at least twice may add to a colour channel of one
    /// path. Removes isolated bright pixels at the price of lost energy; `None` (the default) is
    /// unbiased.
    pub clamp: Option<f32>,
    /// Sample lights directly at every surface (the default). Without, only paths that happen to
    /// meet an emissive surface or the environment carry light: the same expectation with far more
    /// noise, and darkness under punctual lights. For checking one against the other.
    pub light_sampling: bool,
    /// Seed of all random choices.
    pub seed: u64,
    /// Who decides on the effects; makes no difference to the image.
    pub planning: Planning,
}

impl Default for PathSettings {
    /// 512 × 512 pixels, 64 samples, depth 8, roulette from 3, no clamp, seed 0.
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            samples: 64,
            max_depth: 8,
            roulette_start: 3,
            clamp: None,
            light_sampling: true,
            seed: 0,
            planning: Planning::Scene,
        }
    }
}

/// The reference integrator.
///
/// Light arrives from emissive triangles (both sides), punctual lights and the environment; at
/// each surface one shadow ray is traced to each *kind* of light that the scene has, so a scene
/// without lights traces none. Surfaces scatter as `niwaki_scene::Material` says: a diffuse base
/// under a GGX coat, a GGX metal, or a smooth or rough interface between dielectrics. The
/// interface always separates the inside (against the normal) from air; nested media are not
/// tracked. Point lights do not shine through glass: only paths that scatter could find them, and
/// no scattered ray meets a point.
///
/// The same settings and scene give the same image bit for bit on any number of threads, as long
/// as the intersector's answers do not depend on them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PathTracer {
    /// What to render and how exactly.
    pub settings: PathSettings,
}

impl PathTracer {
    /// A path tracer with these settings.
    #[must_use]
    pub const fn new(settings: PathSettings) -> Self {
        Self { settings }
    }

    /// Renders the scene from its first camera on the current rayon pool. `intersector` must
    /// answer for the scene's mesh.
    #[must_use]
    pub fn render<I: Intersector + ?Sized>(&self, scene: &Scene, intersector: &I) -> Image {
        self.render_with(scene, intersector, |_, _| {}).0
    }

    /// As [`PathTracer::render`], calling `progress(finished, all)` after each tile, from any
    /// thread and not always in order, and also returning what it took.
    #[must_use]
    pub fn render_with<I: Intersector + ?Sized>(
        &self,
        scene: &Scene,
        intersector: &I,
        progress: impl Fn(usize, usize) + Sync,
    ) -> (Image, RenderStats) {
        let Some(camera) = scene.cameras.first() else {
            let black = Image::black(self.settings.width, self.settings.height);
            return (black, RenderStats::default());
        };
        self.render_from(camera, scene, intersector, progress)
    }

    /// As [`PathTracer::render_with`], from another camera than the scene's first.
    #[must_use]
    pub fn render_from<I: Intersector + ?Sized>(
        &self,
        camera: &Camera,
        scene: &Scene,
        intersector: &I,
        progress: impl Fn(usize, usize) + Sync,
    ) -> (Image, RenderStats) {
        let facts = SceneFacts::new(scene, SceneFacts::MIRROR_ROUGHNESS);
        self.render_knowing(&facts, camera, scene, intersector, progress)
    }

    /// As [`PathTracer::render_from`], with facts that were found before (at any limit of
    /// roughness): looking for them takes as long as going through all triangles and textures, and
    /// they hold from frame to frame, also where objects move.
    #[must_use]
    pub fn render_knowing<I: Intersector + ?Sized>(
        &self,
        facts: &SceneFacts,
        camera: &Camera,
        scene: &Scene,
        intersector: &I,
        progress: impl Fn(usize, usize) + Sync,
    ) -> (Image, RenderStats) {
        let PathSettings { width, height, samples, seed, .. } = self.settings;
        let view = View::new(camera, width, height);
        let stage = Stage::new(scene, facts, intersector, &self.settings);
        render_tiles(width, height, progress, |x, y, stats| {
            let mut sum = DVec3::ZERO;
            for sample in 0..samples {
                let pixel = y.wrapping_mul(width).wrapping_add(x);
                let mut sampler = Sampler::new(pixel, sample, seed);
                let ray = view.ray(x, y, sampler.next_2d());
                let radiance = stage.trace(ray, &mut sampler, stats);
                if radiance.is_finite() {
                    sum += radiance.as_dvec3();
                } else {
                    stats.dropped_paths += 1;
                }
            }
            (sum / f64::from(samples.max(1))).as_vec3()
        })
    }

    /// The effects that a rendering of this scene simulates, and why.
    #[must_use]
    pub fn plan(&self, scene: &Scene) -> EffectPlan {
        // What counts as a mirror makes no difference here.
        plan(&SceneFacts::new(scene, SceneFacts::MIRROR_ROUGHNESS), &self.settings)
    }
}

/// The effects of path tracing a scene.
fn plan(facts: &SceneFacts, settings: &PathSettings) -> EffectPlan {
    const EFFECTS: [Effect; 7] = [
        Effect::PunctualLight,
        Effect::AreaLight,
        Effect::EnvironmentLight,
        Effect::Sky,
        Effect::Emission,
        Effect::Alpha,
        Effect::Absorption,
    ];
    let mut plan = EffectPlan::new(facts, &EFFECTS, settings.planning);
    if !settings.light_sampling || settings.max_depth == 0 {
        for effect in [Effect::PunctualLight, Effect::AreaLight, Effect::EnvironmentLight] {
            plan = plan.without(effect, "the settings sample no lights");
        }
    }
    plan
}

/// A scene made ready for path tracing.
pub(crate) struct Stage<'a, I: Intersector + ?Sized> {
    scene: &'a Scene,
    settings: &'a PathSettings,
    area_lights: AreaLights,
    /// One per material; shared through `coats`.
    coat_ids: Vec<usize>,
    coats: Vec<CoatAlbedo>,
    query: Query<'a, I>,
    runs: Runs,
}

/// The plan as the inner loops read it.
#[derive(Clone, Copy)]
struct Runs {
    punctual: bool,
    area: bool,
    environment: bool,
    sky: bool,
    emission: bool,
    absorption: bool,
    /// Rays that can carry no light are traced too.
    everything: bool,
}

/// What multiple importance sampling must know of the last scattering event.
struct Last {
    /// Density of the sampled direction.
    pdf: f32,
    /// Shading normal there.
    normal: Vec3,
    /// No light sample could have found the direction.
    specular: bool,
}

impl<'a, I: Intersector + ?Sized> Stage<'a, I> {
    pub(crate) fn new(
        scene: &'a Scene,
        facts: &SceneFacts,
        intersector: &'a I,
        settings: &'a PathSettings,
    ) -> Self {
        let mut iors: Vec<u32> = Vec::new();
        let mut coat_ids = Vec::with_capacity(scene.materials.len());
        for material in &scene.materials {
            let bits = material.index_of_refraction().to_bits();
            let id = iors.iter().position(|&known| known == bits).unwrap_or_else(|| {
                iors.push(bits);
                iors.len() - 1
            });
            coat_ids.push(id);
        }
        let plan = plan(facts, settings);
        let runs = Runs {
            punctual: plan.runs(Effect::PunctualLight),
            area: plan.runs(Effect::AreaLight),
            environment: plan.runs(Effect::EnvironmentLight),
            sky: plan.runs(Effect::Sky),
            emission: plan.runs(Effect::Emission),
            absorption: plan.runs(Effect::Absorption),
            everything: settings.planning == Planning::Everything,
        };
        // Hits on emissive surfaces are weighed against the light samples that could have been.
        let lights = runs.emission || runs.area;
        Self {
            scene,
            settings,
            area_lights: if lights { AreaLights::new(scene) } else { AreaLights::default() },
            coat_ids,
            coats: iors.par_iter().map(|&bits| CoatAlbedo::new(f32::from_bits(bits))).collect(),
            query: Query { scene, intersector, alpha: plan.runs(Effect::Alpha) },
            runs,
        }
    }

    /// The radiance that arrives along one path that starts with `ray`.
    pub(crate) fn trace(
        &self,
        mut ray: Ray,
        sampler: &mut Sampler,
        observer: &mut impl Observer,
    ) -> Vec3 {
        let scene = self.scene;
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        // Radiance within a dense medium is compressed by eta²; roulette must not see that.
        let mut compression = 1.0;
        let mut last = Last { pdf: 0.0, normal: Vec3::Z, specular: true };
        for depth in 0.. {
            observer.closest(depth, &ray);
            let limit = if depth > 1 { self.settings.clamp } else { None };
            let found = self
                .query
                .closest(ray, Passed::default(), observer, |opacity| sampler.next_1d() < opacity);
            let Some(Found { surface, passed: Passed { distance, .. }, .. }) = found else {
                if !self.runs.sky {
                    break;
                }
                let weight = if last.specular {
                    1.0
                } else {
                    power_heuristic(last.pdf, cosine_density(last.normal.dot(ray.direction)))
                };
                let arriving = scene.environment.radiance(ray.direction) * weight;
                radiance += limited(throughput * arriving, limit);
                break;
            };
            let material = surface.material;
            if self.runs.absorption && !surface.front && material.transmission > 0.0 {
                // Beer and Lambert: the segment that ends on the inside ran through it.
                throughput *= (-material.absorption.max(Vec3::ZERO) * distance).exp();
            }
            let emission = if self.runs.emission { surface.emission(scene) } else { Vec3::ZERO };
            if emission != Vec3::ZERO {
                let weight = if last.specular {
                    1.0
                } else {
                    power_heuristic(last.pdf, self.area_pdf(&surface, ray.direction, distance))
                };
                radiance += limited(throughput * emission * weight, limit);
            }
            if depth >= self.settings.max_depth {
                break;
            }
            observer.surface(depth, &surface);
            let bsdf = self.bsdf(&surface, sampler);
            let frame = Frame::new(surface.normal);
            let wo = frame.to_local(-ray.direction);
            if self.settings.light_sampling && !bsdf.is_specular() {
                let limit = if depth > 0 { self.settings.clamp } else { None };
                let vertex = Vertex { surface: &surface, bsdf: &bsdf, frame: &frame, wo };
                let direct = self.direct(&vertex, sampler, observer);
                radiance += limited(throughput * direct, limit);
            }
            let Some(sample) = bsdf.sample(wo, sampler) else { break };
            let direction = frame.to_world(sample.wi);
            let Some(origin) = leave(&surface, direction, sample.wi.z > 0.0) else { break };
            throughput *= sample.weight;
            compression *= sample.compression;
            let survival = (throughput.max_element() * compression).min(0.95);
            // Drawn always, so that the dimensions after it do not depend on the settings.
            let roulette = sampler.next_1d();
            if depth >= self.settings.roulette_start {
                if roulette >= survival {
                    break;
                }
                throughput /= survival;
            }
            if throughput.max_element() <= 0.0 || !throughput.is_finite() {
                break;
            }
            observer.scattered(sample.wi.z <= 0.0);
            ray = Ray::new(origin, direction);
            let specular = sample.specular || !self.settings.light_sampling;
            last = Last { pdf: sample.pdf, normal: surface.normal, specular };
        }
        radiance
    }

    /// How a surface scatters; materials between the kinds choose by chance.
    fn bsdf(&self, surface: &Surface<'_>, sampler: &mut Sampler) -> Bsdf<'_> {
        let base = surface.base_color(self.scene);
        let (metallic, roughness) = surface.metallic_roughness(self.scene);
        let ior = surface.material.index_of_refraction();
        let choice = sampler.next_1d();
        if choice < metallic {
            return Bsdf::Metal { f0: base, roughness };
        }
        let transmission = surface.material.transmission.clamp(0.0, 1.0);
        if choice < metallic + (1.0 - metallic) * transmission {
            let eta = if surface.front { ior } else { ior.recip() };
            return Bsdf::Interface { tint: base, roughness, eta };
        }
        let coat = &self.coats[self.coat_ids[surface.material_id]];
        Bsdf::Plastic { base, roughness, ior, coat }
    }

    /// Density over solid angle with which light sampling would have found an emissive surface.
    fn area_pdf(&self, surface: &Surface<'_>, direction: Vec3, distance: f32) -> f32 {
        let cosine = f64::from(surface.geometric_normal.dot(direction).abs()).max(1e-12);
        let pdf = self.area_lights.pdf_area(surface.material.emission)
            * f64::from(distance)
            * f64::from(distance)
            / cosine;
        narrow(pdf)
    }
}

/// To `f32`, at most its largest value: densities only enter quotients.
#[expect(clippy::cast_possible_truncation, reason = "clamped to the range of f32")]
fn narrow(x: f64) -> f32 {
    x.min(f64::from(f32::MAX)) as f32
}

/// A contribution with no channel above `limit`, its colour kept.
fn limited(contribution: Vec3, limit: Option<f32>) -> Vec3 {
    match limit {
        Some(limit) if contribution.max_element() > limit => {
            contribution * (limit.max(0.0) / contribution.max_element())
        }
        _ => contribution,
    }
}
