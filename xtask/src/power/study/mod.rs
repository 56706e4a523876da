//! `power study`: the paper's six algorithms on this device.

mod answers;
mod args;
mod measure;
mod page;
mod plots;
mod rows;
mod tables;
#[cfg(test)]
mod tests;

pub(crate) use args::StudyArgs;
pub(crate) use measure::{Metered, Play, Visit, WARM_UP, least_time, visit};

use super::source::{Kind, Opened, Session, part, trace_of};
use crate::bench::progress::Progress;
use crate::machine;
use crate::render::Size;
use crate::results::Failure;
use crate::scenes::{Origin, SceneSpec};
use anyhow::{Context, Result, bail};
use measure::power_of;
use niwaki_power::{
    AnalysisOptions, Block, CLOCK, FrameLog, FrameLogHeader, IdlePolicy, SyncMethod, TraceInfo,
    TraceReader, analyze,
};
use niwaki_raster::{Algorithm, DeviceKind, Gpu, Renderer, Settings, study};
use rows::{Cell, Key, SceneRow, Study};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

/// The version of the layout of `study.json`.
const SCHEMA: u32 = 1;

/// The paper's scenes, as many triangles, and whether its shadow algorithms were measured there.
const SCENES: [(&str, usize, bool); 2] = [
    ("serpents", study::ATRIUM_TRIANGLES, false),
    ("tessellated", study::TESSELLATED_TRIANGLES, true),
];

/// What is measured of a scene.
struct Job {
    spec: SceneSpec,
    cells: Vec<(Algorithm, usize)>,
}

/// A cell and what was measured of it so far.
struct Measured {
    key: Key,
    map_side: u32,
    visits: Vec<Visit>,
}

/// What a kind of device can do in a time that one waits for.
struct Defaults {
    triangles: Option<usize>,
    size: Size,
    frames: u32,
}

