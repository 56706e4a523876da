//! `power analyze`.

use super::args::AnalyzeArgs;
use super::source::trace_of;
use super::{page, tables};
use anyhow::{Context, Result};
use niwaki_power::{Analysis, AnalysisOptions, FrameLog, analyze};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::ExitCode;

pub(super) fn run(args: &AnalyzeArgs) -> Result<ExitCode> {
    let analysis =
        of_files(&args.trace, args.frames.as_deref(), &args.settings.options(args.size)?)?;
    let name = args.trace.file_name().unwrap_or_default().to_string_lossy();
    show(&analysis, &name, &args.out)?;
    Ok(ExitCode::SUCCESS)
}

pub(super) fn of_files(
    trace: &Path,
    frames: Option<&Path>,
    options: &AnalysisOptions,
) -> Result<Analysis> {
    let log = frames.map(read_log).transpose()?;
    analyze(|| trace_of(trace), log.as_ref(), options)
        .with_context(|| format!("cannot analyse {}", trace.display()))
}

pub(super) fn read_log(path: &Path) -> Result<FrameLog> {
    let file = File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    FrameLog::read(BufReader::new(file)).with_context(|| format!("{}", path.display()))
}

/// Prints the main tables and writes the report.
pub(super) fn show(analysis: &Analysis, name: &str, out: &Path) -> Result<()> {
    for line in tables::summary(analysis) {
        println!("{}: {}", line.0, line.1);
    }
    for table in [tables::groups(analysis), tables::faults(&analysis.quality)] {
        if !table.is_empty() {
            println!("\n{}", table.to_text());
        }
    }
    println!("{}", page::save(analysis, name, &[], out)?.display());
    Ok(())
}
