//! The command line.

use crate::bench::Shard;
use crate::gpu::GpuArgs;
use crate::kernel::Collapse;
use crate::power::PowerArgs;
use crate::power::source::PowerSource;
use crate::render::{RenderArgs, Size};
use crate::stability::{StabilityArgs, StabilityOptions};
use crate::thesis::ThesisArgs;
use crate::trace::TraceArgs;
use crate::tune::TuneArgs;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Niwaki's commands.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", max_term_width = 100)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Compare builders: how fast they build, how good their trees are, how fast rays go.
    Bench(Box<BenchArgs>),
    /// Show what quality costs in time: the main knobs of every builder swept, or every kernel.
    Accuracy(AccuracyArgs),
    /// Measure builds and rays on the GPU, beside the driver's own ray tracing.
    Gpu(Box<GpuArgs>),
    /// Merge results files into one report.
    Report(ReportArgs),
    /// Measure what frames cost in joules: six algorithms on this device, recordings, traces of meters.
    Power(Box<PowerArgs>),
    /// Draw pictures of a scene: by the hybrid renderer on the GPU, or references on the CPU.
    Render(Box<RenderArgs>),
    /// Regenerate the thesis's tables of builders beside the published values.
    Thesis(Box<ThesisArgs>),
    /// Answer rays from a file: what each hits first, through a chosen tree and kernel.
    Trace(Box<TraceArgs>),
    /// Keep a frame time: an analytical model of the GPU and controllers, compared along camera paths.
    Tune(Box<TuneArgs>),
    /// Check every builder and kernel against brute force, Embree and obvhs.
    Verify(VerifyArgs),
    /// Give hard cases to every builder, kernel and peer, each in a process that is watched.
    Stability(StabilityArgs),
    /// What `stability` starts.
    #[command(hide = true)]
    StabilityWorker(StabilityOptions),
}

const BENCH_EXAMPLES: &str = "\
Examples:
  cargo xtask bench
      Seven procedural scenes, every builder of ours, all cores; a few minutes on two cores.
  cargo xtask bench --scene model.glb --threads 1,2
      Your own scene (.obj, .gltf, .glb, each also packed as .zst), at one and at two threads.
  cargo xtask bench --scene city:1000000 --scene hair:3M --builders sweep,bonsai_p,embree
      Procedural scenes of a chosen size; only some builders.
  cargo xtask bench --scenes models --shard 2/8 --out out/shard2
      The second of eight parts of the matrix of all scenes below a folder, for a job scheduler.
      Afterwards: cargo xtask report out/shard*/results.json