/// Runs the command.
pub(super) fn run(args: &StudyArgs) -> Result<ExitCode> {
    let study = measure_all(args)?;
    print(&study, &args.out);
    let is_good = study.failures.is_empty();
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The kind of a device, by which its meter is chosen.
pub(crate) fn kind(gpu: &Gpu) -> Kind {
    match gpu.kind() {
        DeviceKind::Software | DeviceKind::Integrated => Kind::Processor,
        DeviceKind::Discrete => Kind::Card,
        _ => Kind::Other,
    }
}

fn measure_all(args: &StudyArgs) -> Result<Study> {
    let options = args.settings.options(None)?;
    if args.margin.is_some_and(|margin| !(0.0..=3600.0).contains(&margin)) {
        bail!("--margin: 0 to 3600 seconds");
    }
    if args.margin == Some(0.0) && options.idle == IdlePolicy::Outside {
        bail!("--idle outside needs idle time to measure: leave --margin out");
    }
    // Arguments that cannot be are refused before a device is opened.
    jobs(args, Some(1))?;
    let gpu = Gpu::new().context(
        "the study draws on a Vulkan device (ci/setup-vulkan.sh installs a software one on Debian)",
    )?;
    let is_software = gpu.kind() == DeviceKind::Software;
    let defaults = match (args.quick, is_software) {
        (true, _) => {
            Defaults { triangles: Some(3_000), size: Size { width: 96, height: 54 }, frames: 4 }
        }
        (_, true) => {
            let size = Size { width: 320, height: 180 };
            Defaults { triangles: Some(20_000), size, frames: 20 }
        }
        _ => Defaults { triangles: None, size: Size { width: 1280, height: 720 }, frames: 200 },
    };
    let jobs = jobs(args, args.triangles.or(defaults.triangles))?;
    let mut sizes = if args.sizes.is_empty() { vec![defaults.size] } else { args.sizes.clone() };
    sizes.sort_by_key(|size| std::cmp::Reverse(size.width * size.height));
    sizes.dedup();
    let frames = args.frames.unwrap_or(defaults.frames);
    let repeats = args.repeats.unwrap_or(if args.quick { 1 } else { 3 });
    let mut study = Study {
        schema: SCHEMA,
        run: machine::describe(),
        device: gpu.name().to_owned(),
        device_times: gpu.has_timestamps(),
        ..Study::default()
    };
    study.run.arguments = std::env::args().skip(2).collect();
    study.run.threads = vec![machine::cores()];
    let opened = args.source.open(gpu.name(), kind(&gpu))?;
    let (mut session, mut file) = (None, None);
    match opened {
        Opened::Nothing(reason) => study.source.notes.push(format!("no meter: {reason}")),
        Opened::Meters(meters, notes) => {
            let started = Session::start(meters, notes, args.rate)?;
            study.source.name = Some(started.info().sensor.name.clone());
            study.source.notes.extend_from_slice(started.notes());
            session = Some(started);
        }
        Opened::File(path) => {
            study.source.name = Some(path.display().to_string());
            file = Some(path);
        }
    }
    let has_meter = session.is_some() || file.is_some();
    let default_margin = if has_meter { 1.0 } else { 0.0 };
    let margin = Duration::from_secs_f64(args.margin.unwrap_or(default_margin));
    let metered = session.as_ref().map(|session| Metered { session, options: &options });

    let steps: usize = jobs.iter().map(|j| j.cells.len()).sum();
    let progress = Progress::new(steps * sizes.len() * repeats as usize);
    let mut all: Vec<Measured> = Vec::new();
    let mut least_s = None;
    for job in &jobs {
        let name = &job.spec.name;
        progress.message(&format!("{name}: load"));
        let scene = match load(args, &job.spec) {
            Ok(scene) => scene,
            Err(error) => {
                fail(&mut study, &progress, &job.spec.describe(), &error);
                progress.skip(job.cells.len() * sizes.len() * repeats as usize);
                continue;
            }
        };
        let triangles = scene.scene.mesh.len();
        study.scenes.push(SceneRow { name: name.clone(), triangles });
        for size in &sizes {
            let first = all.len();
            all.extend(job.cells.iter().map(|&(algorithm, lights)| {
                let maps =
                    matches!(algorithm, Algorithm::ShadowMaps | Algorithm::VarianceShadowMaps);
                let side = Settings::new(algorithm, size.width, size.height).shadow_resolution;
                let lights = u32::try_from(lights).unwrap_or(u32::MAX);
                let (width, height) = (size.width, size.height);
                let key = Key { scene: name.clone(), width, height, algorithm, lights };
                Measured { key, map_side: if maps { side } else { 0 }, visits: Vec::new() }
            }));
            let mut renderer = None;
            let mut broken = vec![false; job.cells.len()];
            for repeat in 0..repeats {
                for k in 0..job.cells.len() {
                    let key = &all[first + k].key;
                    let what = format!("{name} {} {}", key.size(), key.name());
                    progress.message(&format!("{what}, {} of {repeats}", repeat + 1));
                    if broken[k] {
                        progress.step();
                        continue;
                    }
                    let mut play = Play {
                        path: &scene.path,
                        size: [size.width, size.height],
                        frames,
                        warm_up: if repeat == 0 { frames } else { WARM_UP },
                        margin,
                        least_s: 0.0,
                    };
                    let result = prepared(&gpu, &mut renderer, &scene, key).and_then(|renderer| {
                        if let (None, Some(metered)) = (least_s, &metered) {
                            let (least, refresh) = least_time(metered, renderer, &play)?;
                            least_s = Some(least);
                            study.source.refresh_s = Some(refresh);
                        }
                        play.least_s = least_s.unwrap_or(0.0);
                        visit(renderer, &play, metered.as_ref())
                    });
                    match result {
                        Ok(visit) => {
                            if let Some(Err(error)) = &visit.power {
                                let error = anyhow::anyhow!("times alone, no energy: {error}");
                                fail(&mut study, &progress, &what, &error);
                            }
                            all[first + k].visits.push(visit);
                        }
                        Err(error) => {
                            // What a device could not do once it will not do again.
                            broken[k] = true;
                            renderer = None;
                            fail(&mut study, &progress, &what, &error);
                        }
                    }
                    progress.step();
                    save(&mut study, &all, &args.out)?;
                }
            }
        }
    }
    progress.finish();
    drop(session);
    if let Some(path) = &file
        && let Err(error) = add_trace(path, &mut all, &mut study, &options)
    {
        let what = path.display().to_string();
        fail(&mut study, &progress, &what, &error.context("times alone, no energy"));
    }
    save(&mut study, &all, &args.out)?;
    Ok(study)
}

fn fail(study: &mut Study, progress: &Progress, what: &str, error: &anyhow::Error) {
    progress.warn(&format!("error: {what}: {error:#}"));
    study.failures.push(Failure { scene: what.to_owned(), error: format!("{error:#}") });
}

/// Scenes with the algorithms that draw them; `triangles` for procedural ones without a number, else
/// the paper's.
fn jobs(args: &StudyArgs, triangles: Option<usize>) -> Result<Vec<Job>> {
    let lights: Vec<usize> = match (args.lights.is_empty(), args.quick) {
        (false, _) => args.lights.iter().map(|n| usize::from(*n)).collect(),
        (true, true) => vec![2, 4],
        (true, false) => vec![2, 4, 6, 8],
    };
    let wanted = |a: &Algorithm| args.algorithms.is_empty() || args.algorithms.contains(a);
    let cells = |shadows: bool| -> Vec<(Algorithm, usize)> {
        let primary = Algorithm::PRIMARY.into_iter().filter(wanted);
        let mut cells: Vec<_> = primary.map(|a| (a, study::PRIMARY_LIGHTS)).collect();
        for algorithm in Algorithm::SHADOWS.into_iter().filter(|a| shadows && wanted(a)) {
            cells.extend(lights.iter().map(|n| (algorithm, *n)));
        }
        let mut once = Vec::new();
        for cell in cells {
            if !once.contains(&cell) {
                once.push(cell);
            }
        }
        once
    };
    let mut jobs = Vec::new();
    if args.scenes.is_empty() {
        for (name, papers, shadows) in SCENES {
            let spec = SceneSpec::parse(name, triangles.unwrap_or(papers))?;
            jobs.push(Job { spec, cells: cells(shadows) });
        }
    } else {
        let default = triangles.unwrap_or(study::TESSELLATED_TRIANGLES);
        let mut specs = SceneSpec::select(&args.scenes, &[], default, Vec::new)?;
        let names: Vec<String> = specs.iter().map(|spec| spec.name.clone()).collect();
        for spec in &mut specs {
            // Sizes of one procedural scene.
            if names.iter().filter(|name| **name == spec.name).count() > 1 {
                spec.name = spec.describe();
            }
        }
        jobs.extend(specs.into_iter().map(|spec| Job { spec, cells: cells(true) }));
    }
    jobs.retain(|job| !job.cells.is_empty());
    let is_atrium = |job: &Job| matches!(&job.spec.origin, Origin::Generated { name, .. } if name == SCENES[0].0);
    if let Some(dragon) = &args.dragon {
        SceneSpec::parse(&dragon.display().to_string(), 1).context("--dragon")?;
        if !jobs.iter().any(is_atrium) {
            bail!("--dragon is for the atrium, which is not among the scenes");
        }
    }
    Ok(jobs)
}

fn load(args: &StudyArgs, spec: &SceneSpec) -> Result<study::Study> {
    let found = match (&args.dragon, &spec.origin) {
        (Some(dragon), Origin::Generated { name, triangles }) if name == SCENES[0].0 => {
            let dragon = SceneSpec::parse(&dragon.display().to_string(), 1)?.load(args.seed)?;
            study::atrium_with(&dragon, *triangles, args.seed)
        }
        (_, Origin::Generated { name, .. }) => {
            // By its own name, as the study's scenes have lights of theirs.
            study::Study::of(SceneSpec { name: name.clone(), ..spec.clone() }.load(args.seed)?)
        }
        _ => study::Study::of(spec.load(args.seed)?),
    };
    if found.scene.mesh.is_empty() {
        bail!("the scene has no triangles");
    }
    Ok(found)
}

/// The scene's renderer, set up for a cell.
fn prepared<'a>(
    gpu: &Gpu,
    kept: &'a mut Option<Renderer>,
    study: &study::Study,
    key: &Key,
) -> Result<&'a mut Renderer> {
    let settings = Settings::new(key.algorithm, key.width, key.height);
    let lights = if key.algorithm.has_shadows() {
        study.shadow_lights(key.lights as usize)
    } else {
        study.lights.clone()
    };
    let renderer = match kept.take() {
        Some(mut renderer) => {
            renderer.set_settings(settings);
            renderer.set_lights(lights);
            renderer
        }
        None => Renderer::new(gpu, study.scene.clone(), lights, settings)?,
    };
    Ok(kept.insert(renderer))
}

