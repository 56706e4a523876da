//! What a study found, as `study.json` has it.

use super::measure::Visit;
use crate::power::published::LIGHTS;
use crate::results::{Failure, Run};
use niwaki_power::{Analysis, FrameEnergy, Segmentation, statistic, student};
use niwaki_raster::Algorithm;
use serde::Serialize;

/// Level of confidence intervals.
const CONFIDENCE: f64 = 0.95;

/// Everything.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Study {
    /// Version of this file's layout.
    pub(super) schema: u32,
    pub(super) run: Run,
    pub(super) device: String,
    /// The device times its passes itself.
    pub(super) device_times: bool,
    pub(super) source: SourceRow,
    pub(super) scenes: Vec<SceneRow>,
    pub(super) cells: Vec<Cell>,
    pub(super) answers: Vec<Answer>,
    pub(super) failures: Vec<Failure>,
}

/// The meter.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct SourceRow {
    /// Its name; none without one.
    pub(super) name: Option<String>,
    /// What has to be said of it, or why there is none.
    pub(super) notes: Vec<String>,
    /// Seconds between new readings while frames were drawn.
    pub(super) refresh_s: Option<f64>,
}

/// A scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SceneRow {
    pub(super) name: String,
    pub(super) triangles: usize,
}

/// A question of the paper, and what this device says.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Answer {
    pub(super) question: &'static str,
    /// Whether the data say anything about it.
    pub(super) is_answered: bool,
    pub(super) words: Vec<String>,
}

/// What is measured: a scene, a size, an algorithm, a number of lights.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Key {
    pub(super) scene: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) algorithm: Algorithm,
    pub(super) lights: u32,
}

impl Key {
    pub(super) fn pixels(&self) -> f64 {
        f64::from(self.width) * f64::from(self.height)
    }

    /// The algorithm, with its lights where they vary.
    pub(super) fn name(&self) -> String {
        match self.algorithm.has_shadows() {
            true => format!("{}, {} lights", self.algorithm, self.lights),
            false => self.algorithm.short().to_owned(),
        }
    }

    pub(super) fn size(&self) -> String {
        format!("{}×{}", self.width, self.height)
    }

    /// True if both solve the same problem: the same scene, size and lights, with shadows or without.
    pub(super) fn competes_with(&self, other: &Self) -> bool {
        let what = |key: &Self| (key.width, key.height, key.lights, key.algorithm.has_shadows());
        self.scene == other.scene && what(self) == what(other)
    }

    /// True for numbers of lights that go into table 1: the paper's, or the first of `lights`.
    pub(super) fn is_in_table(&self, lights: &[u32]) -> bool {
        let wanted = if lights.contains(&LIGHTS) { Some(LIGHTS) } else { lights.first().copied() };
        !self.algorithm.has_shadows() || Some(self.lights) == wanted
    }
}

/// The mean time of a pass in a frame, all lights together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct PassRow {
    pub(super) name: String,
    pub(super) ms: f64,
}

/// A cell of the study.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Cell {
    #[serde(flatten)]
    pub(super) key: Key,
    /// Side of shadow maps; 0 without.
    pub(super) map_side: u32,
    /// Frames along the path, and frames that were drawn in all.
    pub(super) frames: usize,
    pub(super) drawn: usize,
    /// Milliseconds from frame to frame, the mean of each repetition, in order.
    pub(super) repeats_ms: Vec<f64>,
    /// Their median.
    pub(super) ms: f64,
    /// Standard deviation over the frames of the path.
    pub(super) deviation_ms: f64,
    /// Milliseconds of all passes on the GPU, mean over the frames of the repetition (or two) whose time is the
    /// median; none on devices without a clock.
    pub(super) gpu_ms: Option<f64>,
    pub(super) passes: Vec<PassRow>,
    /// Milliseconds of each frame of the path, median over all times that it was drawn, and on the GPU.
    pub(super) path_ms: Vec<f64>,
    pub(super) path_gpu_ms: Vec<f64>,
    /// Cores that other programs used meanwhile.
    pub(super) other_cores: Option<f64>,
    pub(super) energy: Option<Energy>,
}

