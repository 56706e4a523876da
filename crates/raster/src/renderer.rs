//! The renderer: what it keeps from frame to frame, and the making of a frame.

mod record;
mod shadows;

use crate::{
    Algorithm, FrameReport, Pass, PassReport, Picture, Settings, Shares, SpotLight,
    layout::{FrameUniform, GpuLight},
    pipelines::{Draw, Pipelines, Variant},
    targets::{Maps, Screen, ScreenKind},
    volumes::Volumes,
};
use niwaki_core::to_u32;
use niwaki_gpu_frame::{FrameError, Gpu, Surfaces, ViewMatrix, camera_view, check_camera, wgpu};
use niwaki_scene::{AlphaMode, Camera, Object, Scene, SceneFacts};
use std::{sync::Arc, time::Instant};
use wgpu::BufferUsages;

/// Renders frames of a scene that does not move, by one of the six algorithms, and times their
/// passes.
///
/// ```no_run
/// use niwaki_raster::{Algorithm, Gpu, Renderer, Settings, study};
///
/// let study = study::atrium(100_000, 1);
/// let settings = Settings::new(Algorithm::ShadowVolumes, 320, 180);
/// let gpu = Gpu::new()?;
/// let mut renderer = Renderer::new(&gpu, study.scene.clone(), study.shadow_lights(4), settings)?;
/// let report = renderer.draw(&study.path.frame(0), 320, 180)?;
/// println!("{:?} ms", report.gpu_ms());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Surfaces are opaque, masks excepted (which shadow volumes do not know: there the whole triangle
/// casts a shadow); nothing is reflected or refracted.
pub struct Renderer {
    gpu: Gpu,
    scene: Arc<Scene>,
    objects: Vec<Object>,
    lights: Vec<SpotLight>,
    settings: Settings,
    surfaces: Surfaces,
    frame: wgpu::Buffer,
    group: wgpu::BindGroup,
    variant: Variant,
    near: f32,
    pipelines: Arc<Pipelines>,
    screen: Option<Screen>,
    maps: Option<Maps>,
    volumes: Option<Volumes>,
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renderer")
            .field("device", &self.gpu.name())
            .field("scene", &self.scene.name)
            .field("lights", &self.lights.len())
            .field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Show {
    /// The picture.
    Picture,
    /// The share of one light that arrives.
    Share(u32),
}

/// What a frame is recorded from.
struct Frame {
    show: Show,
    lights: Vec<GpuLight>,
    /// The camera's, then the lights'.
    views: Vec<ViewMatrix>,
    view_group: wgpu::BindGroup,
    view_buffer: wgpu::Buffer,
    light_group: wgpu::BindGroup,
}

/// Bytes from one view to the next: what every device can bind.
const VIEW_STRIDE: usize = 256;

impl Renderer {
    /// Uploads a scene; lights are [sanitized](SpotLight::sanitized), settings too.
    ///
    /// # Errors
    /// [`FrameError::TooLarge`] if the scene does not fit the device, and what the device reports.
    pub fn new(
        gpu: &Gpu,
        scene: Arc<Scene>,
        lights: Vec<SpotLight>,
        settings: Settings,
    ) -> Result<Self, FrameError> {
        gpu.check()?;
        let surfaces = Surfaces::new(gpu, &scene, &Surfaces::vertices_of(&scene))?;
        // Nothing is a mirror here: all of metals' and coats' reflection is highlight.
        let facts = SceneFacts::new(&scene, 0.0);
        surfaces.write_materials(gpu, &scene, &facts, |_, m| m.thickness, false);
        let frame = gpu.buffer("frame", size_of::<FrameUniform>() as u64, BufferUsages::UNIFORM)?;
        let group = surfaces.group(gpu, &frame);
        let bounds = scene.mesh.bounds();
        let diagonal = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        // Without triangles there is no diagonal.
        let diagonal = if diagonal.is_finite() { diagonal } else { 1.0 };
        #[expect(clippy::cast_possible_truncation, reason = "clamped to the range of f32")]
        let near = (diagonal * 1e-5).clamp(1e-30, 1e20) as f32;
        let variant = Variant {
            alpha: scene.materials.iter().any(|m| m.alpha_mode != AlphaMode::Opaque),
            textures: !scene.textures.is_empty(),
        };
        Ok(Self {
            gpu: gpu.clone(),
            objects: scene.objects_or_whole().into_owned(),
            scene,
            lights: lights.into_iter().map(SpotLight::sanitized).collect(),
            settings: settings.sanitized(),
            surfaces,
            frame,
            group,
            variant,
            near,
            pipelines: gpu.shared(Pipelines::new)?,
            screen: None,
            maps: None,
            volumes: None,
        })
    }

