//! Timing traversal.

use super::builds::Built;
use super::rays::{RaySet, blocks_of};
use super::timing::{Effort, in_turns, median};
use super::{Group, Method};
use crate::kernel::{TraceKernel, WideTree, each_any, each_closest};
use crate::machine;
use crate::registry::{OwnScene, TreeBuilder};
use crate::results::{Source, TraceRow};
use niwaki_core::{Hit, Ray};
use niwaki_trace::{BinaryScene, Counts};
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Rays that a thread takes at once, unless they make a batch: few enough that no thread waits long
/// for the last.
const CHUNK: usize = 256;
/// Bytes that a wide tree or a peer's structure takes per reference, at most: only to decide
/// whether all of them fit in memory at once.
const BYTES_PER_REFERENCE: usize = 200;
/// Rays whose work is counted.
const COUNTED: usize = 16_384;

/// Something that is timed.
struct Engine<'a> {
    builder: &'a TreeBuilder,
    kernel: String,
    kind: Kind,
}

enum Kind {
    Wide(TraceKernel, WideTree),
    Binary(Box<BinaryScene>),
    Own(OwnScene),
}

impl Engine<'_> {
    /// Rays of a call.
    const fn rays_per_call(&self) -> usize {
        match &self.kind {
            Kind::Wide(kernel, _) => kernel.rays_per_call(),
            Kind::Binary(_) | Kind::Own(_) => 1,
        }
    }

    /// Bytes of nodes and triangles, where they are known.
    fn bytes(&self) -> Option<usize> {
        match &self.kind {
            Kind::Wide(_, tree) => Some(tree.bytes()),
            Kind::Binary(_) => None,
            Kind::Own(own) => Some(own.bytes),
        }
    }

    /// Rays that a thread takes at once: those of a call, or [`CHUNK`].
    fn chunk(&self) -> usize {
        self.rays_per_call().max(CHUNK)
    }

    fn trace_closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        match &self.kind {
            Kind::Wide(kernel, tree) => tree.trace_closest(kernel.batch, rays, hits),
            Kind::Binary(scene) => each_closest(scene.as_ref(), rays, hits),
            // Peers leave `closest_hits` as it comes with the trait: a loop, compiled for the
            // peer, with one call of `rtcIntersect1` a ray.
            Kind::Own(own) => own.scene.closest_hits(rays, hits),
        }
    }

    fn trace_any(&self, rays: &[Ray], flags: &mut [bool]) {
        match &self.kind {
            Kind::Wide(kernel, tree) => tree.trace_any(kernel.batch, rays, flags),
            Kind::Binary(scene) => each_any(scene.as_ref(), rays, flags),
            Kind::Own(own) => own.scene.any_hits(rays, flags),
        }
    }
}

/// Room for the answers, allocated once.
#[derive(Default)]
struct Answers {
    hits: Vec<Hit>,
    flags: Vec<bool>,
}

impl Answers {
    /// Traces all rays once on the current pool.
    fn trace(&mut self, engine: &Engine<'_>, rays: &[Ray], any_hit: bool) -> Duration {
        let chunk = engine.chunk();
        if any_hit {
            self.flags.resize(rays.len(), false);
            let start = Instant::now();
            rays.par_chunks(chunk)
                .zip(self.flags.par_chunks_mut(chunk))
                .for_each(|(rays, flags)| engine.trace_any(rays, flags));
            start.elapsed()
        } else {
            self.hits.resize(rays.len(), Hit::MISS);
            let start = Instant::now();
            rays.par_chunks(chunk)
                .zip(self.hits.par_chunks_mut(chunk))
                .for_each(|(rays, hits)| engine.trace_closest(rays, hits));
            start.elapsed()
        }
    }

    fn hits(&self, any_hit: bool) -> usize {
        if any_hit {
            self.flags.iter().filter(|flag| **flag).count()
        } else {
            self.hits.iter().filter(|hit| hit.is_hit()).count()
        }
    }
}

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
    let layouts = layouts(&method.kernels).len();
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

