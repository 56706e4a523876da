//! What is rendered: phases of frames, and power over time.

use super::RecordingOptions;
use fastrand::Rng;

/// A part of a frame's work.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// Name of the pass.
    pub name: &'static str,
    /// Share of the time of work, relative to the others.
    pub share: f64,
    /// Power above idle, as a share of [`Animation::busy_w`].
    pub level: f64,
}

/// Some frames of one algorithm.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Short name of the algorithm.
    pub algorithm: String,
    /// Number of lights.
    pub lights: u32,
    /// Number of frames.
    pub frames: usize,
    /// Mean time of a frame's work in seconds.
    pub work_s: f64,
    /// Mean idle time between frames in seconds; it varies by half of that.
    pub idle_s: f64,
    /// Power above idle while all units work, in watts.
    pub busy_w: f64,
    /// By how much time and power vary along the animation, as a share.
    pub swing: f64,
    /// What a frame consists of.
    pub phases: Vec<Phase>,
}

impl Animation {
    fn new(algorithm: &str, lights: u32, frames: usize, work_s: f64, busy_w: f64) -> Self {
        Self {
            algorithm: algorithm.into(),
            lights,
            frames,
            work_s,
            idle_s: 0.8e-3,
            busy_w,
            swing: 0.15,
            phases: Vec::new(),
        }
    }

