//! What kernels answer, how long they take and how wrong they are.

use super::study::{Leak, Row};
use crate::bench::engines::{Answers, DOUBLE, Engine, in_double, ours, own};
use crate::bench::rays::{self, RaySet};
use crate::bench::{Failures, Group, Method, traces};
use anyhow::{Context as _, Result, bail};
use niwaki_core::{Builder as _, Ray, TriangleMesh};
use niwaki_hard_cases::{Closed, closed};
use niwaki_scene::Scene;
use niwaki_trace::{AutoScene, Kernel, Mode};
use rayon::prelude::*;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) threads: usize,
    pub(super) seed: u64,
    /// Rays of a set, at most.
    pub(super) rays: usize,
    /// Rays of a set whose answers are checked exactly, at most.
    pub(super) checked: usize,
    /// Rays at the corners and edges of each closed surface.
    pub(super) leak_rays: usize,
}

/// The ray sets in the order of tables.
pub(super) const RAY_SETS: [&str; 4] = ["camera", "bounce", "shadow", "ao"];

/// All that is compared, over one mesh: our kernels and the one in double precision over our tree
/// (the first of the method's builders), and peers under their own. Kernels over other nodes than
/// those of `niwaki-wide` would join here, as engines of a kind of their own.
fn engines<'a>(method: &'a Method, group: &mut Group<'_>) -> Result<Vec<Engine<'a>>> {
    let (main, peers) = method.builders.split_first().context("no builder")?;
    let mesh = group.mesh;
    let bvh = method.all_cores.install(|| main.build(mesh, None))?.bvh;
    let mut engines = ours(method, group, main, &bvh);
    engines.extend(in_double(group, main));
    for peer in peers {
        engines.extend(own(method, group, peer));
    }
    Ok(engines)
}

/// Engines of one kernel belong together; for Embree there is one for each quality.
pub(super) fn kernels<'e>(engines: &'e [Engine<'_>]) -> Vec<&'e str> {
    let mut names: Vec<&str> = Vec::new();
    for engine in engines {
        if !names.contains(&engine.kernel.as_str()) {
            names.push(&engine.kernel);
        }
    }
    names
}

/// What kernels have in common whose points are joined in plots.
pub(super) fn family(engine: &Engine<'_>) -> String {
    let Some(kernel) = engine.trace_kernel() else { return engine.kernel.replace('_', " ") };
    match (kernel.kernel, kernel.mode) {
        (Kernel::Scalar, Mode::Fast) => "scalar fast".into(),
        (Kernel::Scalar, Mode::Watertight) => "scalar watertight".into(),
        (_, mode) => mode.name().into(),
    }
}

/// Measures a scene.
pub(super) fn scene(
    method: &Method,
    effort: Effort,
    scene: &Scene,
    failures: &mut Failures,
) -> Result<Vec<Row>> {
    if scene.mesh.is_empty() {
        bail!("it has no triangles");
    }
    let sets = method.all_cores.install(|| {
        let wide = AutoScene::new(&rays::recorder().build_mesh(&scene.mesh)?, &scene.mesh)?;
        let names = RAY_SETS.map(str::to_owned);
        anyhow::Ok(rays::record(scene, &wide, &names, effort.rays, effort.seed))
    })?;
    let mut judged = Vec::new();
    let name = (scene.name.as_str(), &scene.mesh);
    let mut group = Group::new(method, name, effort.threads, &mut judged, failures)?;
    method.progress.message(&format!("{}: build", scene.name));
    let engines = engines(method, &mut group)?;
    let mut rows = Vec::new();
    for set in &sets {
        rows.extend(ray_set(method, effort, &group, &engines, set));
    }
    Ok(rows)
}

/// Times all engines on a ray set, and checks what they answer.
fn ray_set(
    method: &Method,
    effort: Effort,
    group: &Group<'_>,
    engines: &[Engine<'_>],
    set: &RaySet,
) -> Vec<Row> {
    let timed = traces::measure_set(method, group, engines, set, 0);
    method.progress.message(&format!("{}: check {} rays", group.name, set.name));
    let sample: Vec<Ray> = rays::thinned(&set.rays, effort.checked).collect();
    let errors = method.all_cores.install(|| check(group.mesh, engines, &sample, set.any_hit));
    let of_kernel = |kernel: &str| {
        let here = || (0..engines.len()).filter(|&i| engines[i].kernel == kernel);
        let fastest =
            here().max_by(|&a, &b| timed[a].mrays_per_s.total_cmp(&timed[b].mrays_per_s))?;
        let errors = Errors::merge(here().map(|i| &errors[i]));
        Some(Row {
            scene: group.name.to_owned(),
            triangles: group.mesh.len(),
            rays: set.name.clone(),
            kernel: kernel.to_owned(),
            family: family(&engines[fastest]),
            tree: engines[fastest].builder.full_name(),
            width: engines[fastest].width(),
            ns: 1e3 / timed[fastest].mrays_per_s,
            bytes: engines[fastest].bytes(),
            checked: errors.checked,
            wrong: errors.wrong,
            t_median: errors.quantile(0.5),
            t_p99: errors.quantile(0.99),
            t_max: errors.quantile(1.0),
        })
    };
    kernels(engines).into_iter().filter_map(of_kernel).collect()
}

/// How wrong an engine is on some rays.
#[derive(Clone, Debug, Default, PartialEq)]
struct Errors {
    checked: usize,
    /// Answers of hit or miss that are not the exact one, and triangles that are not the closest.
    wrong: usize,
    /// Relative errors of the distances to triangles that are the closest, in ascending order.
    distances: Vec<f64>,
}

impl Errors {
    fn merge<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let mut sum = Self::default();
        for errors in all {
            sum.checked += errors.checked;
            sum.wrong += errors.wrong;
            sum.distances.extend(&errors.distances);
        }
        sum.distances.sort_by(f64::total_cmp);
        sum
    }

    /// The error that this share of distances does not exceed.
    fn quantile(&self, share: f64) -> Option<f64> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position")]
        let at = (share * self.distances.len() as f64).ceil() as usize;
        self.distances.get(at.max(1) - 1).copied()
    }
}

