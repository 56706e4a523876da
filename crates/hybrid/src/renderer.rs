//! The renderer: what it keeps from frame to frame, and the making of a frame.

mod cube;
mod record;

use crate::{
    Effect, EffectPlan, Face, Frame, FrameFacts, FrameReport, Gpu, HybridError, Kept, March,
    ObjectFacts, Settings,
    layout::{FrameInput, FrameUniform, GpuLight},
    pipelines::{Pipelines, Variant},
    pyramid::Pyramid,
    report::Counters,
    targets::{CubeMap, Layers, Screen, shadow_maps},
    tree::NearTree,
    upload::GpuScene,
    views::{LightViews, light_views},
};
use glam::Vec4;
use niwaki_core::Aabb;
use niwaki_gpu_frame::check_camera;
use niwaki_render::Image;
use niwaki_scene::{Camera, Light, Scene, ScenePose};
use std::{sync::Arc, time::Instant};

/// Renders frames of a scene on a GPU.
///
/// ```no_run
/// use niwaki_hybrid::{Gpu, HybridRenderer, Settings};
/// use std::sync::Arc;
///
/// let scene = niwaki_scene::generate::generate("atrium", 100_000, 1).ok_or("no such scene")?;
/// let gpu = Gpu::new()?;
/// let camera = scene.cameras[0];
/// let mut renderer = HybridRenderer::new(&gpu, Arc::new(scene), Settings::default())?;
/// let frame = renderer.render(&camera, 320, 180, 0.0)?;
/// println!("{}\n{:?}", frame.plan, frame.report.counters);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The renderer decides anew in each frame which passes run ([`EffectPlan`]), and keeps what still
/// holds. After an error nothing is kept; after [`HybridError::DeviceLost`] it is of no more use.
pub struct HybridRenderer {
    gpu: Gpu,
    scene: Arc<Scene>,
    settings: Settings,
    uploaded: GpuScene,
    pipelines: Arc<Pipelines>,
    screen: Option<Screen>,
    pub(crate) cube: CubeMap,
    pub(crate) pyramid: Pyramid,
    shadows: Layers,
    tree: NearTree,
    /// Lights that shine.
    lights: Vec<Light>,
    kept: Option<Kept>,
    pose: Option<ScenePose>,
}

impl std::fmt::Debug for HybridRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HybridRenderer")
            .field("device", &self.gpu.name())
            .field("scene", &self.scene.name)
            .field("triangles", &self.uploaded.triangles())
            .field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}

/// What a frame is recorded from.
struct Scenery {
    plan: EffectPlan,
    objects: Vec<ObjectFacts>,
    pose: ScenePose,
    lights: Vec<LightViews>,
    camera: Camera,
    size: [u32; 2],
    variant: Variant,
}

impl HybridRenderer {
    /// Uploads a scene and compiles the kernels.
    ///
    /// # Errors
    /// [`HybridError::TooLarge`] if the scene does not fit the device, and what the device reports.
    pub fn new(gpu: &Gpu, scene: Arc<Scene>, settings: Settings) -> Result<Self, HybridError> {
        gpu.check()?;
        let settings = settings.sanitized();
        let lit = |l: &&Light| l.intensity.max_element() > 0.0;
        Ok(Self {
            gpu: gpu.clone(),
            uploaded: GpuScene::new(gpu, &scene, &settings)?,
            pipelines: gpu.shared(Pipelines::new)?,
            screen: None,
            cube: CubeMap::new(gpu, 1, 1)?,
            pyramid: Pyramid::new(gpu, 1, 1)?,
            shadows: shadow_maps(gpu, 1, 1)?,
            tree: NearTree::empty(gpu)?,
            lights: scene.lights.iter().filter(lit).copied().collect(),
            kept: None,
            pose: None,
            scene,
            settings,
        })
    }

    /// The settings, each within its range.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes the settings; nothing is kept from earlier frames.
    pub fn set_settings(&mut self, settings: Settings) {
        self.settings = settings.sanitized();
        self.uploaded.restate(&self.gpu, &self.scene, &self.settings);
        self.kept = None;
    }

    /// What the next frame with this view would do, and why.
    #[must_use]
    pub fn plan(&self, camera: &Camera, width: u32, height: u32, time: f64) -> EffectPlan {
        let pose = self.scene.pose(time);
        let objects = self.uploaded.objects_at(&self.scene, &pose, self.pose.as_ref());
        self.decide(camera, [width, height], &objects)
    }

    fn decide(&self, camera: &Camera, size: [u32; 2], objects: &[ObjectFacts]) -> EffectPlan {
        EffectPlan::decide(&FrameFacts {
            scene: &self.uploaded.facts,
            objects,
            camera,
            width: size[0],
            height: size[1],
            settings: &self.settings,
            kept: self.kept.as_ref(),
        })
    }

    /// Renders a frame as it stands at `time` (seconds) and fetches its image. An image without
    /// pixels takes no work.
    ///
    /// # Errors
    /// [`HybridError::BadCamera`], [`HybridError::TooLarge`], [`HybridError::OutOfMemory`] and
    /// [`HybridError::DeviceLost`].
    pub fn render(
        &mut self,
        camera: &Camera,
        width: u32,
        height: u32,
        time: f64,
    ) -> Result<Frame, HybridError> {
        let (plan, report) = self.draw(camera, width, height, time)?;
        Ok(Frame { image: self.image()?, plan, report })
    }

