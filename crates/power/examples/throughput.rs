//! How fast traces are analysed: `cargo run --release --example throughput -- [SECONDS] [FORMAT] [DIR]`.
//!
//! Writes six channels at 40 kHz in each format (or in `npt`, `csv` or `dump` alone), then analyses each
//! file with its frame log. Processor time is that of all threads, from Linux; with two idle cores, the
//! wall time is little more than half of it.

use niwaki_power::generator::{Recording, RecordingOptions};
use niwaki_power::{
    AnalysisOptions, ReadOptions, TraceFormat, TraceReader, TraceWriter, analyze, open_trace,
};
use std::io::BufWriter;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let seconds: f64 = arguments.next().map_or(Ok(60.0), |s| s.parse())?;
    let only = arguments.next().filter(|format| format != "all");
    let folder = arguments.next().map_or_else(std::env::temp_dir, Into::into);
    let currents = Recording::new(&RecordingOptions::six_rails(1, seconds))?;
    let mut pairs = RecordingOptions::six_rails(1, seconds);
    pairs.rails = RecordingOptions::quick(1).rails;
    let pairs = Recording::new(&pairs)?;

    for (recording, format, name) in [
        (&currents, TraceFormat::Binary, "trace.npt"),
        (&currents, TraceFormat::Csv, "trace.csv"),
        (&pairs, TraceFormat::PowerSensor3, "trace.dump"),
    ] {
        if only.as_ref().is_some_and(|only| !name.ends_with(only.as_str())) {
            continue;
        }
        let path = folder.join(format!("niwaki-{}-{name}", std::process::id()));
        let file = BufWriter::with_capacity(1 << 20, std::fs::File::create(&path)?);
        let mut writer = TraceWriter::new(file, format, recording.info())?;
        let mut reader = recording.reader();
        while let Some(block) = reader.next_block()? {
            writer.write(&block)?;
        }
        writer.finish()?;
        let bytes = std::fs::metadata(&path)?.len();

        let mut options =
            AnalysisOptions { rails: Some(recording.rails()), ..AnalysisOptions::default() };
        if format == TraceFormat::PowerSensor3 {
            options.rails = None;
        }
        let before = processor_seconds();
        let start = Instant::now();
        let open = || open_trace(&path, &ReadOptions::default());
        let analysis = analyze(open, Some(&recording.log()), &options)?;
        let wall = start.elapsed().as_secs_f64();
        let processor = processor_seconds() - before;
        let clock = analysis.clock.as_ref().map_or(f64::NAN, |c| c.drift_ppm);
        println!(
            "{name}: {:.1} M samples, {:.0} MB: {wall:.2} s ({:.0} MB/s), {processor:.2} s of processor time, drift {clock:.2} ppm, {:.1} nJ/pixel (truth {:.1})",
            analysis.quality.samples as f64 * 1e-6,
            bytes as f64 * 1e-6,
            bytes as f64 * 1e-6 / wall,
            analysis.groups[0].energy.mean_nj_per_pixel,
            recording.truth().nj_per_pixel[0],
        );
        std::fs::remove_file(path)?;
        // Linux tells the most memory that a process ever had.
        if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
            let most = status.lines().find(|l| l.starts_with("VmHWM"));
            println!("    {}", most.unwrap_or_default());
        }
    }
    Ok(())
}

/// Time that all threads of this process have had, in seconds; 0 where Linux does not tell.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields 14 and 15, in ticks of 10 ms, for all threads; the name before them may hold spaces.
    let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace();
    let ticks: f64 = fields.skip(11).take(2).filter_map(|f| f.parse::<f64>().ok()).sum();
    ticks * 0.01
}
