//! Sampling a view on the CPU.

use crate::{HybridModelError, PlannedWork, ViewWork};
use niwaki_core::{Hit, Intersector, Ray, glam::Vec3};
use niwaki_gpu_model::workload::CountingKernel;
use niwaki_hybrid::{Effect, EffectPlan, Face, FrameFacts, NearRegion, ObjectFacts, Settings};
use niwaki_render::{AmbientLight, RenderStats, Whitted, WhittedSettings};
use niwaki_scene::{Camera, Scene, SceneFacts};
use std::{
    fmt,
    sync::{Arc, Mutex, PoisonError},
};

/// How finely a view is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSampling {
    /// Columns of samples, at least 1. Default 32.
    pub width: u32,
    /// Rows of samples, at least 1. Default 18.
    pub height: u32,
    /// Most reflections and refractions that are followed. Default 4.
    pub max_depth: u32,
    /// Triangles whose place is looked at, to tell how many are near, at least 1. Default 2048.
    pub triangles: usize,
    /// Sizes of the near region that the effects are planned for, as shares of the diagonal of the
    /// scene's bounds, half a side each; the whole scene is planned for as well. Others count as the
    /// nearest. Default 0 and 0.0125 to 0.4, each twice the one before.
    pub regions: Vec<f32>,
}

impl Default for ViewSampling {
    fn default() -> Self {
        Self {
            width: 32,
            height: 18,
            max_depth: 4,
            triangles: 2048,
            regions: [0.0, 0.0125, 0.025, 0.05, 0.1, 0.2, 0.4].to_vec(),
        }
    }
}

/// Samples views of a scene at rest.
pub struct ViewSampler {
    scene: Arc<Scene>,
    traced: Arc<dyn CountingKernel>,
    facts: SceneFacts,
    objects: Vec<ObjectFacts>,
    settings: Settings,
    whitted: Whitted,
    /// Middles of some triangles.
    middles: Vec<Vec3>,
    /// Of the scene's bounds; zero if there are none.
    extent: Vec3,
    /// Half the sides of near regions that are planned for, in order.
    regions: Vec<f32>,
    /// One thread: the others draw.
    pool: rayon::ThreadPool,
}

impl fmt::Debug for ViewSampler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ViewSampler")
            .field("scene", &self.scene.name)
            .field("sampling", &self.whitted.settings)
            .finish_non_exhaustive()
    }
}

impl ViewSampler {
    /// Of a scene, with a kernel that counts for its mesh and settings that all frames share (roughness of
    /// mirrors, cutoff).
    ///
    /// # Errors
    /// [`HybridModelError::Thread`].
    pub fn new(
        scene: &Arc<Scene>,
        traced: Arc<dyn CountingKernel>,
        settings: &Settings,
        sampling: ViewSampling,
    ) -> Result<Self, HybridModelError> {
        let settings = Settings { max_depth: sampling.max_depth, ..settings.sanitized() };
        let facts = SceneFacts::new(scene, settings.mirror_roughness);
        let whitted = Whitted::new(WhittedSettings {
            width: sampling.width.max(1),
            height: sampling.height.max(1),
            grid: 1,
            max_depth: sampling.max_depth,
            cutoff: settings.throughput_cutoff,
            max_rays: settings.max_rays,
            ambient: AmbientLight::NONE,
            occlusion_rays: 0,
            mirror_roughness: settings.mirror_roughness,
            ..WhittedSettings::default()
        });
        let count = scene.mesh.len();
        let step = count.div_ceil(sampling.triangles.max(1)).max(1);
        let middle = |i: usize| {
            let triangle = scene.mesh.triangle(i);
            (triangle.v0 + triangle.v1 + triangle.v2) / 3.0
        };
        let extent = if count == 0 { Vec3::ZERO } else { scene.mesh.bounds().extent() };
        let mut regions: Vec<f32> = sampling.regions.iter().map(|x| x * extent.length()).collect();
        regions.retain(|half| *half >= 0.0);
        regions.push(f32::INFINITY);
        regions.sort_by(f32::total_cmp);
        Ok(Self {
            objects: ObjectFacts::of(scene, &facts),
            middles: (0..count).step_by(step).map(middle).collect(),
            extent,
            regions,
            pool: rayon::ThreadPoolBuilder::new().num_threads(1).build()?,
            scene: scene.clone(),
            traced,
            facts,
            settings,
            whitted,
        })
    }

