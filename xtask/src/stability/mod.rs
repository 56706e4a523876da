//! `cargo xtask stability`: the catalogue of hard cases against every builder, kernel and peer, each
//! in a process that is watched.

mod cases;
mod engines;
mod page;
mod summary;
mod watch;
mod worker;

use crate::machine;
use crate::results::{Run, Source};
use anyhow::{Context, Result, bail};
use cases::Case;
use clap::Args;
use engines::Engine;
use indicatif::{ProgressBar, ProgressStyle};
use niwaki_peers::Embree;
use serde::Serialize;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Duration;
use watch::{End, Outcome, Watch};
use worker::Row;

const EXAMPLES: &str = "\
Examples:
  cargo xtask stability
      The whole catalogue: every builder and kernel, and the peers; some minutes on two cores.
  cargo xtask stability --only integer_grid,closed_box --builders bonsai_p
      Two cases and one builder.
  cargo xtask stability --long
      A billion rays from inside closed surfaces through each of the fastest kernels.
  cargo xtask stability --quick
      Few rays, for continuous integration.

Output (in --out): stability.html (open it in a browser; it needs nothing else), stability.json with
every row, csv/*.csv.

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

    /// Rays from inside closed surfaces, all surfaces together, through each kernel over the tree
    /// of bonsai_p; a million at most through others [default: 10M, with --quick 100k]
    #[arg(long, value_parser = crate::cli::parse_count, value_name = "COUNT")]
    leak_rays: Option<usize>,

    /// A billion rays from inside closed surfaces through each of the fastest kernels
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
        let most = if engine.is_main() && engines::is_fastest(kernel) {
            total
        } else if engine.is_main() {
            total.min(10_000_000)
        } else {
            total.min(1_000_000)
        };
        let count = most.div_ceil(surfaces);
        match engine {
            Engine::BruteForce => count.min(BRUTE_FORCE_TESTS / triangles.max(1)),
            _ => count,
        }
    }

    /// The arguments that say the same to a worker.
    fn arguments(&self) -> Vec<String> {
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

/// Arguments of `cargo xtask stability`.
///
/// Every case of the catalogue of hard cases is given to every builder under every kernel, to Embree
/// and to obvhs, in processes of their own that are watched: counted are wrong answers, leaks of
/// closed surfaces, panics, crashes and hangs.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct StabilityArgs {
    #[command(flatten)]
    options: StabilityOptions,

    /// Only these cases, separated by commas [default: all; --list names them]
    #[arg(long, value_delimiter = ',', value_name = "CASES")]
    only: Vec<String>,

    /// Processes at a time [default: as many as this process may use hardware threads]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024), value_name = "NUMBER")]
    jobs: Option<u16>,

    /// Seconds without a sign of life after which a process counts as hanging
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..), default_value_t = 120,
          value_name = "SECONDS")]
    patience: u64,

    /// Fail if Embree is not there (by default it is left out with a note)
    #[arg(long, conflicts_with = "no_peers")]
    peers: bool,

    /// Folder for the report
    #[arg(long, default_value = "out/stability", value_name = "DIR")]
    out: PathBuf,

    /// Print the cases and what is hard about them, and stop
    #[arg(long)]
    list: bool,
}

/// The answers of a kernel over the tree of a builder, or how it ended.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Finding {
    pub(crate) case: String,
    pub(crate) source: Source,
    /// Builder or preset; `none` where every triangle is tested.
    pub(crate) builder: String,
    /// Empty where a builder ended before any kernel.
    pub(crate) kernel: String,
    /// Answers, if there are any.
    #[serde(flatten)]
    pub(crate) row: Option<Row>,
    /// How it ended, if not with answers.
    pub(crate) end: Option<End>,
    /// What was said at that end.
    pub(crate) what: Option<String>,
}

/// Everything that was found.
#[derive(Debug, Serialize)]
pub(crate) struct Catalogue {
    /// Version of this file's layout.
    schema: u32,
    pub(crate) run: Run,
    /// Names, what is hard about them, and triangles.
    pub(crate) cases: Vec<(String, String, usize)>,
    pub(crate) findings: Vec<Finding>,
}

/// Runs the worker of the command.
///
/// # Errors
/// As [`worker::run`].
pub(crate) fn run_worker(options: &StabilityOptions) -> Result<ExitCode> {
    worker::run(options)
}

/// Runs the command.
///
/// # Errors
/// If a name is unknown, a worker cannot be started, or a file cannot be written.
pub(crate) fn run(args: &StabilityArgs) -> Result<ExitCode> {
    let cases = cases::all();
    if args.list {
        for case in &cases {
            println!("{:24}{} ({} triangles)", case.name(), case.why(), case.mesh().len());
        }
        return Ok(ExitCode::SUCCESS);
    }
    for name in &args.only {
        if !cases.iter().any(|case| case.name() == name) {
            bail!("`{name}` is no case; `cargo xtask stability --list` names them");
        }
    }
    let mut run = machine::describe();
    run.arguments = std::env::args().skip(1).collect();
    let mut options = args.options.clone();
    if !options.no_peers {
        match Embree::load() {
            Ok(embree) => run.peers = vec![format!("Embree {}", embree.version()), "obvhs".into()],
            Err(error) if args.peers => return Err(error).context("--peers asks for Embree"),
            Err(error) => {
                println!("Without peers: {error}");
                options.no_peers = true;
            }
        }
    }
    let engines = Engine::all(&options.builders, !options.no_peers)?;
    let chosen: Vec<usize> = (0..cases.len())
        .filter(|&i| args.only.is_empty() || args.only.iter().any(|n| n == cases[i].name()))
        .collect();
    let findings = try_all(args, &options, &cases, &chosen, &engines)?;
    let described = chosen.iter().map(|&i| &cases[i]);
    let catalogue = Catalogue {
        schema: 1,
        run,
        cases: described.map(|c| (c.name().into(), c.why().into(), c.mesh().len())).collect(),
        findings,
    };
    finish(args, &catalogue)
}

/// Tries all engines at the chosen cases, in as many processes as there are jobs.
fn try_all(
    args: &StabilityArgs,
    options: &StabilityOptions,
    cases: &[Case],
    chosen: &[usize],
    engines: &[Engine],
) -> Result<Vec<Finding>> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let arguments = options.arguments();
    let command = || {
        let mut command = Command::new(&program);
        // Jobs are the parallelism: a thread a process.
        command.arg("stability-worker").args(&arguments).env("RAYON_NUM_THREADS", "1");
        command
    };
    let jobs = args.jobs.map_or_else(machine::cores, usize::from).clamp(1, chosen.len().max(1));
    let numbers: Vec<usize> = (0..engines.len()).collect();
    let bar = ProgressBar::new((chosen.len() * engines.len()) as u64).with_style(
        ProgressStyle::with_template("{elapsed_precise} {bar:30} {pos}/{len} {msg}")
            .context("progress style")?,
    );
    bar.enable_steady_tick(Duration::from_millis(200));
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| -> Result<()> {
        let work = || -> Result<()> {
            let mut watch = Watch::new(&command, Duration::from_secs(args.patience));
            while let Some(&case) = chosen.get(next.fetch_add(1, Relaxed)) {
                let name = cases[case].name();
                bar.set_message(name);
                let mut last = None;
                watch.run(case, &numbers, |engine, outcome| {
                    if last.replace(engine) != Some(engine) {
                        bar.inc(1);
                    }
                    let finding = Finding::new(name, &engines[engine], outcome);
                    if let Ok(mut found) = found.lock() {
                        found.push((case, engine, finding));
                    }
                })?;
            }
            Ok(())
        };
        let threads: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        for thread in threads {
            thread.join().map_err(|_| anyhow::anyhow!("a watch panicked"))??;
        }
        Ok(())
    })?;
    bar.finish_and_clear();
    let mut found = found.into_inner().unwrap_or_default();
    // Kernels of one engine are in the order in which they answered.
    found.sort_by_key(|(case, engine, _)| (*case, *engine));
    Ok(found.into_iter().map(|(.., finding)| finding).collect())
}

impl Finding {
    fn new(case: &str, engine: &Engine, outcome: Outcome) -> Self {
        let (kernel, row, end, what) = match outcome {
            Outcome::Answered(row) => (Some(row.kernel.clone()), Some(row), None, None),
            Outcome::Ended { kernel, end, what } => (kernel, None, Some(end), Some(what)),
        };
        Self {
            case: case.to_owned(),
            source: engine.source(),
            builder: engine.name().to_owned(),
            kernel: kernel.or_else(|| engine.kernel().map(str::to_owned)).unwrap_or_default(),
            row,
            end,
            what,
        }
    }

    /// True if it must not be.
    pub(crate) fn counts_against_us(&self) -> bool {
        let wrong = self.row.as_ref().is_some_and(|row| {
            row.tally.ours_wrong > 0
                || row.illegal > 0
                || (row.leaks > 0 && engines::is_watertight(&self.kernel))
        });
        self.source == Source::Niwaki && (wrong || self.end.is_some())
    }
}

/// Prints and writes everything.
fn finish(args: &StabilityArgs, catalogue: &Catalogue) -> Result<ExitCode> {
    for (title, table) in summary::tables(catalogue) {
        println!("{title}\n{}", table.to_text());
    }
    let page = page::write(catalogue, &args.out)?;
    let json = args.out.join("stability.json");
    let mut text = serde_json::to_string_pretty(catalogue)?;
    text.push('\n');
    std::fs::write(&json, text).with_context(|| format!("cannot write {}", json.display()))?;
    println!("every row {}\nreport    {}", json.display(), page.display());
    let against = catalogue.findings.iter().filter(|f| f.counts_against_us()).count();
    if against > 0 {
        println!("{against} findings count against us.");
        return Ok(ExitCode::FAILURE);
    }
    println!("Nothing counts against us.");
    Ok(ExitCode::SUCCESS)
}
