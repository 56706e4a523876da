//! The Whitted integrator: rays reflect and refract from surface to surface, lights cast hard
//! shadows, and nothing is left to chance (Whitted 1980, "An Improved Illumination Model for
//! Shaded Display"; the reference of thesis paper III, section 3.4).
//!
//! What a surface sends to the viewer is the model of [`shading`](crate::shading).

mod stage;

use crate::{
    image::Image,
    plan::{Effect, EffectPlan, Planning},
    shading::Ambient,
    stats::RenderStats,
    tiles::render_tiles,
    view::View,
};
use glam::{DVec3, Vec2, Vec3};
use niwaki_core::{Intersector, glam};
use niwaki_scene::{Camera, Scene, SceneFacts};
use stage::Stage;
use std::borrow::Cow;

/// Where ambient radiance comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AmbientLight {
    /// This share of the scene's environment: how much of it surfaces see on average, 0 to 1.
    Environment(f32),
    /// This radiance from everywhere, linear RGB.
    Constant(Vec3),
}

impl AmbientLight {
    /// No ambient light.
    pub const NONE: Self = Self::Environment(0.0);

    /// The radiance for surfaces that face up and down.
    #[must_use]
    pub fn radiance(&self, scene: &Scene) -> Ambient {
        match *self {
            Self::Environment(share) if share > 0.0 => Ambient::of(&scene.environment, share),
            Self::Environment(_) => Ambient::default(),
            Self::Constant(radiance) => Ambient { up: radiance, down: radiance },
        }
    }
}

/// What to render and how far to follow rays.
#[derive(Clone, Debug, PartialEq)]
pub struct WhittedSettings {
    /// Width of the image in pixels; 0 gives an empty image.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Rays per pixel in each direction, on a regular grid; 1 shoots through the centre only. 0
    /// gives black.
    pub grid: u32,
    /// Most reflections and refractions on the way from the camera: 0 shows mirrors and glass
    /// black, but for emission, ambient light and highlights.
    pub max_depth: u32,
    /// Rays that count less than this in every colour channel are not traced; 0 traces all that
    /// count at all.
    pub cutoff: f32,
    /// Most rays of one camera ray, so that a high `max_depth` between glass surfaces (where each
    /// hit makes two rays) ends in reasonable time. What is due then is left out and counted in
    /// [`RenderStats::cut_rays`].
    pub max_rays: u32,
    /// Ambient light.
    pub ambient: AmbientLight,
    /// Rays from each surface that find out how much of the ambient light the surfaces around it
    /// hold back ([`AmbientOcclusion`](crate::AmbientOcclusion)); 0 for none.
    pub occlusion_rays: u32,
    /// How far these look, in units of the scene; not positive or NaN counts nothing, ∞ all.
    pub occlusion_radius: f32,
    /// Perceptual roughness, 0 to 1, from which a surface is no mirror any more; up to half of it,
    /// it is a perfect one.
    pub mirror_roughness: f32,
    /// Who decides on the effects; makes no difference to the image.
    pub planning: Planning,
}

impl Default for WhittedSettings {
    /// 512 × 512 pixels, one ray each, depth 8, cutoff 1/1000, 65,536 rays, half of the
    /// environment as ambient light, without occlusion.
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            grid: 1,
            max_depth: 8,
            cutoff: 1e-3,
            max_rays: 1 << 16,
            ambient: AmbientLight::Environment(0.5),
            occlusion_rays: 0,
            occlusion_radius: f32::INFINITY,
            mirror_roughness: SceneFacts::MIRROR_ROUGHNESS,
            planning: Planning::Scene,
        }
    }
}

impl WhittedSettings {
    /// As the thesis renders (paper III, section 4): four recursions, no cutoff.
    #[must_use]
    pub fn thesis() -> Self {
        Self { max_depth: 4, cutoff: 0.0, ..Self::default() }
    }
}

/// The Whitted integrator.
///
/// The same settings and scene give the same image bit for bit on any number of threads, as long
/// as the intersector's answers do not depend on them. Rays wait on a stack of their own, so that
/// no depth overflows the thread's.
///
/// ```
/// use niwaki_core::{Hit, Intersector, Ray};
/// use niwaki_render::{Whitted, WhittedSettings};
///
/// /// Everything is sky.
/// struct Nothing;
/// impl Intersector for Nothing {
///     fn closest_hit(&self, _: &Ray) -> Hit {
///         Hit::MISS
///     }
///     fn any_hit(&self, _: &Ray) -> bool {
///         false
///     }
/// }
///
/// let scene = niwaki_scene::generate::generate("hair", 1_000, 1).ok_or("no such scene")?;
/// let settings = WhittedSettings { width: 32, height: 32, ..WhittedSettings::default() };
/// let image = Whitted::new(settings).render(&scene, &Nothing);
/// assert!(image.mean().min_element() > 0.0);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Whitted {
    /// What to render and how far to follow rays.
    pub settings: WhittedSettings,
}

impl Whitted {
    /// An integrator with these settings.
    #[must_use]
    pub const fn new(settings: WhittedSettings) -> Self {
        Self { settings }
    }

