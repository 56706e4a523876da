//! Measuring a scene: all builders in turns, through bench's own functions.

use super::names::{Standing, candidates};
use super::plan::Plan;
use super::published::{Item, Published};
use crate::bench::engines::BINARY;
use crate::bench::rays::{DEPTH, RaySet};
use crate::bench::timing::{Effort, in_turns, median};
use crate::bench::{Failures, Group, Method, builds, pool, rays, traces};
use crate::registry;
use crate::results::{Row, SceneInfo, Source, TraceRow, finite};
use anyhow::{Result, bail};
use niwaki_build_bonsai::Bonsai;
use niwaki_core::{Builder, SahConstants};
use niwaki_metrics::sah;
use niwaki_scene::Scene;
use niwaki_trace::AutoScene;
use serde::Serialize;
use std::time::Duration;

/// The ray sets of a path: one camera ray, and as many bounces as are followed.
const RAY_SETS: [(&str, f64); 2] = [("camera", 1.0), ("bounce", DEPTH as f64)];

/// What was measured of a scene.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SceneResult {
    /// Published names and how the scene stands for them.
    pub(crate) stands_for: Vec<(String, Standing)>,
    /// Name of what was measured.
    pub(crate) scene: String,
    /// Its triangles.
    pub(crate) triangles: usize,
    /// Threads that built and traced.
    pub(crate) threads: usize,
    pub(crate) trees: Vec<Tree>,
    pub(crate) steps: Vec<Step>,
    pub(crate) scaling: Vec<Scaling>,
    #[serde(skip)]
    pub(crate) info: SceneInfo,
    #[serde(skip)]
    pub(crate) rows: Vec<Row>,
}

/// A builder on a scene.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Tree {
    /// As in the registry, peers with `embree:`.
    pub(crate) builder: String,
    /// Median, milliseconds.
    pub(crate) build_ms: f64,
    /// With the constants of paper IV.
    pub(crate) sah_iv: Option<f64>,
    /// With the constants of paper V.
    pub(crate) sah_v: Option<f64>,
    /// References over triangles, less one.
    pub(crate) added_references: f64,
    /// Mean over a path, nanoseconds a ray, our fastest kernel.
    pub(crate) ns_per_ray: Option<f64>,
    /// The same by the scalar kernel over the binary tree.
    pub(crate) ns_per_ray_binary: Option<f64>,
}

/// A step of a build.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Step {
    pub(crate) builder: String,
    pub(crate) step: String,
    /// Median, milliseconds.
    pub(crate) ms: f64,
}

/// A build on some threads.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Scaling {
    pub(crate) builder: String,
    pub(crate) threads: usize,
    /// Median, milliseconds.
    pub(crate) build_ms: f64,
}

/// Builders whose steps can be timed one by one.
fn timed() -> Vec<Bonsai> {
    vec![Bonsai::bonsai(), Bonsai::bonsai_p(), Bonsai::bonsai_p_star(), Bonsai::bonsai_s()]
}

/// Builders of our own that figure 4 of paper V shows beside the published two.
const ALSO_SCALED: [&str; 2] = ["sweep", "bonsai_p"];

/// The builders that any item needs, as far as the registry knows them.
pub(crate) fn builders(published: &Published) -> Vec<registry::TreeBuilder> {
    let mut names: Vec<&str> = Vec::new();
    for item in Item::ALL {
        for builder in published.builders(item) {
            names.extend(candidates(builder));
        }
    }
    let mut all = registry::TreeBuilder::all();
    all.retain(|builder| names.contains(&builder.full_name().as_str()));
    all
}

/// Steps of the progress bar that a scene takes.
pub(crate) const fn steps(builders: usize) -> usize {
    1 + builders * (1 + RAY_SETS.len())
}

/// What else than trees is measured, and how rays are recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    pub(crate) threads: usize,
    pub(crate) ray_count: usize,
    pub(crate) seed: u64,
}

