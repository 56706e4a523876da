//! `cargo xtask accuracy --suite kernels`: what leaks and errors of distances cost in time.

mod measure;
mod page;
mod study;

use super::conclude;
use crate::bench::progress::Progress;
use crate::bench::{Failures, Method, find_peers, pool};
use crate::cli::AccuracyArgs;
use crate::kernel::{Collapse, TraceKernel};
use crate::results::Failure;
use crate::{machine, registry};
use anyhow::{Result, bail};
use measure::{Effort, RAY_SETS};
use niwaki_trace::Kernel;
use std::process::ExitCode;
use study::Study;

/// Our tree first, then peers.
const BUILDERS: [&str; 4] = ["niwaki:high", "embree:medium", "embree:high", "obvhs:medium"];

/// The kernels of ours: the fastest of each width in each mode, and the scalar ones.
fn our_kernels() -> Vec<TraceKernel> {
    let mut kernels = TraceKernel::best_of_each_width();
    let scalar = TraceKernel::available().into_iter().filter(|k| k.kernel == Kernel::Scalar);
    kernels.extend(scalar);
    let mut unique: Vec<TraceKernel> = Vec::new();
    for kernel in kernels {
        if !unique.contains(&kernel) {
            unique.push(kernel);
        }
    }
    unique
}

/// Runs the suite.
pub(super) fn run(args: &AccuracyArgs) -> Result<ExitCode> {
    if !args.families.is_empty() {
        bail!("--families are of builders; the suite of kernels has none");
    }
    let specs = super::scenes(args)?;
    let mut run = machine::describe();
    let mut builders = registry::select(&BUILDERS.map(str::to_owned))?;
    find_peers(false, "", &mut builders, &mut run)?;
    let effort = Effort {
        threads: args.threads.map_or(1, usize::from),
        seed: args.seed,
        rays: if args.quick { 20_000 } else { 200_000 },
        checked: if args.quick { 2_000 } else { 50_000 },
        leak_rays: if args.quick { 5_000 } else { 200_000 },
    };
    let seconds = if args.quick { 0.03 } else { 0.5 };
    run.threads = vec![effort.threads];
    run.collapse = Collapse::Optimal.name().to_owned();
    run.arguments = std::env::args().skip(2).collect();
    run.seconds_per_measurement = seconds;
    let kernels = our_kernels();
    let surfaces = measure::surfaces();
    // Besides ours the one in double precision; two modes of each quality of Embree.
    let engines = kernels.len() + 1 + 2 * (builders.len() - 1);
    let method = Method {
        builders,
        kernels,
        collapse: Collapse::Optimal,
        robust: true,
        embree_config: String::new(),
        binary: Vec::new(),
        seconds,
        brief: false,
        all_cores: pool(machine::cores())?,
        progress: Progress::new(surfaces.len() + specs.len() * engines * RAY_SETS.len()),
    };
    let mut failures = Failures::default();
    let mut leaks = Vec::new();
    for surface in &surfaces {
        method.progress.message(&format!("leaks of {}", surface.name));
        match measure::leaks(&method, effort, surface, &mut failures) {
            Ok(found) => leaks.extend(found),
            Err(error) => note(&method, &mut failures, surface.name, &error),
        }
        method.progress.step();
    }
    let mut rows = Vec::new();
    for spec in &specs {
        method.progress.message(&format!("{}: load", spec.name));
        let measured = method
            .all_cores
            .install(|| spec.load(args.seed))
            .and_then(|scene| measure::scene(&method, effort, &scene, &mut failures));
        match measured {
            Ok(found) => rows.extend(found),
            Err(error) => note(&method, &mut failures, &spec.describe(), &error),
        }
    }
    method.progress.finish();
    let leaky = leaks.iter().any(|leak| leak.leaks > 0 && measure::is_watertight(&leak.kernel));
    let reference = TraceKernel::best().name();
    finish(args, &Study::of(run, reference, rows, leaks, failures.list))?;
    if leaky {
        eprintln!("a watertight kernel leaked");
    }
    Ok(if failures.fatal || leaky { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn note(method: &Method, failures: &mut Failures, what: &str, error: &anyhow::Error) {
    method.progress.warn(&format!("error: {what}: {error:#}"));
    failures.fatal = true;
    failures.list.push(Failure { scene: what.to_owned(), error: format!("{error:#}") });
}

/// Prints and writes everything.
fn finish(args: &AccuracyArgs, study: &Study) -> Result<()> {
    for (title, table) in study.tables() {
        println!("\n{title}\n{}", table.to_text());
    }
    let page = page::write(study, &args.out)?;
    let note = "t errors are 99th percentiles, in units of 2^-24";
    conclude(args, study, &study.failures, &page, note)
}
