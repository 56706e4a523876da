//! The command line of `cargo xtask trace`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask trace --scene model.glb --rays rays.csv --out hits.csv
      The best tree and the fastest kernel there are.
  cargo xtask trace --scene city:200k --rays rays.bin --builder sbvh --kernel scalar --out hits.npy
      A binary file of rays, one of the builders, the scalar kernel, a file for numpy.load.

Rays are a CSV file (.csv) whose first line names its columns, in any order:
  origin_x,origin_y,origin_z,t_min,direction_x,direction_y,direction_z,t_max
(or ox,oy,oz,tmin,dx,dy,dz,tmax; t_min and t_max may be missing and are then 0 and inf; other columns
are ignored), or any other file of 32-byte records: those eight in that order as little-endian
32-bit floats. Directions need not be normalised; t counts in their lengths.

Hits are t, u, v and primitive of each ray in order; inf, 0, 0 and -1 for a miss. u and v are the
barycentric weights of the second and third vertex. A .npy file holds records of those names, three
32-bit floats and a 32-bit integer. Primitives are numbered in the order of the scene's triangles.";

/// Arguments of `cargo xtask trace`.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct TraceArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles (city:200k)
    #[arg(long, value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scene: String,

    /// The rays: .csv, or binary records
    #[arg(long, value_name = "FILE")]
    pub(crate) rays: PathBuf,

    /// Where the hits go: .csv or .npy
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,

    /// One builder, as in bench: bonsai_p, niwaki:fast, embree:high
    #[arg(long, value_name = "NAME", default_value = "best")]
    pub(crate) builder: String,

    /// scalar, sse42, avx2, avx512, binary (the reference over the binary tree) or brute (every triangle
    /// for every ray) [default: the fastest that this processor has]
    #[arg(long, value_name = "NAME")]
    pub(crate) kernel: Option<String>,

    /// Children a node: 4, 8 or 16 [default: what suits the kernel]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(4..=16))]
    pub(crate) width: Option<u8>,

    /// What is guaranteed
    #[arg(long, value_enum, default_value = "watertight")]
    pub(crate) mode: Mode,

    /// Number of threads [default: all that this process may use]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Seed of procedural scenes
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

/// What a kernel guarantees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mode {
    /// No ray from inside a closed surface passes between two triangles
    Watertight,
    /// Every triangle is tested by itself: a ray aimed at a shared edge may pass between two
    Fast,
}

impl Mode {
    /// As the kernels call it.
    pub(crate) const fn of_scene(self) -> niwaki_trace::Mode {
        match self {
            Self::Watertight => niwaki_trace::Mode::Watertight,
            Self::Fast => niwaki_trace::Mode::Fast,
        }
    }
}
