//! Ambient occlusion: which share of its surroundings, weighted by the cosine, a surface sees
//! within a radius (Zhukov, Iones and Kronin 1998; Landis 2002).

use crate::{
    image::Image,
    offset::offset_origin,
    plan::{Effect, EffectPlan, Planning},
    query::{Passed, Query},
    rng::Sampler,
    sampling::{Frame, cosine_hemisphere},
    stats::{Observer, RenderStats},
    surface::Surface,
    tiles::render_tiles,
    view::View,
};
use glam::{Vec2, Vec3};
use niwaki_core::{Intersector, Ray, glam};
use niwaki_scene::{Scene, SceneFacts};

/// What to render and how exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct OcclusionSettings {
    /// Width of the image in pixels; 0 gives an empty image.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Directions per pixel; noise falls with its square root. 0 gives white.
    pub samples: u32,
    /// How far occluders count, in units of the scene; not positive or NaN counts none, ∞ all.
    pub radius: f32,
    /// Seed of the directions.
    pub seed: u64,
    /// Who decides on the effects; makes no difference to the image.
    pub planning: Planning,
}

impl OcclusionSettings {
    /// 512 × 512 pixels, 64 directions, a radius of a tenth of the scene's diagonal.
    #[must_use]
    pub fn for_scene(scene: &Scene) -> Self {
        let bounds = scene.mesh.bounds();
        let diagonal = if bounds.is_finite() { bounds.extent().length() } else { f32::INFINITY };
        Self {
            width: 512,
            height: 512,
            samples: 64,
            radius: 0.1 * diagonal,
            seed: 0,
            planning: Planning::Scene,
        }
    }
}

/// The ambient occlusion integrator.
///
/// A pixel is the share of rays about the shading normal, cosine-distributed, that nothing within
/// the radius holds back: 1 (white) is open, 0 closed. Where no surface is met the pixel is 1.
/// Alpha counts: rays from the camera pass surfaces that are less than half there, occlusion rays
/// lose the share that they meet. Each pixel has directions of its own, hashed from its place,
/// so that the same settings give the same image bit for bit on any number of threads.
#[derive(Clone, Debug, PartialEq)]
pub struct AmbientOcclusion {
    /// What to render and how exactly.
    pub settings: OcclusionSettings,
}

impl AmbientOcclusion {
    /// An integrator with these settings.
    #[must_use]
    pub const fn new(settings: OcclusionSettings) -> Self {
        Self { settings }
    }

    /// The effects that a rendering of this scene simulates, and why.
    #[must_use]
    pub fn plan(&self, scene: &Scene) -> EffectPlan {
        let facts = SceneFacts::new(scene, SceneFacts::MIRROR_ROUGHNESS);
        EffectPlan::new(&facts, &[Effect::Alpha], self.settings.planning)
    }

    /// Renders the scene from its first camera on the current rayon pool. `intersector` must
    /// answer for the scene's mesh.
    #[must_use]
    pub fn render<I: Intersector + ?Sized>(&self, scene: &Scene, intersector: &I) -> Image {
        self.render_with(scene, intersector, |_, _| {}).0
    }

    /// As [`AmbientOcclusion::render`], calling `progress(finished, all)` after each tile, from
    /// any thread and not always in order, and also returning what it took.
    #[must_use]
    pub fn render_with<I: Intersector + ?Sized>(
        &self,
        scene: &Scene,
        intersector: &I,
        progress: impl Fn(usize, usize) + Sync,
    ) -> (Image, RenderStats) {
        let OcclusionSettings { width, height, samples, radius, seed, .. } = self.settings;
        let Some(camera) = scene.cameras.first() else {
            return (Image::black(width, height), RenderStats::default());
        };
        let view = View::new(camera, width, height);
        let alpha = self.plan(scene).runs(Effect::Alpha);
        let query = Query { scene, intersector, alpha };
        render_tiles(width, height, progress, |x, y, stats| {
            let ray = view.ray(x, y, Vec2::splat(0.5));
            stats.closest(0, &ray);
            let found = query.closest(ray, Passed::default(), stats, |opacity| opacity >= 0.5);
            let Some(found) = found.filter(|_| samples > 0 && radius > 0.0) else {
                return Vec3::ONE;
            };
            let place = Place { pixel: y.wrapping_mul(width).wrapping_add(x), first: 0, seed };
            Vec3::splat(open_share(&query, &found.surface, samples, radius, place, stats))
        })
    }
}

/// Where in an image directions are drawn: each place has its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Number of the pixel.
    pub(crate) pixel: u32,
    /// Number of the first direction among those of the pixel.
    pub(crate) first: u32,
    pub(crate) seed: u64,
}

/// The share of `samples` rays about the shading normal, cosine-distributed, that nothing within
/// `radius` holds back.
pub(crate) fn open_share<I: Intersector + ?Sized>(
    query: &Query<'_, I>,
    surface: &Surface<'_>,
    samples: u32,
    radius: f32,
    place: Place,
    stats: &mut RenderStats,
) -> f32 {
    let geometric = surface.geometric_normal;
    let frame = Frame::new(surface.normal);
    let origin = offset_origin(surface.point, geometric, surface.reach);
    let mut open = 0.0;
    for sample in 0..samples {
        let number = place.first.wrapping_add(sample);
        let mut sampler = Sampler::new(place.pixel, number, place.seed);
        let direction = frame.to_world(cosine_hemisphere(sampler.next_2d()));
        // What the shading normal shows but the surface itself hides is closed.
        if direction.dot(geometric) <= 0.0 {
            continue;
        }
        stats.occlusion_rays += 1;
        let ray = Ray::new(origin, direction).with_range(0.0, radius);
        open += query.visibility(ray, stats);
    }
    open / samples as f32
}
