//! What sampling a view coarsely costs the prediction of its time, and what it saves the processor.

use crate::bench::progress::Progress;
use crate::tune::device::{asked, ray_settings};
use crate::tune::pilots::Model;
use crate::tune::plant::Plant;
use crate::tune::stage::Stage;
use anyhow::{Context, Result};
use niwaki_frame_control::RenderSettings;
use niwaki_gpu_model::calibrate::Calibrated;
use niwaki_gpu_model::{
    Workload,
    workload::{Pattern, Sampling},
};
use niwaki_gpu_tracer::TracerModel;
use serde::Serialize;
use std::time::Instant;

/// Columns and rows of samples.
const RESOLUTIONS: [[u32; 2]; 6] = [[8, 5], [16, 9], [24, 14], [32, 18], [64, 36], [128, 72]];
/// Frames that share a sampling.
const PERIODS: [usize; 4] = [1, 2, 4, 8];
/// Directions of ambient occlusion of the settings that are timed; shadows are on.
const DIRECTIONS: [u16; 3] = [0, 4, 16];
/// Times that a view is sampled; the fastest counts, as what disturbs only adds.
const REPEATS: usize = 3;
/// Rays of ambient occlusion of each hit where every pixel is sampled.
const FINE_AO_RAYS: u32 = 4;
/// Shares of divergence that are tried.
const DIVERGENCES: [f64; 6] = [0.0, 0.1, 0.2, 0.3, 0.5, 1.0];
/// What sampling may add to the error of a prediction: half of what a frame on target may be off.
pub(super) const TOLERABLE: f64 = 0.025;

/// A way of sampling.
#[derive(Clone, Debug)]
pub(super) struct Way {
    pub(super) pattern: Pattern,
    pub(super) size: [u32; 2],
    /// Frames that share a sampling.
    pub(super) period: usize,
}

impl Way {
    /// The line in plots to which it belongs.
    fn family(&self) -> String {
        match self.period {
            1 => name(self.pattern).to_owned(),
            // Only the default pattern has periods.
            n => format!("every {n} frames"),
        }
    }

    fn is_default(&self) -> bool {
        let default = Sampling::default();
        self.pattern == default.pattern
            && self.size == [default.width, default.height]
            && self.period == 1
    }

    fn sampling(&self, of: &Sampling) -> Sampling {
        let [width, height] = self.size;
        Sampling { width, height, pattern: self.pattern, ..of.clone() }
    }
}

const fn name(pattern: Pattern) -> &'static str {
    match pattern {
        Pattern::Regular => "regular",
        Pattern::Jittered => "jittered",
        Pattern::LowDiscrepancy => "low discrepancy",
        Pattern::Blocks => "blocks",
    }
}

/// All ways for frames of a size: each pattern at each resolution, and the default pattern with each
/// period. With `quick` the ends and the default.
pub(super) fn ways(frame: [u32; 2], quick: bool) -> Vec<Way> {
    let default = Sampling::default();
    let fits = |size: &[u32; 2]| size[0] <= frame[0] && size[1] <= frame[1];
    let is_wanted = |size: &[u32; 2]| {
        !quick || *size == RESOLUTIONS[0] || *size == [default.width, default.height]
    };
    let sizes: Vec<[u32; 2]> =
        RESOLUTIONS.into_iter().filter(|size| fits(size) && is_wanted(size)).collect();
    let patterns = [Pattern::LowDiscrepancy, Pattern::Regular, Pattern::Jittered, Pattern::Blocks];
    let mut all = Vec::new();
    for pattern in patterns {
        for period in PERIODS {
            if period > 1 && (pattern != default.pattern || quick && period < 8) {
                continue;
            }
            all.extend(sizes.iter().map(|&size| Way { pattern, size, period }));
        }
    }
    all
}

/// Errors of counters: means over frames of |sampled − true|, over the mean of what is true; of m, which is a
/// share, without that.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Counters {
    pub(super) p_t: f64,
    pub(super) p_i: f64,
    pub(super) t_v: f64,
    pub(super) a_t: f64,
    pub(super) a_w: f64,
    pub(super) m: f64,
    pub(super) s_t: f64,
}

