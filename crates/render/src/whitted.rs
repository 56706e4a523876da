//! The Whitted integrator: rays reflect and refract from surface to surface, lights cast hard
//! shadows, and nothing is left to chance (Whitted 1980, "An Improved Illumination Model for
//! Shaded Display"; the reference of thesis paper III, section 3.4).
//!
//! What a surface sends to the viewer is the model of [`shading`].

use crate::{
    fresnel::{reflect, refract},
    image::Image,
    occlusion::{Place, open_share},
    offset::offset_origin,
    plan::{Effect, EffectPlan, Planning},
    query::{Found, Passed, Query, beyond, shadow_ray},
    shading::{self, Ambient, PointMaterial},
    stats::{Observer, RenderStats},
    surface::Surface,
    tiles::render_tiles,
    view::View,
};
use glam::{DVec3, Vec2, Vec3};
use niwaki_core::{Intersector, Ray, glam};
use niwaki_scene::{Camera, Scene, SceneFacts};
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
struct Stage<'a, I: Intersector + ?Sized> {
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
    fn new(
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
    fn trace(&self, ray: Ray, number: u32, stats: &mut RenderStats) -> Vec3 {
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