Output (in --out): results.json, report.html (open it in a browser; it needs nothing else),
csv/*.csv and pictures/*.png. results.json is written after each scene, so an interrupted run can
still be turned into a report by `cargo xtask report`.

Every measurement is taken alternately with its rivals in one process (A B C, A B C, ...), on the
same recorded path-tracing rays and the same threads; reported are medians. Compare ratios, not
milliseconds of different runs. Embree joins in if EMBREE_LIBRARY names its library or the system
has it; ci/setup-embree.sh installs it.

The exit code is 1 if a scene could not be loaded or a builder of ours failed; the rest is measured
all the same.";

/// Arguments of `cargo xtask bench`.
#[derive(Args, Clone, Debug)]
#[command(after_help = BENCH_EXAMPLES)]
pub(crate) struct BenchArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles (city:200k);
    /// may be repeated [default: all procedural scenes]
    #[arg(long = "scene", value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scenes: Vec<String>,

    /// All files below a folder that can be loaded
    #[arg(long = "scenes", value_name = "DIR")]
    pub(crate) folders: Vec<PathBuf>,

    /// Builders, comma-separated: names (bonsai_p), peers' presets (embree:medium, obvhs:fast), or
    /// groups (niwaki, embree, obvhs, all) [default: sweep, binned, lbvh, the three bonsai,
    /// embree:medium and obvhs:medium]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) builders: Vec<String>,

    /// Numbers of threads, comma-separated [default: all that this process may use]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',',
          value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Vec<u16>,

    /// Ray sets, comma-separated: camera, shadow, ao, bounce (all bounces together), bounce1 to
    /// bounce4, or all (the first four)
    #[arg(long, value_name = "SETS", value_delimiter = ',', default_value = "camera,bounce",
          value_parser = ["camera", "shadow", "ao", "bounce", "bounce1", "bounce2", "bounce3",
                          "bounce4", "all"])]
    pub(crate) rays: Vec<String>,

    /// Our traversal kernels, comma-separated: scalar, sse42_4, avx2, avx512, or watertight for the best
    /// that this processor has [default: watertight]
    ///
    /// Behind the instructions may stand, in this order:
    ///
    /// - the children of a node: _4 (scalar_4, sse42_4, avx2_4) or _16 (scalar_16, avx512_16); 8 without;
    ///
    /// - _quantised for nodes of half the size (avx512_quantised; quantised for the best);
    ///
    /// - _fast for the mode that is not watertight (avx512_fast, avx2_4_fast; fast for the best);
    ///
    /// - _batch for calls with 1024 rays each (avx512_batch, fast_batch); without it, rays are asked
    ///   for one by one, as peers are.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) kernels: Vec<String>,

    /// How binary trees become wide ones
    #[arg(long, value_enum, default_value_t)]
    pub(crate) collapse: Collapse,

    /// Measure Embree's robust mode besides its default one
    #[arg(long)]
    pub(crate) robust: bool,

    /// More of the configuration of Embree's device, such as max_isa=avx2 or max_isa=sse4.2; the
    /// instructions that it then says it uses stand beside its version in the report
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub(crate) embree_config: String,

    /// Rays per set, at most [default: 200000, with --quick 50000]
    #[arg(long, value_name = "NUMBER", value_parser = parse_count)]
    pub(crate) ray_count: Option<usize>,

    /// Shorter measurements (0.1 s instead of 0.5 s), fewer rays, smaller procedural scenes:
    /// enough to see that everything works
    ///
    /// What has taken 300 times as long in all (30 s, 150 s without this) is not measured again; the
    /// report says how often each was.
    #[arg(long)]
    pub(crate) quick: bool,

    /// Triangles of procedural scenes that are named without a number [default: 100k, with
    /// --quick 10k]
    #[arg(long, value_name = "NUMBER", value_parser = parse_count)]
    pub(crate) triangles: Option<usize>,

    /// Seed of procedural scenes and of recorded rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/bench")]
    pub(crate) out: PathBuf,

    /// Write the results to this file too
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,

    /// Measure only the K-th of N parts; a scene at one number of threads is never divided
    #[arg(long, value_name = "K/N")]
    pub(crate) shard: Option<Shard>,

    /// Fail if Embree is not there (by default it is left out with a note)
    #[arg(long, overrides_with = "no_peers")]
    pub(crate) peers: bool,

    /// Compare our own builders only
    #[arg(long)]
    pub(crate) no_peers: bool,

    /// Leave pictures out of the report
    #[arg(long)]
    pub(crate) no_pictures: bool,

    /// Paths per pixel of the picture of each scene [default: 32, with --quick 4]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) samples: Option<u32>,

    /// Credit shown under pictures: NAME=TEXT for one scene, or TEXT for all; may be repeated. Files
    /// named like the scene with .credit.txt or .txt, or a LICENSE.txt beside it, are read otherwise
    #[arg(long = "credit", value_name = "[NAME=]TEXT")]
    pub(crate) credits: Vec<String>,

    /// Print what would be measured, and stop
    #[arg(long)]
    pub(crate) list: bool,
}

const REPORT_EXAMPLES: &str = "\
Example:
  cargo xtask report out/shard1/results.json out/shard2/results.json --out out/whole

Pictures are read from where the results files say, so keep the folders as the bench wrote them.";

const ACCURACY_EXAMPLES: &str = "\
Examples:
  cargo xtask accuracy
      The main knobs of every builder on three procedural scenes, all cores; about ten minutes on two.
  cargo xtask accuracy --scene model.glb --families bonsai,sbvh,preset
      Your own scene; some families of builders.
  cargo xtask accuracy --scenes models --families preset
      The presets alone on all scenes below a folder: fits the cost model by which
      Preset::for_rays chooses, and shows the fit.

  cargo xtask accuracy --suite kernels
      Kernels instead of builders: every width, fast, watertight, scalar, f64, Embree and obvhs, one
      ray a call on one thread. Leaks of a million rays at corners and edges of closed surfaces,
      errors of distances against exact arithmetic, and the time of each kind of ray.

  cargo xtask accuracy --suite hybrid
      The hybrid renderer: error of the picture against time of the frame on the GPU, as the size of
      the traced region, the map, the march, the depth and more change one by one, for the presets,
      and on a grid; five procedural scenes. On a software driver about an hour.
  cargo xtask accuracy --suite hybrid --scene model.glb --families region,map --size 1280x720
      Your own scene, two of the knobs.

  cargo xtask accuracy --suite shadows
      Shadow volumes, shadow maps and variance shadow maps: error of shadows against exact ones by
      rays, over map resolution, filter and bias, and the time of the frame on the GPU; where the
      device has a meter (--source), also energy per pixel along the camera path.

  cargo xtask accuracy --suite model
      Frames that keep their time: how coarsely views can be sampled before predictions of their times
      suffer, against processor time; and what directions of ambient occlusion, their radius and shadow
      rays are worth, against the time of the frame.
  cargo xtask accuracy --suite model --device geforce-580 --families sampling --scene model.glb
      Your own scene on a simulated device, sampling alone.

Output (in --out): accuracy.json, accuracy.html and csv/*.csv; of renderers also
pictures/*.png, the worst artifact of each scene with the setting that removes it. In the suite of builders a point is a tree: build time up to
the traversable 8-wide tree against time per ray of an equal mix of the ray sets, SAH, end-point
overlap (EPO) and leaf count variability (LCV). Points that no other beats in both times are on the
Pareto front. Correlations are of logarithms, between a metric and the time per ray, over all trees
of a scene.";

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Suite {
    /// Builders and their knobs: build time against trace time, SAH, EPO and LCV.
    Builders,
    /// Our kernels and the peers': time against leaks and against errors of distances.
    Kernels,
    /// Settings of the hybrid renderer: time of frames against error of pictures. Needs a Vulkan
    /// device.
    Hybrid,
    /// Shadow volumes, shadow maps and variance shadow maps over resolution, filter and bias: time
    /// of frames against error of shadows. Needs a Vulkan device.
    Shadows,
    /// The ray tracer that keeps its frame time: sampling of views against error of predictions, and rays of
    /// ambient occlusion and shadow against error of pictures. Needs a Vulkan device, or simulates one.
    Model,
}

/// Arguments of `cargo xtask accuracy`.
#[derive(Args, Clone, Debug)]
#[command(after_help = ACCURACY_EXAMPLES)]
pub(crate) struct AccuracyArgs {
    /// What is compared
    #[arg(long, value_enum, default_value = "builders")]
    pub(crate) suite: Suite,

    /// A file, or the name of a procedural scene with an optional number of triangles (city:200k);
    /// may be repeated [default: dragon, atrium and foliage; for hybrid chess, gallery, atrium,
    /// courtyard and one_mirror; for shadows serpents and tessellated; for model fairy, cabin and
    /// atrium]
    #[arg(long = "scene", value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scenes: Vec<String>,

    /// All files below a folder that can be loaded
    #[arg(long = "scenes", value_name = "DIR")]
    pub(crate) folders: Vec<PathBuf>,

    /// Families of builders, or knobs of the renderers, comma-separated (a name that is none
    /// lists them) [default: all]; not for the suite of kernels
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) families: Vec<String>,

    /// Width and height of pictures, for hybrid, shadows and model [default: 320x180, with --quick
    /// 96x54, for model 64x36]
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    pub(crate) size: Option<Size>,

    /// Frames that are compared, spread over the camera path, for hybrid, shadows and model [default: 3,
    /// with --quick 1]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=100))]
    pub(crate) frames: Option<u32>,

    /// The device of the suite model: vulkan, or a simulated one [default: vulkan]
    #[arg(long, value_name = "NAME",
          value_parser = ["vulkan", "geforce-8800", "geforce-580", "radeon-5870"])]
    pub(crate) device: Option<String>,

    /// Number of threads [default: all that this process may use, for kernels 1]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// The meter by which energy per pixel is measured, for shadows: auto (that of the device that
    /// renders, if there is one), none, rapl (rapl:FOLDER) or nvml (nvml:NUMBER)
    #[arg(long, value_name = "SOURCE", default_value = "auto")]
    pub(crate) source: PowerSource,

    /// Shorter measurements (0.1 s instead of 0.5 s), fewer rays, smaller procedural scenes; of knobs
    /// of the hybrid renderer only the ends, on one small scene
    #[arg(long)]
    pub(crate) quick: bool,

    /// Seed of procedural scenes and of recorded rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/accuracy")]
    pub(crate) out: PathBuf,
}

/// Arguments of `cargo xtask report`.
#[derive(Args, Clone, Debug)]
#[command(after_help = REPORT_EXAMPLES)]
pub(crate) struct ReportArgs {
    /// Results files of `cargo xtask bench`
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,

    /// Where the report goes: report.html, results.json (merged) and csv/*.csv
    #[arg(long, value_name = "DIR", default_value = "out/report")]
    pub(crate) out: PathBuf,
}

/// A count such as `250000`, `250k`, `1.5M`.
pub(crate) fn parse_count(text: &str) -> Result<usize, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((at, 'k' | 'K')) => (&text[..at], 1e3),
        Some((at, 'm' | 'M')) => (&text[..at], 1e6),
        _ => (text, 1.0),
    };
    let number: f64 = digits.replace('_', "").parse().map_err(|_| {
        format!("`{text}` is not a count; write a number such as 250000, 250k or 1.5M")
    })?;
    let count = (number * unit).round();
    if !(1.0..=1e9).contains(&count) {
        return Err(format!("{text} is out of range; use 1 to 1000M"));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 1e9")]
    Ok(count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn counts_have_units() {
        assert_eq!(parse_count("250000"), Ok(250_000));
        assert_eq!(parse_count("250k"), Ok(250_000));
        assert_eq!(parse_count("1.5M"), Ok(1_500_000));
        for bad in ["", "k", "-3", "0", "1e99", "many", "nan"] {
            assert!(parse_count(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn repeated_scenes_and_lists_are_read() {
        let cli = Cli::try_parse_from([
            "xtask",
            "bench",
            "--scene",
            "a.glb",
            "--scene",
            "city:1M",
            "--threads",
            "1,2",
            "--builders",
            "sweep,embree:medium",
            "--rays",
            "camera,ao",
            "--shard",
            "2/3",
        ])
        .unwrap();
        let Command::Bench(args) = cli.command else { panic!("not a bench") };
        assert_eq!(args.scenes, ["a.glb", "city:1M"]);
        assert_eq!(args.threads, [1, 2]);
        assert_eq!(args.rays, ["camera", "ao"]);
        assert_eq!(args.shard, Some(Shard { part: 2, parts: 3 }));
        for bad in [&["--threads", "0"][..], &["--rays", "sideways"], &["--shard", "4/3"]] {
            assert!(Cli::try_parse_from([&["xtask", "bench"], bad].concat()).is_err(), "{bad:?}");
        }
    }
}

const VERIFY_EXAMPLES: &str = "\
Examples:
  cargo xtask verify
      Hard cases and the procedural scenes.
  cargo xtask verify --scene model.glb --scene city:1M
      Also a scene of your own, and a procedural one of a million triangles.
  cargo xtask verify --scenes models --no-hard-cases
      Every scene below a folder.
  cargo xtask verify --quick
      A smaller run of everything, for continuous integration.

docs/verify.md says what is proved and how disagreements are settled.

The exit code is 1 if anything is settled as `ours wrong`, invalid or not deterministic, or if a
scene cannot be loaded.";

/// Arguments of `cargo xtask verify`.
///
/// Trees are validated and built on 1, 2, 3 and 8 threads (with --quick 1 and 3), which must give the
/// same bytes. Hits are
/// compared with brute force on the catalogue of hard cases, and with the peers on full scenes.
/// Every disagreement is settled in exact arithmetic as tie, rounding, peer wrong or ours wrong.
#[derive(Args, Clone, Debug)]
#[command(after_help = VERIFY_EXAMPLES)]
pub(crate) struct VerifyArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles (city:200k);
    /// may be repeated [default: all procedural scenes]
    #[arg(long = "scene", value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scenes: Vec<String>,

    /// All files below a folder that can be loaded
    #[arg(long = "scenes", value_name = "DIR")]
    pub(crate) folders: Vec<PathBuf>,

    /// Our builders to check, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) builders: Vec<String>,

    /// Rays a scene, of all kinds together [default: 1M, with --quick 50k]
    #[arg(long, value_parser = parse_count, value_name = "COUNT")]
    pub(crate) rays: Option<usize>,

    /// Seed of procedural scenes and rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Smaller procedural scenes, fewer rays and numbers of threads
    #[arg(long)]
    pub(crate) quick: bool,

    /// Leave the hard cases out
    #[arg(long)]
    pub(crate) no_hard_cases: bool,

    /// Folder for verify.json
    #[arg(long, default_value = "out/verify", value_name = "DIR")]
    pub(crate) out: PathBuf,
}