    /// Renders the scene from its first camera on the current rayon pool. `intersector` must
    /// answer for the scene's mesh.
    #[must_use]
    pub fn render<I: Intersector + ?Sized>(&self, scene: &Scene, intersector: &I) -> Image {
        self.render_with(scene, intersector, |_, _| {}).0
    }

    /// As [`Whitted::render`], calling `progress(finished, all)` after each tile, from any thread
    /// and not always in order, and also returning what it took.
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

    /// As [`Whitted::render_with`], from another camera than the scene's first.
    #[must_use]
    pub fn render_from<I: Intersector + ?Sized>(
        &self,
        camera: &Camera,
        scene: &Scene,
        intersector: &I,
        progress: impl Fn(usize, usize) + Sync,
    ) -> (Image, RenderStats) {
        let facts = SceneFacts::new(scene, self.settings.mirror_roughness);
        self.render_knowing(&facts, camera, scene, intersector, progress)
    }

    /// As [`Whitted::render_from`], with facts that were found before: looking for them takes as
    /// long as going through all triangles and textures, and they hold from frame to frame, also
    /// where objects move. Facts found with another limit of roughness are found again.
    #[must_use]
    pub fn render_knowing<I: Intersector + ?Sized>(
        &self,
        facts: &SceneFacts,
        camera: &Camera,
        scene: &Scene,
        intersector: &I,
        progress: impl Fn(usize, usize) + Sync,
    ) -> (Image, RenderStats) {
        let WhittedSettings { width, height, grid, .. } = self.settings;
        let view = View::new(camera, width, height);
        let facts = self.usable(facts, scene);
        let stage = Stage::new(scene, &facts, intersector, &self.settings);
        let step = (grid.max(1) as f32).recip();
        render_tiles(width, height, progress, |x, y, stats| {
            let mut sum = DVec3::ZERO;
            for row in 0..grid {
                for column in 0..grid {
                    let within = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * step;
                    let ray = view.ray(x, y, within);
                    // Its own number for every ray of every pixel.
                    let number = [(y, 1), (x, width), (row, grid), (column, grid)]
                        .into_iter()
                        .fold(0_u32, |n, (at, of)| n.wrapping_mul(of).wrapping_add(at));
                    let radiance = stage.trace(ray, number, stats);
                    if radiance.is_finite() {
                        sum += radiance.as_dvec3();
                    } else {
                        stats.dropped_paths += 1;
                    }
                }
            }
            (sum * f64::from(step * step)).as_vec3()
        })
    }

    /// The effects that a rendering of this scene simulates, and why.
    #[must_use]
    pub fn plan(&self, scene: &Scene) -> EffectPlan {
        let facts = SceneFacts::new(scene, self.settings.mirror_roughness);
        plan(scene, &facts, &self.settings)
    }

    /// As [`Whitted::plan`], with facts that were found before.
    #[must_use]
    pub fn plan_knowing(&self, facts: &SceneFacts, scene: &Scene) -> EffectPlan {
        plan(scene, &self.usable(facts, scene), &self.settings)
    }

    /// The facts, if they are of the limit of roughness in the settings.
    fn usable<'a>(&self, facts: &'a SceneFacts, scene: &Scene) -> Cow<'a, SceneFacts> {
        let limit = self.settings.mirror_roughness;
        if facts.mirror_roughness == limit {
            Cow::Borrowed(facts)
        } else {
            Cow::Owned(SceneFacts::new(scene, limit))
        }
    }
}

/// The effects of rendering a scene.
fn plan(scene: &Scene, facts: &SceneFacts, settings: &WhittedSettings) -> EffectPlan {
    const EFFECTS: [Effect; 9] = [
        Effect::PunctualLight,
        Effect::Ambient,
        Effect::Occlusion,
        Effect::Sky,
        Effect::Emission,
        Effect::Alpha,
        Effect::Reflection,
        Effect::Refraction,
        Effect::Absorption,
    ];
    let mut plan = EffectPlan::new(facts, &EFFECTS, settings.planning);
    let ambient = settings.ambient.radiance(scene);
    if ambient.is_dark() {
        plan = plan.without(Effect::Ambient, "there is no ambient light");
    } else if matches!(settings.ambient, AmbientLight::Constant(_)) {
        plan = plan.with(Effect::Ambient, "the settings give a constant");
    }
    if settings.occlusion_rays == 0 {
        plan = plan.without(Effect::Occlusion, "the settings ask for no rays");
    } else if settings.occlusion_radius.is_nan() || settings.occlusion_radius <= 0.0 {
        plan = plan.without(Effect::Occlusion, "the settings ask for no radius");
    } else if !plan.runs(Effect::Ambient) {
        plan = plan.without(Effect::Occlusion, "there is no ambient light to hold back");
    }
    if settings.max_depth == 0 {
        plan = plan.without(Effect::Reflection, "the depth is 0");
        plan = plan.without(Effect::Refraction, "the depth is 0");
    }
    if settings.planning == Planning::Scene && !facts.has_lit() {
        plan = plan.without(Effect::PunctualLight, "no material scatters the light of lamps");
    }
    plan
}
