//! The process that does the work, so that a crash or a hang ends nothing else.
//!
//! It reads lines from standard input, each the number of a case and the numbers of engines, and
//! writes an [`Event`] a line to standard output.

use super::StabilityOptions;
use super::cases::{Case, Exact, Judge};
use super::engines::Engine;
use crate::judge::{Tally, any, closest};
use anyhow::{Context, Result};
use niwaki_core::{Intersector, TriangleMesh};
use niwaki_hard_cases::{Closed, bad_rays};
use niwaki_peers::Embree;
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// What a worker says.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Event {
    /// An engine begins.
    Engine(usize),
    /// A kernel of it begins.
    Kernel(String),
    /// It has answered; from here on it is our time that passes.
    Judging,
    /// What its answers have come to so far.
    SoFar(Row),
    /// A kernel of it has answered all rays.
    Row(String, Row),
    /// It would not take the case, and says why.
    Refused(String),
    /// It panicked.
    Panicked(String),
    /// All engines of the line have been tried.
    Done,
}

/// What the answers of a kernel to the rays of a case came to.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Against the exact answers; closest and any hit together.
    pub(crate) tally: Tally,
    /// Rays that hit nothing by definition (NaN, an empty range), and yet were answered by a hit.
    pub(crate) illegal: u64,
    /// Rays from inside of a closed surface.
    pub(crate) inside: u64,
    /// Those that got out.
    pub(crate) leaks: u64,
    /// The first wrong answer, or the first leak.
    pub(crate) example: Option<String>,
}

/// The case whose illegal rays are traced as well.
const ILLEGAL: &str = "one";

/// Rays of one seed.
const CHUNK: usize = 1 << 12;

/// Time between two signs of life.
const PULSE: Duration = Duration::from_millis(250);

/// The last panic's message and place.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Runs until standard input ends.
///
/// # Errors
/// If standard input or output cannot be used, or the arguments name no builder.
pub(crate) fn run(options: &StabilityOptions) -> Result<ExitCode> {
    std::panic::set_hook(Box::new(|info| {
        if let Ok(mut last) = PANIC.lock() {
            *last = info.to_string();
        }
    }));
    let embree = if options.no_peers { None } else { Embree::load().ok() };
    let engines = Engine::all(&options.builders, !options.no_peers)?;
    let cases = super::cases::all();
    let surfaces = cases.iter().filter(|case| matches!(case, Case::Closed(_))).count();
    for line in std::io::stdin().lines() {
        let line = line.context("cannot read standard input")?;
        let numbers = line.split_whitespace().map(str::parse::<usize>);
        let numbers: Vec<usize> = numbers.collect::<Result<_, _>>().context("not a number")?;
        let (&case, chosen) = numbers.split_first().context("an empty line")?;
        let case = cases.get(case).context("no such case")?;
        let worker = Worker { case, embree: embree.as_ref() };
        match case {
            Case::Open(open) => {
                let exact = Exact::new(open, options.rays(), options.seed);
                let judge = Judge::new(&open.mesh, &exact);
                worker.each(chosen, &engines, |kernel, scene, _| {
                    let answers = judge.ask(scene);
                    say(&Event::Judging);
                    say(&Event::Row(kernel.to_owned(), judge.judge(&answers)));
                    // A kernel looks at a ray before any triangle, so one case will do. Peers may
                    // end the process here; the row above has been told by then.
                    if open.name == ILLEGAL {
                        say(&Event::Kernel(format!("{kernel}, illegal rays")));
                        let illegal = illegal(&open.mesh, scene);
                        say(&Event::Row(kernel.to_owned(), Row { illegal, ..Row::default() }));
                    }
                });
            }
            Case::Closed(closed) => {
                worker.each(chosen, &engines, |kernel, scene, engine| {
                    let triangles = closed.mesh.len();
                    let count = options.leak_rays(surfaces, triangles, engine, kernel);
                    let seed = options.leak_seed(engine, kernel);
                    say(&Event::Row(kernel.to_owned(), leaks(closed, scene, count, seed)));
                });
            }
        }
        say(&Event::Done);
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes a line. If nobody reads any more there is nothing left to do.
fn say(event: &Event) {
    let mut out = std::io::stdout().lock();
    let written = serde_json::to_writer(&mut out, event)
        .map_err(std::io::Error::from)
        .and_then(|()| out.write_all(b"\n"))
        .and_then(|()| out.flush());
    if written.is_err() {
        std::process::exit(1);
    }
}

struct Worker<'a> {
    case: &'a Case,
    embree: Option<&'a Embree>,
}

impl Worker<'_> {
    fn each(
        &self,
        chosen: &[usize],
        engines: &[Engine],
        judge: impl Fn(&str, &dyn Intersector, &Engine),
    ) {
        for &number in chosen {
            let Some(engine) = engines.get(number) else { continue };
            say(&Event::Engine(number));
            let tried = catch_unwind(AssertUnwindSafe(|| {
                engine.each(self.case.mesh(), self.embree, |kernel, scene| {
                    say(&Event::Kernel(kernel.to_owned()));
                    judge(kernel, scene, engine);
                })
            }));
            match tried {
                Ok(Ok(())) => {}
                Ok(Err(error)) => say(&Event::Refused(format!("{error:#}"))),
                Err(_) => {
                    let message = PANIC.lock().map(|last| last.clone()).unwrap_or_default();
                    say(&Event::Panicked(message));
                }
            }
        }
    }
}

/// Illegal rays that are answered by a hit.
fn illegal(mesh: &TriangleMesh, scene: &dyn Intersector) -> u64 {
    let hits = |ray| scene.closest_hit(ray).is_hit() || scene.any_hit(ray);
    bad_rays(mesh).iter().filter(|ray| hits(ray)).count() as u64
}

/// Counts rays that get out of a closed surface, in either query. Half of the rays are asked about
/// one by one, half in batches.
fn leaks(closed: &Closed, scene: &dyn Intersector, count: usize, seed: u64) -> Row {
    let mut row = Row::default();
    let mut last = Instant::now();
    for (chunk, start) in (0..count).step_by(CHUNK).enumerate() {
        let rays = closed.rays_from_inside(CHUNK.min(count - start), seed + chunk as u64);
        let (hits, flags) = if chunk % 2 == 0 {
            (closest(scene, &rays), any(scene, &rays))
        } else {
            rays.iter().map(|ray| (scene.closest_hit(ray), scene.any_hit(ray))).unzip()
        };
        for ((ray, hit), flag) in rays.iter().zip(hits).zip(flags) {
            row.inside += 1;
            if !(hit.is_hit() && flag) {
                row.leaks += 1;
                let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
                row.example
                    .get_or_insert_with(|| format!("ray from {origin:?} along {direction:?}"));
            }
        }
        if last.elapsed() >= PULSE {
            last = Instant::now();
            say(&Event::SoFar(row.clone()));
        }
    }
    row
}
