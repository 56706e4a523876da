//! Timing traversal.

use super::builds::Built;
use super::engines::{Answers, CHUNK, Engine, ours, own, own_structures};
use super::rays::{RaySet, blocks_of};
use super::timing::{Effort, in_turns, median};
use super::{Group, Method};
use crate::kernel::TraceKernel;
use crate::machine;
use crate::results::TraceRow;
use niwaki_trace::Counts;
use rayon::prelude::*;
use std::time::Duration;

/// Bytes that a wide tree or a peer's structure takes per reference, at most: only to decide
/// whether all of them fit in memory at once.
const BYTES_PER_REFERENCE: usize = 200;
/// Rays whose work is counted.
const COUNTED: usize = 16_384;

/// Times all trees under our kernels and all peers under their own, in turns. The trees are used
/// up, so that they do not fill the memory beside what is made of them.
pub(crate) fn measure(
    method: &Method,
    group: &mut Group<'_>,
    trees: Vec<Built<'_>>,
    sets: &[RaySet],
) -> Vec<TraceRow> {
    let mut rows = Vec::new();
    let mut rest = trees.into_iter().peekable();
    let mut batch = 0;
    let layouts = TraceKernel::by_layout(&method.kernels).len();
    while rest.peek().is_some() {
        // What fits into half of the free memory is measured in turns; on most machines and
        // scenes that is everything.
        let room = machine::available_memory().unwrap_or(usize::MAX) / 2;
        let mut engines = Vec::new();
        let mut used = 0;
        while let Some(tree) = rest.peek() {
            // One a layout of ours, a binary tree, a peer's own structures.
            let scenes = layouts
                + usize::from(method.binary.contains(&tree.builder.full_name()))
                + own_structures(tree.builder.source(), method.robust);
            used += tree.row.references * BYTES_PER_REFERENCE * scenes;
            if used > room && !engines.is_empty() {
                break;
            }
            if let Some(tree) = rest.next() {
                engines.extend(make(method, group, tree));
            }
        }
        for set in sets {
            rows.extend(measure_set(method, group, &engines, set, batch));
        }
        batch += 1;
    }
    // The table is by builder; sets of one engine follow each other.
    rows
}

/// What traces a tree: our kernels, and the peer's own.
fn make<'a>(method: &Method, group: &mut Group<'_>, tree: Built<'a>) -> Vec<Engine<'a>> {
    let Built { builder, bvh, .. } = tree;
    let mut engines = ours(method, group, builder, &bvh);
    drop(bvh);
    if !method.brief {
        engines.extend(own(method, group, builder));
    }
    engines
}

/// Times engines on a set of rays in turns.
pub(crate) fn measure_set(
    method: &Method,
    group: &Group<'_>,
    engines: &[Engine<'_>],
    set: &RaySet,
    batch: usize,
) -> Vec<TraceRow> {
    let mut answers = Answers::default();
    // A first pass over all rays warms up, counts hits and shows who is slow.
    let mut slowest = Duration::ZERO;
    let mut hits = Vec::with_capacity(engines.len());
    for engine in engines {
        let name = engine.builder.full_name();
        method.progress.message(&format!("{}: {} rays, {name}", group.title(), set.name));
        let time = group.pool.install(|| answers.trace(engine, &set.rays, set.any_hit));
        slowest = slowest.max(time);
        hits.push(answers.hits(set.any_hit));
    }
    // Three passes of the slowest shall not take much longer than what all get.
    let longest = method.seconds.max(0.2);
    let chunk = engines.iter().map(Engine::chunk).max().unwrap_or(CHUNK);
    let share = (longest / slowest.as_secs_f64().max(1e-9)).min(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of it")]
    let most = ((set.rays.len() as f64 * share) as usize).max(chunk * group.threads * 8);
    let rays = blocks_of(&set.rays, most);

    let mut seconds: Vec<Vec<f64>> = vec![Vec::new(); engines.len()];
    in_turns(engines.len(), Effort::seconds(method.seconds), |i| {
        let time = group.pool.install(|| answers.trace(&engines[i], &rays, set.any_hit));
        seconds[i].push(time.as_secs_f64());
        Some(time)
    });
    let rows = engines.iter().zip(hits).zip(&seconds).map(|((engine, hits), seconds)| {
        method.progress.step();
        let counts = count(group, engine, set);
        TraceRow {
            run: 0,
            scene: group.name.to_owned(),
            triangles: group.mesh.len(),
            source: engine.builder.source(),
            builder: engine.builder.name().to_owned(),
            kernel: engine.kernel.clone(),
            width: engine.width(),
            rays_per_call: engine.rays_per_call(),
            rays: set.name.clone(),
            query: if set.any_hit { "any".into() } else { "closest".into() },
            threads: group.threads,
            ray_count: set.rays.len(),
            timed_rays: rays.len(),
            repeats: seconds.len(),
            batch,
            mrays_per_s: rays.len() as f64 / median(seconds) / 1e6,
            bytes: engine.bytes(),
            hits,
            boxes_per_ray: counts.map(|(boxes, _)| boxes),
            triangles_per_ray: counts.map(|(_, triangles)| triangles),
        }
    });
    rows.collect()
}

/// Boxes and triangles tested per ray, for our kernels.
fn count(group: &Group<'_>, engine: &Engine<'_>, set: &RaySet) -> Option<(f64, f64)> {
    let tree = engine.wide_tree()?;
    let rays = blocks_of(&set.rays, COUNTED);
    let counts: Counts =
        group.all_cores.install(|| rays.par_iter().map(|ray| tree.counts(set.any_hit, ray)).sum());
    let per_ray = |count: u64| count as f64 / rays.len() as f64;
    Some((per_ray(counts.boxes), per_ray(counts.triangles)))
}
