//! Frames of the hybrid renderer that keep their time: its ladder also turns render scale, reflection
//! depth and the size of the near region.

use super::args::TuneArgs;
use super::fit::spread;
use super::flight::{Craft, Known, fly};
use super::pilots::Model;
use super::plant::in_rounds;
use super::rows::Tour;
use super::stage::path;
use crate::bench::progress::Progress;
use crate::render::Preset;
use crate::{registry, scenes::SceneSpec};
use anyhow::{Context, Result, bail};
use niwaki_frame_control::{Ladder, RenderSettings};
use niwaki_gpu_model::workload::Background;
use niwaki_hybrid::{DeviceKind, FrameReport, Gpu, HybridRenderer, Settings};
use niwaki_hybrid_model::{
    DrawnFrame, HybridModel, ViewSampler, ViewSampling, ViewWork, settings as of_rung,
};
use niwaki_metrics::TreeStats;
use niwaki_scene::Camera;
use niwaki_trace::QuantisedScene;
use std::sync::Arc;
use std::time::Instant;

/// Views that the model is fitted in, and how far apart the rungs are that are drawn there, besides those that
/// change the near region.
const VIEWS: usize = 3;
const STEP: usize = 4;
/// Seconds from frame to frame, for what moves.
const FRAME_S: f64 = 1.0 / 60.0;

/// Refuses what only the ray tracer can do.
pub(super) fn check(args: &TuneArgs) -> Result<()> {
    if args.devices.iter().any(|device| device != "vulkan") {
        bail!(
            "--renderer hybrid draws on the Vulkan device; simulated ones only know the ray tracer"
        );
    }
    if args.model.is_some() || args.no_fit {
        bail!(
            "--renderer hybrid has no table of a device: its model is fitted; leave --model and --no-fit"
        );
    }
    Ok(())
}

/// The hybrid renderer on a camera path.
struct Hybrid {
    /// One a controller, as each has images and a tree of its own size.
    renderers: Vec<HybridRenderer>,
    sampler: Arc<ViewSampler>,
    background: Background<Camera, Arc<ViewWork>>,
    cameras: Vec<Camera>,
    size: [u32; 2],
    base: Settings,
    /// Diagonal of the scene's bounds.
    diagonal: f32,
}

impl Hybrid {
    fn report(&mut self, number: usize, frame: usize, s: &RenderSettings) -> Result<FrameReport> {
        let renderer = &mut self.renderers[number];
        // Nothing is kept from the frame before, whether or not settings stay.
        renderer.set_settings(of_rung(&self.base, s, self.diagonal));
        let [width, height] = s.scaled(self.size);
        let time = frame as f64 * FRAME_S;
        Ok(renderer.draw(&self.cameras[frame], width, height, time)?.1)
    }

    /// Fits the model to some rungs in some views.
    fn fit(&mut self, ladder: &Ladder<RenderSettings>) -> Result<(HybridModel, String)> {
        let begun = Instant::now();
        let views = spread(self.cameras.len(), VIEWS);
        // Kernels are compiled when the first frame needs them.
        for rung in ladder.rungs() {
            self.report(0, 0, rung)?;
        }
        let all = ladder.rungs();
        let is_drawn = |i: &usize| {
            i.is_multiple_of(STEP) || *i > 0 && all[*i].near_region != all[*i - 1].near_region
        };
        let drawn: Vec<usize> = (0..all.len()).filter(is_drawn).collect();
        let asked: Vec<(usize, &RenderSettings)> =
            views.iter().flat_map(|&view| drawn.iter().map(move |&i| (view, &all[i]))).collect();
        let mut reports = in_rounds(asked.len(), |i| {
            let report = self.report(0, asked[i].0, asked[i].1)?;
            Ok((milliseconds(&report)?, report))
        })?
        .into_iter();
        let mut frames = Vec::new();
        for &view in &views {
            let work = self.work(view);
            for (rung, (_, report)) in drawn.iter().map(|&i| &all[i]).zip(reports.by_ref()) {
                let settings = of_rung(&self.base, rung, self.diagonal);
                let size = rung.scaled(self.size);
                frames.push(DrawnFrame { settings, size, work: work.clone(), report });
            }
        }
        let model = HybridModel::fit(&frames)?;
        let mut error = 0.0;
        for frame in &frames {
            let made = model.predict(&frame.settings, frame.size, &frame.work).milliseconds();
            error += (made / milliseconds(&frame.report)? - 1.0).abs() / frames.len() as f64;
        }
        let line = format!(
            "six parts, fitted to {} frames ({} views, drawn in {:.1} s) with an error of {:.1} %",
            frames.len(),
            views.len(),
            begun.elapsed().as_secs_f64(),
            100.0 * error
        );
        Ok((model, line))
    }
}

/// Milliseconds of a frame on the GPU.
fn milliseconds(report: &FrameReport) -> Result<f64> {
    let times = report.stages.iter().map(|stage| stage.gpu_time);
    let sum: Option<std::time::Duration> = times.sum();
    let sum = sum.context("the device has no timestamps, so frames cannot be timed by parts")?;
    Ok(1e3 * sum.as_secs_f64())
}

impl Craft for Hybrid {
    type Work = Arc<ViewWork>;

