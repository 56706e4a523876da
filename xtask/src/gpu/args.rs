//! The command line of `cargo xtask gpu`.

use crate::cli::parse_count;
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask gpu
      On a GPU: a generated city of 1, 4 and 10 million triangles, builds and rays; minutes. On a
      software driver: one of 50,000.
  cargo xtask gpu --scene sponza.glb --scene model.obj
      Your own scenes.
  cargo xtask gpu --no-traces --triangles 1M,2M,4M,8M,16M
      How the build of the linear BVH scales, stage by stage.
  cargo xtask gpu --scene model.glb --trees best --layouts wide --no-builds --ray-count 4M
      One tree in one layout against the driver, with more rays in flight.

Builds: the linear BVH on the GPU with codes of 30 and of 63 bits, from vertices to finished nodes;
the same tree on the CPU; and the driver's acceleration structures, asked for fast tracing and for
fast building. Rays: camera, ambient occlusion, bounces and shadows of a path tracer, through our
kernels (binary and quantised eight-wide trees, watertight and fast, one ray a thread and persistent
threads) and through the driver's own ray tracing where it has any (ray-tracing pipeline, ray query).

Before anything is timed, every tree from the GPU is compared with the CPU's, bit for bit, and
answers of every kernel with those of the scalar CPU kernel; differences are settled in exact
arithmetic. Times are the device's own (timestamps), medians of measurements in turns (A B C, A B C).
What does not fit a device's limits gets a row that says what it would take.

Output (in --out): gpu.json, gpu.html and csv/*.csv. NIWAKI_VULKAN_DEVICE chooses one of several
devices, by a part of its name or by its number; ci/setup-vulkan.sh installs a software one on Debian,
and ci/setup-mesa-ray-tracing.sh one with ray tracing.

The exit code is 1 if a scene could not be loaded, or a tree or an answer of ours was wrong.";

/// Arguments of `cargo xtask gpu`.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct GpuArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles (city:200k);
    /// may be repeated [default: city, in each size of --triangles]
    #[arg(long = "scene", value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scenes: Vec<String>,

    /// All files below a folder that can be loaded
    #[arg(long = "scenes", value_name = "DIR")]
    pub(crate) folders: Vec<PathBuf>,

    /// Sizes of procedural scenes that are named without a number, comma-separated [default:
    /// 1M,4M,10M; 50k on a software driver; 10k with --quick]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', value_parser = parse_count)]
    pub(crate) triangles: Vec<usize>,

    /// Builders of ours whose trees are traced, comma-separated
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "lbvh,bonsai_p,best")]
    pub(crate) trees: Vec<String>,

    /// Layouts, comma-separated: binary (32 bytes a node), wide (eight quantised children, 96 bytes)
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "binary,wide",
          value_parser = ["binary", "wide"])]
    pub(crate) layouts: Vec<String>,

    /// Triangle tests, comma-separated
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "watertight,fast",
          value_parser = ["watertight", "fast"])]
    pub(crate) modes: Vec<String>,

    /// Which thread traces which ray, comma-separated: thread (each one ray), persistent (a fixed
    /// number of workgroups take rays until there are none)
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "thread,persistent",
          value_parser = ["thread", "persistent"])]
    pub(crate) schedules: Vec<String>,

    /// Workgroups of persistent threads: as many as the device runs at once are best, some eight a
    /// multiprocessor [default: 1056; on a software driver 4 a core]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=65535))]
    pub(crate) groups: Option<u32>,

    /// Ray sets, comma-separated: camera, shadow, ao, bounce (all bounces together), bounce1 to
    /// bounce4, or all (the first four)
    #[arg(long, value_name = "SETS", value_delimiter = ',', default_value = "camera,ao,bounce,shadow",
          value_parser = ["camera", "shadow", "ao", "bounce", "bounce1", "bounce2", "bounce3",
                          "bounce4", "all"])]
    pub(crate) rays: Vec<String>,

    /// Rays per set, at most [default: 1M; 100k on a software driver; 10k with --quick]
    #[arg(long, value_name = "NUMBER", value_parser = parse_count)]
    pub(crate) ray_count: Option<usize>,

    /// Scenes of more triangles are built, not traced: trees of the CPU take minutes there
    #[arg(long, value_name = "NUMBER", value_parser = parse_count, default_value = "5M")]
    pub(crate) trace_up_to: usize,

    /// Trace nothing
    #[arg(long, conflicts_with = "no_builds")]
    pub(crate) no_traces: bool,

    /// Build nothing but what is traced
    #[arg(long)]
    pub(crate) no_builds: bool,

    /// Shorter measurements, fewer rays, smaller procedural scenes: enough to see that everything
    /// works
    #[arg(long)]
    pub(crate) quick: bool,

    /// Measure as on a device that can bind no more than so many MiB at once
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..=1_048_576))]
    pub(crate) binding_limit: Option<u64>,

    /// Seed of procedural scenes and of recorded rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/gpu")]
    pub(crate) out: PathBuf,
}