/// A way of sampling along the path.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Point {
    pub(super) family: String,
    /// Columns and rows.
    pub(super) size: [u32; 2],
    pub(super) period: usize,
    /// Milliseconds of processor time of a sampling, and of sampling a frame.
    pub(super) sampling_ms: f64,
    pub(super) frame_ms: f64,
    /// Mean of |predicted − measured| / measured: as predicted, and after the one factor on all
    /// predictions that makes it least.
    pub(super) open_loop: f64,
    pub(super) one_factor: f64,
    /// The median of predictions over those by every pixel, less 1; and what is left of their
    /// differences after it.
    pub(super) bias: f64,
    pub(super) scatter: f64,
    pub(super) counters: Counters,
    pub(super) is_default: bool,
    pub(super) on_front: bool,
    /// The cheapest whose scatter is tolerable.
    pub(super) is_recommended: bool,
}

impl Point {
    /// The name in plots.
    pub(super) fn label(&self) -> String {
        let [width, height] = self.size;
        match self.period {
            1 => format!("{width}×{height}"),
            n => format!("{width}×{height} / {n}"),
        }
    }
}

/// What the device counts over what sampling every pixel counts.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct DeviceCounts {
    pub(super) primary_nodes: f64,
    pub(super) primary_triangles: f64,
    pub(super) secondary_nodes: f64,
    pub(super) secondary_triangles: f64,
}

/// All that was measured of a path.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Measured {
    pub(super) frames: usize,
    pub(super) points: Vec<Point>,
    /// Errors of predictions by every pixel: what is left is the model's and the device's.
    pub(super) every_pixel: [f64; 2],
    pub(super) divergences: Vec<Divergence>,
    /// Absent of simulated devices.
    pub(super) device_counts: Option<DeviceCounts>,
}

/// Errors after one factor of a model by which threads of a warp wait for each other.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Divergence {
    /// The share of divergence that costs time.
    pub(super) share: f64,
    /// By every pixel, by the default sampling, and by blocks of as many samples.
    pub(super) every_pixel: f64,
    pub(super) default: f64,
    pub(super) blocks: f64,
}

/// A frame by some settings.
struct Timed {
    frame: usize,
    settings: RenderSettings,
    measured_ms: f64,
}

/// Steps of the progress bar.
pub(super) fn steps(ways: &[Way]) -> usize {
    2 + ways.len()
}

/// Draws the path, then samples it in all ways.
pub(super) fn measure(
    plant: &mut Plant,
    stage: &Stage,
    model: &TracerModel,
    ways: &[Way],
    progress: &Progress,
) -> Result<Measured> {
    let name = &stage.scene.name;
    progress.message(&format!("{name}: every pixel"));
    let [width, height] = stage.size;
    // Rows and columns of a regular pattern as large as the image are its pixels.
    let fine = Sampling {
        width,
        height,
        pattern: Pattern::Regular,
        ao_rays: FINE_AO_RAYS,
        ..stage.sampling.clone()
    };
    let truth: Vec<Workload> =
        stage.cameras.iter().map(|camera| stage.workload(&fine, camera)).collect();
    progress.step();
    progress.message(&format!("{name}: drawing {} frames", stage.cameras.len()));
    let timed = draw(plant, stage)?;
    progress.step();
    let ask = asked(model.clone());
    let model_of = |share: f64| {
        let mut model = model.clone();
        model.frame_model_mut().constants.divergence = share;
        asked(model)
    };
    let wanted = predict(&ask, &timed, |frame| &truth[frame]);
    let measured: Vec<f64> = timed.iter().map(|one| one.measured_ms).collect();
    let mut points = Vec::with_capacity(ways.len());
    // Ways that differ in their period alone share their samples.
    let mut last: Option<(Pattern, [u32; 2], Vec<Workload>, f64)> = None;
    let mut sorted: Vec<&Way> = ways.iter().collect();
    sorted.sort_by_key(|way| (name_order(way.pattern), way.size, way.period));
    for way in sorted {
        progress.message(&format!("{name}: {} {}×{}", way.family(), way.size[0], way.size[1]));
        let is_known = last.as_ref().is_some_and(|(p, s, ..)| *p == way.pattern && *s == way.size);
        if !is_known {
            let (workloads, seconds) = sample(stage, &way.sampling(&stage.sampling));
            last = Some((way.pattern, way.size, workloads, seconds));
        }
        let (.., workloads, seconds) = last.as_ref().context("it was just sampled")?;
        let known = |frame: usize| &workloads[frame - frame % way.period];
        let made = predict(&ask, &timed, known);
        let ratios: Vec<f64> =
            made.iter().zip(&wanted).map(|(made, wanted)| made / wanted).collect();
        let middle = median(&ratios);
        let scatter = ratios.iter().map(|ratio| (ratio / middle - 1.0).abs());
        points.push(Point {
            family: way.family(),
            size: way.size,
            period: way.period,
            sampling_ms: 1e3 * seconds,
            frame_ms: 1e3 * seconds / way.period as f64,
            open_loop: error(&made, &measured, 1.0),
            one_factor: error(&made, &measured, best_factor(&made, &measured)),
            bias: middle - 1.0,
            scatter: scatter.sum::<f64>() / ratios.len().max(1) as f64,
            counters: counters(&truth, known),
            is_default: way.is_default(),
            on_front: false,
            is_recommended: false,
        });
        progress.step();
    }
    mark(&mut points);
    let usual = Sampling { pattern: Pattern::default(), ..stage.sampling.clone() };
    let (coarse, _) = sample(stage, &usual);
    let (blocks, _) = sample(stage, &Sampling { pattern: Pattern::Blocks, ..usual });
    let divergences = DIVERGENCES.map(|share| {
        let model = model_of(share);
        let [every_pixel, default, blocks] = [&truth, &coarse, &blocks].map(|workloads| {
            let made = predict(&model, &timed, |frame| &workloads[frame]);
            error(&made, &measured, best_factor(&made, &measured))
        });
        Divergence { share, every_pixel, default, blocks }
    });
    Ok(Measured {
        frames: stage.cameras.len(),
        points,
        every_pixel: [1.0, best_factor(&wanted, &measured)]
            .map(|factor| error(&wanted, &measured, factor)),
        divergences: divergences.to_vec(),
        device_counts: device_counts(plant, stage, &truth)?,
    })
}

