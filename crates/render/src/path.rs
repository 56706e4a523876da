//! The path tracer: unidirectional path tracing with next-event estimation and multiple importance
//! sampling (Veach 1997, chapters 9 and 10).

mod direct;

use crate::{
    albedo::CoatAlbedo,
    bsdf::{Bsdf, cosine_density},
    image::Image,
    lights::AreaLights,
    offset::offset_origin,
    rng::Sampler,
    sampling::{Frame, power_heuristic},
    surface::Surface,
    view::View,
};
use direct::Vertex;
use glam::{DVec3, Vec3};
use niwaki_core::{Hit, Intersector, Ray, glam};
use niwaki_scene::{AlphaMode, Scene};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Side of the square tiles that threads take, in pixels.
const TILE: u32 = 16;

/// Most surfaces that one ray may pass where alpha cuts them out; further ones block it.
const MAX_CUTOUTS: u32 = 1024;

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
        }
    }
}

/// What a rendering took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderStats {
    /// Closest-hit queries, continuations through cut-out surfaces included.
    pub closest_hit_rays: u64,
    /// Queries for visibility between a surface and a light.
    pub shadow_rays: u64,
    /// Paths whose radiance was not finite and was left out of the image: overflow at extreme
    /// scales or intensities. 0 for any reasonable scene.
    pub dropped_paths: u64,
}

