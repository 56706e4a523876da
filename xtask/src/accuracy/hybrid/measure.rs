//! Measuring a scene: frames by every setup, compared with the reference of the same frames.

use super::artifact::{Crop, Panels};
use super::sweep::Sweep;
use crate::bench::progress::Progress;
use crate::bench::rays;
use crate::render::{self, Size};
use anyhow::{Context, Result};
use niwaki_core::Builder;
use niwaki_hybrid::{DebugView, Frame, FrameReport, Gpu, HybridRenderer, Settings};
use niwaki_render::metrics::{ErrorMap, FlipSettings, Tile, flip, hdr_flip, psnr, ssim};
use niwaki_render::{AmbientLight, Image, ToneCurve, Whitted, WhittedSettings};
use niwaki_scene::{Camera, CameraPath, Scene, SceneFacts};
use niwaki_trace::AutoScene;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Reflections and refractions that the reference follows: as many as the renderer can.
pub(super) const DEEPEST: u32 = niwaki_hybrid::settings::MAX_DEPTH;
/// The least that a ray of the reference counts. Eight surfaces of glass make hundreds of rays that
/// count less.
const CUTOFF: f32 = 1e-3;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) size: Size,
    /// Frames, spread over the camera path.
    pub(super) frames: u32,
    /// Times that each setup draws each frame; the median counts.
    pub(super) draws: u32,
    /// Side of the tile in which the worst artifact is looked for, in pixels.
    pub(super) tile: u32,
}

impl Effort {
    /// Steps of the progress bar for a scene.
    pub(super) fn steps(&self, sweep: &Sweep) -> usize {
        self.frames as usize * (depths(sweep).len() + 2 + sweep.setups.len())
    }
}

/// How far a picture is from the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    /// Mean FLIP of what is displayed.
    pub(super) flip: f64,
    /// The same against a reference of the setup's own depth.
    pub(super) flip_of_depth: f64,
    /// Mean HDR-FLIP; absent where the reference shows nothing brighter than the display.
    pub(super) hdr_flip: Option<f64>,
    /// In decibels; infinite for equal pictures.
    pub(super) psnr: f64,
    pub(super) ssim: f64,
}

/// A frame by a setup.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub(super) errors: Errors,
    /// What ran on the GPU, in milliseconds each; on devices without timestamps nothing.
    pub(super) passes: Passes,
    /// Their sum; on devices without timestamps the time from the call to the end of the work.
    pub(super) ms: f64,
    /// Mean FLIP of the worst tile; only of its frame.
    pub(super) tile: Option<f64>,
}

/// All that was measured of a scene.
#[derive(Debug)]
pub(super) struct Measured {
    /// By setup, then by frame; empty for a setup that failed.
    pub(super) samples: Vec<Vec<Sample>>,
    /// Numbers of the frames on the camera path.
    pub(super) frames: Vec<u32>,
    /// The frame (by its place in `frames`) and the tile in it that are worst at the default.
    pub(super) worst: (usize, Tile),
    pub(super) panels: Panels,
    /// What failed, by setup.
    pub(super) failures: Vec<(usize, String)>,
}

/// The depths of the references: those of the setups, and the deepest.
fn depths(sweep: &Sweep) -> Vec<u32> {
    let mut depths: Vec<u32> = sweep.setups.iter().map(|s| s.settings.max_depth).collect();
    depths.push(DEEPEST);
    depths.sort_unstable();
    depths.dedup();
    depths
}

/// Names and milliseconds of passes.
type Passes = Vec<(String, f64)>;

/// A camera at a time, in seconds.
type View = (Camera, f64);

/// A frame that is compared.
struct Moment {
    number: u32,
    view: View,
    /// The view one step earlier, so that what a moving camera keeps is kept.
    before: View,
    /// By depth: radiance and what is displayed of it.
    references: BTreeMap<u32, (Image, Image)>,
    tone: ToneCurve,
    /// The display cuts its highlights.
    is_hdr: bool,
}

