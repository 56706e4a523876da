//! Timing builds and judging the trees.

use super::timing::{Effort, in_turns, median};
use super::{Group, Method};
use crate::kernel::{TraceKernel, WideTree};
use crate::memory::peak_of;
use crate::registry::TreeBuilder;
use crate::results::{BuildRow, finite};
use anyhow::{Error, Result};
use niwaki_core::{Bvh, SahConstants};
use niwaki_metrics::{TreeStats, epo_sampled, sah};
use std::time::{Duration, Instant};

/// The constants that reports use: those of the thesis's paper IV.
pub(crate) const CONSTANTS: SahConstants = SahConstants::THESIS_IV;

/// Triangles that end-point overlap is measured on; more are sampled.
const EPO_SAMPLES: usize = 100_000;

/// A tree that was built, and its row.
pub(crate) struct Built<'a> {
    pub(crate) builder: &'a TreeBuilder,
    pub(crate) bvh: Bvh,
    pub(crate) row: BuildRow,
}

/// What does not depend on the number of threads.
#[derive(Clone, Debug)]
pub(crate) struct Judgement {
    sah: f64,
    epo: f64,
    epo_error: f64,
    stats: TreeStats,
}

#[derive(Default)]
struct Times {
    build: Vec<f64>,
    wide: Vec<f64>,
    commit: Vec<f64>,
    bvh: Option<Bvh>,
    error: Option<Error>,
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Times all builders in turns and judges their trees; what failed is noted in the group.
pub(crate) fn measure<'a>(method: &'a Method, group: &mut Group<'_>) -> Vec<Built<'a>> {
    let builders = &method.builders;
    let mut times: Vec<Times> = builders.iter().map(|_| Times::default()).collect();
    let effort = Effort::seconds(method.seconds);
    in_turns(builders.len(), effort, |i| {
        method.progress.message(&format!("{}: build {}", group.title(), builders[i].full_name()));
        match time_once(&builders[i], group, method, &mut times[i]) {
            Ok(time) => Some(time),
            Err(error) => {
                times[i].error = Some(error);
                None
            }
        }
    });
    let mut built = Vec::new();
    for (builder, times) in builders.iter().zip(times) {
        method.progress.message(&format!("{}: judge {}", group.title(), builder.full_name()));
        method.progress.step();
        if let Some(error) = times.error {
            group.fail(builder, &error);
            continue;
        }
        let Some(bvh) = times.bvh else { continue };
        let judgement = judge(method, group, builder, &bvh);
        let optional = |times: &[f64]| finite(median(times));
        let row = BuildRow {
            run: 0,
            scene: group.name.to_owned(),
            triangles: group.mesh.len(),
            source: builder.source(),
            builder: builder.name().to_owned(),
            threads: group.threads,
            repeats: times.build.len(),
            ms_median: median(&times.build),
            ms_min: times.build.iter().copied().fold(f64::INFINITY, f64::min),
            ms_wide_median: optional(&times.wide),
            ms_commit_median: optional(&times.commit),
            references: judgement.stats.references,
            nodes: judgement.stats.nodes,
            bytes: judgement.stats.bytes,
            peak_bytes: if method.brief { None } else { peak_bytes(group, builder) },
            sah: finite(judgement.sah),
            sah_constants: CONSTANTS.into(),
            epo: finite(judgement.epo),
            epo_standard_error: finite(judgement.epo_error),
            depth: judgement.stats.depth_max,
        };
        built.push(Built { builder, bvh, row });
    }
    built
}

/// Builds the tree, the wide tree and the peer's own structure once each.
fn time_once(
    builder: &TreeBuilder,
    group: &Group<'_>,
    method: &Method,
    times: &mut Times,
) -> Result<Duration> {
    let mesh = group.mesh;
    let start = Instant::now();
    let tree = group.pool.install(|| builder.build(mesh, group.embree.as_ref()))?;
    let collapse = Instant::now();
    let kernel = TraceKernel::best();
    let wide = group.pool.install(|| WideTree::new(kernel, method.collapse, &tree.bvh, mesh));
    let collapse = collapse.elapsed();
    drop(wide?);
    times.build.push(milliseconds(tree.time));
    times.wide.push(milliseconds(tree.time + collapse));
    // A peer whose own structure fails still has its tree to show; the failure is reported where
    // that structure should have traced.
    if !method.brief
        && let Ok(Some(own)) =
            group.pool.install(|| builder.own_scene(mesh, group.embree.as_ref(), false))
    {
        times.commit.push(milliseconds(own.time));
    }
    times.bvh = Some(tree.bvh);
    Ok(start.elapsed())
}

/// Judges a tree, once for all numbers of threads: our trees are the same for each. (Embree's
/// may differ slightly.)
fn judge(method: &Method, group: &mut Group<'_>, builder: &TreeBuilder, bvh: &Bvh) -> Judgement {
    let mesh = group.mesh;
    let pool = group.all_cores;
    let known = |name: &str| matches!(builder, TreeBuilder::Ours(_)) && name == builder.name();
    if let Some((_, judgement)) = group.judged.iter().find(|(name, _)| known(name)) {
        return judgement.clone();
    }
    let judgement = pool.install(|| {
        let epo = (!method.brief).then(|| epo_sampled(bvh, mesh, &CONSTANTS, EPO_SAMPLES, 1));
        Judgement {
            sah: sah(bvh, &CONSTANTS),
            epo: epo.map_or(f64::NAN, |epo| epo.value),
            epo_error: epo.map_or(f64::NAN, |epo| epo.standard_error),
            stats: TreeStats::of(bvh),
        }
    });
    if matches!(builder, TreeBuilder::Ours(_)) {
        group.judged.push((builder.name().to_owned(), judgement.clone()));
    }
    judgement
}

/// The peak memory of one more build, untimed. Peers allocate elsewhere or convert on the way.
fn peak_bytes(group: &Group<'_>, builder: &TreeBuilder) -> Option<usize> {
    let TreeBuilder::Ours(ours) = builder else { return None };
    let (tree, peak) = peak_of(|| group.pool.install(|| ours.build_mesh(group.mesh)));
    tree.ok().map(|_| peak)
}