fn name_order(pattern: Pattern) -> usize {
    match pattern {
        Pattern::LowDiscrepancy => 0,
        Pattern::Regular => 1,
        Pattern::Jittered => 2,
        Pattern::Blocks => 3,
    }
}

/// The front of processor time and scatter, and the cheapest point whose scatter is tolerable.
fn mark(points: &mut [Point]) {
    let costs: Vec<(f64, f64)> = points.iter().map(|p| (p.scatter, p.frame_ms)).collect();
    for (point, on_front) in points.iter_mut().zip(crate::report::pareto_front(&costs)) {
        point.on_front = on_front;
    }
    let tolerable = points.iter_mut().filter(|point| point.scatter <= TOLERABLE);
    if let Some(best) = tolerable.min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms)) {
        best.is_recommended = true;
    }
}

/// Each frame by each of the settings, in turns.
fn draw(plant: &mut Plant, stage: &Stage) -> Result<Vec<Timed>> {
    let ao_radius = f64::from(stage.sampling.ao_radius / stage.diagonal.max(f32::MIN_POSITIVE));
    let settings = DIRECTIONS.map(|ao_rays| RenderSettings {
        shadows: true,
        ao_rays,
        ao_radius: ao_radius.min(1.0),
        ..RenderSettings::PRIMARY
    });
    let frames = 0..stage.cameras.len();
    let asked: Vec<(usize, &RenderSettings)> =
        frames.flat_map(|frame| settings.iter().map(move |settings| (frame, settings))).collect();
    let times = plant.probe_all(stage, &asked)?;
    let timed = asked.into_iter().zip(times);
    Ok(timed.map(|((frame, s), measured_ms)| Timed { frame, settings: *s, measured_ms }).collect())
}

/// What the model makes of the frames' workloads, in milliseconds.
fn predict<'a>(
    model: &Model<Workload>,
    timed: &[Timed],
    workload: impl Fn(usize) -> &'a Workload,
) -> Vec<f64> {
    timed.iter().map(|one| model(&one.settings, workload(one.frame))).collect()
}

/// Workloads of all frames, and the mean of the seconds of processor time that one took.
fn sample(stage: &Stage, sampling: &Sampling) -> (Vec<Workload>, f64) {
    let mut sum = 0.0;
    let workloads = stage
        .cameras
        .iter()
        .map(|camera| {
            let mut least = f64::INFINITY;
            let mut workload = Workload::default();
            for _ in 0..REPEATS {
                let clock = Clock::start();
                workload = stage.workload(sampling, camera);
                least = least.min(clock.seconds());
            }
            sum += least;
            workload
        })
        .collect();
    (workloads, sum / stage.cameras.len().max(1) as f64)
}

