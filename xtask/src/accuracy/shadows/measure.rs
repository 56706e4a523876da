//! Measuring a scene: shadows by every setup against rays, and the time of frames.

use super::sweep::Setup;
use crate::bench::progress::Progress;
use crate::bench::rays;
use crate::power::study::{Metered, Play, WARM_UP, least_time, visit};
use crate::render::Size;
use anyhow::{Context, Result, anyhow, bail};
use niwaki_raster::{
    Algorithm, ExactShadows, FrameReport, Gpu, Judged, Renderer, ShadowError, study::Study,
};
use niwaki_render::Image;
use niwaki_scene::{Camera, Scene};
use serde::Serialize;
use std::time::Duration;

/// Radius of silhouette pixels, in pixels.
pub(super) const RADIUS: f64 = 0.25;
/// Lights, as in the paper's table.
pub(super) const LIGHTS: usize = 4;
/// Frames that are timed for each setup and view; the median counts.
const REPEATS: usize = 3;
/// Idle time before and after a setup is given to the meter.
const MARGIN: Duration = Duration::from_millis(200);

/// What a setup's shadows cost and how wrong they are.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Point {
    pub(super) algorithm: String,
    pub(super) knob: String,
    pub(super) value: String,
    /// Side of the map; 0 for shadow volumes.
    pub(super) resolution: u32,
    /// Mean |share − exact| over the pixels that a light reaches and that face it.
    pub(super) mean: f64,
    /// Of that, light in shadows and darkness in light.
    pub(super) leaked: f64,
    pub(super) lost: f64,
    /// Counts over views and lights.
    pub(super) error: ShadowError,
    /// Milliseconds of a frame, all passes, and of those for shadows alone.
    pub(super) ms: f64,
    pub(super) shadow_ms: f64,
    /// Energy of a pixel along the camera path in nanojoules, where a meter tells; half the width of
    /// its 95 % interval; mean power in watts.
    pub(super) nj_per_pixel: Option<f64>,
    pub(super) nj_half_width: Option<f64>,
    pub(super) mean_w: Option<f64>,
    pub(super) on_front: bool,
}

/// All that was measured of a scene.
pub(super) struct Measured {
    /// By setup; what failed says why.
    pub(super) points: Vec<Result<Point, String>>,
    /// The first view by the first setup of each algorithm whose map is by the paper's rule.
    pub(super) pictures: Vec<(Algorithm, Image)>,
    pub(super) triangles: usize,
}

/// A view with what rays say of each light.
struct View {
    camera: Camera,
    judged: Vec<Vec<Judged>>,
}

/// Milliseconds of a frame and of its shadows; by the host's clock on devices without one.
fn times(report: &FrameReport) -> (f64, f64) {
    let all = report.gpu_ms().unwrap_or(report.total_ms);
    let of_light = report.passes.iter().filter(|p| p.pass.light().is_some());
    (all, of_light.map(|p| p.ms()).sum::<Option<f64>>().unwrap_or(report.total_ms))
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Steps of the progress bar for a scene.
pub(super) fn steps(setups: usize, frames: u32, has_meter: bool) -> usize {
    frames as usize * (1 + setups) + if has_meter { setups } else { 0 }
}

/// How the suite measures.
pub(super) struct Method<'a> {
    pub(super) setups: &'a [Setup],
    pub(super) size: Size,
    /// Views along the path.
    pub(super) frames: u32,
    pub(super) meter: Option<Metered<'a>>,
    pub(super) progress: &'a Progress,
}

