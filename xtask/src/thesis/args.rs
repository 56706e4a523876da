//! The arguments of `cargo xtask thesis`.

use crate::cli::parse_count;
use crate::kernel::Collapse;
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask thesis
      Every scene by a procedural stand-in of at most 200,000 triangles.
  cargo xtask thesis --scenes models
      The same with the scenes that lie below a folder, recognised by their names (sponza.gltf,
      San_Miguel.obj, crown.glb, ...); stand-ins for the rest.
  cargo xtask thesis --scenes models --only sponza,conference
      Two scenes.
  cargo xtask thesis --scenes models --no-stand-ins --threads 8
      Only the scenes that are there, on eight threads as in the papers.
  cargo xtask thesis --quick
      Small stand-ins and short measurements, for continuous integration.

Output (in --out): thesis.html (open it in a browser; it needs nothing else), thesis.json, csv/*.csv
and results.json (the rows behind it, for `cargo xtask report`). All are written after each scene, so
an interrupted run leaves what it had.

Every cell shows the published value beside the measured one, both relative to sweep SAH of the same
table. `·` means that the scene or builder was not measured. docs/thesis.md says what differs from
the papers and why.

The exit code is 1 if a scene could not be loaded or a builder of ours failed. Orderings that do not
hold are listed and do not change it: they are what the command is there to find.";

/// Arguments of `cargo xtask thesis`.
///
/// Regenerates the result tables of the thesis's papers IV (figures 5 to 8) and V (tables 1 to 5,
/// figure 4), side by side with the published values, and checks whether the order of the builders
/// is the published one.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ThesisArgs {
    /// A file of one of the papers' scenes, recognised by its name, or a procedural scene with a
    /// number of triangles (city:1M), which sets the size of stand-ins of that kind; may be repeated
    #[arg(long = "scene", value_name = "FILE|NAME:TRIANGLES")]
    pub(crate) scenes: Vec<String>,

    /// All files below a folder that can be loaded and are of the papers
    #[arg(long = "scenes", value_name = "DIR")]
    pub(crate) folders: Vec<PathBuf>,

    /// Only these scenes of the papers, comma-separated (sponza,"San Miguel") [default: all]
    #[arg(long, value_name = "SCENES", value_delimiter = ',')]
    pub(crate) only: Vec<String>,

    /// Leave out scenes that would need a procedural stand-in
    #[arg(long)]
    pub(crate) no_stand_ins: bool,

    /// Triangles of a stand-in, at most; fewer if the scene had fewer [default: 200k, with
    /// --quick 4k]
    #[arg(long, value_name = "NUMBER", value_parser = parse_count)]
    pub(crate) triangles: Option<usize>,

    /// Number of threads; figure 4 of paper V goes up to it [default: all that this process may use]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Rays per set (camera, bounce), at most [default: 200000, with --quick 10000]
    #[arg(long, value_name = "NUMBER", value_parser = parse_count)]
    pub(crate) ray_count: Option<usize>,

    /// How binary trees become 8-wide ones
    #[arg(long, value_enum, default_value_t = Collapse::Greedy)]
    pub(crate) collapse: Collapse,

    /// Small stand-ins, fewer rays, short measurements (0.02 s instead of 0.5 s): enough to see
    /// that everything works, too little to judge
    #[arg(long)]
    pub(crate) quick: bool,

    /// Seed of procedural scenes and of recorded rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Where results go
    #[arg(long, value_name = "DIR", default_value = "out/thesis")]
    pub(crate) out: PathBuf,

    /// Fail if Embree is not there (by default it is left out with a note)
    #[arg(long, overrides_with = "no_peers")]
    pub(crate) peers: bool,

    /// Leave Embree out
    #[arg(long)]
    pub(crate) no_peers: bool,

    /// Print what would be measured, and stop
    #[arg(long)]
    pub(crate) list: bool,
}

impl ThesisArgs {
    /// Triangles of stand-ins, at most.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles.unwrap_or(if self.quick { 4_000 } else { 200_000 })
    }

    /// Rays of a set, at most.
    pub(crate) fn ray_count(&self) -> usize {
        self.ray_count.unwrap_or(if self.quick { 10_000 } else { 200_000 })
    }

    /// Least time of each measurement.
    pub(crate) const fn seconds(&self) -> f64 {
        if self.quick { 0.02 } else { 0.5 }
    }
}

#[cfg(test)]
impl Default for ThesisArgs {
    fn default() -> Self {
        Self {
            scenes: Vec::new(),
            folders: Vec::new(),
            only: Vec::new(),
            no_stand_ins: false,
            triangles: None,
            threads: None,
            ray_count: None,
            collapse: Collapse::Greedy,
            quick: false,
            seed: 1,
            out: PathBuf::from("out/thesis"),
            peers: false,
            no_peers: false,
            list: false,
        }
    }
}