/// Compares the answers of all engines with exact ones. What is exactly closest is sought among all
/// triangles that some engine found: to miss an error, all of them have to make it.
fn check(mesh: &TriangleMesh, engines: &[Engine<'_>], rays: &[Ray], any_hit: bool) -> Vec<Errors> {
    let hits: Vec<Vec<Option<(f64, u32)>>> =
        engines.iter().map(|engine| engine.precise_hits(rays)).collect();
    let exact: Vec<_> = rays
        .par_iter()
        .enumerate()
        .map(|(i, ray)| {
            let mut found: Vec<u32> = hits.iter().filter_map(|hits| Some(hits[i]?.1)).collect();
            found.sort_unstable();
            found.dedup();
            let triangles = found.into_iter().map(|id| (id, mesh.triangle(id as usize)));
            niwaki_exact::closest(ray, triangles)
        })
        .collect();
    let mut answers = Answers::default();
    let mut all = Vec::with_capacity(engines.len());
    for (engine, hits) in engines.iter().zip(&hits) {
        let mut errors = Errors { checked: rays.len(), ..Errors::default() };
        if any_hit {
            answers.trace(engine, rays, true);
            let pairs = answers.flags.iter().zip(&exact);
            errors.wrong = pairs.filter(|(flag, exact)| **flag != exact.is_some()).count();
        }
        for (hit, exact) in hits.iter().zip(&exact) {
            let right = match (hit, exact) {
                (Some((t, id)), Some(exact)) if exact.ties.iter().any(|tie| tie.0 == *id) => {
                    if exact.t > 0.0 {
                        errors.distances.push((t - exact.t).abs() / exact.t);
                    }
                    true
                }
                (None, None) => true,
                _ => false,
            };
            errors.wrong += usize::from(!right && !any_hit);
        }
        errors.distances.sort_by(f64::total_cmp);
        all.push(errors);
    }
    all
}

/// The closed surfaces that leaks are counted on: those on which peers are at home too. (Sizes of
/// 1e±30 are for `cargo xtask stability`.)
pub(super) fn surfaces() -> Vec<Closed> {
    let mut all = closed();
    all.retain(|surface| !surface.name.ends_with("30"));
    all
}

/// Counts the rays from inside a closed surface that get out.
pub(super) fn leaks(
    method: &Method,
    effort: Effort,
    surface: &Closed,
    failures: &mut Failures,
) -> Result<Vec<Leak>> {
    let mut judged = Vec::new();
    let name = (surface.name, &surface.mesh);
    let mut group = Group::new(method, name, effort.threads, &mut judged, failures)?;
    let engines = engines(method, &mut group)?;
    let rays = surface.rays_from_inside(effort.leak_rays, effort.seed);
    let count = |engine: &Engine<'_>| {
        let mut answers = Answers::default();
        method.all_cores.install(|| answers.trace(engine, &rays, false));
        rays.len() - answers.hits(false)
    };
    let of_kernel = |kernel: &str| {
        let here = || engines.iter().filter(|engine| engine.kernel == kernel);
        Leak {
            surface: surface.name.to_owned(),
            kernel: kernel.to_owned(),
            rays: rays.len() * here().count(),
            leaks: here().map(count).sum(),
        }
    };
    Ok(kernels(&engines).into_iter().map(of_kernel).collect())
}

/// True for kernels in which no ray from inside a closed surface may get out.
pub(super) fn is_watertight(kernel: &str) -> bool {
    kernel == DOUBLE || !(kernel.ends_with("_fast") || crate::report::is_peers(kernel))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_errors_that_occurred() {
        let errors = Errors { distances: vec![1.0, 2.0, 3.0, 4.0], ..Errors::default() };
        assert_eq!(errors.quantile(0.5), Some(2.0));
        assert_eq!(errors.quantile(0.99), Some(4.0));
        assert_eq!(errors.quantile(0.0), Some(1.0));
        assert_eq!(Errors::default().quantile(0.5), None);
        let merged = Errors::merge([&errors, &errors].into_iter());
        assert_eq!(merged.distances, [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0]);
    }
}