    fn with(mut self, phases: &[(&'static str, f64, f64)]) -> Self {
        let phases = phases.iter().map(|&(name, share, level)| Phase { name, share, level });
        self.phases.extend(phases);
        self
    }

    /// Forward rendering: full power throughout.
    #[must_use]
    pub fn forward(frames: usize) -> Self {
        Self::new("FR", 32, frames, 16e-3, 235.0).with(&[("forward", 1.0, 1.0)])
    }

    /// Z-prepass: a pass of depth, with drops.
    #[must_use]
    pub fn z_prepass(frames: usize) -> Self {
        Self::new("ZR", 32, frames, 9e-3, 200.0).with(&[
            ("z_prepass", 0.18, 0.75),
            ("z_prepass", 0.04, 0.5),
            ("lighting", 0.78, 1.0),
        ])
    }

    /// Deferred: a drop to idle between G-buffer and lights.
    #[must_use]
    pub fn deferred(frames: usize) -> Self {
        Self::new("DR", 32, frames, 7e-3, 195.0).with(&[
            ("g_buffer", 0.42, 0.9),
            ("lights", 0.06, 0.0),
            ("lights", 0.52, 1.0),
        ])
    }

    /// Shadow volumes: each light fills a volume.
    #[must_use]
    pub fn shadow_volumes(frames: usize, lights: u32) -> Self {
        let work = 4e-3 + 2.2e-3 * f64::from(lights);
        let mut all = Self::new("SV", lights, frames, work, 230.0).with(&[("ambient", 0.6, 0.8)]);
        for _ in 0..lights {
            all = all.with(&[("volumes", 0.8, 1.0), ("light", 0.3, 0.85)]);
        }
        all
    }

    /// Shadow maps: idle between lights.
    #[must_use]
    pub fn shadow_maps(frames: usize, lights: u32) -> Self {
        let work = 2e-3 + 1.1e-3 * f64::from(lights);
        let mut all = Self::new("SM", lights, frames, work, 180.0).with(&[("depth", 0.5, 0.7)]);
        for _ in 0..lights {
            all = all.with(&[("map", 0.5, 0.9), ("map", 0.12, 0.05), ("light", 0.4, 1.0)]);
        }
        all
    }

    /// Variance shadow maps: a filtered map for each light.
    #[must_use]
    pub fn variance_shadow_maps(frames: usize, lights: u32) -> Self {
        let work = 2.5e-3 + 1.5e-3 * f64::from(lights);
        let mut all = Self::new("VSM", lights, frames, work, 205.0).with(&[("depth", 0.5, 0.7)]);
        for _ in 0..lights {
            all = all.with(&[("map", 0.5, 0.9), ("mips", 0.35, 0.6), ("light", 0.4, 1.0)]);
        }
        all
    }

    pub(super) fn is_valid(&self) -> bool {
        let is_size = |x: f64| x >= 0.0 && x.is_finite();
        let shares: f64 = self.phases.iter().map(|p| p.share).sum();
        self.work_s > 0.0
            && self.work_s.is_finite()
            && is_size(self.idle_s)
            && is_size(self.busy_w)
            && (0.0..1.0).contains(&self.swing)
            && self.phases.iter().all(|p| is_size(p.share) && is_size(p.level))
            && shares > 0.0
            && shares.is_finite()
    }
}

/// Constant power from a time on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub(super) start_ns: f64,
    pub(super) watts: f64,
}

pub(super) struct PlannedFrame {
    pub(super) animation: usize,
    pub(super) number: usize,
    pub(super) start_ns: f64,
    pub(super) busy_end_ns: f64,
    pub(super) end_ns: f64,
    pub(super) energy_j: f64,
    pub(super) passes: Vec<(&'static str, u64)>,
}

pub(super) struct Program {
    pub(super) segments: Vec<Segment>,
    pub(super) frames: Vec<PlannedFrame>,
    /// End of the last frame, in nanoseconds of the trace.
    pub(super) end_ns: f64,
}

/// Idle time between two animations.
const PAUSE_S: f64 = 0.05;

/// Lays frames out over time, from the start of the trace.
pub(super) fn plan(options: &RecordingOptions, random: &mut Rng) -> Program {
    let idle = options.idle_w;
    let mut time = options.margin_s * 1e9;
    let mut segments = vec![Segment { start_ns: 0.0, watts: idle }];
    let mut frames: Vec<PlannedFrame> = Vec::new();
    let mut factor = 1.0;
    let mut index = 0;
    for (which, animation) in options.animations.iter().enumerate() {
        let shares: f64 = animation.phases.iter().map(|p| p.share).sum();
        for number in 0..animation.frames {
            if let Some((_, to)) = options.states.iter().rev().find(|(from, _)| *from == index) {
                factor = *to;
            }
            // The view changes slowly along the path, and a little from frame to frame.
            let along = number as f64 / animation.frames as f64 * std::f64::consts::TAU;
            let swing = 1.0 + animation.swing * (along.sin() + 0.3 * (5.0 * along).cos()) / 1.3;
            let work =
                animation.work_s * 1e9 * swing * (1.0 + 0.02 * gauss(random).clamp(-3.0, 3.0));
            let busy = animation.busy_w * factor * (1.0 + 0.3 * (swing - 1.0));
            let start = time;
            let mut joules = 0.0;
            let mut passes: Vec<(&'static str, u64)> = Vec::new();
            for phase in &animation.phases {
                let length = work * phase.share / shares;
                let watts = idle + busy * phase.level;
                segments.push(Segment { start_ns: time, watts });
                joules += 1e-9 * length * watts;
                time += length;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a positive time"
                )]
                let ns = length as u64;
                match passes.iter_mut().find(|p| p.0 == phase.name) {
                    Some(pass) => pass.1 += ns,
                    None => passes.push((phase.name, ns)),
                }
            }
            let busy_end = time;
            segments.push(Segment { start_ns: time, watts: idle });
            let mut rest = animation.idle_s * (0.5 + random.f64());
            if let Some((_, delay)) = options.delays.iter().find(|(frame, _)| *frame == index) {
                rest += delay;
            }
            time += 1e9 * rest;
            let is_last = number + 1 == animation.frames;
            if !is_last {
                joules += rest * idle;
            }
            frames.push(PlannedFrame {
                animation: which,
                number,
                start_ns: start,
                busy_end_ns: busy_end,
                end_ns: if is_last { busy_end } else { time },
                energy_j: joules,
                passes,
            });
            index += 1;
        }
        time += 1e9 * PAUSE_S;
    }
    let end_ns = frames.last().map_or(0.0, |f| f.busy_end_ns);
    Program { segments, frames, end_ns }
}

/// A number of about the standard normal distribution, within ±3.5: the sum of four even ones, which is
/// all the tail that noise of a sensor needs.
pub(super) fn gauss(random: &mut Rng) -> f64 {
    let bits = random.u64(..);
    let sum: u64 = (0..4).map(|i| (bits >> (16 * i)) & 0xffff).sum();
    // Each of the four has the variance (2^32 − 1)/12.
    (sum as f64 - 2.0 * 65535.0) / (4.0 * (65536.0 * 65536.0 - 1.0) / 12.0f64).sqrt()
}
