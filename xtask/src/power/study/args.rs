//! The command line of `cargo xtask power study`.

use crate::cli::parse_count;
use crate::power::args::Settings;
use crate::power::source::PowerSource;
use crate::render::Size;
use clap::Args;
use niwaki_raster::Algorithm;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask power study
      The paper's: FR, ZR and DR in the atrium with five dragons and in the tessellated scene, SV, SM and
      VSM with 2, 4, 6 and 8 lights in the latter, with the meter of the device that renders, if it has one.
  cargo xtask power study --size 2560x1440,960x640 --source nvml --repeats 5
      Two of the paper's sizes; energy by NVIDIA's counters, in windows that are long enough for them.
  cargo xtask power study --source csv:trace.dump --sync correlation
      With an instrument of your own, which writes its trace while the study runs (start it before).
  cargo xtask power study --scene model.glb --algorithms DR,SM,VSM --lights 4
      Your own scene, along a path around it.
  cargo xtask power study --dragon dragon.obj
      The atrium with five times that model instead of procedural serpents.

A trace that comes from another machine later is brought together with the study's log by
  cargo xtask power analyze trace.dump --frames out/power-study/frames.jsonl

Every cell is a scene, a size, an algorithm and a number of lights. Cells of a scene are drawn in turns,
--repeats times each: a second of idling, the camera path, a second of idling. Where the meter is slow the
path is repeated until there are ten windows of twenty of its readings. Without a meter there are times
alone, and the report says so.

Output (in --out), written after each cell: study.html, study.json, csv/*.csv and frames.jsonl, the log
of all frames.";

/// Arguments of `study`.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct StudyArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles; may be repeated.
    /// Each is drawn by all algorithms [default: the paper's two, serpents (the atrium) and tessellated]
    #[arg(long = "scene", value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scenes: Vec<String>,

    /// A model in place of the five dragons of the atrium
    #[arg(long, value_name = "FILE")]
    pub(crate) dragon: Option<PathBuf>,

    /// Triangles of procedural scenes that are named without a number [default: the paper's, 724,337 and
    /// 396,000; on software drivers 20k, with --quick 3k]
    #[arg(long, value_name = "NUMBER", value_parser = parse_count)]
    pub(crate) triangles: Option<usize>,

    /// Sizes of images, comma-separated [default: 1280x720; on software drivers 320x180, with --quick
    /// 96x54]
    #[arg(long = "size", value_name = "WIDTHxHEIGHT", value_delimiter = ',')]
    pub(crate) sizes: Vec<Size>,

    /// Frames along the camera path [default: 200; on software drivers 20, with --quick 4]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) frames: Option<u32>,

    /// Numbers of lights of SV, SM and VSM, 1 to 8, comma-separated [default: 2,4,6,8; with --quick 2,4]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',',
          value_parser = clap::value_parser!(u8).range(1..=8))]
    pub(crate) lights: Vec<u8>,

    /// Algorithms, comma-separated [default: FR,ZR,DR,SV,SM,VSM]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) algorithms: Vec<Algorithm>,

    /// How often each cell is measured, in turns with the others [default: 3, with --quick 1]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeats: Option<u32>,

    /// The meter: auto (that of the device that renders, if there is one), none, rapl (the processor's
    /// counters; rapl:FOLDER below another folder), nvml (nvml:NUMBER for another device), or csv:FILE (the
    /// trace that an instrument writes meanwhile, CSV or a dump of PowerSensor3)
    #[arg(long, value_name = "SOURCE", default_value = "auto")]
    pub(crate) source: PowerSource,

    /// Readings a second of a meter of this machine
    #[arg(long, default_value_t = 1000.0, value_name = "HZ")]
    pub(crate) rate: f64,

    /// Seconds of idling before and after each cell [default: 1; without a meter 0]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) margin: Option<f64>,

    #[command(flatten)]
    pub(crate) settings: Settings,

    /// Seed of procedural scenes
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Small scenes and images and few frames: enough to see that everything works
    #[arg(long)]
    pub(crate) quick: bool,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/power-study")]
    pub(crate) out: PathBuf,
}