/// The name of the scalar reference kernel over binary trees.
pub(crate) const BINARY: &str = "binary";

/// What is put behind the name of a peer for its robust mode.
pub(crate) const ROBUST: &str = "_robust";

/// How many structures of its own a peer makes for its own kernels: Embree one for its default
/// mode, and one for its robust mode if that was asked for.
pub(crate) fn own_structures(source: Source, robust: bool) -> usize {
    match source {
        Source::Niwaki => 0,
        Source::Embree => 1 + usize::from(robust),
        Source::Obvhs => 1,
    }
}

/// The kernels by the layout that they share: trees of one width in one mode.
fn layouts(kernels: &[TraceKernel]) -> Vec<Vec<TraceKernel>> {
    let mut layouts: Vec<Vec<TraceKernel>> = Vec::new();
    for &kernel in kernels {
        let same = |layout: &&mut Vec<TraceKernel>| {
            (layout[0].mode, layout[0].width) == (kernel.mode, kernel.width)
        };
        match layouts.iter_mut().find(same) {
            Some(layout) => layout.push(kernel),
            None => layouts.push(vec![kernel]),
        }
    }
    layouts
}

/// What traces a tree: our kernels, and the peer's own.
fn make<'a>(method: &Method, group: &mut Group<'_>, tree: Built<'a>) -> Vec<Engine<'a>> {
    let Built { builder, bvh, .. } = tree;
    let mesh = &group.scene.mesh;
    let mut engines = Vec::new();
    for layout in layouts(&method.kernels) {
        let tree = group
            .all_cores
            .install(|| WideTree::new(layout[0], method.collapse, &bvh, mesh))
            .and_then(|tree| {
                let of = |&kernel: &TraceKernel| {
                    tree.clone().with_kernel(kernel.kernel).map(|tree| (kernel, tree))
                };
                layout.iter().map(of).collect::<Result<Vec<_>, _>>()
            });
        match tree {
            Ok(trees) => engines.extend(trees.into_iter().map(|(kernel, tree)| Engine {
                builder,
                kernel: kernel.name(),
                kind: Kind::Wide(kernel, tree),
            })),
            Err(error) => group.fail(builder, &error.into()),
        }
    }
    if method.binary.contains(&builder.full_name()) {
        match group.all_cores.install(|| BinaryScene::new(&bvh, mesh)) {
            Ok(scene) => engines.push(Engine {
                builder,
                kernel: BINARY.to_owned(),
                kind: Kind::Binary(Box::new(scene)),
            }),
            Err(error) => group.fail(builder, &error.into()),
        }
    }
    drop(bvh);
    if method.brief {
        return engines;
    }
    for i in 0..own_structures(builder.source(), method.robust) {
        let robust = i == 1;
        match group.pool.install(|| builder.own_scene(mesh, group.embree.as_ref(), robust)) {
            Ok(Some(own)) => engines.push(Engine {
                builder,
                kernel: builder.source().name().to_owned() + if robust { ROBUST } else { "" },
                kind: Kind::Own(own),
            }),
            Ok(None) => {}
            Err(error) => group.fail(builder, &error),
        }
    }
    engines
}

fn measure_set(
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
            scene: group.scene.name.clone(),
            triangles: group.scene.mesh.len(),
            source: engine.builder.source(),
            builder: engine.builder.name().to_owned(),
            kernel: engine.kernel.clone(),
            width: match &engine.kind {
                Kind::Wide(kernel, _) => Some(kernel.width),
                Kind::Binary(_) => Some(2),
                Kind::Own(_) => None,
            },
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
    let Kind::Wide(_, tree) = &engine.kind else { return None };
    let rays = blocks_of(&set.rays, COUNTED);
    let counts: Counts =
        group.all_cores.install(|| rays.par_iter().map(|ray| tree.counts(set.any_hit, ray)).sum());
    let per_ray = |count: u64| count as f64 / rays.len() as f64;
    Some((per_ray(counts.boxes), per_ray(counts.triangles)))
}
