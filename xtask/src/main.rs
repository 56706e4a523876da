//! Niwaki's commands: orchestration and reports, no algorithms. `cargo xtask --help` lists them.

mod accuracy;
mod bench;
mod cli;
mod gpu;
mod judge;
mod kernel;
mod machine;
mod memory;
mod power;
mod registry;
mod render;
mod report;
mod results;
mod scenes;
mod stability;
#[cfg(test)]
mod testing;
mod thesis;
mod trace;
mod tune;
mod verify;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = match cli::Cli::parse().command {
        cli::Command::Bench(args) => bench::run(&args),
        cli::Command::Accuracy(args) => accuracy::run(&args),
        cli::Command::Gpu(args) => gpu::run(&args),
        cli::Command::Report(args) => report::run(&args),
        cli::Command::Power(args) => power::run(&args),
        cli::Command::Render(args) => render::run(&args),
        cli::Command::Stability(args) => stability::run(&args),
        cli::Command::StabilityWorker(options) => stability::run_worker(&options),
        cli::Command::Thesis(args) => thesis::run(&args),
        cli::Command::Trace(args) => trace::run(&args),
        cli::Command::Tune(args) => tune::run(&args),
        cli::Command::Verify(args) => verify::run(&args),
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}
