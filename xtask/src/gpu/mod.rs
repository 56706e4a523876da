//! `cargo xtask gpu`: builds and traversal on the GPU, beside the driver's own ray tracing.

mod args;
mod builds;
mod lanes;
mod page;
mod rows;
mod tables;
mod traces;

pub(crate) use args::GpuArgs;

use crate::{
    bench::{pool, progress::Progress, rays, timing::Effort},
    machine, registry,
    results::Failure,
    scenes::{Origin, SceneSpec},
};
use anyhow::{Context, Result, bail};
use niwaki_core::Builder;
use niwaki_trace::{AutoScene, Mode};
use niwaki_trace_vulkan::{
    Device, DeviceKind, DeviceOptions, DriverMethod, GpuLbvh, Schedule, Tracer, TreeLayout,
};
use rows::{DeviceRow, Study};
use std::{process::ExitCode, time::Duration};

/// The version of the layout of `gpu.json`.
const SCHEMA: u32 = 1;

/// The procedural scene that is measured without others.
const DEFAULT_SCENE: &str = "city";

/// What the arguments ask for.
struct Setup {
    device: Device,
    tracer: Tracer,
    lbvh: GpuLbvh,
    /// How long each measurement takes.
    effort: Effort,
    trees: Vec<Box<dyn Builder>>,
    layouts: Vec<TreeLayout>,
    modes: Vec<Mode>,
    schedules: Vec<Schedule>,
    ray_sets: Vec<String>,
    ray_count: usize,
    /// Rays of a set whose answers are checked.
    checked: usize,
    progress: Progress,
}

/// Runs the command.
pub(crate) fn run(args: &GpuArgs) -> Result<ExitCode> {
    pool(machine::cores())?.install(|| measure(args))
}

fn measure(args: &GpuArgs) -> Result<ExitCode> {
    // What is wrong with the arguments is said before anything takes time.
    let max_binding_bytes = args.binding_limit.map(|mib| mib << 20);
    // A software driver may take long for a million rays.
    let timeout = Duration::from_secs(600);
    let device =
        Device::open(&DeviceOptions { max_binding_bytes, timeout, ..DeviceOptions::default() })?;
    let is_software = device.info().kind == DeviceKind::Cpu;
    let specs = scenes(args, is_software)?;
    let counts = if is_software { (100_000, 5_000) } else { (1_000_000, 20_000) };
    let (ray_count, checked) = if args.quick { (10_000, 2_000) } else { counts };
    let default_groups = if is_software { 4 * u32::try_from(machine::cores())? } else { 1056 };
    let ray_sets = rays::names(&args.rays);
    let steps = specs.len() * (1 + ray_sets.len());
    let known = |name: &String| TreeLayout::ALL.into_iter().find(|l| l.name() == name);
    let trees = args.trees.iter().map(|name| registry::one_of_ours("--trees", name));
    let setup = Setup {
        tracer: Tracer::new(&device)?,
        lbvh: GpuLbvh::new(&device)?,
        effort: Effort::seconds(if args.quick { 0.02 } else { 0.2 }),
        trees: trees.collect::<Result<_>>()?,
        layouts: args.layouts.iter().filter_map(known).collect(),
        modes: traces::modes(&args.modes)?,
        schedules: traces::schedules(&args.schedules, args.groups.unwrap_or(default_groups)),
        ray_sets,
        ray_count: args.ray_count.unwrap_or(ray_count),
        checked,
        progress: Progress::new(steps),
        device,
    };
    let mut study = Study {
        schema: SCHEMA,
        run: machine::describe(),
        device: DeviceRow::from(setup.device.info()),
        builds: Vec::new(),
        traces: Vec::new(),
        failures: Vec::new(),
    };
    study.run.seconds_per_measurement = setup.effort.total.as_secs_f64();
    study.run.threads = vec![rayon::current_num_threads()];
    study.run.arguments = std::env::args().skip(2).collect();
    study.run.peers = DriverMethod::ALL
        .into_iter()
        .filter(|method| method.is_offered(setup.device.info()))
        .map(|method| format!("{} of {}", method.name(), study.device.driver))
        .collect();
    for spec in &specs {
        let name = named(spec);
        setup.progress.message(&format!("{name}: load"));
        if let Err(error) = measure_scene(&setup, args, spec, &name, &mut study) {
            setup.progress.warn(&format!("error: {name}: {error:#}"));
            study.failures.push(Failure { scene: name, error: format!("{error:#}") });
        }
        // An interrupted run leaves what it has.
        page::save(&study, &args.out)?;
        if setup.device.is_lost() {
            break;
        }
    }
    setup.progress.finish();
    println!("{}, {} ({})", study.device.name, study.device.driver, study.device.kind);
    for (title, table) in tables::all(&study) {
        println!("\n{title}\n{}", table.to_text());
    }
    if study.run.peers.is_empty() {
        println!("\nThe driver has no ray tracing of its own to compare with.");
    }
    for failure in &study.failures {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    let out = &args.out;
    println!("\nresults {0}/gpu.json\nreport  {0}/gpu.html", out.display());
    Ok(if study.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The scenes that were asked for, procedural ones in each size.
fn scenes(args: &GpuArgs, is_software: bool) -> Result<Vec<SceneSpec>> {
    let sizes = match (args.triangles.as_slice(), args.quick, is_software) {
        ([], true, _) => vec![10_000],
        ([], false, true) => vec![50_000],
        ([], false, false) => vec![1_000_000, 4_000_000, 10_000_000],
        (sizes, ..) => sizes.to_vec(),
    };
    let mut specs: Vec<SceneSpec> = Vec::new();
    for &size in &sizes {
        let default = || SceneSpec::generated(&[DEFAULT_SCENE], size);
        for spec in SceneSpec::select(&args.scenes, &args.folders, size, default)? {
            if !specs.contains(&spec) {
                specs.push(spec);
            }
        }
    }
    if specs.is_empty() {
        bail!("there is no scene to measure");
    }
    Ok(specs)
}

/// The name in tables: several sizes of a procedural scene are told apart.
fn named(spec: &SceneSpec) -> String {
    match &spec.origin {
        Origin::File(_) => spec.name.clone(),
        Origin::Generated { triangles, .. } => {
            format!("{}:{}", spec.name, crate::report::axis::short(*triangles as f64))
        }
    }
}

fn measure_scene(
    setup: &Setup,
    args: &GpuArgs,
    spec: &SceneSpec,
    name: &str,
    study: &mut Study,
) -> Result<()> {
    let scene = spec.load(args.seed)?;
    let mesh = &scene.mesh;
    if mesh.is_empty() {
        bail!("it has no triangles");
    }
    if !args.no_builds {
        setup.progress.message(&format!("{name}: build"));
        study.builds.extend(builds::measure(setup, name, mesh)?);
    }
    if args.no_traces || mesh.len() > args.trace_up_to {
        setup.progress.skip(setup.ray_sets.len());
        return Ok(());
    }
    setup.progress.message(&format!("{name}: record rays"));
    let recorded = rays::recorder().build_mesh(mesh)?;
    let wide = AutoScene::new(&recorded, mesh).context("cannot record rays")?;
    let sets = rays::record(&scene, &wide, &setup.ray_sets, setup.ray_count, args.seed);
    study.traces.extend(traces::measure(setup, name, mesh, &recorded, &sets)?);
    Ok(())
}
