//! `cargo xtask tune`: frames that keep their time, by several controllers, on the Vulkan device or on simulated
//! ones (Ganestam and Doggett 2012).

mod args;
mod page;
mod pilots;
mod plant;
mod plots;
mod rows;
mod stage;

pub(crate) use args::TuneArgs;

use crate::{
    bench::progress::Progress, machine, render::Size, results::Failure, scenes::SceneSpec,
};
use anyhow::{Context, Result, bail};
use niwaki_frame_control::{
    FrameRecord, Ladder, RenderSettings, Summary, frames_off, kendall_tau_b,
};
use niwaki_gpu_model::{
    Device as DeviceTable, KernelCounts, Workload, microbench, workload::BackgroundSampler,
};
use niwaki_gpu_tracer::{TracerCounts, TracerModel};
use niwaki_metrics::TreeStats;
use niwaki_trace::Mode;
use niwaki_trace_vulkan::{Device, DeviceKind, Tracer, TreeLayout};
use pilots::{Model, Pilot, Start};
use plant::Plant;
use rows::{Flight, Rank, Study, Tour};
use stage::Stage;
use std::{process::ExitCode, sync::Arc, time::Instant};

/// The version of the layout of `tune.json`.
const SCHEMA: u32 = 1;

/// Frames in which controllers learn, and frames after a turn that are looked at.
const FIRST: usize = 10;

/// The scenes of the paper: as many triangles.
const SCENES: [(&str, usize); 2] = [("fairy", 174_117), ("cabin", 422_635)];

/// What simulated devices run: a kernel over a binary tree without rare cases. Their law is another, so
/// there is nothing to be counted.
const SMALL_KERNEL: KernelCounts = KernelCounts {
    compute_per_traversal: 38.0,
    compute_per_intersection: 23.0,
    compute_constant: 60.0,
    memory_per_traversal: 5.0,
    memory_per_intersection: 3.0,
    memory_constant: 3.0,
    bytes_per_memory_instruction: 16.0,
};