/// The log of all visits, in the order of time.
fn log(study: &Study, all: &[Measured]) -> FrameLog {
    let names: Vec<&str> = study.scenes.iter().map(|s| s.name.as_str()).collect();
    let header =
        FrameLogHeader { clock: CLOCK, device: study.device.clone(), scene: names.join(" + ") };
    let mut frames: Vec<_> =
        all.iter().flat_map(|cell| &cell.visits).flat_map(|v| v.frames.clone()).collect();
    frames.sort_by_key(|frame| frame.start_ns);
    FrameLog { header, frames }
}

/// Writes everything.
fn save(study: &mut Study, all: &[Measured], out: &Path) -> Result<()> {
    let cell = |m: &Measured| Cell::of(m.key.clone(), m.map_side, &m.visits);
    study.cells = all.iter().filter_map(cell).collect();
    study.answers = answers::all(study);
    page::save(study, out)?;
    let path = out.join("study.json");
    crate::results::write_json(&path, study)?;
    let path = out.join("frames.jsonl");
    let failed = || format!("cannot write {}", path.display());
    let file = std::fs::File::create(&path).with_context(failed)?;
    log(study, all).write_json_lines(std::io::BufWriter::new(file)).with_context(failed)?;
    Ok(())
}

/// Brings the trace of an instrument together with the log of all visits, and measures each.
fn add_trace(
    path: &Path,
    all: &mut [Measured],
    study: &mut Study,
    options: &AnalysisOptions,
) -> Result<()> {
    let log = log(study, all);
    let whole = analyze(|| trace_of(path), Some(&log), options)?;
    let clock = whole.clock.context("the trace was not brought together with the log")?;
    if !whole.info.sensor.name.is_empty() {
        study.source.name = Some(format!("{} ({})", whole.info.sensor.name, path.display()));
    }
    study.source.refresh_s = Some(whole.sensor.refresh_s);
    let mut words = format!(
        "the clocks of trace and log were brought together by {}: drift {:.3} ± {:.3} ppm, deviation \
         {:.1} µs",
        clock.method.name(),
        clock.drift_ppm,
        clock.drift_error_ppm,
        1e-3 * clock.residual_ns
    );
    if clock.is_ambiguous() {
        words += "; AMBIGUOUS: another position fits nearly as well";
    }
    study.source.notes.push(words);
    // Each visit with its part of the trace, on the trace's clock from here on.
    let mut visits: Vec<&mut Visit> = all.iter_mut().flat_map(|cell| &mut cell.visits).collect();
    visits.sort_by_key(|visit| visit.span_ns);
    #[expect(clippy::cast_possible_truncation, reason = "times of a trace fit")]
    let place = |ns: i64| clock.to_trace(ns).round() as i64;
    let info = TraceInfo { clock: CLOCK, ..whole.info.clone() };
    let options = AnalysisOptions { sync: SyncMethod::SharedClock, ..options.clone() };
    let measure = |visit: &mut Visit, blocks: Vec<Block>| {
        let mut log = FrameLog { frames: visit.frames.clone(), ..FrameLog::default() };
        log.header.clock = CLOCK;
        for frame in &mut log.frames {
            (frame.start_ns, frame.end_ns) = (place(frame.start_ns), place(frame.end_ns));
        }
        let measured = power_of(&info, blocks, Some(&log), &options);
        visit.power = Some(measured.map_err(|error| format!("{error:#}")));
    };
    let mut reader = trace_of(path)?;
    let mut rest = visits.into_iter().peekable();
    let mut blocks: Vec<Block> = Vec::new();
    while let Some(block) = reader.next_block()? {
        let Some(last) = block.times_ns.iter().max().copied() else { continue };
        while let Some(visit) = rest.peek_mut() {
            let (from, to) = (place(visit.span_ns.0), place(visit.span_ns.1));
            let part = part(&block, from, to);
            if !part.is_empty() {
                blocks.push(part);
            }
            // Rows may come late by some places.
            if last < to + 1_000_000 {
                break;
            }
            measure(visit, std::mem::take(&mut blocks));
            rest.next();
        }
    }
    for visit in rest {
        measure(visit, std::mem::take(&mut blocks));
    }
    Ok(())
}

/// The main tables and answers, for a terminal.
fn print(study: &Study, out: &Path) {
    println!("{}", tables::cells(study).to_text());
    for table in tables::table_1(study) {
        println!("{}\n{}", table.title, table.table.to_text());
    }
    for answer in &study.answers {
        println!("{}", answer.question);
        for words in &answer.words {
            println!("  {words}");
        }
    }
    for failure in &study.failures {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    println!("\nresults {0}/study.json\nreport  {0}/study.html", out.display());
}
