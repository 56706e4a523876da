//! What is going on, on a terminal as bars, elsewhere as a line a case.

use super::cases::Case;
use super::engines::Engine;
use super::options::StabilityOptions;
use super::watch::News;
use anyhow::{Context, Result};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// The bars of a run.
pub(crate) struct Progress {
    bars: MultiProgress,
    /// Attempts of engines at cases.
    attempts: ProgressBar,
    /// Rays from inside closed surfaces, which take most of the time.
    rays: ProgressBar,
    jobs: Vec<Mutex<Job>>,
    start: Instant,
    is_terminal: bool,
}

/// What a job is at.
struct Job {
    line: ProgressBar,
    case: String,
    since: Instant,
    /// Rays of the kernel at work that the bar has.
    counted: u64,
}

impl Progress {
    pub(crate) fn new(
        jobs: usize,
        cases: &[Case],
        engines: &[Engine],
        tasks: &[(usize, Vec<usize>)],
        options: &StabilityOptions,
    ) -> Result<Self> {
        let style = |template| ProgressStyle::with_template(template).context("progress style");
        let bars = MultiProgress::new();
        let attempts = tasks.iter().map(|(_, engines)| engines.len() as u64).sum();
        let attempts = bars
            .add(ProgressBar::new(attempts))
            .with_style(style("{elapsed_precise} {bar:30} {pos}/{len} attempts")?);
        let rays = rays_from_inside(cases, engines, tasks, options);
        let rays = bars.add(ProgressBar::new(rays)).with_style(style(
            "         {bar:30} {human_pos}/{human_len} rays from inside, {per_sec}",
        )?);
        let jobs = (0..jobs)
            .map(|_| {
                let line =
                    bars.add(ProgressBar::new_spinner()).with_style(style("{spinner} {msg}")?);
                line.enable_steady_tick(Duration::from_millis(200));
                let job = Job { line, case: String::new(), since: Instant::now(), counted: 0 };
                Ok(Mutex::new(job))
            })
            .collect::<Result<_>>()?;
        let is_terminal = std::io::stderr().is_terminal();
        Ok(Self { bars, attempts, rays, jobs, start: Instant::now(), is_terminal })
    }

    /// A job begins with a case.
    pub(crate) fn case(&self, job: usize, name: &str) {
        self.with(job, |job| {
            name.clone_into(&mut job.case);
            job.since = Instant::now();
            job.line.set_message(format!("{name}: exact answers"));
        });
    }

    /// Something happened.
    pub(crate) fn news(&self, job: usize, engine: &Engine, news: &News) {
        self.with(job, |job| match news {
            News::Begins(kernel) => {
                job.counted = 0;
                job.line.set_message(format!("{}: {}, {kernel}", job.case, engine.label()));
            }
            News::SoFar(row) | News::Answered(_, row) => {
                self.rays.inc(row.inside.saturating_sub(job.counted));
                job.counted = row.inside;
            }
            News::Ended { .. } => {}
            News::Over => self.attempts.inc(1),
        });
    }

    /// A job has ended with a case.
    pub(crate) fn end_of_case(&self, job: usize, name: &str) {
        self.with(job, |job| {
            if !self.is_terminal {
                let (at, took) = (self.start.elapsed().as_secs(), job.since.elapsed().as_secs());
                let (done, all) = (self.attempts.position(), self.attempts.length().unwrap_or(0));
                eprintln!("{at:6} s: {name} took {took} s; {done} of {all} attempts");
            }
            job.line.set_message("");
        });
    }

    pub(crate) fn end(&self) {
        // What cannot be cleared is no loss.
        let _ = self.bars.clear();
    }

    fn with(&self, job: usize, f: impl FnOnce(&mut Job)) {
        if let Ok(mut job) = self.jobs[job].lock() {
            f(&mut job);
        }
    }
}

/// Rays from inside closed surfaces that the tasks come to.
fn rays_from_inside(
    cases: &[Case],
    engines: &[Engine],
    tasks: &[(usize, Vec<usize>)],
    options: &StabilityOptions,
) -> u64 {
    let surfaces = cases.iter().filter(|case| matches!(case, Case::Closed(_))).count();
    let mut sum = 0;
    for (case, numbers) in tasks {
        let Case::Closed(closed) = &cases[*case] else { continue };
        for engine in numbers.iter().map(|&number| &engines[number]) {
            for kernel in engine.kernels() {
                sum += options.leak_rays(surfaces, closed.mesh.len(), engine, &kernel) as u64;
            }
        }
    }
    sum
}
