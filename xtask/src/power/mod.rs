//! `cargo xtask power`: what frames cost in joules.

mod analyze;
mod args;
mod demo;
mod page;
mod plots;
mod published;
mod record;
#[cfg(test)]
pub(crate) mod simulated;
pub(crate) mod source;
pub(crate) mod study;
mod tables;

pub(crate) use args::PowerArgs;

use anyhow::Result;
use args::PowerCommand;
use std::process::ExitCode;

/// Runs the command.
pub(crate) fn run(args: &PowerArgs) -> Result<ExitCode> {
    match &args.command {
        PowerCommand::Demo(args) => demo::run(args),
        PowerCommand::Analyze(args) => analyze::run(args),
        PowerCommand::Record(args) => record::run(args),
        PowerCommand::Study(args) => study::run(args),
    }
}
