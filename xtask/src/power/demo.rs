//! `power demo`: the generator, end to end, with the truth beside what was recovered.

use super::args::DemoArgs;
use super::{page, tables};
use crate::report::table::{Best, Cell, Table};
use anyhow::{Context, Result};
use niwaki_power::generator::{FaultPlan, MarkPolicy, Recording, RecordingOptions};
use niwaki_power::{
    Analysis, AnalysisOptions, Fault, FrameLog, SyncMethod, TraceFormat, TraceReader, TraceWriter,
    analyze,
};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::process::ExitCode;

/// What has to hold.
const ENERGY: f64 = 0.005;
const DRIFT_PPM: f64 = 5.0;

pub(super) fn run(args: &DemoArgs) -> Result<ExitCode> {
    let plain = RecordingOptions { states: Vec::new(), ..options(args) };
    let mut methods = Table::new("power-demo-methods")
        .column("synchronised by", Best::Neither)
        .column_with_digits("energy, largest\nerror %", Best::Low, 4)
        .column_with_digits("starts within\nsamples", Best::Low, 2)
        .column_with_digits("ends within\nsamples", Best::Low, 2)
        .column_with_digits("drift ppm\n(truth 50)", Best::Neither, 3)
        .column_with_digits("± ppm", Best::Low, 3)
        .column("holds", Best::Neither);
    let mut holds = true;
    for (method, marks, limit) in [
        (SyncMethod::Marker, MarkPolicy::Every(1), 1.0),
        (SyncMethod::Correlation, MarkPolicy::Never, 3.0),
        (SyncMethod::Idle, MarkPolicy::Never, 6.0),
    ] {
        let recording = Recording::new(&RecordingOptions { marks, ..plain.clone() })?;
        let analysis = of(&recording, method)?;
        let (starts, ends) = boundaries(&analysis, &recording, plain.rate_hz);
        let energy = energy_error(&analysis, &recording);
        let (drift, error) =
            analysis.clock.map_or((f64::NAN, f64::NAN), |c| (c.drift_ppm, c.drift_error_ppm));
        let is_good =
            energy <= ENERGY && starts <= limit && (drift - plain.drift_ppm).abs() <= DRIFT_PPM;
        holds &= is_good;
        methods.push(vec![
            method.name().into(),
            (100.0 * energy).into(),
            starts.into(),
            ends.into(),
            drift.into(),
            error.into(),
            if is_good { "yes" } else { "NO" }.into(),
        ]);
    }
    println!("{}", methods.to_text());

    let spoilt = RecordingOptions { faults: FaultPlan::of_each(5), ..options(args) };
    let recording = Recording::new(&spoilt)?;
    let analysis = of(&recording, SyncMethod::Auto)?;
    let (faults, all_found) = faults(&analysis, &recording);
    holds &= all_found;
    println!("{}", faults.to_text());
    let energies = energies(&analysis, &recording);
    println!("{}", energies.to_text());
    for line in tables::summary(&analysis) {
        println!("{}: {}", line.0, line.1);
    }
    if let Some(path) = &args.save {
        save(&recording, path)?;
    }
    let extra = [
        ("Recovered without faults, against the truth", methods),
        ("Faults put in and found", faults),
        ("Energy per pixel with faults, against the truth", energies),
    ];
    println!("{}", page::save(&analysis, "a generated trace", &extra, &args.out)?.display());
    if !holds {
        eprintln!("error: what has to hold does not: see the tables");
    }
    Ok(if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn options(args: &DemoArgs) -> RecordingOptions {
    RecordingOptions::paper(args.seed, args.frames as usize)
}

fn of(recording: &Recording, sync: SyncMethod) -> Result<Analysis> {
    let options =
        AnalysisOptions { rails: Some(recording.rails()), sync, ..AnalysisOptions::default() };
    let log = recording.log();
    Ok(analyze(|| Ok(Box::new(recording.reader())), Some(&log), &options)?)
}

/// Largest distance of starts and of ends of work from the truth, in samples.
fn boundaries(analysis: &Analysis, recording: &Recording, rate_hz: f64) -> (f64, f64) {
    let sample = 1e9 / rate_hz;
    let pairs = analysis.frames.iter().zip(&recording.truth().frames);
    pairs.fold((0.0, 0.0), |(starts, ends): (f64, f64), (found, truth)| {
        let end = found.start_ns + 1e9 * found.busy_s;
        (
            starts.max((found.start_ns - truth.start_ns).abs() / sample),
            ends.max((end - truth.busy_end_ns).abs() / sample),
        )
    })
}

fn energy_error(analysis: &Analysis, recording: &Recording) -> f64 {
    let pairs = analysis.groups.iter().zip(&recording.truth().nj_per_pixel);
    let errors = pairs.map(|(group, truth)| (group.energy.mean_nj_per_pixel / truth - 1.0).abs());
    errors.fold(0.0, f64::max)
}

fn energies(analysis: &Analysis, recording: &Recording) -> Table {
    let mut table = Table::new("power-demo-energy")
        .column("algorithm", Best::Neither)
        .column_with_digits("truth nJ/pixel", Best::Neither, 2)
        .column_with_digits("found nJ/pixel", Best::Neither, 2)
        .column_with_digits("error %", Best::Neither, 3)
        .column("frames", Best::Neither)
        .column("incomplete", Best::Neither)
        .column("clipped", Best::Neither);
    for (group, truth) in analysis.groups.iter().zip(&recording.truth().nj_per_pixel) {
        let found = group.energy.mean_nj_per_pixel;
        #[expect(clippy::cast_possible_truncation, reason = "counts of frames")]
        let count = |n: u64| Cell::from(n as usize);
        table.push(vec![
            tables::name(group).into(),
            (*truth).into(),
            found.into(),
            (100.0 * (found / truth - 1.0)).into(),
            count(group.frames),
            count(group.incomplete),
            count(group.clipped),
        ]);
    }
    table
}

/// Faults put in and found, and whether all were.
fn faults(analysis: &Analysis, recording: &Recording) -> (Table, bool) {
    let mut table = Table::new("power-demo-faults")
        .column("fault", Best::Neither)
        .column("put in", Best::Neither)
        .column("found", Best::Neither);
    let mut all = true;
    for fault in Fault::ALL {
        let mut put_in = recording.truth().faults[fault as usize];
        if fault == Fault::Clipped {
            // The truth counts stretches of 40 rows.
            put_in *= 40;
        }
        let found = analysis.quality.count(fault).count;
        all &= found == put_in;
        #[expect(clippy::cast_possible_truncation, reason = "small counts")]
        table.push(vec![fault.name().into(), (put_in as usize).into(), (found as usize).into()]);
    }
    (table, all)
}

fn save(recording: &Recording, path: &Path) -> Result<()> {
    let failed = |path: &Path| format!("cannot write {}", path.display());
    let file = File::create(path).with_context(|| failed(path))?;
    let mut writer =
        TraceWriter::new(BufWriter::new(file), TraceFormat::of_path(path), recording.info())?;
    let mut reader = recording.reader();
    while let Some(block) = reader.next_block()? {
        writer.write(&block).with_context(|| failed(path))?;
    }
    writer.finish()?;
    let log: FrameLog = recording.log();
    let path = path.with_extension("jsonl");
    let file = File::create(&path).with_context(|| failed(&path))?;
    log.write_json_lines(BufWriter::new(file))?;
    println!("{}", path.display());
    Ok(())
}