/// Measures all setups on a scene.
pub(super) fn scene(
    gpu: &Gpu,
    scene: &Arc<Scene>,
    sweep: &Sweep,
    effort: Effort,
    progress: &Progress,
) -> Result<Measured> {
    let moments = moments(scene, sweep, effort, progress)?;
    let default = &sweep.setups[Sweep::DEFAULT].settings;
    progress.message(&format!("{}: upload", scene.name));
    let mut bench = Bench {
        renderer: HybridRenderer::new(gpu, Arc::clone(scene), default.clone())?,
        size: effort.size,
        warm: Vec::new(),
    };
    // Where the default is worst has to be known before anything is compared there.
    let mut worst: Option<(usize, Tile, f64)> = None;
    for (i, moment) in moments.iter().enumerate() {
        progress
            .message(&format!("{}: frame {}, looking for artifacts", scene.name, moment.number));
        let image = bench.frame(default, moment)?.image;
        let (_, map) = moment.flip(&image)?;
        if let Some((tile, error)) = map.worst_tile(effort.tile)
            && worst.is_none_or(|(_, _, most)| error > most)
        {
            worst = Some((i, tile, error));
        }
        progress.step();
    }
    let (at, tile, _) = worst.context("there are no pixels")?;
    let view = DebugView::HitSource;
    let hits = Settings { debug_view: view, ..default.clone() };
    let hits = bench.frame(&hits, &moments[at])?.image;
    let mut panels = Panels::new(&moments[at].deepest().1, &hits, tile);
    progress.skip(effort.frames as usize);

    let mut samples: Vec<Vec<Sample>> = vec![Vec::new(); sweep.setups.len()];
    let mut failures: Vec<(usize, String)> = Vec::new();
    for (i, moment) in moments.iter().enumerate() {
        // Setups take turns, so that what disturbs the machine disturbs all of them.
        for (number, setup) in sweep.setups.iter().enumerate() {
            progress.message(&format!("{}: frame {}, {}", scene.name, moment.number, setup.name));
            let failed = failures.iter().any(|(failed, _)| *failed == number);
            if !failed {
                match bench.measure(&setup.settings, moment, (i == at).then_some(tile)) {
                    Ok((sample, crop)) => {
                        samples[number].push(sample);
                        panels.crops.extend(crop.map(|crop| (number, crop)));
                    }
                    Err(error) if number == Sweep::DEFAULT => return Err(error),
                    Err(error) => {
                        samples[number].clear();
                        failures.push((number, format!("{error:#}")));
                    }
                }
            }
            progress.step();
        }
        progress.message(&format!("{}: frame {}, again", scene.name, moment.number));
        again(&mut bench, sweep, effort, moment, &mut samples)?;
    }
    panels.whole = moments[at].tone.apply(&bench.frame(default, &moments[at])?.image);
    let frames = moments.iter().map(|moment| moment.number).collect();
    Ok(Measured { samples, frames, worst: (at, tile), panels, failures })
}

/// Has all setups draw a frame more often, in turns, and leaves the median of each one's times in its last sample.
fn again(
    bench: &mut Bench,
    sweep: &Sweep,
    effort: Effort,
    moment: &Moment,
    samples: &mut [Vec<Sample>],
) -> Result<()> {
    let mut times: Vec<Vec<(f64, Passes)>> = samples
        .iter()
        .map(|all| all.last().map(|last| (last.ms, last.passes.clone())).into_iter().collect())
        .collect();
    for round in 1..effort.draws {
        let mut order: Vec<usize> = (0..times.len()).filter(|&i| !times[i].is_empty()).collect();
        // There and back, as what was drawn before a setup, large maps for one, bears on its time.
        if round % 2 == 1 {
            order.reverse();
        }
        for number in order {
            let settings = &sweep.setups[number].settings;
            let Drawn { passes, ms, .. } = bench.frame(settings, moment)?;
            times[number].push((ms, passes));
        }
    }
    for (samples, mut times) in samples.iter_mut().zip(times) {
        times.sort_by(|a, b| a.0.total_cmp(&b.0));
        let middle = times.len() / 2;
        if let (Some(last), Some((ms, passes))) =
            (samples.last_mut(), times.into_iter().nth(middle))
        {
            (last.ms, last.passes) = (ms, passes);
        }
    }
    Ok(())
}

/// A frame, and what it took: as in [`Sample`].
struct Drawn {
    image: Image,
    passes: Passes,
    ms: f64,
}

/// The renderer that draws all frames of a scene.
struct Bench {
    renderer: HybridRenderer,
    size: Size,
    /// Settings that frames were drawn with.
    warm: Vec<Settings>,
}

impl Bench {
    /// A frame by some settings.
    fn frame(&mut self, settings: &Settings, moment: &Moment) -> Result<Drawn> {
        let Size { width, height } = self.size;
        let ((before, earlier), (camera, time)) = (&moment.before, &moment.view);
        let mut draw = || -> Result<(bool, Frame)> {
            // Forgets what earlier frames left. The frame before draws it anew, so that what is
            // timed is a frame in the midst of others.
            self.renderer.set_settings(settings.clone());
            let (_, report) = self.renderer.draw(before, width, height, *earlier)?;
            let frame = self.renderer.render(camera, width, height, *time)?;
            let rays = |report: &FrameReport| report.counters.spawning_pixels > 0;
            Ok((rays(&frame.report) && !rays(&report), frame))
        };
        let (first_rays, mut frame) = draw()?;
        // Drivers compile kernels when they first have work to do, and some again at the next.
        if first_rays || !self.warm.contains(settings) {
            frame = draw()?.1;
            self.warm.push(settings.clone());
        }
        let passes = render::passes(&frame.report);
        let sum: f64 = passes.iter().map(|(_, ms)| ms).sum();
        let total = frame.report.total.as_secs_f64() * 1e3;
        Ok(Drawn { image: frame.image, passes, ms: if sum > 0.0 { sum } else { total } })
    }