/// What a cell costs in energy, by a meter.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Energy {
    /// Eq. 2, in nanojoules per pixel.
    pub(super) nj_per_pixel: f64,
    /// Standard deviation over frames, or over windows.
    pub(super) deviation: f64,
    /// Half the width of the 95 % interval of the mean if the same is repeated.
    pub(super) half_width: f64,
    pub(super) joules_per_frame: f64,
    /// Milliseconds of the frames that were measured, from one to the next.
    pub(super) ms: f64,
    /// Mean power from frame to frame, less what the policy subtracts, and while frames are worked on.
    pub(super) mean_w: f64,
    pub(super) busy_w: f64,
    /// Before and after the frames, and what of it is subtracted.
    pub(super) idle_w: Option<f64>,
    pub(super) subtracted_w: f64,
    /// Frames are told apart; else these are windows of many.
    pub(super) by_frame: bool,
    /// Frames that were measured, of them repaired and clipped, and frames that count nowhere.
    pub(super) frames: u64,
    pub(super) repaired: u64,
    pub(super) clipped: u64,
    pub(super) incomplete: u64,
    /// What the sensor can resolve, in words.
    pub(super) sensor: String,
    /// Mean power over the number of the frame (the middle of a window's), in order of the number.
    pub(super) path_w: Vec<(f64, f64)>,
    /// Mean power in equal parts of a frame; empty if the meter does not tell. Its time, and the share of
    /// it that is work.
    pub(super) signature_w: Vec<f64>,
    pub(super) signature_ms: f64,
    pub(super) busy_share: f64,
    /// Idle time within and after the work of a frame, milliseconds a frame.
    pub(super) idle_inside_ms: f64,
    pub(super) idle_between_ms: f64,
    /// Changes of power states, and frames that take longer than those around them by a third.
    pub(super) states: usize,
    pub(super) spikes: usize,
}

pub(super) fn mean(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.into_iter().fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    sum / count
}

pub(super) fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    match numbers.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => numbers[n / 2],
        n => 0.5 * (numbers[n / 2 - 1] + numbers[n / 2]),
    }
}

/// The middle one, or the two middle ones: those whose time is the median.
fn middle(visits: &[Visit], time: impl Fn(&Visit) -> f64) -> Vec<&Visit> {
    let mut sorted: Vec<&Visit> = visits.iter().filter(|v| !v.frames.is_empty()).collect();
    sorted.sort_by(|a, b| time(a).total_cmp(&time(b)));
    match sorted.len() {
        0 => Vec::new(),
        n => sorted[(n - 1) / 2..=n / 2].to_vec(),
    }
}

/// Times of passes, means over the frames of visits.
fn mean_passes(visits: &[&Visit]) -> Vec<PassRow> {
    let mut passes: Vec<PassRow> = Vec::new();
    for visit in visits {
        let of_all = (visits.len() * visit.frames.len()) as f64;
        for pass in visit.frames.iter().flat_map(|frame| &frame.passes) {
            let ms = 1e-6 * pass.ns as f64 / of_all;
            match passes.iter_mut().find(|row| row.name == pass.name) {
                Some(row) => row.ms += ms,
                None => passes.push(PassRow { name: pass.name.clone(), ms }),
            }
        }
    }
    passes
}

impl Cell {
    /// What its visits come to; none before the first.
    pub(super) fn of(key: Key, map_side: u32, visits: &[Visit]) -> Option<Self> {
        let all = || visits.iter().flat_map(|v| &v.frames);
        let drawn = all().count();
        let frames = usize::try_from(all().map(|f| f.frame).max()? + 1).ok()?;
        let (mut path, mut path_gpu) = (vec![Vec::new(); frames], vec![Vec::new(); frames]);
        for frame in all() {
            let at = usize::try_from(frame.frame).ok()?;
            path[at].push(1e-6 * (frame.end_ns - frame.start_ns) as f64);
            if !frame.passes.is_empty() {
                path_gpu[at].push(frame.passes.iter().map(|p| 1e-6 * p.ns as f64).sum());
            }
        }
        let path_ms: Vec<f64> = path.into_iter().map(median).collect();
        let is_timed = path_gpu.iter().all(|times| !times.is_empty());
        let path_gpu_ms: Vec<f64> =
            if is_timed { path_gpu.into_iter().map(median).collect() } else { Vec::new() };
        let time = |visit: &Visit| {
            let (first, last) = (visit.frames.first()?, visit.frames.last()?);
            Some(1e-6 * (last.end_ns - first.start_ns) as f64 / visit.frames.len() as f64)
        };
        let repeats_ms: Vec<f64> = visits.iter().filter_map(time).collect();
        let passes = mean_passes(&middle(visits, |visit| time(visit).unwrap_or_default()));
        let loads: Vec<f64> = visits.iter().filter_map(|v| v.other_cores).collect();
        let energy = Energy::of(&key, visits);
        Some(Self {
            map_side,
            frames,
            drawn,
            ms: median(repeats_ms.clone()),
            repeats_ms,
            deviation_ms: statistic(&path_ms, CONFIDENCE).deviation,
            gpu_ms: is_timed.then(|| passes.iter().map(|p| p.ms).sum()),
            passes,
            path_ms,
            path_gpu_ms,
            other_cores: (!loads.is_empty()).then(|| mean(loads)),
            energy,
            key,
        })
    }

    /// Nanoseconds per pixel and their deviation: eq. 2 for time.
    pub(super) fn ns_per_pixel(&self) -> (f64, f64) {
        let pixels = self.key.pixels();
        (1e6 * self.ms / pixels, 1e6 * self.deviation_ms / pixels)
    }
}

