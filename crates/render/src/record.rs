//! Rays as a path tracer really traces them, kept for measurements.

use crate::{
    offset::offset_origin,
    path::{PathSettings, Stage},
    plan::Planning,
    rng::{Sampler, halves},
    sampling::{Frame, cosine_hemisphere, uniform_sphere},
    stats::Observer,
    surface::Surface,
    view::View,
};
use glam::Vec3;
use niwaki_core::{Aabb, Intersector, Ray, glam, to_u32};
use niwaki_scene::{Scene, SceneFacts};
use rayon::prelude::*;

/// What is asked of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RayKind {
    /// The nearest hit.
    ClosestHit,
    /// Whether anything is hit.
    AnyHit,
}

/// What to record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordSettings {
    /// Most rays a set may hold.
    pub max_rays: usize,
    /// Seed of all random choices.
    pub seed: u64,
    /// Scattering events to follow, 1 or more for bounce rays: sets `bounce1` … `bounceN`.
    pub depth: u32,
    /// Width divided by height of the image that the camera rays cover.
    pub aspect: f32,
    /// Length of ambient occlusion rays as a share of the diagonal of the scene's box.
    pub ao_radius: f32,
    /// Most passes over the image (each with other random choices) made to fill the sets where
    /// much of the view is empty; camera rays come from the first pass only.
    pub passes: u32,
}

impl Default for RecordSettings {
    /// A million rays a set, seed 0, depth 3, aspect 16:9, occlusion radius a tenth of the
    /// diagonal, 4 passes.
    fn default() -> Self {
        Self {
            max_rays: 1_000_000,
            seed: 0,
            depth: 3,
            aspect: 16.0 / 9.0,
            ao_radius: 0.1,
            passes: 4,
        }
    }
}

/// Named sets of rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RaySets {
    /// Name, what is asked, and the rays.
    pub sets: Vec<(String, RayKind, Vec<Ray>)>,
}

impl RaySets {
    /// The rays of the set with this name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&[Ray]> {
        self.sets.iter().find(|(n, ..)| n == name).map(|(.., rays)| rays.as_slice())
    }
}

/// What one row of pixels gave.
#[derive(Default)]
struct Recorder {
    camera: Vec<Ray>,
    shadow: Vec<Ray>,
    ao: Vec<Ray>,
    bounces: Vec<Vec<Ray>>,
    ao_length: f32,
    /// Separate random numbers, so that recording does not change the paths.
    ao_sampler: Option<Sampler>,
}

impl Observer for Recorder {
    fn closest(&mut self, depth: u32, ray: &Ray) {
        if depth == 0 {
            self.camera.push(*ray);
        } else if let Some(set) = self.bounces.get_mut(depth as usize - 1) {
            set.push(*ray);
        }
    }

    fn shadow(&mut self, ray: &Ray) {
        self.shadow.push(*ray);
    }

    fn surface(&mut self, depth: u32, surface: &Surface<'_>) {
        let Some(sampler) = self.ao_sampler.as_mut().filter(|_| depth == 0) else { return };
        let normal = surface.geometric_normal;
        let direction = Frame::new(normal).to_world(cosine_hemisphere(sampler.next_2d()));
        let origin = offset_origin(surface.point, normal, surface.reach);
        self.ao.push(Ray::new(origin, direction).with_range(0.0, self.ao_length));
    }
}

