//! A scene made ready: tree, kernels that count, camera path.

use super::args::TuneArgs;
use crate::{registry, scenes::SceneSpec};
use anyhow::{Context, Result};
use niwaki_core::{Bvh, Ray};
use niwaki_frame_control::RenderSettings;
use niwaki_gpu_model::Workload;
use niwaki_gpu_model::workload::{CountingKernel, LightSample, SampledScene, Sampling, View};
use niwaki_gpu_tracer::FrameSettings;
use niwaki_scene::{Camera, LightKind, Scene};
use niwaki_trace::{BinaryScene, QuantisedScene};
use std::sync::Arc;

/// A scene made ready.
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) bvh: Bvh,
    pub(super) cameras: Vec<Camera>,
    pub(super) size: [u32; 2],
    pub(super) sampled: SampledScene,
    pub(super) sampling: Sampling,
    /// Diagonal of the scene's bounds.
    pub(super) diagonal: f32,
    pub(super) seed: u32,
}

impl Stage {
    /// `is_simulated` samples the binary tree, which simulated devices traverse.
    pub(super) fn new(
        args: &TuneArgs,
        spec: &SceneSpec,
        size: [u32; 2],
        is_simulated: bool,
    ) -> Result<Self> {
        let scene = spec.load(args.seed)?;
        let builder = registry::one_of_ours("--builder", &args.builder)?;
        let bvh = builder.build(&scene.mesh.prim_refs()).context("cannot build a tree")?;
        // The tree as the device has it: binary, or eight wide with boxes on a grid.
        let kernel: Arc<dyn CountingKernel> = if is_simulated {
            Arc::new(BinaryScene::new(&bvh, &scene.mesh)?)
        } else {
            Arc::new(QuantisedScene::<8>::new(&bvh, &scene.mesh)?)
        };
        let sampled = SampledScene { kernel, mesh: Arc::new(scene.mesh.clone()) };
        let frames = args.frames.unwrap_or(if args.quick { 12 } else { 100 });
        let mut path = scene.camera_path();
        path.frames = frames;
        let cameras = (0..frames).map(|frame| {
            let mut camera = path.frame(frame);
            if args.turn && frame >= frames / 2 {
                camera.forward = -camera.forward;
            }
            camera
        });
        let cameras = cameras.collect();
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
    pub(super) fn view(&self, camera: &Camera) -> View {
        let aspect = self.size[0] as f32 / self.size[1].max(1) as f32;
        let target = camera.position + camera.forward;
        View::look_at(camera.position, target, camera.up, camera.vertical_fov, aspect)
    }

    /// What the rays of a camera's view do, sampled now.
    pub(super) fn workload(&self, sampling: &Sampling, camera: &Camera) -> Workload {
        sampling.sample(&*self.sampled.kernel, &self.sampled.mesh, &self.view(camera))
    }

    /// Settings as the tracer knows them.
    pub(super) fn frame(&self, settings: &RenderSettings) -> FrameSettings {
        let scaled = |n: u32| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
            let n = (f64::from(n) * settings.render_scale).round() as u32;
            n.max(1)
        };
        #[expect(clippy::cast_possible_truncation, reason = "a share of a length")]
        let ao_radius = settings.ao_radius as f32 * self.diagonal;
        FrameSettings {
            width: scaled(self.size[0]),
            height: scaled(self.size[1]),
            shadows: settings.shadows,
            ao_rays: u32::from(settings.ao_rays),
            ao_radius,
            seed: self.seed,
        }
    }

    /// The work of rays through a grid of pixels, for what samplers do not tell: nodes and triangles of each.
    pub(super) fn walks(&self, camera: &Camera, [columns, rows]: [u16; 2]) -> Vec<(u64, u64)> {
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
