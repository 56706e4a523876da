//! `cargo xtask bench`: scenes × builders × threads × ray sets.

pub(crate) mod builds;
pub(crate) mod engines;
mod matrix;
mod pictures;
pub(crate) mod progress;
pub(crate) mod rays;
pub(crate) mod timing;
pub(crate) mod traces;

pub(crate) use matrix::Shard;

use crate::cli::BenchArgs;
use crate::kernel::{Collapse, TraceKernel};
use crate::registry::{self, TreeBuilder};
use crate::results::{Failure, Results, Row, Run, SceneInfo, Source};
use crate::scenes::{SceneSpec, drop_repeated, make_names_unique};
use crate::{machine, report};
use anyhow::{Context, Error, Result, bail};
use builds::Judgement;
use matrix::{ScenePlan, plan};
use niwaki_core::{Builder, TriangleMesh};
use niwaki_peers::{Embree, EmbreeSettings};
use niwaki_scene::Scene;
use niwaki_trace::AutoScene;
use progress::Progress;
use rayon::{ThreadPool, ThreadPoolBuilder};
use rays::RaySet;
use std::path::PathBuf;
use std::process::ExitCode;

/// What the arguments ask for.
struct Setup {
    method: Method,
    ray_sets: Vec<String>,
    ray_count: usize,
    seed: u64,
    samples: u32,
    pictures: Option<PathBuf>,
    credits: Vec<String>,
    files: Vec<PathBuf>,
}

/// Who is measured, and how.
pub(crate) struct Method {
    pub(crate) builders: Vec<TreeBuilder>,
    pub(crate) kernels: Vec<TraceKernel>,
    /// How binary trees become wide ones.
    pub(crate) collapse: Collapse,
    /// Embree's robust mode is measured too.
    pub(crate) robust: bool,
    /// What Embree's device is configured with besides its threads.
    pub(crate) embree_config: String,
    /// Builders whose binary trees are traced too, by the scalar reference kernel.
    pub(crate) binary: Vec<String>,
    /// Least time of each measurement.
    pub(crate) seconds: f64,
    /// Only times and SAH: no end-point overlap, no peaks of memory, no structures of the peers'
    /// own.
    pub(crate) brief: bool,
    pub(crate) all_cores: ThreadPool,
    pub(crate) progress: Progress,
}

/// A scene at a number of threads.
pub(crate) struct Group<'a> {
    pub(crate) name: &'a str,
    pub(crate) mesh: &'a TriangleMesh,
    threads: usize,
    pool: ThreadPool,
    all_cores: &'a ThreadPool,
    embree: Option<Embree>,
    /// Judgements of our trees of this scene, by builder.
    judged: &'a mut Vec<(String, Judgement)>,
    failures: &'a mut Failures,
}

/// What went wrong so far.
#[derive(Default)]
pub(crate) struct Failures {
    pub(crate) list: Vec<Failure>,
    /// A scene or a builder of ours failed, not just a peer.
    pub(crate) fatal: bool,
}

impl<'a> Group<'a> {
    /// Starts the threads, and Embree's if one of its builders takes part.
    pub(crate) fn new(
        method: &'a Method,
        (name, mesh): (&'a str, &'a TriangleMesh),
        threads: usize,
        judged: &'a mut Vec<(String, Judgement)>,
        failures: &'a mut Failures,
    ) -> Result<Self> {
        // One device at a time: Embree takes the largest number of threads of all that live.
        let embree = if method.builders.iter().any(|b| b.source() == Source::Embree) {
            let config = method.embree_config.clone();
            Some(Embree::with_settings(&EmbreeSettings { library: None, threads, config })?)
        } else {
            None
        };
        let all_cores = &method.all_cores;
        let pool = pool(threads)?;
        Ok(Self { name, mesh, threads, pool, all_cores, embree, judged, failures })
    }

    fn title(&self) -> String {
        format!("{}, {} threads", self.name, self.threads)
    }

