//! Frames by the hybrid renderer.

use super::{
    Draw, Drawn, Part, Steps,
    args::{Mode, Preset, RenderArgs, Size, View},
    counted,
};
use anyhow::Result;
use niwaki_hybrid::{
    DebugView, FrameReport, Gpu, HybridRenderer, NearRegion, Settings, StageReport,
};
use niwaki_scene::{Camera, Scene};
use std::{sync::Arc, time::Duration};

/// Draws on the GPU.
pub(super) struct OnGpu {
    renderer: HybridRenderer,
    device: String,
    size: Size,
    /// A frame was drawn: kernels are compiled.
    warm: bool,
}

impl OnGpu {
    pub(super) fn new(scene: &Arc<Scene>, args: &RenderArgs) -> Result<Self> {
        let gpu = Gpu::new()?;
        let renderer = HybridRenderer::new(&gpu, Arc::clone(scene), settings(args))?;
        Ok(Self { renderer, device: gpu.name().to_owned(), size: args.size, warm: false })
    }

    /// The name of the device.
    pub(super) fn device(&self) -> String {
        self.device.clone()
    }
}

impl Preset {
    /// What the preset stands for.
    pub(crate) fn settings(self) -> Settings {
        match self {
            Self::Fast => Settings::fast(),
            Self::Default => Settings::default(),
            Self::Fine => Settings::fine(),
            Self::Paper => Settings::paper(),
        }
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Names and milliseconds of what the GPU did for a frame, in order; none on a device without
/// timestamps.
pub(crate) fn passes(report: &FrameReport) -> Vec<(String, f64)> {
    let pass = |s: &StageReport| Some((s.stage.to_string(), ms(s.gpu_time?)));
    report.stages.iter().filter_map(pass).collect()
}

/// What the arguments ask for.
pub(super) fn settings(args: &RenderArgs) -> Settings {
    let preset = args.preset.settings();
    let near_region = match args.mode {
        Mode::FullBvh => NearRegion::WholeScene,
        _ => args.region.map_or(preset.near_region, NearRegion::ShareOfScene),
    };
    let debug_view = match args.debug_view {
        View::Image => DebugView::None,
        View::Hits => DebugView::HitSource,
        View::Normals => DebugView::Normal,
        View::Steps => DebugView::MarchSteps,
        View::Occlusion => DebugView::Occlusion,
    };
    let max_depth = args.depth.unwrap_or(preset.max_depth);
    Settings {
        near_region,
        debug_view,
        max_depth,
        occlusion_rays: args.occlusion,
        occlusion_radius: args.occlusion_radius,
        ..preset
    }
}

impl Draw for OnGpu {
    fn draw(&mut self, camera: &Camera, time: f64, progress: &Steps<'_>) -> Result<Drawn> {
        let Size { width, height } = self.size;
        if !self.warm {
            // Drivers compile kernels when they first run. The second frame does all again,
            // since new settings make the renderer forget what the first left.
            self.renderer.draw(camera, width, height, time)?;
            self.renderer.set_settings(self.renderer.settings().clone());
            self.warm = true;
        }
        let frame = self.renderer.render(camera, width, height, time)?;
        progress(1, 1);
        let counts = counted(counted_rays(&frame.report));
        Ok(Drawn { image: frame.image, parts: parts(&frame.report), counts })
    }

    fn explain(&self, camera: &Camera, time: f64) -> String {
        self.renderer.plan(camera, self.size.width, self.size.height, time).to_string()
    }
}

/// The parts of a frame and how long they took.
pub(super) fn parts(report: &FrameReport) -> Vec<Part> {
    let mut parts: Vec<Part> =
        passes(report).into_iter().map(|(name, ms)| Part { name, ms }).collect();
    let named: f64 = parts.iter().map(|part| part.ms).sum();
    // Recording commands, waiting, and all of it on a device without timestamps.
    let rest = (ms(report.total) - named).max(0.0);
    parts.push(Part { name: "host".into(), ms: rest });
    parts
}

/// What a frame counted, by name.
pub(super) fn counted_rays(report: &FrameReport) -> [(&'static str, u64); 20] {
    let counters = &report.counters;
    [
        ("triangles in the tree", report.region_triangles.into()),
        ("pixels with a surface", counters.primary_pixels),
        ("pixels that send rays", counters.spawning_pixels),
        ("reflected rays", counters.reflected_rays),
        ("refracted rays", counters.refracted_rays),
        ("rays past alpha", counters.continued_rays),
        ("shadow rays", counters.shadow_rays),
        ("traversals of the tree", counters.tree_traversals),
        ("marches through faces", counters.face_marches),
        ("pixels of marches", counters.march_samples),
        ("cells of pyramids", counters.pyramid_cells),
        ("from face to face", counters.face_hops),
        ("back to the tree", counters.region_returns),
        ("ended in the tree", counters.tree_hits),
        ("ended in the map", counters.map_hits),
        ("on its second layer", counters.second_layer_hits),
        ("occlusion rays", counters.occlusion_rays),
        ("ended in the sky", counters.sky_misses),
        ("ended behind a surface", counters.behind_misses),
        ("rays left out", counters.cut_rays),
    ]
}
