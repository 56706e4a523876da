//! Frames by the integrators of `niwaki-render`.

use super::{
    Draw, Drawn, Steps,
    args::{Mode, RenderArgs},
    counted, timed,
};
use anyhow::{Context, Result};
use niwaki_core::Builder;
use niwaki_render::{PathSettings, PathTracer, RenderStats, Whitted, WhittedSettings};
use niwaki_scene::{Camera, Scene, SceneFacts};
use niwaki_trace::AutoScene;
use std::sync::Arc;

/// Bounces unless said otherwise.
const DEPTH: u32 = 8;

/// Draws on the CPU, with a new tree a frame if something moves.
pub(super) struct OnCpu {
    scene: Arc<Scene>,
    builder: Box<dyn Builder>,
    /// What the scene contains, whether its objects move or not.
    facts: SceneFacts,
    /// The tree of the scene at rest, kept where nothing moves.
    kept: Option<AutoScene>,
    integrator: Integrator,
    frame: u64,
}

enum Integrator {
    Whitted(Whitted),
    Path(PathTracer),
}

impl OnCpu {
    pub(super) fn new(scene: &Arc<Scene>, builder: Box<dyn Builder>, args: &RenderArgs) -> Self {
        let (width, height) = (args.size.width, args.size.height);
        let max_depth = args.depth.unwrap_or(DEPTH);
        let integrator = if args.mode == Mode::Path {
            let settings = PathSettings { width, height, max_depth, ..PathSettings::default() };
            let (samples, seed) = (args.samples, args.seed);
            Integrator::Path(PathTracer::new(PathSettings { samples, seed, ..settings }))
        } else {
            let settings =
                WhittedSettings { width, height, max_depth, ..WhittedSettings::default() };
            let bounds = scene.mesh.bounds();
            let diagonal = if bounds.is_empty() { 0.0 } else { bounds.extent().length() };
            Integrator::Whitted(Whitted::new(WhittedSettings {
                grid: args.grid,
                occlusion_rays: args.occlusion,
                occlusion_radius: args.occlusion_radius * diagonal,
                ..settings
            }))
        };
        let facts = SceneFacts::new(scene, SceneFacts::MIRROR_ROUGHNESS);
        Self { scene: Arc::clone(scene), builder, facts, kept: None, integrator, frame: 0 }
    }
}

impl Draw for OnCpu {
    fn draw(&mut self, camera: &Camera, time: f64, progress: &Steps<'_>) -> Result<Drawn> {
        let mut parts = Vec::new();
        let scene = match &self.scene.animation {
            Some(_) => {
                let moved = timed(&mut parts, "motion", || self.scene.frozen(time));
                Arc::new(moved.context("motion takes the scene out of range")?)
            }
            None => Arc::clone(&self.scene),
        };
        if self.kept.is_none() || self.scene.animation.is_some() {
            let build = || -> Result<_> {
                let bvh = self.builder.build_mesh(&scene.mesh)?;
                Ok(AutoScene::new(&bvh, &scene.mesh)?)
            };
            self.kept = Some(timed(&mut parts, "tree", build)?);
        }
        let tree = self.kept.as_ref().context("there is no tree")?;
        let frame = self.frame;
        self.frame += 1;
        let (image, stats) = timed(&mut parts, "rays", || match &self.integrator {
            Integrator::Whitted(whitted) => {
                whitted.render_knowing(&self.facts, camera, &scene, tree, progress)
            }
            Integrator::Path(path) => {
                // Noise that stood still would look like dirt on the lens.
                let seed = path.settings.seed.wrapping_add(frame);
                let settings = PathSettings { seed, ..path.settings.clone() };
                let tracer = PathTracer::new(settings);
                tracer.render_knowing(&self.facts, camera, &scene, tree, progress)
            }
        });
        Ok(Drawn { image, parts, counts: counts(&stats) })
    }

    fn explain(&self, _: &Camera, _: f64) -> String {
        match &self.integrator {
            Integrator::Whitted(whitted) => {
                whitted.plan_knowing(&self.facts, &self.scene).to_string()
            }
            Integrator::Path(_) => self.facts.to_string(),
        }
    }
}

fn counts(stats: &RenderStats) -> Vec<super::Count> {
    counted([
        ("closest-hit rays", stats.closest_hit_rays),
        ("shadow rays", stats.shadow_rays),
        ("occlusion rays", stats.occlusion_rays),
        ("reflected rays", stats.reflected_rays),
        ("refracted rays", stats.refracted_rays),
        ("rays past alpha", stats.continued_rays),
        ("rays left out", stats.cut_rays),
        ("paths dropped", stats.dropped_paths),
    ])
}
