//! A scene made ready: tree, kernels that count, camera path.

use crate::{registry, render::Size, scenes::SceneSpec};
use anyhow::{Context, Result};
use niwaki_core::{Bvh, Ray};
use niwaki_frame_control::RenderSettings;
use niwaki_gpu_model::Workload;
use niwaki_gpu_model::workload::{CountingKernel, LightSample, SampledScene, Sampling, View};
use niwaki_gpu_tracer::FrameSettings;
use niwaki_scene::{Camera, CameraPath, LightKind, Scene};
use niwaki_trace::{BinaryScene, QuantisedScene};
use std::sync::Arc;

/// What is made ready of a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting<'a> {
    /// Name of the tree's builder.
    pub(crate) builder: &'a str,
    /// Frames along the camera path.
    pub(crate) frames: u32,
    /// Turns the camera around for the second half.
    pub(crate) turn: bool,
    /// Pixels of a frame.
    pub(crate) size: [u32; 2],
    /// How far occluders count, as a share of the diagonal of the scene's bounds.
    pub(crate) ao_radius: f64,
    /// Columns and rows of samples of a view.
    pub(crate) sampling: Size,
    pub(crate) seed: u64,
}

/// A scene made ready.
pub(crate) struct Stage {
    pub(crate) scene: Scene,
    pub(crate) bvh: Bvh,
    pub(crate) cameras: Vec<Camera>,
    pub(crate) size: [u32; 2],
    pub(crate) sampled: SampledScene,
    pub(crate) sampling: Sampling,
    /// Diagonal of the scene's bounds.
    pub(crate) diagonal: f32,
    pub(crate) seed: u32,
}

impl Stage {
    /// `is_simulated` samples the binary tree, which simulated devices traverse.
    pub(crate) fn new(spec: &SceneSpec, args: &Setting<'_>, is_simulated: bool) -> Result<Self> {
        let &Setting { frames, size, .. } = args;
        let scene = spec.load(args.seed)?;
        let builder = registry::one_of_ours("--builder", args.builder)?;
        let bvh = builder.build(&scene.mesh.prim_refs()).context("cannot build a tree")?;
        // The tree as the device has it: binary, or eight wide with boxes on a grid.
        let kernel: Arc<dyn CountingKernel> = if is_simulated {
            Arc::new(BinaryScene::new(&bvh, &scene.mesh)?)
        } else {
            Arc::new(QuantisedScene::<8>::new(&bvh, &scene.mesh)?)
        };
        let sampled = SampledScene { kernel, mesh: Arc::new(scene.mesh.clone()) };
        let cameras = path(&scene, frames, args.turn);
        let diagonal = scene.mesh.bounds().extent().length();
        let lights = scene.lights.iter().map(|light| match light.kind {
            LightKind::Directional => LightSample::Directional(light.direction),
            LightKind::Point | LightKind::Spot { .. } => LightSample::Point(light.position),
        });
        #[expect(clippy::cast_possible_truncation, reason = "a share of a length")]
        let ao_radius = args.ao_radius as f32 * diagonal;
        let sampling = Sampling {
            width: args.sampling.width,
            height: args.sampling.height,
            ao_radius,
            lights: lights.collect(),
            frame: size,
            seed: args.seed,
            ..Sampling::default()
        };
        let seed = u32::try_from(args.seed & u64::from(u32::MAX)).unwrap_or_default();
        Ok(Self { scene, bvh, cameras, size, sampled, sampling, diagonal, seed })
    }

    /// A camera as the sampler knows it.
    pub(crate) fn view(&self, camera: &Camera) -> View {
        let aspect = self.size[0] as f32 / self.size[1].max(1) as f32;
        let target = camera.position + camera.forward;
        View::look_at(camera.position, target, camera.up, camera.vertical_fov, aspect)
    }

    /// What the rays of a camera's view do, sampled now.
    pub(crate) fn workload(&self, sampling: &Sampling, camera: &Camera) -> Workload {
        sampling.sample(&*self.sampled.kernel, &self.sampled.mesh, &self.view(camera))
    }

    /// Settings as the tracer knows them.
    pub(crate) fn frame(&self, settings: &RenderSettings) -> FrameSettings {
        let [width, height] = settings.scaled(self.size);
        #[expect(clippy::cast_possible_truncation, reason = "a share of a length")]
        let ao_radius = settings.ao_radius as f32 * self.diagonal;
        FrameSettings {
            width,
            height,
            shadows: settings.shadows,
            ao_rays: u32::from(settings.ao_rays),
            ao_radius,
            seed: self.seed,
        }
    }

    /// The work of rays through a grid of pixels, for what samplers do not tell: nodes and triangles of each.
    pub(crate) fn walks(&self, camera: &Camera, [columns, rows]: [u16; 2]) -> Vec<(u64, u64)> {
        let view = self.view(camera);
        let place = |i: u16, n: u16| (f32::from(i) + 0.5) / f32::from(n);
        let pixels = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        pixels
            .map(|(x, y)| {
                let ray: Ray = view.ray(place(x, columns), place(y, rows));
                let (_, walk) = self.sampled.kernel.closest(&ray);
                (walk.counts.nodes, walk.counts.triangles)
            })
            .collect()
    }
}

/// The views of a scene's camera path. `turn` turns the camera around for the second half.
pub(super) fn path(scene: &Scene, frames: u32, turn: bool) -> Vec<Camera> {
    let path = CameraPath { frames, ..scene.camera_path() };
    let view = |frame| {
        let mut camera = path.frame(frame);
        if turn && frame >= frames / 2 {
            camera.forward = -camera.forward;
        }
        camera
    };
    (0..frames).map(view).collect()
}