/// Runs the command.
pub(crate) fn run(args: &TuneArgs) -> Result<ExitCode> {
    if let Some(target) = args.target_ms
        && !(target.is_finite() && target > 0.0)
    {
        bail!("--target-ms {target} is no frame time; give milliseconds above 0, such as 16.7");
    }
    if !(0.0..=1.0).contains(&args.ao_radius) {
        bail!("--ao-radius {} is not a share from 0 to 1", args.ao_radius);
    }
    let specs = scenes(args)?;
    let steps = specs.len() * args.devices.len() * 3;
    let progress = Progress::new(steps);
    let mut study = Study { schema: SCHEMA, run: machine::describe(), ..Study::default() };
    study.run.arguments = std::env::args().skip(2).collect();
    let mut vulkan = None;
    for name in &args.devices {
        for spec in &specs {
            let scene = spec.name.clone();
            progress.message(&format!("{scene} on {name}"));
            match tour(args, spec, name, &mut vulkan, &progress) {
                Ok(tour) => study.tours.push(tour),
                Err(error) => {
                    progress.warn(&format!("error: {scene} on {name}: {error:#}"));
                    study.failures.push(Failure { scene, error: format!("{error:#}") });
                }
            }
            page::save(&study, &args.out)?;
        }
    }
    progress.finish();
    for (number, tour) in study.tours.iter().enumerate() {
        println!(
            "\n{}: {} triangles, {}×{}, {:.2} ms wanted, sampling {:.2} ms, a prediction {:.2} µs{}\n{}",
            tour.title(),
            tour.triangles,
            tour.width,
            tour.height,
            tour.target_ms,
            tour.sampling_ms,
            tour.prediction_us,
            if tour.is_simulated { " (simulated)" } else { "" },
            page::summary(tour, number).to_text()
        );
        if !tour.ranks.is_empty() {
            println!(
                "Does the model order settings as the device does?\n{}",
                page::ranks(tour, number).to_text()
            );
        }
    }
    for failure in &study.failures {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    println!("\nresults {0}/tune.json\nreport  {0}/tune.html", args.out.display());
    Ok(if study.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn scenes(args: &TuneArgs) -> Result<Vec<SceneSpec>> {
    let default = || {
        let sized = |(name, triangles): (&str, usize)| {
            let triangles = if args.quick { 10_000 } else { triangles };
            SceneSpec::parse(&format!("{name}:{triangles}"), triangles)
        };
        SCENES.into_iter().filter_map(|scene| sized(scene).ok()).collect()
    };
    SceneSpec::select(&args.scenes, &[], if args.quick { 10_000 } else { 174_117 }, default)
}

/// The Vulkan device and its table, once they were wanted.
struct Real {
    device: Device,
    table: DeviceTable,
}

fn real<'a>(args: &TuneArgs, known: &'a mut Option<Real>) -> Result<&'a Real> {
    if known.is_none() {
        let device = Device::new()?;
        let table = match &args.model {
            Some(model) => DeviceTable::load(model)?,
            None => {
                let mut settings = microbench::Settings::default();
                if args.quick {
                    settings.working_set_bytes = Some(8 << 20);
                    settings.repeats = 2;
                }
                let table = microbench::measure(&device, &settings)
                    .context("cannot measure the device; give its table by --model")?
                    .device;
                std::fs::create_dir_all(&args.out)
                    .with_context(|| format!("cannot make {}", args.out.display()))?;
                let path = args.out.join("device.toml");
                std::fs::write(&path, table.to_toml())
                    .with_context(|| format!("cannot write {}", path.display()))?;
                table
            }
        };
        *known = Some(Real { device, table });
    }
    known.as_ref().context("the device was just opened")
}

/// A scene on a device, by all controllers.
fn tour(
    args: &TuneArgs,
    spec: &SceneSpec,
    name: &str,
    vulkan: &mut Option<Real>,
    progress: &Progress,
) -> Result<Tour> {
    let is_simulated = name != "vulkan";
    let (table, is_software) = if is_simulated {
        (DeviceTable::load(args.model.as_deref().unwrap_or(name))?, false)
    } else {
        let real = real(args, vulkan)?;
        (real.table.clone(), real.device.info().kind == DeviceKind::Cpu)
    };
    let size = match (args.size, args.quick, is_software) {
        (Some(Size { width, height }), ..) => [width, height],
        (None, true, _) => [64, 36],
        (None, false, true) => [320, 180],
        (None, false, false) => [1280, 720],
    };
    let stage = Stage::new(args, spec, size, is_simulated)?;
    progress.step();
    let counts = match vulkan.as_ref().filter(|_| !is_simulated) {
        Some(real) => {
            let is_fused = Tracer::new(&real.device)?.is_fused();
            TracerCounts::new(TreeLayout::Wide, Mode::Watertight, is_fused)?
        }
        None => TracerCounts { pixel: SMALL_KERNEL, compute_per_direction: 0.0 },
    };
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let model = TracerModel::new(table.clone(), counts, pixels);
    let model: Model = Arc::new(move |s: &RenderSettings, w: &Workload| {
        let settings =
            niwaki_gpu_model::RaySettings { ao_rays: f64::from(s.ao_rays), shadows: s.shadows };
        model.milliseconds(&settings, w, s.render_scale).unwrap_or(f64::NAN)
    });
    let mut plant = if is_simulated {
        Plant::simulated(name, &stage, args.controllers.len(), args.seed)?
    } else {
        Plant::vulkan(&real(args, vulkan)?.device, &stage)?
    };
    let ladder = Ladder::ray_tracing(args.max_ao, args.ao_radius)?;
    // Kernels are compiled at the first frame.
    plant.probe(&stage, 0, &ladder.rungs()[ladder.top().min(2)])?;
    let first = stage.workload(&stage.sampling, &stage.cameras[0]);
    let target_ms = match args.target_ms {
        Some(target) => target,
        None => {
            let usual = ladder.rungs().iter().position(|s| s.ao_rays == 16);
            let rung = usual.unwrap_or(ladder.top());
            plant.probe(&stage, 0, &ladder.rungs()[rung])?
        }
    };
    let rung = by_hand(&mut plant, &stage, &ladder, target_ms)?;
    progress.step();
    let start = Start { ladder: &ladder, model: model.clone(), target_ms, workload: first, rung };
    let mut pilots: Vec<Pilot> =
        args.controllers.iter().map(|name| start.pilot(name)).collect::<Result<_>>()?;
    let (flights, sampling_ms, late_samples) =
        fly(&mut plant, &stage, &ladder, &mut pilots, target_ms)?;
    let ranks = rank(args, &mut plant, &stage, &ladder, &model)?;
    progress.step();
    let turn = if args.turn { Some(stage.cameras.len() / 2) } else { None };
    Ok(Tour {
        scene: spec.name.clone(),
        triangles: stage.scene.mesh.len(),
        depth: TreeStats::of(&stage.bvh).depth_max,
        device: if is_simulated { format!("simulated {name}") } else { table.name.clone() },
        is_simulated,
        model: format!("{} ({})", table.name, table.source),
        width: size[0],
        height: size[1],
        target_ms,
        ao_rays: ladder.rungs().iter().map(|s| s.ao_rays).collect(),
        flights: flights.into_iter().map(|flight| summed(flight, turn)).collect(),
        sampling_ms,
        late_samples,
        prediction_us: prediction_us(&model, &ladder, &first),
        ranks,
    })
}

/// The rung whose time in the first frame is nearest to the target: what a person would choose.
fn by_hand(
    plant: &mut Plant,
    stage: &Stage,
    ladder: &Ladder<RenderSettings>,
    target_ms: f64,
) -> Result<usize> {
    let (mut low, mut high) = (0, ladder.top());
    // More rays take longer, so halving will do.
    while low < high {
        let middle = (low + high).div_ceil(2);
        if plant.probe(stage, 0, &ladder.rungs()[middle])? <= target_ms {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    let next = (low + 1).min(ladder.top());
    let mut off = |rung: usize| -> Result<f64> {
        Ok((plant.probe(stage, 0, &ladder.rungs()[rung])? - target_ms).abs())
    };
    Ok(if off(next)? < off(low)? { next } else { low })
}

/// All frames, each by all controllers in turns. Also the median of what sampling took, and how many views were not
/// sampled in time.
fn fly(
    plant: &mut Plant,
    stage: &Stage,
    ladder: &Ladder<RenderSettings>,
    pilots: &mut [Pilot],
    target_ms: f64,
) -> Result<(Vec<Flight>, f64, usize)> {
    let sampler = BackgroundSampler::spawn(stage.sampled.clone(), stage.sampling.clone())
        .context("cannot start the sampler")?;
    let delay = plant.delay();
    let mut flights: Vec<Flight> = pilots
        .iter()
        .map(|pilot| Flight {
            controller: pilot.name.clone(),
            records: Vec::with_capacity(stage.cameras.len()),
            summary: None,
            off_after_turn: None,
        })
        .collect();
    let mut numbers: Vec<Vec<u64>> = vec![Vec::new(); pilots.len()];
    let (mut took, mut late) = (Vec::new(), 0);
    submit(&sampler, stage, 0);
    // A frame that nobody sees, as applications draw some while they load.
    let first = wait(&sampler, 0, false)?;
    for (k, pilot) in pilots.iter_mut().enumerate() {
        let decision = pilot.controller.decide(&first.workload);
        let rung = decision.rung.min(ladder.top());
        let measured_ms = plant.draw(stage, k, 0, &ladder.rungs()[rung])?;
        pilot.controller.measure(decision.frame, Some(measured_ms));
    }
    for index in 0..stage.cameras.len() {
        let sampled =
            wait(&sampler, index as u64, matches!(plant, Plant::Vulkan { .. }) && index > 0)?;
        late += usize::from(sampled.frame != index as u64);
        took.push(1e3 * sampled.took.as_secs_f64());
        submit(&sampler, stage, index + 1);
        for (k, pilot) in pilots.iter_mut().enumerate() {
            let records = &mut flights[k].records;
            if let Some(known) = index.checked_sub(delay) {
                pilot.controller.measure(numbers[k][known], Some(records[known].measured_ms));
            }
            let decision = pilot.controller.decide(&sampled.workload);
            let rung = decision.rung.min(ladder.top());
            let measured_ms = plant.draw(stage, k, index, &ladder.rungs()[rung])?;
            numbers[k].push(decision.frame);
            records.push(FrameRecord {
                frame: index as u64,
                rung,
                model_ms: decision.model_ms,
                predicted_ms: decision.predicted_ms,
                measured_ms,
                target_ms,
                status: decision.status,
            });
        }
    }
    took.sort_by(f64::total_cmp);
    let median = took.get(took.len() / 2).copied().unwrap_or_default();
    Ok((flights, median, late))
}

fn submit(sampler: &BackgroundSampler, stage: &Stage, index: usize) {
    if let Some(camera) = stage.cameras.get(index) {
        sampler.submit(index as u64, stage.view(camera));
    }
}

/// The workload of a frame; if it need not be that one, the newest there is.
fn wait(
    sampler: &BackgroundSampler,
    frame: u64,
    newest_will_do: bool,
) -> Result<niwaki_gpu_model::workload::Sampled> {
    loop {
        match sampler.newest() {
            Some(sampled) if sampled.frame == frame || newest_will_do => return Ok(sampled),
            _ if !sampler.is_running() => bail!("the sampler has ended"),
            _ => std::thread::yield_now(),
        }
    }
}

/// Adds what a flight comes to.
fn summed(mut flight: Flight, turn: Option<usize>) -> Flight {
    let learnt = flight.records.get(FIRST..).unwrap_or_default();
    flight.summary = Summary::of(learnt).or_else(|| Summary::of(&flight.records));
    flight.off_after_turn = turn.map(|turn| {
        let end = (turn + FIRST).min(flight.records.len());
        frames_off(flight.records.get(turn..end).unwrap_or_default(), 0.1)
    });
    flight
}

/// Times rungs in some views and compares their order with the model's.
fn rank(
    args: &TuneArgs,
    plant: &mut Plant,
    stage: &Stage,
    ladder: &Ladder<RenderSettings>,
    model: &Model,
) -> Result<Vec<Rank>> {
    let frames = stage.cameras.len();
    let views = (args.rank as usize).min(frames);
    // Every rung of a short ladder, else about this many.
    const RUNGS: usize = 20;
    let rungs: Vec<usize> = (0..=ladder.top()).step_by((ladder.top() / RUNGS).max(1)).collect();
    let mut ranks = Vec::with_capacity(views);
    for view in 0..views {
        let frame = if views == 1 { 0 } else { view * (frames - 1) / (views - 1) };
        let workload = stage.workload(&stage.sampling, &stage.cameras[frame]);
        let mut timed = Vec::with_capacity(rungs.len());
        for &rung in &rungs {
            let settings = &ladder.rungs()[rung];
            timed.push((rung, model(settings, &workload), plant.probe(stage, frame, settings)?));
        }
        let (predicted, measured): (Vec<f64>, Vec<f64>) =
            timed.iter().map(|&(_, predicted, measured)| (predicted, measured)).unzip();
        let tau = kendall_tau_b(&predicted, &measured);
        ranks.push(Rank { frame: u32::try_from(frame).unwrap_or(u32::MAX), tau, rungs: timed });
    }
    Ok(ranks)
}

/// Microseconds of a prediction, the mean of some thousand.
fn prediction_us(model: &Model, ladder: &Ladder<RenderSettings>, workload: &Workload) -> f64 {
    const TIMES: u32 = 4096;
    let begun = Instant::now();
    let mut sum = 0.0;
    for i in 0..TIMES as usize {
        sum += model(&ladder.rungs()[i % ladder.rungs().len()], workload);
    }
    std::hint::black_box(sum);
    1e6 * begun.elapsed().as_secs_f64() / f64::from(TIMES)
}