    /// The settings, each within its range.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes the settings.
    pub fn set_settings(&mut self, settings: Settings) {
        self.settings = settings.sanitized();
    }

    /// The lights, each within its range.
    #[must_use]
    pub fn lights(&self) -> &[SpotLight] {
        &self.lights
    }

    /// Changes the lights.
    pub fn set_lights(&mut self, lights: Vec<SpotLight>) {
        self.lights = lights.into_iter().map(SpotLight::sanitized).collect();
    }

    /// The device's name.
    #[must_use]
    pub fn device_name(&self) -> &str {
        self.gpu.name()
    }

    /// The scene.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Draws a frame, waits for it and leaves its picture on the GPU. An image without pixels
    /// takes no work.
    ///
    /// # Errors
    /// [`FrameError::BadCamera`], [`FrameError::Unsupported`] if the device lacks what the
    /// algorithm needs, [`FrameError::TooLarge`], [`FrameError::OutOfMemory`],
    /// [`FrameError::DeviceLost`].
    pub fn draw(
        &mut self,
        camera: &Camera,
        width: u32,
        height: u32,
    ) -> Result<FrameReport, FrameError> {
        self.run(camera, [width, height], Show::Picture)
    }

    /// The picture of the last frame; one without pixels before the first.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn picture(&self) -> Result<Picture, FrameError> {
        let Some(screen) = &self.screen else { return Ok(Picture::default()) };
        let [width, height] = screen.kind.size;
        let pixels = self.gpu.read_texture(&screen.output, wgpu::TextureAspect::All)?;
        Ok(Picture { width, height, pixels })
    }

    /// The share of a light that arrives at each pixel's point by the algorithm of the settings
    /// (all of it for those without shadows), and what each pixel shows.
    ///
    /// # Errors
    /// As [`Renderer::draw`]; [`FrameError::TooLarge`] if there is no such light.
    pub fn shares(
        &mut self,
        camera: &Camera,
        width: u32,
        height: u32,
        light: usize,
    ) -> Result<(Shares, FrameReport), FrameError> {
        if light >= self.lights.len() {
            return Err(FrameError::TooLarge {
                what: "the number of a light".into(),
                wanted: light as u64,
                limit: (self.lights.len() as u64).saturating_sub(1),
                remedy: "use the number of a light that the renderer has",
            });
        }
        let kept = self.settings.algorithm;
        if matches!(kept, Algorithm::Forward | Algorithm::ZPrepass) {
            // Both have the lights of deferred rendering, and no sums to show.
            self.settings.algorithm = Algorithm::Deferred;
        }
        let report = self.run(camera, [width, height], Show::Share(to_u32(light)));
        self.settings.algorithm = kept;
        let report = report?;
        let deferred = self.screen.as_ref().and_then(|s| s.deferred.as_ref());
        let (Some(deferred), true) = (deferred, width > 0 && height > 0) else {
            return Ok((Shares { width, height, ..Shares::default() }, report));
        };
        let depth =
            self.gpu.read_texture(&deferred.depth_texture, wgpu::TextureAspect::DepthOnly)?;
        let triangle = match &deferred.triangle {
            Some((texture, _)) => self.gpu.read_texture(texture, wgpu::TextureAspect::All)?,
            None => Vec::new(),
        };
        let share = if deferred.sum.format() == wgpu::TextureFormat::Rgba32Float {
            let all: Vec<[f32; 4]> =
                self.gpu.read_texture(&deferred.sum, wgpu::TextureAspect::All)?;
            all.into_iter().map(|s| s[0]).collect()
        } else {
            let all: Vec<[u16; 4]> =
                self.gpu.read_texture(&deferred.sum, wgpu::TextureAspect::All)?;
            all.into_iter().map(|s| crate::picture::half(s[0])).collect()
        };
        Ok((Shares { width, height, near: self.near, share, triangle, depth }, report))
    }