/// Measures a scene.
pub(crate) fn measure(
    method: &Method,
    settings: Settings,
    plan: &Plan,
    published: &Published,
    failures: &mut Failures,
) -> Result<SceneResult> {
    let name = &plan.spec.name;
    method.progress.message(&format!("{name}: load"));
    let scene = method.all_cores.install(|| plan.spec.load(plan.seed))?;
    if scene.mesh.is_empty() {
        bail!("it has no triangles");
    }
    method.progress.message(&format!("{name}: record rays"));
    let sets = method.all_cores.install(|| record(&scene, settings))?;
    method.progress.step();

    let stands_for = |item| {
        let scenes = published.scenes(item);
        plan.stands_for.iter().any(|(scene, _)| scenes.contains(&scene.published))
    };
    let mut stepped = timed();
    stepped.retain(|builder| {
        [Item::IvFigure6, Item::VTable4].into_iter().any(|item| {
            let needs = |name: &&str| candidates(name).contains(&builder.name());
            stands_for(item) && published.builders(item).iter().any(needs)
        })
    });
    method.progress.message(&format!("{name}: steps of Bonsai"));
    let steps = measure_steps(method, settings.threads, &scene, &stepped)?;
    let scaling = if stands_for(Item::VFigure4) {
        method.progress.message(&format!("{name}: scaling"));
        measure_scaling(method, settings.threads, &scene, published)?
    } else {
        Vec::new()
    };
    let (trees, rows) = measure_trees(method, settings.threads, &scene, &sets, failures)?;
    let info = SceneInfo {
        name: name.clone(),
        triangles: scene.mesh.len(),
        origin: plan.spec.origin_name(),
        dropped: (!scene.dropped.is_empty())
            .then(|| scene.dropped.to_string().lines().next().unwrap_or_default().to_owned()),
        ..SceneInfo::default()
    };
    Ok(SceneResult {
        stands_for: plan
            .stands_for
            .iter()
            .map(|(scene, standing)| {
                let sizes = published.sizes(scene.published);
                (scene.published.to_owned(), standing.with_triangles(info.triangles, &sizes))
            })
            .collect(),
        scene: name.clone(),
        triangles: scene.mesh.len(),
        threads: settings.threads,
        trees,
        steps,
        scaling,
        info,
        rows,
    })
}

fn record(scene: &Scene, settings: Settings) -> Result<Vec<RaySet>> {
    let wide = AutoScene::new(&rays::recorder().build_mesh(&scene.mesh)?, &scene.mesh)?;
    let names = RAY_SETS.map(|(name, _)| name.to_owned());
    Ok(rays::record(scene, &wide, &names, settings.ray_count, settings.seed))
}

fn measure_trees(
    method: &Method,
    threads: usize,
    scene: &Scene,
    sets: &[RaySet],
    failures: &mut Failures,
) -> Result<(Vec<Tree>, Vec<Row>)> {
    let mut judged = Vec::new();
    let mut group = Group::new(method, (&scene.name, &scene.mesh), threads, &mut judged, failures)?;
    let built = builds::measure(method, &mut group);
    let mut trees = Vec::new();
    let mut rows = Vec::new();
    for tree in &built {
        let row = &tree.row;
        let sah_v = method.all_cores.install(|| sah(&tree.bvh, &SahConstants::THESIS_V));
        trees.push(Tree {
            builder: tree.builder.full_name(),
            build_ms: row.ms_median,
            sah_iv: row.sah,
            sah_v: finite(sah_v),
            added_references: row.references as f64 / row.triangles as f64 - 1.0,
            ns_per_ray: None,
            ns_per_ray_binary: None,
        });
        rows.push(Row::Build(row.clone()));
    }
    let traced = traces::measure(method, &mut group, built, sets);
    for tree in &mut trees {
        let of = |binary: bool| {
            let rows: Vec<_> = traced
                .iter()
                .filter(|row| is_of(row, &tree.builder) && (row.kernel == BINARY) == binary)
                .collect();
            path_time(&rows)
        };
        (tree.ns_per_ray, tree.ns_per_ray_binary) = (of(false), of(true));
    }
    rows.extend(traced.into_iter().map(Row::Trace));
    Ok((trees, rows))
}

fn is_of(row: &TraceRow, builder: &str) -> bool {
    match row.source {
        Source::Niwaki => row.builder == builder,
        source => {
            builder.strip_prefix(source.name()).and_then(|b| b.strip_prefix(':'))
                == Some(row.builder.as_str())
        }
    }
}

/// Mean nanoseconds a ray of a path, over the sets that were traced.
fn path_time(rows: &[&TraceRow]) -> Option<f64> {
    let (mut time, mut count) = (0.0, 0.0);
    for (set, weight) in RAY_SETS {
        if let Some(row) = rows.iter().find(|row| row.rays == set) {
            time += weight * 1e3 / row.mrays_per_s;
            count += weight;
        }
    }
    (count > 0.0).then(|| time / count).and_then(finite)
}

