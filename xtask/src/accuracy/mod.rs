//! `cargo xtask accuracy`: what quality costs in time.

mod analysis;
mod crops;
mod hybrid;
mod kernels;
mod model;
mod page;
mod scatter;
mod shadows;
mod variants;

use crate::bench::builds::{self, CONSTANTS};
use crate::bench::progress::Progress;
use crate::bench::{Failures, Group, Method, find_peers, pool, rays, traces};
use crate::cli::{AccuracyArgs, Suite};
use crate::machine;
use crate::power::source::PowerSource;
use crate::results::{Failure, Results, Row, Run, SceneInfo, Source, finite};
use crate::scenes::SceneSpec;
use analysis::{Point, Study};
use anyhow::{Context, Result, bail};
use niwaki_core::Builder;
use niwaki_metrics::lcv;
use niwaki_scene::Scene;
use serde::Serialize;
use std::path::Path;
use std::process::ExitCode;
use variants::Variant;

/// The ray sets that a point's time per ray is the mean of.
const RAY_SETS: [&str; 2] = ["camera", "bounce"];
/// Rays that leaf counts vary over.
const LCV_RAYS: usize = 20_000;

/// Runs the command.
pub(crate) fn run(args: &AccuracyArgs) -> Result<ExitCode> {
    if args.device.is_some() && args.suite != Suite::Model {
        bail!(
            "--device is of the suite model; the others draw on the Vulkan device, or not at all"
        );
    }
    if args.source != PowerSource::Auto && args.suite != Suite::Shadows {
        bail!("--source is of the suite shadows, which measures energy");
    }
    match args.suite {
        Suite::Hybrid => return hybrid::run(args),
        Suite::Shadows => return shadows::run(args),
        Suite::Model => return model::run(args),
        Suite::Builders | Suite::Kernels => {}
    }
    if args.size.is_some() || args.frames.is_some() {
        bail!(
            "--size and --frames are of the suites hybrid, shadows and model, which draw pictures"
        );
    }
    match args.suite {
        Suite::Kernels => kernels::run(args),
        _ => builders(args),
    }
}

fn scenes(args: &AccuracyArgs) -> Result<Vec<SceneSpec>> {
    let triangles = if args.quick { 5_000 } else { 100_000 };
    SceneSpec::select(&args.scenes, &args.folders, triangles, || {
        SceneSpec::generated(&["dragon", "atrium", "foliage"], triangles)
    })
}