    fn frames(&self) -> usize {
        self.cameras.len()
    }

    fn draw(&mut self, controller: usize, frame: usize, s: &RenderSettings) -> Result<f64> {
        milliseconds(&self.report(controller, frame, s)?)
    }

    fn probe_all(&mut self, frames: &[(usize, &RenderSettings)]) -> Result<Vec<f64>> {
        let draw = |i: usize| Ok((self.draw(0, frames[i].0, frames[i].1)?, ()));
        Ok(in_rounds(frames.len(), draw)?.into_iter().map(|(ms, ())| ms).collect())
    }

    fn work(&self, frame: usize) -> Arc<ViewWork> {
        Arc::new(self.sampler.sample(&self.cameras[frame]))
    }

    fn submit(&self, frame: usize) {
        self.background.submit(frame as u64, self.cameras[frame]);
    }

    fn newest(&self) -> Option<Known<Arc<ViewWork>>> {
        let answered = self.background.newest()?;
        Some(Known { frame: answered.frame, work: answered.answer, took: answered.took })
    }

    fn is_sampling(&self) -> bool {
        self.background.is_running()
    }

    fn delay(&self) -> usize {
        1
    }

    fn is_live(&self) -> bool {
        true
    }

    fn is_chain(&self) -> bool {
        // A larger near region leaves less for the cube map.
        false
    }
}

/// A scene by all controllers.
pub(super) fn tour(args: &TuneArgs, spec: &SceneSpec, progress: &Progress) -> Result<Tour> {
    let scene = Arc::new(spec.load(args.seed)?);
    let builder = registry::one_of_ours("--builder", &args.builder)?;
    let bvh = builder.build(&scene.mesh.prim_refs()).context("cannot build a tree")?;
    let traced = Arc::new(QuantisedScene::<8>::new(&bvh, &scene.mesh)?);
    let gpu = Gpu::new()?;
    let is_software = gpu.kind() == DeviceKind::Software;
    let preset = args.preset.unwrap_or(if is_software { Preset::Fast } else { Preset::Default });
    let base = preset.settings();
    let ladder = Ladder::hybrid();
    let most = ladder.rungs().iter().map(|s| u32::from(s.reflection_depth)).max().unwrap_or(0);
    let sampling = ViewSampling {
        width: args.sampling.width,
        height: args.sampling.height,
        max_depth: most,
        regions: regions(&ladder),
        ..ViewSampling::default()
    };
    let sampler = Arc::new(ViewSampler::new(&scene, traced, &base, sampling)?);
    let theirs = sampler.clone();
    let mut craft = Hybrid {
        renderers: (0..args.controllers.len().max(1))
            .map(|_| HybridRenderer::new(&gpu, scene.clone(), base.clone()))
            .collect::<Result<_, _>>()?,
        background: Background::spawn(
            "view sampler",
            move |camera: &Camera, _: &dyn Fn() -> bool| Some(Arc::new(theirs.sample(camera))),
        )
        .context("cannot start the sampler")?,
        sampler,
        cameras: path(&scene, args.frames(), args.turn),
        size: args.size(is_software),
        diagonal: if scene.mesh.is_empty() { 0.0 } else { scene.mesh.bounds().extent().length() },
        base: base.clone(),
    };
    progress.step();
    let (model, line) = craft.fit(&ladder)?;
    progress.print(&format!("{}: {line}", spec.name));
    progress.step();
    let (size, diagonal) = (craft.size, craft.diagonal);
    let asked: Model<Arc<ViewWork>> = Arc::new(move |s: &RenderSettings, work: &Arc<ViewWork>| {
        let settings = of_rung(&base, s, diagonal);
        model.predict(&settings, s.scaled(size), work).milliseconds()
    });
    let flown = fly(&mut craft, &args.flight(&ladder, asked, features))?;
    progress.step();
    Ok(Tour {
        scene: spec.name.clone(),
        triangles: scene.mesh.len(),
        depth: TreeStats::of(&bvh).depth_max,
        renderer: args.renderer,
        device: gpu.name().to_owned(),
        is_simulated: false,
        model: line,
        width: size[0],
        height: size[1],
        target_ms: flown.target_ms,
        rungs: ladder.rungs().to_vec(),
        flights: args.summed(flown.flights),
        fit: None,
        sampling_ms: flown.sampling_ms,
        late_samples: flown.late_samples,
        again_ms: flown.again_ms,
        prediction_us: flown.prediction_us,
        ranks: flown.ranks,
    })
}

/// The sizes of the near region on a ladder.
#[expect(clippy::cast_possible_truncation, reason = "shares from 0 to 1")]
fn regions(ladder: &Ladder<RenderSettings>) -> Vec<f32> {
    let mut regions: Vec<f32> = ladder.rungs().iter().map(|s| s.near_region as f32).collect();
    regions.dedup();
    regions
}

/// What a regression without a model learns from, in units of the full size and of the scene.
fn features(s: &RenderSettings, work: &Arc<ViewWork>) -> [f64; 8] {
    let settings = of_rung(&Settings::default(), s, work.diagonal);
    HybridModel::features(&settings, s.scaled([1000, 1000]), work)
}
