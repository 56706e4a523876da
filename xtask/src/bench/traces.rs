//! Timing traversal.

use super::builds::Built;
use super::rays::{RaySet, blocks_of};
use super::timing::{Effort, in_turns, median};
use super::{Group, Method};
use crate::machine;
use crate::registry::TreeBuilder;
use crate::results::{Source, TraceRow};
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_trace::{BinaryScene, Counts, Kernel, Mode, QuantisedScene, SceneError, WideScene};
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Rays that a thread takes at once: few enough that no thread waits long for the last.
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
    Wide(Box<WideScene>),
    Quantised(Box<QuantisedScene>),
    Binary(Box<BinaryScene>),
    Own(Box<dyn Intersector + Send>),
}

/// A scene that several kernels of ours share.
enum Ours {
    Wide(WideScene),
    Quantised(QuantisedScene),
}

impl Ours {
    fn new(
        mode: Mode,
        quantised: bool,
        bvh: &Bvh,
        mesh: &TriangleMesh,
    ) -> Result<Self, SceneError> {
        Ok(if quantised {
            Self::Quantised(QuantisedScene::new_in(mode, bvh, mesh)?)
        } else {
            Self::Wide(WideScene::new_in(mode, bvh, mesh)?)
        })
    }

    fn with_kernel(&self, kernel: Kernel) -> Result<Kind, SceneError> {
        Ok(match self {
            Self::Wide(scene) => Kind::Wide(Box::new(scene.clone().with_kernel(kernel)?)),
            Self::Quantised(scene) => Kind::Quantised(Box::new(scene.clone().with_kernel(kernel)?)),
        })
    }
}

impl Engine<'_> {
    fn intersector(&self) -> &dyn Intersector {
        match &self.kind {
            Kind::Wide(scene) => scene.as_ref(),
            Kind::Quantised(scene) => scene.as_ref(),
            Kind::Binary(scene) => scene.as_ref(),
            Kind::Own(scene) => scene.as_ref(),
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
    fn trace(&mut self, engine: &dyn Intersector, rays: &[Ray], any_hit: bool) -> Duration {
        if any_hit {
            self.flags.resize(rays.len(), false);
            let start = Instant::now();
            rays.par_chunks(CHUNK)
                .zip(self.flags.par_chunks_mut(CHUNK))
                .for_each(|(rays, flags)| engine.any_hits(rays, flags));
            start.elapsed()
        } else {
            self.hits.resize(rays.len(), Hit::MISS);
            let start = Instant::now();
            rays.par_chunks(CHUNK)
                .zip(self.hits.par_chunks_mut(CHUNK))
                .for_each(|(rays, hits)| engine.closest_hits(rays, hits));
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
    while rest.peek().is_some() {
        // What fits into half of the free memory is measured in turns; on most machines and
        // scenes that is everything.
        let room = machine::available_memory().unwrap_or(usize::MAX) / 2;
        let mut engines = Vec::new();
        let mut used = 0;
        while let Some(tree) = rest.peek() {
            // One a kernel of ours at most, a binary tree, a peer's own structures.
            let scenes = method.kernels.len()
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

/// What traces a tree: our kernels, and the peer's own.
fn make<'a>(method: &Method, group: &mut Group<'_>, tree: Built<'a>) -> Vec<Engine<'a>> {
    let Built { builder, bvh, .. } = tree;
    let mesh = &group.scene.mesh;
    let mut engines = Vec::new();
    for mode in Mode::ALL {
        for quantised in [false, true] {
            let kernels = method
                .kernels
                .iter()
                .filter(|kernel| kernel.mode == mode && kernel.quantised == quantised);
            let mut kernels = kernels.peekable();
            if kernels.peek().is_none() {
                continue;
            }
            match group.all_cores.install(|| Ours::new(mode, quantised, &bvh, mesh)) {
                Ok(scene) => {
                    for kernel in kernels {
                        match scene.with_kernel(kernel.kernel) {
                            Ok(kind) => {
                                engines.push(Engine { builder, kernel: kernel.name(), kind });
                            }
                            Err(error) => group.fail(builder, &error.into()),
                        }
                    }
                }
                Err(error) => group.fail(builder, &error.into()),
            }
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
                kind: Kind::Own(own.scene),
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
        let time =
            group.pool.install(|| answers.trace(engine.intersector(), &set.rays, set.any_hit));
        slowest = slowest.max(time);
        hits.push(answers.hits(set.any_hit));
    }
    // Three passes of the slowest shall not take much longer than what all get.
    let longest = method.seconds.max(0.2);
    let share = (longest / slowest.as_secs_f64().max(1e-9)).min(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of it")]
    let most = ((set.rays.len() as f64 * share) as usize).max(CHUNK * group.threads * 8);
    let rays = blocks_of(&set.rays, most);

    let mut seconds: Vec<Vec<f64>> = vec![Vec::new(); engines.len()];
    in_turns(engines.len(), Effort::seconds(method.seconds), |i| {
        let time =
            group.pool.install(|| answers.trace(engines[i].intersector(), &rays, set.any_hit));
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
            rays: set.name.clone(),
            query: if set.any_hit { "any".into() } else { "closest".into() },
            threads: group.threads,
            ray_count: set.rays.len(),
            timed_rays: rays.len(),
            repeats: seconds.len(),
            batch,
            mrays_per_s: rays.len() as f64 / median(seconds) / 1e6,
            hits,
            boxes_per_ray: counts.map(|(boxes, _)| boxes),
            triangles_per_ray: counts.map(|(_, triangles)| triangles),
        }
    });
    rows.collect()
}

/// Boxes and triangles tested per ray, for our kernels.
fn count(group: &Group<'_>, engine: &Engine<'_>, set: &RaySet) -> Option<(f64, f64)> {
    let counted = |ray: &Ray| match (&engine.kind, set.any_hit) {
        (Kind::Wide(scene), false) => Some(scene.closest_hit_counted(ray).1),
        (Kind::Wide(scene), true) => Some(scene.any_hit_counted(ray).1),
        (Kind::Quantised(scene), false) => Some(scene.closest_hit_counted(ray).1),
        (Kind::Quantised(scene), true) => Some(scene.any_hit_counted(ray).1),
        (Kind::Binary(_) | Kind::Own(_), _) => None,
    };
    let rays = blocks_of(&set.rays, COUNTED);
    let counts: Counts =
        group.all_cores.install(|| rays.par_iter().map(counted).sum::<Option<Counts>>())?;
    let per_ray = |count: u64| count as f64 / rays.len() as f64;
    Some((per_ray(counts.boxes), per_ray(counts.triangles)))
}
