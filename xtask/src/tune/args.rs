//! The command line of `cargo xtask tune`.

use super::flight::{FIRST, Orders};
use super::pilots::{Features, Model};
use super::rows::Flight;
use crate::render::{Preset, Size};
use clap::{Args, ValueEnum};
use niwaki_frame_control::{Ladder, RenderSettings, Summary, frames_off};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask tune
      The two scenes after those of Ganestam and Doggett 2012 on the Vulkan device, all controllers; the
      target is what the first frame takes with 16 directions of ambient occlusion.
  cargo xtask tune --scene model.glb --target-ms 16.7 --controller both --size 1920x1080
      Your own scene along its camera path (or an automatic one), kept at 60 frames a second.
  cargo xtask tune --device geforce-580 --device radeon-5870 --turn
      Simulated devices with their own hidden parameters; half-way the camera turns around.
  cargo xtask tune --renderer hybrid --scene gallery:100k --target-ms 16.7
      The hybrid renderer: render scale, reflection depth and the size of the near region are turned too.
  cargo xtask tune --model my-gpu.toml
      A table of the device instead of measuring it (what was measured is written to --out).

On the Vulkan device the model is first fitted to 36 frames: 6 views spread over the path, by 6
settings each, in three rounds whose medians count (--no-fit leaves it as measured).

Each frame, the workload of its view is sampled on the CPU while the frame before is drawn. A controller
predicts what each rung of the ladder (shading; shadows; 1, 2, ... directions of ambient occlusion) will
take, and chooses the highest that meets the target:

  none         the rung that meets it best in the first frame, for ever
  feedback     the price list of the first frame, corrected by the previous frame
  feedforward  the analytical model of the device, uncorrected
  both         the same, corrected by a slow outer loop
  regression   least squares on the same counters, learnt on the way, without a model of the device

All controllers draw each frame in turns (A B C, A B C, ...), so that what disturbs the device disturbs
all of them. Afterwards settings are timed in a few views, to see whether the model orders them by
cost as the device does (Kendall's tau).

Output (in --out): tune.json, tune.html with the plots of the paper's Figures 5 and 8, csv/*.csv and
the table of the device that was measured.

The exit code is 1 if a scene could not be loaded or a device failed.";

/// What draws frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Renderer {
    /// Primary rays, Phong shading, shadow rays and ambient occlusion, as in the paper
    #[default]
    Tracer,
    /// The hybrid renderer: render scale, reflection depth and near region are turned as well
    Hybrid,
}

/// Arguments of `cargo xtask tune`.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct TuneArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles (fairy:20k);
    /// may be repeated [default: fairy:174117 and cabin:422635; of 10k with --quick]
    #[arg(long = "scene", value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scenes: Vec<String>,

    /// vulkan, or a simulated device: geforce-8800, geforce-580, radeon-5870; may be repeated
    #[arg(long = "device", value_name = "NAME", default_value = "vulkan",
          value_parser = ["vulkan", "geforce-8800", "geforce-580", "radeon-5870"])]
    pub(crate) devices: Vec<String>,

    /// What draws: the GPU ray tracer of the paper's application, or the hybrid renderer
    #[arg(long, value_name = "NAME", default_value = "tracer")]
    pub(crate) renderer: Renderer,

    /// Milliseconds that a frame should take [default: what the first frame takes with 16
    /// directions of ambient occlusion]
    #[arg(long, value_name = "MS")]
    pub(crate) target_ms: Option<f64>,

    /// Controllers, comma-separated
    #[arg(long = "controller", value_name = "NAMES", value_delimiter = ',',
          default_value = "none,feedback,feedforward,both,regression",
          value_parser = ["none", "feedback", "feedforward", "both", "regression"])]
    pub(crate) controllers: Vec<String>,

    /// Frames along the camera path [default: 100; 12 with --quick]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) frames: Option<u32>,

    /// Draws each frame as often, and the fastest counts: on machines that other programs disturb, which only adds
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=100))]
    pub(crate) draws: u16,

    /// Turns the camera around for the second half of the path
    #[arg(long)]
    pub(crate) turn: bool,

    /// Pixels of a frame [default: 1280x720; 320x180 on a software driver; 64x36 with --quick]
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    pub(crate) size: Option<Size>,

    /// Directions of ambient occlusion at most
    #[arg(long, value_name = "NUMBER", default_value_t = 64,
          value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) max_ao: u16,

    /// How far occluders count, as a share of the diagonal of the scene's bounds
    #[arg(long, value_name = "SHARE", default_value_t = 0.1)]
    pub(crate) ao_radius: f64,

    /// Columns and rows of samples of a view
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "32x18")]
    pub(crate) sampling: Size,

    /// The table of the device that the model uses: a name of niwaki-gpu-model or a TOML file
    /// [default: measured; for simulated devices the table of that name]
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) model: Option<String>,

    /// Takes the table of the device as it is, instead of fitting it to some frames that are drawn first
    #[arg(long)]
    pub(crate) no_fit: bool,

    /// Builder of the tree
    #[arg(long, value_name = "NAME", default_value = "bonsai_p")]
    pub(crate) builder: String,

    /// Settings of the hybrid renderer that no rung changes [default: default; fast on a software driver]
    #[arg(long, value_name = "NAME")]
    pub(crate) preset: Option<Preset>,

    /// Views in which settings are timed to see whether the model orders them right; 0 for none
    #[arg(long, value_name = "NUMBER", default_value_t = 3)]
    pub(crate) rank: u32,

    /// Small scenes, few frames: enough to see that everything works
    #[arg(long)]
    pub(crate) quick: bool,

    /// Seed of procedural scenes, simulated devices and directions
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/tune")]
    pub(crate) out: PathBuf,
}

impl TuneArgs {
    /// Pixels of a frame.
    pub(super) fn size(&self, is_software: bool) -> [u32; 2] {
        match (self.size, self.quick, is_software) {
            (Some(Size { width, height }), ..) => [width, height],
            (None, true, _) => [64, 36],
            (None, false, true) => [320, 180],
            (None, false, false) => [1280, 720],
        }
    }

    /// Frames along the path.
    pub(super) fn frames(&self) -> u32 {
        self.frames.unwrap_or(if self.quick { 12 } else { 100 })
    }

    /// What the controllers are to do.
    pub(super) fn flight<'a, W>(
        &'a self,
        ladder: &'a Ladder<RenderSettings>,
        model: Model<W>,
        features: Features<W>,
    ) -> Orders<'a, W> {
        Orders {
            ladder,
            model,
            features,
            controllers: &self.controllers,
            target_ms: self.target_ms,
            draws: self.draws,
            rank: self.rank as usize,
        }
    }

    /// Adds what flights come to.
    pub(super) fn summed(&self, mut flights: Vec<Flight>) -> Vec<Flight> {
        for flight in &mut flights {
            let learnt = flight.records.get(FIRST..).unwrap_or_default();
            flight.summary = Summary::of(learnt).or_else(|| Summary::of(&flight.records));
            flight.off_after_turn = self.turn.then(|| {
                let turn = flight.records.len() / 2;
                let end = (turn + FIRST).min(flight.records.len());
                frames_off(flight.records.get(turn..end).unwrap_or_default(), 0.1)
            });
        }
        flights
    }
}