/// Medians of the steps of Bonsai's variants, built in turns.
fn measure_steps(
    method: &Method,
    threads: usize,
    scene: &Scene,
    builders: &[Bonsai],
) -> Result<Vec<Step>> {
    let pool = pool(threads)?;
    let mut times: Vec<Vec<Vec<f64>>> = vec![Vec::new(); builders.len()];
    let mut error = None;
    in_turns(builders.len(), Effort::seconds(method.seconds), |i| {
        match pool.install(|| builders[i].build_mesh_timed(&scene.mesh)) {
            Ok((_, timings)) => {
                let steps = timings.steps().map(|(_, time)| time.as_secs_f64() * 1e3);
                times[i].push(steps.to_vec());
                Some(timings.total())
            }
            Err(failed) => {
                error = Some(failed);
                None
            }
        }
    });
    if let Some(error) = error {
        return Err(error.into());
    }
    let names = niwaki_build_bonsai::Timings::default().steps().map(|(name, _)| name);
    let mut steps = Vec::new();
    for (builder, times) in builders.iter().zip(times) {
        for (at, step) in names.iter().enumerate() {
            let ms = median(&times.iter().map(|t| t[at]).collect::<Vec<_>>());
            let (builder, step) = (builder.name().to_owned(), (*step).to_owned());
            steps.push(Step { builder, step, ms });
        }
    }
    Ok(steps)
}

/// The powers of two below `most`, and `most`.
pub(crate) fn thread_counts(most: usize) -> Vec<usize> {
    let mut counts: Vec<_> = std::iter::successors(Some(1), |n: &usize| n.checked_mul(2))
        .take_while(|&n| n < most)
        .collect();
    counts.push(most);
    counts
}

/// Build times of our builders of figure 4 on more and more threads, all in turns.
fn measure_scaling(
    method: &Method,
    threads: usize,
    scene: &Scene,
    published: &Published,
) -> Result<Vec<Scaling>> {
    let mut names: Vec<&str> = Vec::new();
    for builder in published.builders(Item::VFigure4) {
        names.extend(candidates(builder));
    }
    names.extend(ALSO_SCALED);
    let mut builders = registry::ours();
    builders.retain(|builder| names.contains(&builder.name()));
    let pools = thread_counts(threads)
        .into_iter()
        .map(|n| Ok((n, pool(n)?)))
        .collect::<Result<Vec<_>>>()?;
    let count = builders.len() * pools.len();
    let mut times: Vec<Vec<f64>> = vec![Vec::new(); count];
    let mut error = None;
    in_turns(count, Effort::seconds(method.seconds), |i| {
        let (builder, (_, pool)) = (&builders[i / pools.len()], &pools[i % pools.len()]);
        let start = std::time::Instant::now();
        let built = pool.install(|| builder.build_mesh(&scene.mesh));
        let time: Duration = start.elapsed();
        match built {
            Ok(_) => {
                times[i].push(time.as_secs_f64() * 1e3);
                Some(time)
            }
            Err(failed) => {
                error = Some(failed);
                None
            }
        }
    });
    if let Some(error) = error {
        return Err(error.into());
    }
    let scaling = times.iter().enumerate().map(|(i, times)| Scaling {
        builder: builders[i / pools.len()].name().to_owned(),
        threads: pools[i % pools.len()].0,
        build_ms: median(times),
    });
    Ok(scaling.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::trace;

    #[test]
    fn thread_counts_double_up_to_the_most() {
        assert_eq!(thread_counts(1), [1]);
        assert_eq!(thread_counts(2), [1, 2]);
        assert_eq!(thread_counts(12), [1, 2, 4, 8, 12]);
    }

    #[test]
    fn a_path_is_a_camera_ray_and_its_bounces() {
        let camera = trace("a", "sweep", 1, 10.0);
        let mut bounce = trace("a", "sweep", 1, 2.0);
        bounce.rays = "bounce".into();
        // 100 ns, and four times 500 ns.
        assert!((path_time(&[&camera, &bounce]).unwrap() - 420.0).abs() < 1e-9);
        assert!((path_time(&[&bounce]).unwrap() - 500.0).abs() < 1e-9);
        assert_eq!(path_time(&[]), None);
    }

    #[test]
    fn peers_rows_are_found_by_full_names() {
        let mut row = trace("a", "medium", 1, 1.0);
        row.source = Source::Embree;
        assert!(is_of(&row, "embree:medium"));
        assert!(!is_of(&row, "medium") && !is_of(&row, "embree:high"));
    }
}