    /// Renders a frame and leaves its image on the GPU.
    ///
    /// # Errors
    /// As [`HybridRenderer::render`].
    pub fn draw(
        &mut self,
        camera: &Camera,
        width: u32,
        height: u32,
        time: f64,
    ) -> Result<(EffectPlan, FrameReport), HybridError> {
        self.gpu.check()?;
        check_camera(camera)?;
        // What is kept is known to hold only if this frame succeeds.
        let kept = self.kept.take();
        let pose = self.pose.take();
        let start = Instant::now();
        let scenery = self.prepare(camera, [width, height], time, kept, pose.as_ref())?;
        let mut report = if width == 0 || height == 0 {
            self.screen = None;
            FrameReport::default()
        } else {
            self.record(&scenery)?
        };
        report.total = start.elapsed();
        self.kept = Some(scenery.plan.kept.clone());
        self.pose = Some(scenery.pose);
        Ok((scenery.plan, report))
    }

    /// Fetches the image of the last frame.
    ///
    /// # Errors
    /// As [`HybridRenderer::render`].
    pub fn image(&self) -> Result<Image, HybridError> {
        let Some(screen) = &self.screen else { return Ok(Image::black(0, 0)) };
        let [width, height] = screen.size;
        let count = width as usize * height as usize;
        let pixels: Vec<Vec4> = self.gpu.read(&screen.image, count)?;
        let pixels = pixels.into_iter().map(Vec4::truncate).collect();
        Ok(Image::from_pixels(width, height, pixels).unwrap_or_else(|| Image::black(0, 0)))
    }

    /// The image of the last frame on the GPU, and its width and height: a vector of four a pixel
    /// (linear RGB, the fourth without meaning), rows from the top, to be bound as a read-only
    /// storage buffer of [`Gpu::device`](crate::Gpu::device). `None` before the first frame and
    /// after one without pixels.
    #[must_use]
    pub fn output(&self) -> Option<(&wgpu::Buffer, [u32; 2])> {
        self.screen.as_ref().map(|screen| (&screen.image, screen.size))
    }

    fn prepare(
        &mut self,
        camera: &Camera,
        size: [u32; 2],
        time: f64,
        kept: Option<Kept>,
        last: Option<&ScenePose>,
    ) -> Result<Scenery, HybridError> {
        let pose = self.scene.pose(time);
        let objects = self.uploaded.objects_at(&self.scene, &pose, last);
        self.kept = kept;
        let plan = self.decide(camera, size, &objects);
        self.kept = None;
        let bounds = objects.iter().fold(Aabb::EMPTY, |b, o| b.union(o.bounds));
        let lights = light_views(&self.lights, bounds);
        let textures = self.settings.force_all || self.uploaded.facts.has_textures();
        let variant = Variant::new(&plan, &self.settings, textures);
        Ok(Scenery { plan, objects, pose, lights, camera: *camera, size, variant })
    }

    /// Makes what the plan needs and is not there yet.
    fn make_room(&mut self, scenery: &Scenery) -> Result<(), HybridError> {
        let plan = &scenery.plan;
        if self.screen.as_ref().is_none_or(|s| s.size != scenery.size) {
            self.screen = None;
            self.screen = Some(Screen::new(&self.gpu, scenery.size)?);
        }
        let side = self.settings.face_resolution.max(1);
        if scenery.variant.use_map {
            let layers = if plan.uses(Effect::SecondLayer) { 2 } else { 1 };
            if (self.cube.depth.side, self.cube.layers) != (side, layers) {
                self.cube = CubeMap::new(&self.gpu, side, layers)?;
            }
            if plan.uses(Effect::DepthPyramid)
                && (self.pyramid.side, self.pyramid.layers) != (side, layers)
            {
                self.pyramid = Pyramid::new(&self.gpu, side, layers)?;
            }
        }
        let layers = scenery.lights.iter().map(|l| niwaki_core::to_u32(l.views.len())).sum::<u32>();
        let side = self.settings.shadow_resolution.max(1);
        let there = (self.shadows.side, niwaki_core::to_u32(self.shadows.each.len()));
        if plan.runs(Effect::ShadowMaps) && there != (side, layers.max(1)) {
            self.shadows = shadow_maps(&self.gpu, side, layers)?;
        }
        Ok(())
    }

    fn uniform(&self, scenery: &Scenery) -> FrameUniform {
        let plan = &scenery.plan;
        let face_mask = Face::ALL
            .iter()
            .filter(|f| plan.uses(Effect::CubeFace(**f)))
            .fold(0, |mask, f| mask | 1 << f.index());
        FrameUniform::new(&FrameInput {
            camera: &scenery.camera,
            size: scenery.size,
            region: &plan.region,
            settings: &self.settings,
            environment: &self.scene.environment,
            sky: plan.uses(Effect::Sky),
            face_mask,
            diagonal: self.uploaded.diagonal,
            light_count: niwaki_core::to_u32(self.lights.len()),
            top_level: match self.settings.march {
                March::Hierarchical if plan.uses(Effect::DepthPyramid) => self.pyramid.top_level(),
                _ => 0,
            },
        })
    }

    fn gpu_lights(&self, scenery: &Scenery) -> Vec<GpuLight> {
        let side = self.settings.shadow_resolution.max(1) as f32;
        self.lights
            .iter()
            .zip(&scenery.lights)
            .map(|(light, views)| {
                let maps = niwaki_core::to_u32(views.views.len());
                GpuLight::new(light, views.layer, maps, views.width / side)
            })
            .collect()
    }

    fn counters(&self, screen: &Screen) -> Result<Counters, HybridError> {
        let words: Vec<u32> = self.gpu.read(&screen.counters, 2 * Counters::COUNT)?;
        Ok(Counters::from_words(&words))
    }
}