    /// How many triangles faced the last light of the last frame of shadow volumes, how many
    /// turned their back, and how many walls were drawn; `None` before such a frame.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn volume_counts(&self) -> Result<Option<[u32; 3]>, FrameError> {
        self.volumes.as_ref().map(|v| v.counts(&self.gpu)).transpose()
    }

    fn run(
        &mut self,
        camera: &Camera,
        size: [u32; 2],
        show: Show,
    ) -> Result<FrameReport, FrameError> {
        self.gpu.check()?;
        check_camera(camera)?;
        let start = Instant::now();
        let passes = if size.contains(&0) {
            self.screen = None;
            Vec::new()
        } else {
            self.make_room(size, show)?;
            let sv = self.settings.algorithm == Algorithm::ShadowVolumes && self.settings.one_sided;
            if let (true, Some(volumes)) = (sv, &mut self.volumes) {
                volumes.place(&self.scene, camera.position, &self.lights);
            }
            let frame = self.frame(camera, size, show)?;
            self.record(&frame)?
        };
        Ok(FrameReport {
            algorithm: self.settings.algorithm,
            lights: to_u32(self.lights.len()),
            size,
            passes,
            total_ms: start.elapsed().as_secs_f64() * 1e3,
        })
    }

    /// Makes what the algorithm needs and is not there yet.
    fn make_room(&mut self, size: [u32; 2], show: Show) -> Result<(), FrameError> {
        let algorithm = self.settings.algorithm;
        let stencil = algorithm == Algorithm::ShadowVolumes;
        if stencil {
            let what = "a stencil beside depth of 32 bits, which shadow volumes need";
            self.gpu.require(wgpu::Features::DEPTH32FLOAT_STENCIL8, what)?;
        }
        let forward = matches!(algorithm, Algorithm::Forward | Algorithm::ZPrepass);
        let kind = ScreenKind {
            size,
            stencil,
            sum: (!forward).then_some(self.pipelines.sum_format),
            triangles: show != Show::Picture,
        };
        if self.screen.as_ref().is_none_or(|s| s.kind != kind) {
            self.screen = None;
            self.screen = Some(Screen::new(&self.gpu, kind)?);
        }
        let maps = match algorithm {
            Algorithm::ShadowMaps => Some(false),
            Algorithm::VarianceShadowMaps => Some(true),
            _ => None,
        };
        if let Some(variance) = maps {
            let side = self.settings.shadow_resolution;
            if self.maps.as_ref().is_none_or(|m| (m.side, m.variance) != (side, variance)) {
                self.maps = None;
                self.maps = Some(Maps::new(&self.gpu, side, variance)?);
            }
        }
        if stencil && self.volumes.is_none() {
            self.volumes = Some(Volumes::new(&self.gpu, &self.scene)?);
        }
        Ok(())
    }

    fn frame(&self, camera: &Camera, size: [u32; 2], show: Show) -> Result<Frame, FrameError> {
        let lights: Vec<GpuLight> = self.lights.iter().map(GpuLight::new).collect();
        let uniform = FrameUniform::new(
            camera,
            size,
            self.near,
            to_u32(lights.len()),
            &self.settings,
            &self.scene.environment,
        );
        self.gpu.queue().write_buffer(&self.frame, 0, bytemuck::bytes_of(&uniform));
        let mut views = vec![camera_view(camera, size[0], size[1], self.near)];
        let of_light = |(light, gpu): (&SpotLight, &GpuLight)| ViewMatrix {
            matrix: gpu.matrix,
            eye: light.position,
            pad: 0.0,
        };
        views.extend(self.lights.iter().zip(&lights).map(of_light));
        let mut bytes = vec![0_u8; views.len() * VIEW_STRIDE];
        for (slot, view) in bytes.chunks_exact_mut(VIEW_STRIDE).zip(&views) {
            slot[..size_of::<ViewMatrix>()].copy_from_slice(bytemuck::bytes_of(view));
        }
        let buffer = self.gpu.upload("views", &bytes, BufferUsages::UNIFORM)?;
        let one = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &buffer,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<ViewMatrix>() as u64),
        });
        let listed = self.gpu.upload("lights", &lights, BufferUsages::STORAGE)?;
        Ok(Frame {
            show,
            view_group: self.gpu.bind(&self.pipelines.view, &[one]),
            view_buffer: self.gpu.upload("camera", &views[..1], BufferUsages::UNIFORM)?,
            light_group: self.gpu.bind(&self.pipelines.lights, &[listed.as_entire_binding()]),
            lights,
            views,
        })
    }

    fn pipeline(&self, draw: Draw) -> Result<wgpu::RenderPipeline, FrameError> {
        self.pipelines.draw(&self.gpu, &self.surfaces.layout, draw, self.variant)
    }
}

impl From<niwaki_gpu_frame::Timed<Pass>> for PassReport {
    fn from(timed: niwaki_gpu_frame::Timed<Pass>) -> Self {
        let niwaki_gpu_frame::Timed { stage, draws, dispatches, span } = timed;
        Self { pass: stage, draws, dispatches, span }
    }
}