impl Energy {
    fn of(key: &Key, visits: &[Visit]) -> Option<Self> {
        let found: Vec<&Analysis> =
            visits.iter().filter_map(|v| v.power.as_ref()?.as_ref().ok()).collect();
        let good: Vec<Vec<&FrameEnergy>> =
            found.iter().map(|a| a.frames.iter().filter(|f| !f.is_incomplete).collect()).collect();
        let total = |of: &dyn Fn(&FrameEnergy) -> f64, part: &[&FrameEnergy]| -> f64 {
            part.iter().map(|f| of(f) * f64::from(f.frames)).sum()
        };
        let pooled: Vec<&FrameEnergy> = good.iter().flatten().copied().collect();
        let count = total(&|_| 1.0, &pooled);
        if count == 0.0 {
            return None;
        }
        let nj = |joules: f64| 1e9 * joules / key.pixels();
        let joules_per_frame = total(&|f| f.energy_j, &pooled) / count;
        let time_s = total(&|f| f.time_s, &pooled) / count;
        let busy_s = total(&|f| f.busy_s, &pooled) / count;
        let each: Vec<f64> = pooled.iter().map(|f| f.energy_j).collect();
        let repeats: Vec<f64> = good
            .iter()
            .filter(|part| !part.is_empty())
            .map(|part| total(&|f| f.energy_j, part) / total(&|_| 1.0, part))
            .collect();
        let spread = statistic(&each, CONFIDENCE);
        // Between repetitions, where there are some: that holds what drifts within one.
        let half_width = match repeats.len() {
            0 | 1 => spread.half_width,
            n => {
                let deviation = statistic(&repeats, CONFIDENCE).deviation;
                student(CONFIDENCE, (n - 1) as f64) * deviation / (n as f64).sqrt()
            }
        };
        let by_frame = found.iter().all(|a| a.segmentation == Segmentation::Log);
        let groups = || found.iter().flat_map(|a| &a.groups);
        let sum = |of: fn(&niwaki_power::GroupResult) -> u64| groups().map(of).sum();
        let idle: Vec<f64> = found.iter().filter_map(|a| a.idle.outside_w).collect();
        let weighed = |of: &dyn Fn(&FrameEnergy) -> f64| total(of, &pooled) / count;
        let (signature_w, signature_ms, busy_share) =
            if by_frame { signature(&found) } else { (Vec::new(), f64::NAN, f64::NAN) };
        Some(Self {
            nj_per_pixel: nj(joules_per_frame),
            deviation: nj(spread.deviation),
            half_width: nj(half_width),
            joules_per_frame,
            ms: 1e3 * time_s,
            mean_w: joules_per_frame / time_s,
            busy_w: total(&|f| f.busy_w * f.busy_s, &pooled) / (count * busy_s),
            idle_w: (!idle.is_empty()).then(|| mean(idle)),
            subtracted_w: mean(found.iter().map(|a| a.idle.watts)),
            by_frame,
            frames: sum(|g| g.frames),
            repaired: sum(|g| g.repaired),
            clipped: sum(|g| g.clipped),
            incomplete: sum(|g| g.incomplete),
            sensor: found.last().map(|a| a.sensor.words.clone()).unwrap_or_default(),
            path_w: path_power(&pooled),
            signature_w,
            signature_ms,
            busy_share,
            idle_inside_ms: 1e3 * weighed(&|f| f.idle_inside_s),
            idle_between_ms: 1e3 * weighed(&|f| f.idle_between_s),
            states: found.iter().map(|a| a.states.len()).sum(),
            spikes: found.iter().map(|a| a.spikes.len()).sum(),
        })
    }
}

/// Mean power over the number of a frame or the middle of a window, medians of repetitions.
fn path_power(pooled: &[&FrameEnergy]) -> Vec<(f64, f64)> {
    let mut all: Vec<(f64, f64)> = pooled
        .iter()
        .map(|f| (f.frame as f64 + 0.5 * (f64::from(f.frames) - 1.0), f.mean_w))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.chunk_by(|a, b| a.0 == b.0)
        .map(|same| (same[0].0, median(same.iter().map(|p| p.1).collect())))
        .collect()
}

/// The mean course of power within a frame over repetitions, its milliseconds, and the share of work.
fn signature(found: &[&Analysis]) -> (Vec<f64>, f64, f64) {
    let all: Vec<_> = found.iter().flat_map(|a| &a.signatures).collect();
    // Each has a power of two of parts: the fewest do for all.
    let Some(parts) = all.iter().map(|s| s.mean_w.len()).min() else {
        return (Vec::new(), f64::NAN, f64::NAN);
    };
    let part = |at: usize| {
        let own = |s: &&niwaki_power::Signature| {
            let length = s.mean_w.len() / parts;
            s.mean_w[at * length..(at + 1) * length].to_vec()
        };
        let known = all.iter().flat_map(own).filter(|w| w.is_finite());
        mean(known)
    };
    let course = (0..parts).map(part).collect();
    (course, 1e3 * mean(all.iter().map(|s| s.frame_s)), mean(all.iter().map(|s| s.busy_share)))
}