/// Measures all setups on a scene.
pub(super) fn scene(
    gpu: &Gpu,
    scene: Scene,
    Method { setups, size, frames, meter, progress }: &Method<'_>,
) -> Result<Measured> {
    let (size, frames) = (*size, *frames);
    let study = Study::of(scene);
    let name = study.scene.name.clone();
    let Size { width, height } = size;
    progress.message(&format!("{name}: exact shadows"));
    let exact = ExactShadows::new(&rays::recorder(), &study.scene.mesh)?;
    let first = setups.first().context("there is nothing to compare")?;
    let lights = study.shadow_lights(LIGHTS);
    let mut renderer =
        Renderer::new(gpu, study.scene.clone(), lights.clone(), first.settings.clone())?;
    let mut views = Vec::new();
    for frame in 0..frames {
        let camera = study.path.at((f64::from(frame) + 0.5) / f64::from(frames));
        let mut judged = Vec::new();
        for (number, light) in lights.iter().enumerate() {
            let (shares, _) = renderer.shares(&camera, width, height, number)?;
            judged.push(exact.judge(&camera, &shares, light, RADIUS));
        }
        views.push(View { camera, judged });
        progress.step();
    }
    let mut pictures: Vec<(Algorithm, Image)> = Vec::new();
    let mut sums = vec![ShadowError::default(); setups.len()];
    let mut spent = vec![(Vec::new(), Vec::new()); setups.len()];
    let mut failed: Vec<Option<String>> = vec![None; setups.len()];
    for view in &views {
        for (i, setup) in setups.iter().enumerate() {
            progress.message(&format!("{name}: {} {}", setup.family(), setup.value));
            if failed[i].is_none() {
                renderer.set_settings(setup.settings.clone());
                match one(&mut renderer, view, size) {
                    Ok((error, frame_ms, shadow_ms)) => {
                        sums[i] = sums[i].plus(error);
                        spent[i].0.push(frame_ms);
                        spent[i].1.push(shadow_ms);
                        let algorithm = setup.settings.algorithm;
                        let by_rule =
                            setup.settings.shadow_resolution == first.settings.shadow_resolution;
                        if by_rule && pictures.iter().all(|(shown, _)| *shown != algorithm) {
                            pictures.push((algorithm, renderer.picture()?.to_image()));
                        }
                    }
                    Err(error) => failed[i] = Some(format!("{error:#}")),
                }
            }
            progress.step();
        }
    }
    let mut energies: Vec<Option<Power>> = vec![None; setups.len()];
    if let Some(meter) = meter {
        let mut play = Play {
            path: &study.path,
            size: [width, height],
            frames,
            warm_up: WARM_UP,
            margin: MARGIN,
            least_s: 0.0,
        };
        (play.least_s, _) = least_time(meter, &mut renderer, &play)?;
        for (i, setup) in setups.iter().enumerate() {
            progress.message(&format!("{name}: energy of {} {}", setup.family(), setup.value));
            if failed[i].is_none() {
                renderer.set_settings(setup.settings.clone());
                match power(&mut renderer, &play, meter) {
                    Ok(power) => energies[i] = Some(power),
                    Err(error) => failed[i] = Some(format!("{error:#}")),
                }
            }
            progress.step();
        }
    }
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
    let points = setups.iter().zip(sums).zip(spent).zip(failed).zip(energies).map(
        |((((setup, error), (all, shadows)), failed), energy)| match failed {
            Some(failed) => Err(failed),
            None => {
                let [leaked, lost] = error.leaked_and_lost();
                let algorithm = setup.settings.algorithm;
                let maps = algorithm != Algorithm::ShadowVolumes;
                Ok(Point {
                    algorithm: algorithm.short().into(),
                    knob: setup.knob.into(),
                    value: setup.value.clone(),
                    resolution: if maps { setup.settings.shadow_resolution } else { 0 },
                    mean: error.mean(),
                    leaked,
                    lost,
                    error,
                    ms: mean(&all),
                    shadow_ms: mean(&shadows),
                    nj_per_pixel: energy.map(|e| e.nj_per_pixel),
                    nj_half_width: energy.map(|e| e.half_width),
                    mean_w: energy.map(|e| e.mean_w),
                    on_front: false,
                })
            }
        },
    );
    Ok(Measured { points: points.collect(), pictures, triangles: study.scene.mesh.len() })
}

/// What a setup draws from the meter.
#[derive(Clone, Copy, Debug)]
struct Power {
    nj_per_pixel: f64,
    half_width: f64,
    mean_w: f64,
}

/// The energy of the camera path by the renderer's settings.
fn power(renderer: &mut Renderer, play: &Play<'_>, meter: &Metered<'_>) -> Result<Power> {
    let visit = visit(renderer, play, Some(meter))?;
    let analysis = visit.power.context("the meter was not asked")?.map_err(|e| anyhow!(e))?;
    let group = analysis.groups.first().context("the meter measured no frame")?;
    if group.frames == 0 {
        bail!("the meter measured no whole frame");
    }
    Ok(Power {
        nj_per_pixel: group.energy.mean_nj_per_pixel,
        half_width: group.energy.half_width_nj_per_pixel,
        mean_w: group.power_w.mean,
    })
}

/// A view by the renderer's settings: its error, and milliseconds of a frame and of its shadows.
fn one(renderer: &mut Renderer, view: &View, size: Size) -> Result<(ShadowError, f64, f64)> {
    let Size { width, height } = size;
    let mut error = ShadowError::default();
    for (number, judged) in view.judged.iter().enumerate() {
        let (shares, _) = renderer.shares(&view.camera, width, height, number)?;
        error = error.plus(ShadowError::of(&shares, judged));
    }
    // Drivers compile at the first.
    renderer.draw(&view.camera, width, height)?;
    let (mut all, mut shadows) = (Vec::new(), Vec::new());
    for _ in 0..REPEATS {
        let (frame, of_shadows) = times(&renderer.draw(&view.camera, width, height)?);
        all.push(frame);
        shadows.push(of_shadows);
    }
    Ok((error, median(all), median(shadows)))
}