    fn measure(
        &mut self,
        settings: &Settings,
        moment: &Moment,
        tile: Option<Tile>,
    ) -> Result<(Sample, Option<Crop>)> {
        let Drawn { image, passes, ms } = self.frame(settings, moment)?;
        let (shown, map) = moment.flip(&image)?;
        let errors = moment.errors(&image, &shown, &map, settings.max_depth)?;
        let sample = Sample { errors, passes, ms, tile: tile.map(|tile| map.mean_of(tile)) };
        Ok((sample, tile.map(|tile| Crop::new(&shown, &map, tile))))
    }
}

impl Moment {
    fn deepest(&self) -> &(Image, Image) {
        &self.references[&DEEPEST]
    }

    /// What is displayed, and how far that is from the reference.
    fn flip(&self, image: &Image) -> Result<(Image, ErrorMap)> {
        let shown = self.tone.apply(image);
        let map = flip(&shown, &self.deepest().1, &FlipSettings::default())?;
        Ok((shown, map))
    }

    fn errors(&self, image: &Image, shown: &Image, map: &ErrorMap, depth: u32) -> Result<Errors> {
        let (radiance, wanted) = self.deepest();
        let viewing = FlipSettings::default();
        let of_depth = match self.references.get(&depth) {
            Some((_, wanted)) if depth != DEEPEST => flip(shown, wanted, &viewing)?.mean(),
            _ => map.mean(),
        };
        let hdr = || hdr_flip(image, radiance, &viewing).map(|map| map.mean());
        Ok(Errors {
            flip: map.mean(),
            flip_of_depth: of_depth,
            hdr_flip: if self.is_hdr { Some(hdr()?) } else { None },
            psnr: psnr(shown, wanted)?,
            ssim: ssim(shown, wanted)?,
        })
    }
}

/// The frames with their references.
fn moments(
    scene: &Arc<Scene>,
    sweep: &Sweep,
    effort: Effort,
    progress: &Progress,
) -> Result<Vec<Moment>> {
    let all = render::moments(scene, CameraPath::FRAMES)?;
    let facts = SceneFacts::new(scene, Settings::default().mirror_roughness);
    let mut kept: Option<(Arc<Scene>, AutoScene)> = None;
    let mut moments = Vec::new();
    for i in 0..effort.frames {
        // In the middle of equal parts of the path; never the first frame, which has none before.
        let number = ((2 * i + 1) * CameraPath::FRAMES / (2 * effort.frames)).max(1);
        let (view, before) = (all[number as usize], all[number as usize - 1]);
        if kept.is_none() || scene.animation.is_some() {
            let still = match &scene.animation {
                Some(_) => Arc::new(scene.frozen(view.1).context("motion is out of range")?),
                None => Arc::clone(scene),
            };
            let tree = rays::recorder().build_mesh(&still.mesh)?;
            let tree = AutoScene::new(&tree, &still.mesh)?;
            kept = Some((still, tree));
        }
        let (still, tree) = kept.as_ref().context("there is no tree")?;
        let mut radiance = BTreeMap::new();
        for depth in depths(sweep) {
            progress
                .message(&format!("{}: frame {number}, reference of depth {depth}", scene.name));
            let settings = reference(effort.size, depth);
            let whitted = Whitted::new(settings);
            let image = whitted.render_knowing(&facts, &view.0, still, tree, |_, _| {}).0;
            radiance.insert(depth, image);
            progress.step();
        }
        let deepest = &radiance[&DEEPEST];
        let tone = ToneCurve::automatic().exposed_as(deepest);
        let scale = tone.scale(deepest);
        let is_hdr = deepest.pixels().iter().any(|p| p.max_element() * scale > 1.0);
        let shown = |(depth, image): (u32, Image)| {
            let shown = tone.apply(&image);
            (depth, (image, shown))
        };
        let references = radiance.into_iter().map(shown).collect();
        moments.push(Moment { number, view, before, references, tone, is_hdr });
    }
    Ok(moments)
}

/// The reference that the settings of the hybrid renderer approach.
fn reference(size: Size, max_depth: u32) -> WhittedSettings {
    let same = Settings::default();
    WhittedSettings {
        width: size.width,
        height: size.height,
        max_depth,
        cutoff: if max_depth == DEEPEST { CUTOFF } else { same.throughput_cutoff },
        max_rays: same.max_rays,
        ambient: AmbientLight::Environment(same.ambient),
        mirror_roughness: same.mirror_roughness,
        ..WhittedSettings::default()
    }
}