fn error(made: &[f64], measured: &[f64], factor: f64) -> f64 {
    let sum: f64 =
        made.iter().zip(measured).map(|(made, ms)| (factor * made - ms).abs() / ms).sum();
    sum / made.len().max(1) as f64
}

/// The factor on predictions by which the mean of |factor · predicted − measured| / measured is least: the
/// median of measured ÷ predicted, weighted by predicted ÷ measured.
fn best_factor(made: &[f64], measured: &[f64]) -> f64 {
    let mut ratios: Vec<(f64, f64)> =
        made.iter().zip(measured).map(|(made, ms)| (ms / made, made / ms)).collect();
    ratios.retain(|(ratio, weight)| ratio.is_finite() && weight.is_finite());
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * ratios.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    for &(ratio, weight) in &ratios {
        sum += weight;
        if sum >= half {
            return ratio;
        }
    }
    1.0
}

pub(super) fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

fn counters<'a>(truth: &[Workload], sampled: impl Fn(usize) -> &'a Workload) -> Counters {
    let of = |value: fn(&Workload) -> f64| {
        let off = truth.iter().enumerate().map(|(k, w)| (value(sampled(k)) - value(w)).abs());
        let (off, all) = (off.sum::<f64>(), truth.iter().map(value).sum::<f64>());
        // Nothing off by nothing is no error.
        if all > 0.0 { off / all } else { 0.0 }
    };
    let m = truth.iter().enumerate().map(|(k, w)| (sampled(k).coalescing - w.coalescing).abs());
    Counters {
        p_t: of(|w| w.primary_traversals),
        p_i: of(|w| w.primary_intersections),
        t_v: of(|w| w.visible_triangles),
        a_t: of(|w| w.ao_traversals),
        a_w: of(|w| w.ao_intersections * w.visible_triangles),
        m: m.sum::<f64>() / truth.len().max(1) as f64,
        s_t: of(|w| w.shadow_traversals),
    }
}

/// The device's counts over the sampler's, over some frames.
fn device_counts(
    plant: &mut Plant,
    stage: &Stage,
    truth: &[Workload],
) -> Result<Option<DeviceCounts>> {
    let ao_radius = f64::from(stage.sampling.ao_radius / stage.diagonal.max(f32::MIN_POSITIVE));
    let settings = RenderSettings {
        shadows: true,
        ao_rays: 4,
        ao_radius: ao_radius.min(1.0),
        ..RenderSettings::PRIMARY
    };
    let rays = ray_settings(&settings).ao_rays;
    let pixels = f64::from(stage.size[0]) * f64::from(stage.size[1]);
    let (mut theirs, mut ours) = ([0.0; 4], [0.0; 4]);
    for frame in crate::tune::fit::spread(stage.cameras.len(), 5) {
        let Some(counts) = plant.counts(stage, frame, &settings)? else { return Ok(None) };
        let w = &truth[frame];
        let device = [
            counts.primary.nodes,
            counts.primary.triangles,
            counts.shade.nodes,
            counts.shade.triangles,
        ];
        let sampled = [
            w.primary_traversals,
            w.primary_intersections,
            w.shadow_traversals + rays * w.ao_traversals,
            w.shadow_intersections + rays * w.visible_triangles * w.ao_intersections,
        ];
        for i in 0..4 {
            theirs[i] += device[i] as f64;
            ours[i] += pixels * sampled[i];
        }
    }
    let [primary_nodes, primary_triangles, secondary_nodes, secondary_triangles] =
        std::array::from_fn(|i| theirs[i] / ours[i]);
    Ok(Some(DeviceCounts {
        primary_nodes,
        primary_triangles,
        secondary_nodes,
        secondary_triangles,
    }))
}

/// The processor time of this thread, which others that run meanwhile do not lengthen; where the system does not
/// tell it, the time of the wall.
struct Clock(Instant, Option<f64>);

impl Clock {
    fn start() -> Self {
        Self(Instant::now(), Self::thread())
    }

    fn seconds(&self) -> f64 {
        match (self.1, Self::thread()) {
            (Some(then), Some(now)) => now - then,
            _ => self.0.elapsed().as_secs_f64(),
        }
    }

    #[cfg(unix)]
    fn thread() -> Option<f64> {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Some(now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64)
    }

    #[cfg(not(unix))]
    fn thread() -> Option<f64> {
        None
    }
}