/// Records the rays of path tracing `scene` from its first camera.
///
/// The sets, all in path order (pixel by pixel, rows from the top, pass after pass):
///
/// | name | kind | rays |
/// |---|---|---|
/// | `camera` | closest hit | one through a random place of each pixel; pixels form a grid of the given aspect with at most `max_rays` of them |
/// | `shadow` | any hit | from every surface on a path to one sample of each kind of light; `t_max` ends at the light, ∞ for directional lights and the environment |
/// | `ao` | any hit | one from each surface that a camera ray met, cosine-distributed about the geometric normal, `t_max` = `ao_radius` × scene diagonal |
/// | `bounce1`, `bounce2`, … | closest hit | after that many scattering events |
///
/// A set with more than `max_rays` rays is thinned evenly, so it covers the whole image whatever
/// the cap. Sets may stay smaller or empty: nothing is invented to fill them. The same scene and
/// settings give the same rays on any number of threads. No roulette shortens the paths, so that
/// deep sets stay representative.
#[must_use]
pub fn record_rays<I: Intersector + ?Sized>(
    scene: &Scene,
    intersector: &I,
    settings: &RecordSettings,
) -> RaySets {
    let (width, height) = grid(settings.max_rays, settings.aspect);
    let tracing = PathSettings {
        width,
        height,
        samples: 1,
        max_depth: settings.depth,
        roulette_start: u32::MAX,
        clamp: None,
        light_sampling: true,
        seed: settings.seed,
        planning: Planning::Scene,
    };
    let facts = SceneFacts::new(scene, SceneFacts::MIRROR_ROUGHNESS);
    let stage = Stage::new(scene, &facts, intersector, &tracing);
    let depth = settings.depth as usize;
    let mut all = Recorder { bounces: vec![Vec::new(); depth], ..Recorder::default() };
    let Some(camera) = scene.cameras.first() else { return all.into_sets(0) };
    let view = View::new(camera, width, height);
    let bounds = scene.mesh.bounds();
    let diagonal = if bounds.is_finite() { bounds.extent().length() } else { 0.0 };
    for pass in 0..settings.passes.max(1) {
        let rows: Vec<Recorder> = (0..height)
            .into_par_iter()
            .map(|y| {
                let mut recorder = Recorder {
                    bounces: vec![Vec::new(); depth],
                    ao_length: diagonal * settings.ao_radius,
                    ..Recorder::default()
                };
                for x in 0..width {
                    let pixel = y.wrapping_mul(width).wrapping_add(x);
                    let mut sampler = Sampler::new(pixel, pass, settings.seed);
                    recorder.ao_sampler = Some(Sampler::new(pixel, pass, !settings.seed));
                    let ray = view.ray(x, y, sampler.next_2d());
                    let _ = stage.trace(ray, &mut sampler, &mut recorder);
                }
                recorder
            })
            .collect();
        for mut row in rows {
            if pass == 0 {
                all.camera.append(&mut row.camera);
            }
            all.shadow.append(&mut row.shadow);
            all.ao.append(&mut row.ao);
            for (set, rays) in all.bounces.iter_mut().zip(&mut row.bounces) {
                set.append(rays);
            }
        }
        let enough = |rays: &Vec<Ray>| rays.len() >= settings.max_rays;
        if enough(&all.ao) && all.bounces.iter().all(enough) {
            break;
        }
    }
    all.into_sets(settings.max_rays)
}

impl Recorder {
    fn into_sets(self, max_rays: usize) -> RaySets {
        let set = |name: &str, kind, rays| (name.into(), kind, thin(rays, max_rays));
        let mut sets = vec![
            set("camera", RayKind::ClosestHit, self.camera),
            set("shadow", RayKind::AnyHit, self.shadow),
            set("ao", RayKind::AnyHit, self.ao),
        ];
        for (number, rays) in (1..).zip(self.bounces) {
            sets.push(set(&format!("bounce{number}"), RayKind::ClosestHit, rays));
        }
        RaySets { sets }
    }
}

/// Columns and rows of the largest grid of about this aspect with at most `max_rays` cells.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the root of a count of at most 2³¹ is small and positive"
)]
fn grid(max_rays: usize, aspect: f32) -> (u32, u32) {
    let max_rays = max_rays.min(1 << 31);
    if max_rays == 0 {
        return (0, 0);
    }
    let aspect = if aspect.is_finite() { f64::from(aspect).clamp(1e-3, 1e3) } else { 1.0 };
    let height = ((max_rays as f64 / aspect).sqrt() as u32).clamp(1, to_u32(max_rays));
    (to_u32(max_rays) / height, height)
}

/// At most `max` of the rays, in order, evenly spread.
fn thin(mut rays: Vec<Ray>, max: usize) -> Vec<Ray> {
    let count = rays.len();
    if count <= max {
        return rays;
    }
    for i in 0..max {
        // The source never lies before the target, so nothing is overwritten too early.
        rays[i] = rays[(i as u128 * count as u128 / max as u128) as usize];
    }
    rays.truncate(max);
    rays.shrink_to_fit();
    rays
}

/// `n` rays for verification: half of the origins uniform in `bounds`, half in a box three times
/// as large around it; directions uniform over the sphere, unit length. Empty for an empty or
/// infinite box.
#[must_use]
pub fn random_rays(bounds: &Aabb, n: usize, seed: u64) -> Vec<Ray> {
    if bounds.is_empty() || !bounds.is_finite() {
        return Vec::new();
    }
    let (center, half) = (bounds.center(), bounds.max * 0.5 - bounds.min * 0.5);
    let ray = |i: usize| {
        let [low, high] = halves(i as u64);
        let mut sampler = Sampler::new(low, high, seed);
        let (xy, z) = (sampler.next_2d(), sampler.next_1d());
        let within = Vec3::new(xy.x, xy.y, z) * 2.0 - Vec3::ONE;
        let scale = if i.is_multiple_of(2) { 1.0 } else { 3.0 };
        Ray::new(center + half * within * scale, uniform_sphere(sampler.next_2d()))
    };
    (0..n).into_par_iter().map(ray).collect()
}