    fn fail(&mut self, builder: &TreeBuilder, error: &Error) {
        self.failures.fatal |= builder.source() == Source::Niwaki;
        self.failures.list.push(Failure {
            scene: self.name.to_owned(),
            error: format!("{} at {} threads: {error:#}", builder.full_name(), self.threads),
        });
    }
}

/// Runs the command.
pub(crate) fn run(args: &BenchArgs) -> Result<ExitCode> {
    let mut run = machine::describe();
    let mut failures = Failures::default();
    let specs = scenes(args, &mut failures)?;
    let threads = threads(args);
    let plans = plan(specs.len(), &threads, args.shard);
    let mut builders = registry::select(&args.builders)?;
    if args.no_peers {
        builders.retain(|builder| builder.source() == Source::Niwaki);
    }
    find_peers(args.peers, &args.embree_config, &mut builders, &mut run)?;
    if builders.is_empty() {
        bail!("no builder is left to measure");
    }
    let ray_sets = rays::names(&args.rays);
    if args.list {
        list(&specs, &plans, &builders, &ray_sets, &run.peers);
        return Ok(exit_code(&failures));
    }

    let groups: usize = plans.iter().map(|plan| plan.threads.len()).sum();
    let kernels = TraceKernel::select(&args.kernels)?;
    let engines = builders
        .iter()
        .map(|b| kernels.len() + engines::own_structures(b.source(), args.robust))
        .sum::<usize>();
    let steps = plans.len() + groups * (builders.len() + engines * ray_sets.len());
    let seconds = if args.quick { 0.1 } else { 0.5 };
    let method = Method {
        builders,
        kernels,
        collapse: args.collapse,
        robust: args.robust,
        embree_config: args.embree_config.clone(),
        binary: Vec::new(),
        seconds,
        brief: false,
        all_cores: pool(machine::cores())?,
        progress: Progress::new(steps),
    };
    let setup = Setup {
        method,
        ray_sets,
        ray_count: args.ray_count.unwrap_or(if args.quick { 50_000 } else { 200_000 }),
        seed: args.seed,
        samples: args.samples.unwrap_or(if args.quick { 4 } else { 32 }),
        pictures: (!args.no_pictures).then(|| args.out.join("pictures")),
        credits: args.credits.clone(),
        files: std::iter::once(args.out.join("results.json")).chain(args.json.clone()).collect(),
    };
    run.threads = threads;
    run.collapse = args.collapse.name().to_owned();
    run.arguments = std::env::args().skip(2).collect();
    run.shard = args.shard.map(|shard| shard.to_string());
    run.seconds_per_measurement = seconds;
    let mut results = Results { runs: vec![run], ..Results::default() };
    for plan in &plans {
        let spec = &specs[plan.scene];
        if let Err(error) = measure_scene(&setup, spec, plan, &mut results, &mut failures) {
            setup.method.progress.warn(&format!("error: {}: {error:#}", spec.describe()));
            failures.fatal = true;
            failures.list.push(Failure { scene: spec.describe(), error: format!("{error:#}") });
        }
        results.failures.clone_from(&failures.list);
        save(&setup, &results)?;
    }
    // An empty shard has results too, so that merging needs no special case.
    save(&setup, &results)?;
    setup.method.progress.finish();
    print!("{}", report::summary_as_text(&results));
    let page = report::write(&results, &args.out)?;
    for failure in &failures.list {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    println!("\nresults {}\nreport  {}", setup.files[0].display(), page.display());
    Ok(exit_code(&failures))
}

fn exit_code(failures: &Failures) -> ExitCode {
    if failures.fatal { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

pub(crate) fn pool(threads: usize) -> Result<ThreadPool> {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .with_context(|| format!("cannot start {threads} threads"))
}

/// The scenes that were asked for; those that cannot be found are noted.
fn scenes(args: &BenchArgs, failures: &mut Failures) -> Result<Vec<SceneSpec>> {
    let triangles = args.triangles.unwrap_or(if args.quick { 10_000 } else { 100_000 });
    let mut specs = Vec::new();
    let mut note = |scene: String, error: &Error| {
        eprintln!("error: {scene}: {error:#}");
        failures.fatal = true;
        failures.list.push(Failure { scene, error: format!("{error:#}") });
    };
    for text in &args.scenes {
        match SceneSpec::parse(text, triangles) {
            Ok(spec) => specs.push(spec),
            Err(error) => note(text.clone(), &error),
        }
    }
    for folder in &args.folders {
        match SceneSpec::below(folder) {
            Ok(found) => specs.extend(found),
            Err(error) => note(folder.display().to_string(), &error),
        }
    }
    if args.scenes.is_empty() && args.folders.is_empty() {
        specs = SceneSpec::procedural(triangles);
    }
    if specs.is_empty() {
        bail!("there is no scene to measure");
    }
    drop_repeated(&mut specs);
    make_names_unique(&mut specs);
    Ok(specs)
}

fn threads(args: &BenchArgs) -> Vec<usize> {
    if args.threads.is_empty() {
        return vec![machine::cores()];
    }
    let mut threads: Vec<usize> = Vec::new();
    for &count in &args.threads {
        let count = usize::from(count);
        if !threads.contains(&count) {
            threads.push(count);
        }
    }
    threads
}

/// The version that this program was built with.
fn obvhs_version() -> &'static str {
    include_str!("../../../Cargo.lock")
        .split_once("name = \"obvhs\"\nversion = \"")
        .and_then(|(_, rest)| rest.split('"').next())
        .unwrap_or("of unknown version")
}

/// Notes the peers' versions, and drops Embree's builders with a line if it is not there.
pub(crate) fn find_peers(
    required: bool,
    embree_config: &str,
    builders: &mut Vec<TreeBuilder>,
    run: &mut Run,
) -> Result<()> {
    let has = |builders: &[TreeBuilder], source| builders.iter().any(|b| b.source() == source);
    if has(builders, Source::Obvhs) {
        run.peers.push(format!("obvhs {}", obvhs_version()));
    }
    if has(builders, Source::Embree) {
        let settings = EmbreeSettings { config: embree_config.into(), ..Default::default() };
        match Embree::with_settings(&settings) {
            Ok(embree) => run.peers.push(embree_name(&embree, embree_config)),
            Err(error) if required => return Err(error.into()),
            Err(error) => {
                eprintln!("note: measuring without Embree. {error}");
                builders.retain(|builder| builder.source() != Source::Embree);
            }
        }
    }
    Ok(())
}

/// The version and the instructions that the device itself says it uses: a configuration that Embree
/// did not understand shows.
fn embree_name(embree: &Embree, config: &str) -> String {
    let mut name = format!("Embree {}", embree.version());
    if let Some(width) = embree.vector_width() {
        let instructions = match width {
            16 => "AVX-512",
            8 => "AVX or AVX2",
            _ => "SSE or NEON",
        };
        name += &format!(" with {instructions}");
    }
    if !config.is_empty() {
        name += &format!(" ({config})");
    }
    name
}

fn list(
    specs: &[SceneSpec],
    plans: &[ScenePlan],
    builders: &[TreeBuilder],
    ray_sets: &[String],
    peers: &[String],
) {
    println!("scenes and threads:");
    for plan in plans {
        println!("  {} at {:?}", specs[plan.scene].describe(), plan.threads);
    }
    let names: Vec<_> = builders.iter().map(TreeBuilder::full_name).collect();
    println!("builders: {}\nrays: {}", names.join(", "), ray_sets.join(", "));
    if !peers.is_empty() {
        println!("peers: {}", peers.join(", "));
    }
}

fn save(setup: &Setup, results: &Results) -> Result<()> {
    setup.files.iter().try_for_each(|file| results.write(file))
}

/// Measures a scene at all its numbers of threads, and saves after each.
fn measure_scene(
    setup: &Setup,
    spec: &SceneSpec,
    plan: &ScenePlan,
    results: &mut Results,
    failures: &mut Failures,
) -> Result<()> {
    let per_group = setup.method.builders.len() * (1 + setup.ray_sets.len());
    setup.method.progress.message(&format!("{}: load", spec.name));
    let loaded = setup.method.all_cores.install(|| spec.load(setup.seed));
    let scene = match loaded {
        Ok(scene) if scene.mesh.is_empty() => Err(anyhow::anyhow!("it has no triangles")),
        other => other,
    }
    .inspect_err(|_| setup.method.progress.skip(1 + plan.threads.len() * per_group))?;
    let (info, sets) = prepare(setup, spec, plan, &scene)?;
    results.add_scene(info);
    setup.method.progress.step();
    let mut judged = Vec::new();
    for &threads in &plan.threads {
        let rows = measure_group(setup, &scene, threads, &sets, &mut judged, failures)?;
        let first = results.rows.len();
        results.rows.extend(rows);
        results.failures.clone_from(&failures.list);
        save(setup, results)?;
        setup.method.progress.print(&report::group_as_text(results, &results.rows[first..]));
    }
    Ok(())
}

/// Records the rays, and makes the pictures.
fn prepare(
    setup: &Setup,
    spec: &SceneSpec,
    plan: &ScenePlan,
    scene: &Scene,
) -> Result<(SceneInfo, Vec<RaySet>)> {
    let mut info = SceneInfo {
        name: scene.name.clone(),
        triangles: scene.mesh.len(),
        origin: spec.origin_name(),
        credit: spec.credit(&setup.credits),
        dropped: (!scene.dropped.is_empty())
            .then(|| scene.dropped.to_string().lines().next().unwrap_or_default().to_owned()),
        picture: None,
        heat_map: None,
    };
    let builder = rays::recorder();
    setup.method.all_cores.install(|| {
        setup.method.progress.message(&format!("{}: record rays", scene.name));
        let wide = AutoScene::new(&builder.build_mesh(&scene.mesh)?, &scene.mesh)?;
        let sets = rays::record(scene, &wide, &setup.ray_sets, setup.ray_count, setup.seed);
        if let (true, Some(folder)) = (plan.pictures, &setup.pictures) {
            setup.method.progress.message(&format!("{}: render", scene.name));
            pictures::render(scene, &wide, builder.name(), setup.samples, folder, &mut info)?;
        }
        Ok((info, sets))
    })
}

fn measure_group(
    setup: &Setup,
    scene: &Scene,
    threads: usize,
    sets: &[RaySet],
    judged: &mut Vec<(String, Judgement)>,
    failures: &mut Failures,
) -> Result<Vec<Row>> {
    let mut group =
        Group::new(&setup.method, (&scene.name, &scene.mesh), threads, judged, failures)?;
    let built = builds::measure(&setup.method, &mut group);
    let builds = built.iter().map(|built| Row::Build(built.row.clone()));
    let mut rows: Vec<Row> = builds.collect();
    rows.extend(
        traces::measure(&setup.method, &mut group, built, sets).into_iter().map(Row::Trace),
    );
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_embree_says_what_its_device_uses() {
        let of = |config: &str| {
            let settings = EmbreeSettings { config: config.into(), ..Default::default() };
            Embree::with_settings(&settings).map(|embree| embree_name(&embree, config))
        };
        let (Ok(plain), Ok(narrow)) = (of(""), of("max_isa=sse4.2")) else {
            eprintln!("skipped: Embree is not there");
            return;
        };
        assert!(plain.starts_with("Embree ") && !plain.contains('('), "{plain}");
        assert!(narrow.ends_with("(max_isa=sse4.2)") && !narrow.contains("AVX"), "{narrow}");
    }
}