fn builders(args: &AccuracyArgs) -> Result<ExitCode> {
    let specs = scenes(args)?;
    let variants = variants::select(&args.families, args.quick)?;
    let (families, mut builders): (Vec<_>, Vec<_>) =
        variants.into_iter().map(|Variant { family, builder }| (family, builder)).unzip();
    let family_of: Vec<(String, &str)> =
        builders.iter().zip(families).map(|(b, family)| (b.full_name(), family)).collect();
    let mut run = machine::describe();
    find_peers(false, "", &mut builders, &mut run)?;
    if builders.is_empty() {
        bail!("no builder is left to measure: Embree alone was asked for, and it is not there");
    }
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    let seconds = if args.quick { 0.1 } else { 0.5 };
    run.threads = vec![threads];
    run.arguments = std::env::args().skip(2).collect();
    run.seconds_per_measurement = seconds;
    let steps = specs.len() * builders.len() * (1 + 2 * RAY_SETS.len());
    let method = Method {
        builders,
        kernels: vec![crate::kernel::TraceKernel::best()],
        collapse: crate::kernel::Collapse::Optimal,
        robust: false,
        embree_config: String::new(),
        binary: Vec::new(),
        seconds,
        brief: false,
        all_cores: pool(machine::cores())?,
        progress: Progress::new(steps),
    };
    let mut failures = Failures::default();
    let mut points = Vec::new();
    for spec in &specs {
        method.progress.message(&format!("{}: load", spec.name));
        let measured = method
            .all_cores
            .install(|| spec.load(args.seed))
            .and_then(|scene| measure(args, &method, &scene, threads, &mut failures));
        match measured {
            Ok(found) => points.extend(found),
            Err(error) => {
                method.progress.warn(&format!("error: {}: {error:#}", spec.describe()));
                failures.fatal = true;
                failures.list.push(Failure { scene: spec.describe(), error: format!("{error:#}") });
            }
        }
    }
    method.progress.finish();
    for point in &mut points {
        if let Some((_, family)) = family_of.iter().find(|(name, _)| *name == point.label) {
            point.family = (*family).to_owned();
        }
    }
    let study = Study::of(run, points, failures.list);
    finish(args, &study)?;
    Ok(if failures.fatal { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Measures all builders on a scene.
fn measure(
    args: &AccuracyArgs,
    method: &Method,
    scene: &Scene,
    threads: usize,
    failures: &mut Failures,
) -> Result<Vec<Point>> {
    if scene.mesh.is_empty() {
        bail!("it has no triangles");
    }
    let count = if args.quick { 20_000 } else { 200_000 };
    let sets = method.all_cores.install(|| {
        let tree = rays::recorder().build_mesh(&scene.mesh)?;
        let wide = niwaki_trace::AutoScene::new(&tree, &scene.mesh)?;
        anyhow::Ok(rays::record(scene, &wide, &RAY_SETS.map(str::to_owned), count, args.seed))
    })?;
    let mut judged = Vec::new();
    let mut group = Group::new(method, (&scene.name, &scene.mesh), threads, &mut judged, failures)?;
    let built = builds::measure(method, &mut group);
    let sample: Vec<_> = sets
        .iter()
        .find(|set| set.name == "bounce")
        .map(|set| rays::blocks_of(&set.rays, LCV_RAYS))
        .unwrap_or_default();
    let mut lcvs = Vec::with_capacity(built.len());
    let mut results = Results {
        runs: vec![Run::default()],
        scenes: vec![SceneInfo {
            name: scene.name.clone(),
            triangles: scene.mesh.len(),
            ..SceneInfo::default()
        }],
        ..Results::default()
    };
    for built in &built {
        method.progress.message(&format!("{}: leaf counts {}", scene.name, built.row.builder));
        lcvs.push(method.all_cores.install(|| lcv(&built.bvh, &scene.mesh, &sample)));
        results.rows.push(Row::Build(built.row.clone()));
    }
    let traced = traces::measure(method, &mut group, built, &sets);
    results.rows.extend(traced.into_iter().map(Row::Trace));
    let groups = crate::report::groups(&results);
    let group = groups.first().context("nothing could be measured")?;
    let costs = group.costs();
    let mut points = Vec::new();
    for (row, lcv) in group.builds.iter().zip(lcvs) {
        // The tree under our kernel; a peer's own structure says nothing about its tree.
        let cost = costs.iter().find(|(engine, _)| {
            engine.source == row.source && engine.builder == row.builder && !engine.is_peers_own()
        });
        let Some((_, cost)) = cost else { continue };
        points.push(Point {
            scene: scene.name.clone(),
            triangles: scene.mesh.len(),
            family: String::new(),
            label: match row.source {
                Source::Niwaki => row.builder.clone(),
                source => format!("{}:{}", source.name(), row.builder),
            },
            ours: row.source == Source::Niwaki,
            build_ms: row.ms_median,
            once_ms: cost.once,
            ray_ns: cost.per_ray * 1e6,
            references: row.references,
            peak_bytes: row.peak_bytes,
            sah: row.sah,
            epo: row.epo,
            lcv: finite(lcv),
            on_front: false,
        });
    }
    Ok(points)
}

/// Prints and writes everything.
fn finish(args: &AccuracyArgs, study: &Study) -> Result<()> {
    for table in study.tables() {
        println!("{}\n{}", table.0, table.1.to_text());
    }
    match &study.model {
        Some(Ok(model)) => {
            let path = args.out.join("cost-model.csv");
            std::fs::create_dir_all(&args.out)
                .with_context(|| format!("cannot create {}", args.out.display()))?;
            std::fs::write(&path, model.to_csv())
                .with_context(|| format!("cannot write {}", path.display()))?;
            println!("cost model {}", path.display());
        }
        Some(Err(error)) => println!("no cost model: {error}"),
        None => {}
    }
    let page = page::write(study, &args.out)?;
    let note = format!("SAH and EPO with C_I = {}, C_T = {}", CONSTANTS.inner, CONSTANTS.triangle);
    conclude(args, study, &study.failures, &page, &note)
}

/// Writes what a suite found beside its page, and says what failed, a note on the tables above and where
/// everything lies.
fn conclude(
    args: &AccuracyArgs,
    study: &impl Serialize,
    failures: &[Failure],
    page: &Path,
    note: &str,
) -> Result<()> {
    let json = args.out.join("accuracy.json");
    crate::results::write_json(&json, study)?;
    for failure in failures {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    println!("{note}\nresults {}\nreport  {}", json.display(), page.display());
    Ok(())
}
