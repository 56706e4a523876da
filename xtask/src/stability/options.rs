//! What the command and its workers are told.

use super::engines::{Engine, is_watertight};
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

pub(super) const EXAMPLES: &str = "\
Examples:
  cargo xtask stability
      The whole catalogue: every builder and kernel, and the peers; some 20 minutes on two cores.
  cargo xtask stability --resume
      Goes on where such a run was ended.
  cargo xtask stability --only integer_grid,closed_box --builders bonsai_p
      Two cases and one builder.
  cargo xtask stability --long
      A billion rays from inside closed surfaces through the watertight kernels: about an hour of
      one core more, shared by the processes.
  cargo xtask stability --quick
      Few rays, for continuous integration.

Output (in --out): stability.html (open it in a browser; it needs nothing else), stability.json with
every row, csv/*.csv; journal.jsonl has what is known so far, a line an engine and case.

Answers are compared with exact arithmetic: `wrong` is what no rounding excuses, `rounding` a hit
that was lost or gained within a few units in the last place of a border. From inside a closed
surface no ray may get out; each that does is a leak. docs/stability.md explains the columns.

The exit code is 1 if anything of ours is wrong, panics, crashes or hangs, if a watertight kernel
leaks, or if a builder of ours refuses a case.";

/// What workers have to know as well.
#[derive(Args, Clone, Debug)]
pub(crate) struct StabilityOptions {
    /// Our builders to try, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) builders: Vec<String>,

    /// Rays a case that are compared with exact answers, at most [default: 4400, with --quick 440]
    #[arg(long, value_parser = crate::cli::parse_count, value_name = "COUNT")]
    rays: Option<usize>,

    /// Rays from inside closed surfaces, all surfaces together, that the watertight kernels over
    /// the tree of bonsai_p share, each with rays of its own; a million at most through each fast one
    /// and each structure of a peer, 200,000 through kernels over other trees [default: 10M, with
    /// --quick 100k]
    #[arg(long, value_parser = crate::cli::parse_count, value_name = "COUNT")]
    leak_rays: Option<usize>,

    /// A billion of those rays: --leak-rays 1000M
    #[arg(long, conflicts_with_all = ["leak_rays", "quick"])]
    long: bool,

    /// Few rays
    #[arg(long)]
    quick: bool,

    /// Seed of rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Leave Embree and obvhs out
    #[arg(long)]
    pub(crate) no_peers: bool,
}

impl StabilityOptions {
    pub(crate) fn rays(&self) -> usize {
        self.rays.unwrap_or(if self.quick { 440 } else { 4400 })
    }

    /// Rays from inside one of so many closed surfaces, which has `triangles`.
    pub(crate) fn leak_rays(
        &self,
        surfaces: usize,
        triangles: usize,
        engine: &Engine,
        kernel: &str,
    ) -> usize {
        const BRUTE_FORCE_TESTS: usize = 40_000_000;
        let total = match (self.leak_rays, self.long, self.quick) {
            (Some(total), ..) => total,
            (None, true, _) => 1_000_000_000,
            (None, false, true) => 100_000,
            (None, false, false) => 10_000_000,
        };
        let most = match engine {
            Engine::Ours(_) => match share(engine, kernel) {
                Some((_, sharing)) => total.div_ceil(sharing),
                None if engine.is_main() => total.min(1_000_000),
                None => total.min(200_000),
            },
            _ => total.min(1_000_000),
        };
        let count = most.div_ceil(surfaces);
        match engine {
            Engine::BruteForce => count.min(BRUTE_FORCE_TESTS / triangles.max(1)),
            _ => count,
        }
    }

    /// The seed of those rays: the same for all kernels, except for those that share a number.
    pub(crate) fn leak_seed(&self, engine: &Engine, kernel: &str) -> u64 {
        let place = share(engine, kernel).map_or(0, |(place, _)| place);
        self.seed + ((place as u64) << 32)
    }

    /// The arguments that say the same to a worker.
    pub(super) fn arguments(&self) -> Vec<String> {
        let mut arguments = Vec::new();
        let mut add = |name: &str, value: Option<String>| {
            arguments.push(name.to_owned());
            arguments.extend(value);
        };
        add("--seed", Some(self.seed.to_string()));
        if !self.builders.is_empty() {
            add("--builders", Some(self.builders.join(",")));
        }
        if let Some(rays) = self.rays {
            add("--rays", Some(rays.to_string()));
        }
        if let Some(rays) = self.leak_rays {
            add("--leak-rays", Some(rays.to_string()));
        }
        for (name, is_set) in
            [("--long", self.long), ("--quick", self.quick), ("--no-peers", self.no_peers)]
        {
            if is_set {
                add(name, None);
            }
        }
        arguments
    }
}

/// Which of the kernels that share rays it is, and how many they are.
fn share(engine: &Engine, kernel: &str) -> Option<(usize, usize)> {
    let mut sharing = if engine.is_main() { engine.kernels() } else { Vec::new() };
    sharing.retain(|name| is_watertight(name));
    let place = sharing.iter().position(|name| name == kernel)?;
    Some((place, sharing.len()))
}

/// Arguments of `cargo xtask stability`.
///
/// Every case of the catalogue of hard cases is given to every builder under every kernel, to Embree
/// and to obvhs, in processes of their own that are watched: counted are wrong answers, leaks of
/// closed surfaces, panics, crashes and hangs.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct StabilityArgs {
    #[command(flatten)]
    pub(super) options: StabilityOptions,

    /// Only these cases, separated by commas [default: all; --list names them]
    #[arg(long, value_delimiter = ',', value_name = "CASES")]
    pub(super) only: Vec<String>,

    /// Processes at a time [default: as many as this process may use hardware threads]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024), value_name = "NUMBER")]
    pub(super) jobs: Option<u16>,

    /// Seconds without a sign of life after which a process counts as hanging
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..), default_value_t = 120,
          value_name = "SECONDS")]
    patience: u64,

    /// Seconds of a processor that a structure of a peer may take for a case, the time of judging
    /// its answers apart; then it counts as hanging. Ours may take as long as they like
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..), default_value_t = 30,
          value_name = "SECONDS")]
    peer_limit: u64,

    /// Fail if Embree is not there (by default it is left out with a note)
    #[arg(long, conflicts_with = "no_peers")]
    pub(super) peers: bool,

    /// Keep what the journal in --out has of a run with the same options, and do the rest
    #[arg(long)]
    pub(super) resume: bool,

    /// Folder for the report
    #[arg(long, default_value = "out/stability", value_name = "DIR")]
    pub(super) out: PathBuf,

    /// Print the cases and what is hard about them, and stop
    #[arg(long)]
    pub(super) list: bool,
}

impl StabilityArgs {
    pub(super) const fn patience(&self) -> Duration {
        Duration::from_secs(self.patience)
    }

    pub(super) const fn peer_limit(&self) -> Duration {
        Duration::from_secs(self.peer_limit)
    }
}