    /// The work of a view. Takes a few milliseconds of one core.
    #[must_use]
    pub fn sample(&self, camera: &Camera) -> ViewWork {
        let seen = Seen {
            traced: &*self.traced,
            eye: camera.position,
            found: Mutex::new(Found::default()),
        };
        let (_, stats) = self.pool.install(|| {
            self.whitted.render_knowing(&self.facts, camera, &self.scene, &seen, |_, _| {})
        });
        let WhittedSettings { width, height, .. } = self.whitted.settings;
        let pixels = f64::from(width) * f64::from(height);
        let mut found = seen.found.into_inner().unwrap_or_else(PoisonError::into_inner);
        found.points.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let distances: Vec<f32> = found.points.iter().map(|p| p.distance).collect();
        let occlusion_steps = (0..).zip(&found.points).map(|(i, p)| self.occlusion(i, p)).collect();
        let from_eye = |p: &Vec3| (*p - camera.position).abs().max_element();
        let mut triangle_distances: Vec<f32> = self.middles.iter().map(from_eye).collect();
        triangle_distances.sort_by(f32::total_cmp);
        let mut rays = [0.0; RenderStats::DEPTHS];
        for (share, &count) in rays.iter_mut().zip(&stats.rays_by_depth) {
            *share = count as f64 / pixels;
        }
        // Primary rays are not traced but rasterised.
        rays[0] -= 1.0;
        let objects = self.objects.iter().map(|object| {
            let (min, max) = (object.bounds.min, object.bounds.max);
            let outside = (min - camera.position).max(camera.position - max).max(Vec3::ZERO);
            (outside.max_element(), object.triangles.end - object.triangles.start)
        });
        let mut objects: Vec<(f32, u32)> = objects.collect();
        objects.sort_by(|a, b| a.0.total_cmp(&b.0));
        let shines = |l: &&niwaki_scene::Light| l.intensity.max_element() > 0.0;
        ViewWork {
            visible: distances.len() as f64 / pixels,
            rays,
            ray_steps: found.steps as f64 / found.rays.max(1) as f64,
            distances,
            occlusion_steps,
            triangle_distances,
            objects,
            triangles: self.scene.mesh.len() as u64,
            longest: self.extent.max_element(),
            diagonal: self.extent.length(),
            lights: niwaki_core::to_u32(self.scene.lights.iter().filter(shines).count()),
            planned: self.regions.iter().map(|&half| (half, self.plans(camera, half))).collect(),
        }
    }

    /// Steps of one ray of ambient occlusion from a point; none from mirrors and glass, which show no
    /// ambient light.
    fn occlusion(&self, number: u64, point: &Point) -> f32 {
        let material = self.scene.material_ids.get(point.prim_id as usize).copied().unwrap_or(0);
        let facts = self.facts.materials.get(material as usize);
        if !facts.is_some_and(|m| m.diffuse || m.glossy) {
            return 0.0;
        }
        let triangle = self.scene.mesh.triangle(point.prim_id as usize);
        let normal = (triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0);
        let normal = normal.normalize_or_zero();
        let normal = if normal.dot(point.direction) > 0.0 { -normal } else { normal };
        // Towards a point on the unit sphere about the tip of the normal: by the cosine. Golden-ratio
        // multiples of two numbers spread evenly.
        let [a, b] = [0.618_034, 0.754_878].map(|step: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "from 0 to 1")]
            let x = (step * number as f64).fract() as f32;
            x
        });
        let (sin, cos) = (a * std::f32::consts::TAU).sin_cos();
        let z = 1.0 - 2.0 * b;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let direction = (normal + Vec3::new(r * cos, r * sin, z)).normalize_or(normal);
        let reach = self.extent.length();
        let ray = Ray::new(point.position + normal * (1e-4 * reach), direction)
            .with_range(0.0, ViewWork::OCCLUSION_RADIUS * reach);
        let counts = self.traced.any(&ray).1;
        (counts.nodes + counts.triangles) as f32
    }

    /// What is planned without reflections and with them.
    fn plans(&self, camera: &Camera, half: f32) -> [PlannedWork; 2] {
        let near_region = match half {
            x if x.is_finite() => NearRegion::HalfSize(x),
            _ => NearRegion::WholeScene,
        };
        [0, self.settings.max_depth.max(1)].map(|max_depth| {
            let settings = Settings { max_depth, near_region, ..self.settings.clone() };
            self.plan(camera, &settings)
        })
    }

    fn plan(&self, camera: &Camera, settings: &Settings) -> PlannedWork {
        let WhittedSettings { width, height, .. } = self.whitted.settings;
        let plan = EffectPlan::decide(&FrameFacts {
            scene: &self.facts,
            objects: &self.objects,
            camera,
            width,
            height,
            settings,
            kept: None,
        });
        let faces = Face::ALL.into_iter().filter(|face| plan.uses(Effect::CubeFace(*face)));
        let triangles = |o: &ObjectFacts| u64::from(o.triangles.end - o.triangles.start);
        let drawn = |face: Face| {
            let seen = self.objects.iter().filter(|o| plan.region.seen_by(face, o.bounds));
            seen.map(triangles).sum::<u64>()
        };
        let shown = plan.visible.iter().filter_map(|&i| self.objects.get(i as usize));
        PlannedWork {
            follows: plan.follows_rays(),
            faces: niwaki_core::to_u32(faces.clone().count()),
            view_triangles: shown.map(triangles).sum(),
            face_triangles: faces.map(drawn).sum(),
            second_layer: plan.uses(Effect::SecondLayer),
        }
    }
}

/// A point that the camera sees.
struct Point {
    /// The longest of its three coordinates, from the camera.
    distance: f32,
    position: Vec3,
    /// From the camera.
    direction: Vec3,
    prim_id: u32,
}

/// What rays found.
#[derive(Default)]
struct Found {
    points: Vec<Point>,
    /// Rays that go on from surfaces, and the nodes and triangles that they tested.
    rays: u64,
    steps: u64,
}

/// An intersector that remembers what the camera sees and what other rays take. Light is never held
/// back: where rays go does not depend on it.
struct Seen<'a> {
    traced: &'a dyn CountingKernel,
    eye: Vec3,
    found: Mutex<Found>,
}

impl Intersector for Seen<'_> {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        let (hit, walk) = self.traced.closest(ray);
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        if ray.origin != self.eye {
            found.rays += 1;
            found.steps += walk.counts.nodes + walk.counts.triangles;
        } else if hit.is_hit() {
            found.points.push(Point {
                distance: hit.t * ray.direction.abs().max_element(),
                position: ray.origin + ray.direction * hit.t,
                direction: ray.direction,
                prim_id: hit.prim_id,
            });
        }
        hit
    }

    fn any_hit(&self, _: &Ray) -> bool {
        true
    }
}
