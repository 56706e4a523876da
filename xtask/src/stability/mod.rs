//! `cargo xtask stability`: the catalogue of hard cases against every builder, kernel and peer, each
//! in a process that is watched.

mod cases;
mod engines;
mod journal;
mod options;
mod page;
mod progress;
mod summary;
mod watch;
mod worker;

use crate::machine;
use crate::results::{Run, Source};
use anyhow::{Context, Result, bail};
use cases::Case;
use engines::Engine;
use journal::{Journal, Known};
use niwaki_peers::Embree;
use progress::Progress;
use serde::{Deserialize, Serialize};
use std::process::{Command, ExitCode};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Instant;
use watch::{End, News, Watch};
use worker::Row;

pub(crate) use options::{StabilityArgs, StabilityOptions};

/// The answers of a kernel over the tree of a builder, or how it ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Finding {
    pub(crate) case: String,
    pub(crate) source: Source,
    /// Builder or preset; `none` where every triangle is tested.
    pub(crate) builder: String,
    /// Empty where a builder ended before any kernel.
    pub(crate) kernel: String,
    /// Answers, if there are any: those up to then where it ended in another way.
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
    let (journal, known) = Journal::open(&args.out, depends_on(args, &options, &run), args.resume)?;
    let (journal, started) = (Mutex::new(journal), Instant::now());
    let findings = try_all(args, &options, &cases, &chosen, &engines, known, &journal)?;
    println!("{} cases in {:.0?}", chosen.len(), started.elapsed());
    let described = chosen.iter().map(|&i| &cases[i]);
    let catalogue = Catalogue {
        schema: 2,
        run,
        cases: described.map(|c| (c.name().into(), c.why().into(), c.mesh().len())).collect(),
        findings,
    };
    finish(args, &catalogue)
}

/// What findings depend on, as the journal has it. Not `--only`, since cases know nothing of each
/// other.
fn depends_on(args: &StabilityArgs, options: &StabilityOptions, run: &Run) -> Vec<String> {
    let limit = format!("{} s", args.peer_limit().as_secs());
    options.arguments().into_iter().chain([limit]).chain(run.peers.iter().cloned()).collect()
}

/// Tries all engines at the chosen cases, in as many processes as there are jobs.
fn try_all(
    args: &StabilityArgs,
    options: &StabilityOptions,
    cases: &[Case],
    chosen: &[usize],
    engines: &[Engine],
    known: Known,
    journal: &Mutex<Journal>,
) -> Result<Vec<Finding>> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let arguments = options.arguments();
    let command = || {
        let mut command = Command::new(&program);
        // Jobs are the parallelism: a thread a process.
        command.arg("stability-worker").args(&arguments).env("RAYON_NUM_THREADS", "1");
        command
    };
    let limit =
        |engine: usize| (engines[engine].source() != Source::Niwaki).then(|| args.peer_limit());
    let mut tasks: Vec<(usize, Vec<usize>)> = chosen
        .iter()
        .map(|&case| {
            let is_new = |engine: &Engine| {
                !known.contains_key(&(cases[case].name().to_owned(), engine.label()))
            };
            (case, (0..engines.len()).filter(|&engine| is_new(&engines[engine])).collect())
        })
        .collect();
    tasks.retain(|(_, engines)| !engines.is_empty());
    // The long ones first, so that no process works alone at the end.
    tasks.sort_by_key(|&(case, _)| {
        let is_closed = matches!(cases[case], Case::Closed(_));
        std::cmp::Reverse((is_closed, cases[case].mesh().len()))
    });
    let jobs = args.jobs.map_or_else(machine::cores, usize::from).clamp(1, chosen.len().max(1));
    let progress = Progress::new(jobs, cases, engines, &tasks, options)?;
    let next = AtomicUsize::new(0);
    let found = Mutex::new(known);
    std::thread::scope(|scope| -> Result<()> {
        let work = |job: usize| -> Result<()> {
            let mut watch = Watch::new(&command, args.patience(), &limit);
            while let Some((case, numbers)) = tasks.get(next.fetch_add(1, Relaxed)) {
                let name = cases[*case].name();
                let mut here = Vec::new();
                let mut failure = None;
                progress.case(job, name);
                watch.run(*case, numbers, |number, news| {
                    let engine = &engines[number];
                    progress.news(job, engine, &news);
                    if let News::Over = news {
                        let findings = std::mem::take(&mut here);
                        let written = journal.lock().map(|mut j| j.add(name, engine, &findings));
                        failure = failure.take().or(written.ok().and_then(Result::err));
                        if let Ok(mut found) = found.lock() {
                            found.insert((name.to_owned(), engine.label()), findings);
                        }
                    } else {
                        here.extend(Finding::new(name, engine, news));
                    }
                })?;
                if let Some(failure) = failure {
                    return Err(failure);
                }
                progress.end_of_case(job, name);
            }
            Ok(())
        };
        let threads: Vec<_> = (0..jobs).map(|job| scope.spawn(move || work(job))).collect();
        for thread in threads {
            thread.join().map_err(|_| anyhow::anyhow!("a watch panicked"))??;
        }
        Ok(())
    })?;
    progress.end();
    let mut found = found.into_inner().unwrap_or_default();
    let places = chosen.iter().flat_map(|&case| engines.iter().map(move |engine| (case, engine)));
    // Kernels of one engine are in the order in which they answered.
    Ok(places
        .filter_map(|(case, engine)| found.remove(&(cases[case].name().into(), engine.label())))
        .flatten()
        .collect())
}

impl Finding {
    /// `None` for what is no result yet.
    fn new(case: &str, engine: &Engine, news: News) -> Option<Self> {
        let (kernel, row, end, what) = match news {
            News::Answered(kernel, row) => (Some(kernel), Some(row), None, None),
            News::Ended { kernel, row, end, what } => (kernel, row, Some(end), Some(what)),
            News::Begins(_) | News::SoFar(_) | News::Over => return None,
        };
        Some(Self {
            case: case.to_owned(),
            source: engine.source(),
            builder: engine.name().to_owned(),
            kernel: kernel.or_else(|| engine.kernel().map(str::to_owned)).unwrap_or_default(),
            row,
            end,
            what,
        })
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
    crate::results::write_json(&json, catalogue)?;
    println!("every row {}\nreport    {}", json.display(), page.display());
    let against = catalogue.findings.iter().filter(|f| f.counts_against_us()).count();
    if against > 0 {
        println!("{against} findings count against us.");
        return Ok(ExitCode::FAILURE);
    }
    println!("Nothing counts against us.");
    Ok(ExitCode::SUCCESS)
}
