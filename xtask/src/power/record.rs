//! `power record -- COMMAND`.

use super::analyze::{of_files, show};
use super::args::RecordArgs;
use super::source::all_meters;
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
    let meters = all_meters()?;
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
