//! The command line of `cargo xtask power`.

use super::source::PowerSource;
use super::study::StudyArgs;
use crate::render::Size;
use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand, ValueEnum};
use niwaki_power::{AnalysisOptions, IdlePolicy, Rail, SyncMethod};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask power demo
      Generates a trace whose truth is known, analyses it, and prints both side by side.
  cargo xtask power analyze trace.dump --frames frames.jsonl
      A dump of PowerSensor3 and the log that the renderer wrote meanwhile.
  cargo xtask power analyze trace.csv --frames frames.csv --volts slot12=12,aux1=12 --idle outside
      Currents in CSV (columns slot12_a, aux1_a) on rails of constant voltage; idle power subtracted.
  cargo xtask power record --frames frames.jsonl -- ./renderer --log frames.jsonl
      Records with the meters of this machine (NVML, RAPL) while the renderer runs, then analyses.
  cargo xtask power study
      The paper's six algorithms on this device, and what it answers to the paper's questions.

Traces: CSV with a column of time (time_s, time_ms, time_us or time_ns), columns of samples whose names
end with their unit (_a, _v, _w, or _j for counters of energy) and perhaps a column mark; dumps of
PowerSensor3; or the binary form that record and demo write. Frame logs: JSON lines or CSV; the
README of crates/power describes both.

Output (in --out): power.html (open it in a browser; it needs nothing else), power.json and csv/*.csv.";

/// Arguments of `cargo xtask power`.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct PowerArgs {
    #[command(subcommand)]
    pub(crate) command: PowerCommand,
}

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum PowerCommand {
    /// Generate a trace with known truth, analyse it in every way, and compare
    Demo(DemoArgs),
    /// Analyse a trace, with the renderer's frame log if there is one
    Analyze(AnalyzeArgs),
    /// Record the power of this machine while a command runs, then analyse
    Record(RecordArgs),
    /// Render by the paper's six algorithms on this device: what each takes in time, and in energy where
    /// there is a meter
    Study(StudyArgs),
}

/// Arguments of `demo`.
#[derive(Args, Clone, Debug)]
pub(crate) struct DemoArgs {
    /// Frames of each algorithm
    #[arg(long, default_value_t = 240, value_parser = clap::value_parser!(u32).range(16..=100_000))]
    pub(crate) frames: u32,

    /// Seed of the generator
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Also write the trace and its frame log here, in the format of the ending: .npt (binary), .csv or
    /// .dump (PowerSensor3)
    #[arg(long, value_name = "FILE")]
    pub(crate) save: Option<PathBuf>,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/power-demo")]
    pub(crate) out: PathBuf,
}

/// Arguments of `analyze`.
#[derive(Args, Clone, Debug)]
pub(crate) struct AnalyzeArgs {
    /// The trace
    pub(crate) trace: PathBuf,

    /// The renderer's frame log
    #[arg(long, value_name = "LOG")]
    pub(crate) frames: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) settings: Settings,

    /// Size of images where there is no log to tell, such as 2560x1440
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    pub(crate) size: Option<Size>,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/power")]
    pub(crate) out: PathBuf,
}

/// Arguments of `record`.
#[derive(Args, Clone, Debug)]
pub(crate) struct RecordArgs {
    /// What runs while power is recorded; NIWAKI_FRAME_LOG in its environment names the log
    #[arg(last = true, required = true, value_name = "COMMAND")]
    pub(crate) command: Vec<String>,

    /// The log that the command writes, analysed with the trace afterwards
    #[arg(long, value_name = "LOG")]
    pub(crate) frames: Option<PathBuf>,

    /// The meter: auto (all that this machine has), rapl (the processor's counters; rapl:FOLDER below another
    /// folder, such as a container's mount of /sys/class/powercap), or nvml (nvml:NUMBER for another device)
    #[arg(long, value_name = "SOURCE", default_value = "auto")]
    pub(crate) source: PowerSource,

    /// Readings a second
    #[arg(long, default_value_t = 1000.0, value_name = "HZ")]
    pub(crate) rate: f64,

    /// Seconds to record before and after the command
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    pub(crate) margin: f64,

    #[command(flatten)]
    pub(crate) settings: Settings,

    /// Size of images where there is no log to tell, such as 2560x1440
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    pub(crate) size: Option<Size>,

    /// Where the trace and the results go
    #[arg(long, value_name = "DIR", default_value = "out/power")]
    pub(crate) out: PathBuf,
}

/// How a log and a trace are brought together.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum Sync {
    /// The first of the others that the data allow
    #[default]
    Auto,
    /// Both were stamped by one clock
    Shared,
    /// Marks in the trace
    Marker,
    /// The pattern of busy and idle
    Correlation,
    /// Idle time before the first and after the last frame
    Idle,
}

/// What `analyze`, `record` and `study` share.
#[derive(Args, Clone, Debug)]
pub(crate) struct Settings {
    /// How the log and the trace are brought together
    #[arg(long, value_enum, default_value_t)]
    pub(crate) sync: Sync,

    /// What is subtracted: keep (nothing), outside (the mean before the first and after the last frame),
    /// lowest (the lowest level of the trace), or a number of watts
    #[arg(long, default_value = "keep", value_name = "POLICY")]
    pub(crate) idle: String,

    /// Constant voltages of rails, comma-separated
    #[arg(long, value_name = "RAIL=VOLTS", value_delimiter = ',')]
    pub(crate) volts: Vec<String>,

    /// A JSON file that declares rails, calibrations and ranges, instead of names of columns
    #[arg(long, value_name = "FILE")]
    pub(crate) rails: Option<PathBuf>,
}

impl Settings {
    /// Settings of an analysis; `size` for traces without a log.
    pub(crate) fn options(&self, size: Option<Size>) -> Result<AnalysisOptions> {
        let number = |text: &str, what: &str| -> Result<f64> {
            text.parse().with_context(|| format!("{what}: {text:?} is not a number"))
        };
        let idle = match self.idle.as_str() {
            "keep" => IdlePolicy::Keep,
            "outside" => IdlePolicy::Outside,
            "lowest" => IdlePolicy::Lowest,
            watts => IdlePolicy::Watts(number(watts, "--idle (keep, outside, lowest or watts)")?),
        };
        let mut volts = Vec::new();
        for pair in &self.volts {
            let Some((rail, value)) = pair.split_once('=') else {
                bail!("--volts: {pair:?} is not RAIL=VOLTS");
            };
            volts.push((rail.to_owned(), number(value, "--volts")?));
        }
        let rails: Option<Vec<Rail>> = match &self.rails {
            None => None,
            Some(path) => {
                let text = std::fs::read_to_string(path)
                    .with_context(|| format!("cannot read {}", path.display()))?;
                let rails = serde_json::from_str(&text)
                    .with_context(|| format!("{} does not declare rails", path.display()))?;
                Some(rails)
            }
        };
        Ok(AnalysisOptions {
            rails,
            volts,
            idle,
            size: size.map(|size| (size.width, size.height)),
            sync: match self.sync {
                Sync::Auto => SyncMethod::Auto,
                Sync::Shared => SyncMethod::SharedClock,
                Sync::Marker => SyncMethod::Marker,
                Sync::Correlation => SyncMethod::Correlation,
                Sync::Idle => SyncMethod::Idle,
            },
            ..AnalysisOptions::default()
        })
    }
}
