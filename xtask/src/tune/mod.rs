//! `cargo xtask tune`: frames that keep their time, by several controllers, on the Vulkan device or on simulated
//! ones (Ganestam and Doggett 2012).

mod args;
pub(crate) mod device;
pub(crate) mod fit;
mod flight;
mod hybrid;
mod page;
pub(crate) mod pilots;
pub(crate) mod plant;
mod plots;
mod rows;
pub(crate) mod stage;

pub(crate) use args::TuneArgs;

use crate::{bench::progress::Progress, machine, results::Failure, scenes::SceneSpec};
use anyhow::{Result, bail};
use args::Renderer;
use device::{Real, asked, tracer_model};
use fit::fit;
use flight::{FIRST, Tracing, fly};
use niwaki_frame_control::{Ladder, RenderSettings};
use niwaki_gpu_model::{Device as DeviceTable, Workload};
use niwaki_metrics::TreeStats;
use niwaki_trace_vulkan::DeviceKind;
use pilots::Model;
use plant::Plant;
use rows::{Flight, Study, Tour};
use stage::{Setting, Stage};
use std::process::ExitCode;

/// The version of the layout of `tune.json`.
const SCHEMA: u32 = 2;

/// The scenes of the paper: as many triangles.
const SCENES: [(&str, usize); 2] = [("fairy", 174_117), ("cabin", 422_635)];

/// Scenes in which something reflects and refracts.
const MIRRORS: [(&str, usize); 2] = [("gallery", 100_000), ("courtyard", 100_000)];

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
    if args.renderer == Renderer::Hybrid {
        hybrid::check(args)?;
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
            let tour = match args.renderer {
                Renderer::Tracer => tour(args, spec, name, &mut vulkan, &progress),
                Renderer::Hybrid => hybrid::tour(args, spec, &progress),
            };
            match tour {
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
            "\n{}: {} triangles, {}×{}, {:.2} ms wanted, sampling {:.2} ms, a prediction {:.2} µs{}{}\n{}",
            tour.title(),
            tour.triangles,
            tour.width,
            tour.height,
            tour.target_ms,
            tour.sampling_ms,
            tour.prediction_us,
            if tour.is_simulated { " (simulated)" } else { "" },
            tour.noise().map_or_else(String::new, |noise| format!(
                ", the same frame off by {:.1} %",
                100.0 * noise
            )),
            page::summary(tour, number).to_text()
        );
        if let Some(fit) = &tour.fit {
            println!("{}\n{}", fit.line(&tour.scene), page::parameters(fit, number).to_text());
        }
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
        let scenes = match args.renderer {
            Renderer::Tracer => SCENES,
            Renderer::Hybrid => MIRRORS,
        };
        scenes.into_iter().filter_map(|scene| sized(scene).ok()).collect()
    };
    SceneSpec::select(&args.scenes, &[], if args.quick { 10_000 } else { 174_117 }, default)
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
    if !is_simulated && vulkan.is_none() {
        *vulkan = Some(Real::open(args.model.as_deref(), args.quick, &args.out)?);
    }
    let real = vulkan.as_ref().filter(|_| !is_simulated);
    let table = match real {
        Some(real) => real.table.clone(),
        None => DeviceTable::load(args.model.as_deref().unwrap_or(name))?,
    };
    let is_software = real.is_some_and(|real| real.device.info().kind == DeviceKind::Cpu);
    let size = args.size(is_software);
    let setting = Setting {
        builder: &args.builder,
        frames: args.frames(),
        turn: args.turn,
        size,
        ao_radius: args.ao_radius,
        sampling: args.sampling,
        seed: args.seed,
    };
    let stage = Stage::new(spec, &setting, is_simulated)?;
    progress.step();
    let model = tracer_model(table.clone(), real.map(|real| &real.device), size)?;
    let mut plant = match real {
        Some(real) => Plant::vulkan(&real.device, &stage)?,
        None => Plant::simulated(name, &stage, args.controllers.len(), args.seed)?,
    };
    let ladder = Ladder::ray_tracing(args.max_ao, args.ao_radius)?;
    // Kernels are compiled at the first frame.
    plant.probe(&stage, 0, &ladder.rungs()[ladder.top().min(2)])?;
    let measured = model.clone();
    let (model, fit) = if is_simulated || args.no_fit {
        (model, None)
    } else {
        progress.message(&format!("{}: fitting the model", spec.name));
        let (model, fit) = fit(&mut plant, &stage, &ladder, &model)?;
        (model, Some(fit))
    };
    let (measured, model) = (asked(measured), asked(model));
    progress.step();
    let mut craft = Tracing::new(plant, stage)?;
    let flown = fly(&mut craft, &args.flight(&ladder, model, pilots::features))?;
    progress.step();
    let mut flights = flown.flights;
    if fit.is_some() {
        // Feedback asks the model of another view than the one that it draws.
        for flight in flights.iter_mut().filter(|flight| flight.controller != "feedback") {
            flight.unfitted_error = unfitted_error(flight, &measured, &ladder, &flown.work);
        }
    }
    let Tracing { stage, .. } = craft;
    Ok(Tour {
        scene: spec.name.clone(),
        triangles: stage.scene.mesh.len(),
        depth: TreeStats::of(&stage.bvh).depth_max,
        renderer: args.renderer,
        device: if is_simulated { format!("simulated {name}") } else { table.name.clone() },
        is_simulated,
        model: format!("{} ({})", table.name, table.source),
        width: size[0],
        height: size[1],
        target_ms: flown.target_ms,
        rungs: ladder.rungs().to_vec(),
        flights: args.summed(flights),
        fit,
        sampling_ms: flown.sampling_ms,
        late_samples: flown.late_samples,
        again_ms: flown.again_ms,
        prediction_us: flown.prediction_us,
        ranks: flown.ranks,
    })
}

/// The mean error that the model would have had with parameters as they were measured, in frames that count.
fn unfitted_error(
    flight: &Flight,
    measured: &Model<Workload>,
    ladder: &Ladder<RenderSettings>,
    workloads: &[Workload],
) -> Option<f64> {
    let known =
        flight.records.iter().zip(workloads).filter(|(record, _)| record.model_ms.is_some());
    let errors: Vec<f64> = known
        .map(|(record, workload)| {
            let settings = &ladder.rungs()[record.rung];
            (measured(settings, workload) - record.measured_ms).abs() / record.measured_ms
        })
        .collect();
    let counted = errors.get(FIRST..).filter(|rest| !rest.is_empty()).unwrap_or(&errors);
    (!counted.is_empty()).then(|| counted.iter().sum::<f64>() / counted.len() as f64)
}
