//! `power record -- COMMAND`.

use super::analyze::{of_files, show};
use super::args::RecordArgs;
use anyhow::{Context, Result, bail};
use niwaki_power::{JoinedMeter, Recorder, RecorderOptions, TraceFormat, TraceReader, TraceWriter};
use std::fs::File;
use std::io::BufWriter;
use std::process::{Command, ExitCode};
use std::time::Duration;

pub(super) fn run(args: &RecordArgs) -> Result<ExitCode> {
    if !(0.0..=3600.0).contains(&args.margin) {
        bail!("--margin: 0 to 3600 seconds");
    }
    let analysis = args.settings.options(args.size)?;
    let meters = args.source.meters()?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    let path = args.out.join("trace.npt");
    let options = RecorderOptions { rate_hz: args.rate, ..RecorderOptions::default() };
    let mut recorder = Recorder::start(JoinedMeter(meters), &options)?;
    println!("recording {}", recorder.info().sensor.name);
    let file = File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut writer = TraceWriter::new(BufWriter::new(file), TraceFormat::Binary, recorder.info())?;

    let margin = Duration::from_secs_f64(args.margin);
    let status = std::thread::scope(|scope| -> Result<_> {
        let stop = recorder.stopper();
        let child = scope.spawn(move || {
            std::thread::sleep(margin);
            let mut command = Command::new(&args.command[0]);
            command.args(&args.command[1..]);
            if let Some(log) = &args.frames {
                command.env("NIWAKI_FRAME_LOG", log);
            }
            let status = command.status();
            std::thread::sleep(margin);
            stop.stop();
            status
        });
        while let Some(block) = recorder.next_block()? {
            writer.write(&block)?;
        }
        let status =
            child.join().map_err(|_| anyhow::anyhow!("the command could not be watched"))?;
        status.with_context(|| format!("cannot run {}", args.command[0]))
    })?;
    writer.finish()?;
    println!("{}", path.display());
    if recorder.late() > 0 {
        println!("{} readings came late; gaps are counted below", recorder.late());
    }
    if !status.success() {
        eprintln!("the command ended with {status}; what was recorded is analysed all the same");
    }
    let analysis = of_files(&path, args.frames.as_deref(), &analysis)?;
    show(&analysis, &args.command.join(" "), &args.out)?;
    Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use crate::power::PowerCommand;
    use crate::power::simulated::{Folder, Ticker, WATTS, counter};
    use clap::Parser;
    use niwaki_power::{ReadOptions, now_ns, open_trace};

    fn args(source: &str, out: &str) -> RecordArgs {
        let words =
            ["xtask", "power", "record", "--margin", "0.2", "--out", out, "--source", source];
        let cli = Cli::try_parse_from([&words[..], &["--", "sleep", "0.4"]].concat()).unwrap();
        let Command::Power(power) = cli.command else { panic!("not power") };
        let PowerCommand::Record(args) = power.command else { panic!("not record") };
        args
    }

    #[test]
    fn a_counter_of_known_power_is_recorded_and_analysed() {
        let counters = Folder::new("record-rapl");
        let out = Folder::new("record-out");
        let before = now_ns();
        let mut tick = counter(&counters.0);
        tick();
        let ticker = Ticker::new(tick);
        let folder = out.0.display().to_string();
        run(&args(&format!("rapl:{}", counters.0.display()), &folder)).unwrap();
        drop(ticker);
        let mut trace = open_trace(&out.0.join("trace.npt"), &ReadOptions::default()).unwrap();
        assert_eq!(trace.info().sensor.name, "RAPL");
        let (mut last, mut joules) = (before, 0.0);
        while let Some(block) = trace.next_block().unwrap() {
            last = block.times_ns.last().copied().unwrap_or(last);
            joules = block.channels[0].last().copied().unwrap_or(joules);
        }
        // The thread that plays the meter may be late, but is never ahead.
        let most = WATTS * 1e-9 * (last - before) as f64;
        assert!(joules > 0.0 && joules <= most + 1e-3, "{joules} of {most}");
        for file in ["power.html", "power.json"] {
            assert!(out.0.join(file).is_file(), "{file}");
        }
    }

    #[test]
    fn what_cannot_be_recorded_says_what_to_do() {
        for (source, part) in [("none", "nothing to record"), ("csv:a.csv", "analyze a.csv")] {
            let error = run(&args(source, "nowhere")).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        assert!(!std::path::Path::new("nowhere").exists());
    }
}