impl RenderStats {
    const fn plus(self, other: Self) -> Self {
        Self {
            closest_hit_rays: self.closest_hit_rays + other.closest_hit_rays,
            shadow_rays: self.shadow_rays + other.shadow_rays,
            dropped_paths: self.dropped_paths + other.dropped_paths,
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
        let PathSettings { width, height, samples, .. } = self.settings;
        let mut image = Image::black(width, height);
        let Some(camera) = scene.cameras.first() else { return (image, RenderStats::default()) };
        let view = View::new(camera, width, height);
        let stage = Stage::new(scene, intersector, &self.settings);
        let columns = width.div_ceil(TILE);
        let tiles = columns as usize * height.div_ceil(TILE) as usize;
        let finished = AtomicUsize::new(0);
        let done: Vec<(Vec<Vec3>, RenderStats)> = (0..niwaki_core::to_u32(tiles))
            .into_par_iter()
            .map(|tile| {
                let mut stats = RenderStats::default();
                let pixels = tile_pixels(tile, columns, width, height)
                    .map(|(x, y)| {
                        let mut sum = DVec3::ZERO;
                        for sample in 0..samples {
                            let pixel = y.wrapping_mul(width).wrapping_add(x);
                            let mut sampler = Sampler::new(pixel, sample, self.settings.seed);
                            let ray = view.ray(x, y, sampler.next_2d());
                            let radiance = stage.trace(ray, &mut sampler, &mut stats);
                            if radiance.is_finite() {
                                sum += radiance.as_dvec3();
                            } else {
                                stats.dropped_paths += 1;
                            }
                        }
                        (sum / f64::from(samples.max(1))).as_vec3()
                    })
                    .collect();
                progress(finished.fetch_add(1, Ordering::Relaxed) + 1, tiles);
                (pixels, stats)
            })
            .collect();
        let mut stats = RenderStats::default();
        for (tile, (pixels, taken)) in (0..).zip(done) {
            stats = stats.plus(taken);
            for ((x, y), pixel) in tile_pixels(tile, columns, width, height).zip(pixels) {
                image.set(x, y, pixel);
            }
        }
        (image, stats)
    }
}

/// Pixels of a tile, row by row.
fn tile_pixels(
    tile: u32,
    columns: u32,
    width: u32,
    height: u32,
) -> impl Iterator<Item = (u32, u32)> {
    let (left, top) = (tile % columns * TILE, tile / columns * TILE);
    (top..(top + TILE).min(height))
        .flat_map(move |y| (left..(left + TILE).min(width)).map(move |x| (x, y)))
}

/// Sees the rays of a path as they are traced.
pub(crate) trait Observer {
    /// A ray that goes on from the path's vertex number `depth` (0 is the camera).
    fn closest(&mut self, depth: u32, ray: &Ray);
    /// A ray from a surface towards a light.
    fn shadow(&mut self, ray: &Ray);
    /// The path met a surface after `depth` scattering events.
    fn surface(&mut self, depth: u32, surface: &Surface<'_>);
    /// A continuation through a cut-out surface.
    fn continuation(&mut self);
}

impl Observer for RenderStats {
    fn closest(&mut self, _: u32, _: &Ray) {
        self.closest_hit_rays += 1;
    }
    fn shadow(&mut self, _: &Ray) {
        self.shadow_rays += 1;
    }
    fn surface(&mut self, _: u32, _: &Surface<'_>) {}
    fn continuation(&mut self) {
        self.closest_hit_rays += 1;
    }
}

/// A scene made ready for path tracing.
pub(crate) struct Stage<'a, I: Intersector + ?Sized> {
    scene: &'a Scene,
    intersector: &'a I,
    settings: &'a PathSettings,
    area_lights: AreaLights,
    /// One per material; shared through `coats`.
    coat_ids: Vec<usize>,
    coats: Vec<CoatAlbedo>,
    /// Some surface may let rays pass by its alpha.
    cut_out: bool,
    environment: bool,
    punctual: bool,
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
    pub(crate) fn new(scene: &'a Scene, intersector: &'a I, settings: &'a PathSettings) -> Self {
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
        Self {
            scene,
            intersector,
            settings,
            area_lights: AreaLights::new(scene),
            coat_ids,
            coats: iors.par_iter().map(|&bits| CoatAlbedo::new(f32::from_bits(bits))).collect(),
            cut_out: scene.materials.iter().any(|m| m.alpha_mode != AlphaMode::Opaque),
            environment: !scene.environment.is_dark(),
            punctual: !scene.lights.is_empty(),
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
            let Some((surface, distance)) = self.closest_surface(ray, sampler, observer) else {
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
            if !surface.front && material.transmission > 0.0 && material.absorption != Vec3::ZERO {
                // Beer and Lambert: the segment that ends on the inside ran through it.
                throughput *= (-material.absorption.max(Vec3::ZERO) * distance).exp();
            }
            let emission = surface.emission(scene);
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
            ray = Ray::new(origin, direction);
            let specular = sample.specular || !self.settings.light_sampling;
            last = Last { pdf: sample.pdf, normal: surface.normal, specular };
        }
        radiance
    }

    /// The first surface that the ray really meets, and the distance to it.
    fn closest_surface(
        &self,
        mut ray: Ray,
        sampler: &mut Sampler,
        observer: &mut impl Observer,
    ) -> Option<(Surface<'a>, f32)> {
        let mut passed = 0.0;
        for step in 0..=MAX_CUTOUTS {
            let hit: Hit = self.intersector.closest_hit(&ray);
            let surface = Surface::at(self.scene, &ray, &hit)?;
            let distance = passed + hit.t;
            if !self.cut_out || step == MAX_CUTOUTS {
                return Some((surface, distance));
            }
            let opacity = surface.opacity(self.scene);
            if opacity >= 1.0 || (opacity > 0.0 && sampler.next_1d() < opacity) {
                return Some((surface, distance));
            }
            observer.continuation();
            let origin = offset_origin(surface.point, -surface.geometric_normal, surface.reach);
            ray = Ray::new(origin, ray.direction);
            passed = distance;
        }
        None
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

/// The origin of a ray that leaves in `direction`; `None` if shading and geometric normal disagree
/// on whether it goes through the surface.
fn leave(surface: &Surface<'_>, direction: Vec3, reflected: bool) -> Option<Vec3> {
    let normal = surface.geometric_normal;
    let outside = normal.dot(direction) > 0.0;
    (outside == reflected).then(|| {
        offset_origin(surface.point, if outside { normal } else { -normal }, surface.reach)
    })
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
