//! What traces rays: our kernels over trees of ours and of peers, and peers' own structures.

use super::{Group, Method};
use crate::kernel::{TraceKernel, WideTree, each_any, each_closest};
use crate::registry::{OwnScene, TreeBuilder};
use crate::results::Source;
use niwaki_core::{Builder, Bvh, Hit, Ray};
use niwaki_trace::{BinaryScene, DoubleHit, DoubleRay, DoubleScene};
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Rays that a thread takes at once, unless they make a batch: few enough that no thread waits long
/// for the last.
pub(crate) const CHUNK: usize = 256;

/// Something that is timed.
pub(crate) struct Engine<'a> {
    pub(crate) builder: &'a TreeBuilder,
    pub(crate) kernel: String,
    kind: Kind,
}

enum Kind {
    Wide(TraceKernel, WideTree),
    Binary(Box<BinaryScene>),
    Double(Box<DoubleScene>),
    Own(OwnScene),
}

impl Engine<'_> {
    /// Rays of a call.
    pub(crate) const fn rays_per_call(&self) -> usize {
        match &self.kind {
            Kind::Wide(kernel, _) => kernel.rays_per_call(),
            Kind::Binary(_) | Kind::Double(_) | Kind::Own(_) => 1,
        }
    }

    /// Children a node, where it is a tree of ours.
    pub(crate) const fn width(&self) -> Option<usize> {
        match &self.kind {
            Kind::Wide(kernel, _) => Some(kernel.width),
            Kind::Binary(_) | Kind::Double(_) => Some(2),
            Kind::Own(_) => None,
        }
    }

    /// Which of our kernels over wide trees it is.
    pub(crate) const fn trace_kernel(&self) -> Option<TraceKernel> {
        match &self.kind {
            Kind::Wide(kernel, _) => Some(*kernel),
            _ => None,
        }
    }

    /// The wide tree, if it is one.
    pub(crate) const fn wide_tree(&self) -> Option<&WideTree> {
        match &self.kind {
            Kind::Wide(_, tree) => Some(tree),
            _ => None,
        }
    }

    /// Bytes of nodes and triangles, where they are known.
    pub(crate) fn bytes(&self) -> Option<usize> {
        match &self.kind {
            Kind::Wide(_, tree) => Some(tree.bytes()),
            Kind::Binary(_) | Kind::Double(_) => None,
            Kind::Own(own) => Some(own.bytes),
        }
    }

    /// Rays that a thread takes at once: those of a call, or [`CHUNK`].
    pub(crate) fn chunk(&self) -> usize {
        self.rays_per_call().max(CHUNK)
    }

    fn trace_closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        match &self.kind {
            Kind::Wide(kernel, tree) => tree.trace_closest(kernel.batch, rays, hits),
            Kind::Binary(scene) => each_closest(scene.as_ref(), rays, hits),
            Kind::Double(scene) => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = scene.closest_hit(&double(ray)).map_or(Hit::MISS, single);
                }
            }
            // Peers leave `closest_hits` as it comes with the trait: a loop, compiled for the
            // peer, with one call of `rtcIntersect1` a ray.
            Kind::Own(own) => own.scene.closest_hits(rays, hits),
        }
    }

    /// The closest hit of each ray on the current pool: the distance in as many bits as there are,
    /// and the primitive; nothing for a miss.
    pub(crate) fn precise_hits(&self, rays: &[Ray]) -> Vec<Option<(f64, u32)>> {
        if let Kind::Double(scene) = &self.kind {
            let of = |ray| scene.closest_hit(&double(ray)).map(|hit| (hit.t, hit.prim_id));
            return rays.par_iter().map(of).collect();
        }
        let mut answers = Answers::default();
        answers.trace(self, rays, false);
        let of = |hit: &Hit| hit.is_hit().then_some((hit.t.into(), hit.prim_id));
        answers.hits.iter().map(of).collect()
    }

    fn trace_any(&self, rays: &[Ray], flags: &mut [bool]) {
        match &self.kind {
            Kind::Wide(kernel, tree) => tree.trace_any(kernel.batch, rays, flags),
            Kind::Binary(scene) => each_any(scene.as_ref(), rays, flags),
            Kind::Double(scene) => {
                for (ray, flag) in rays.iter().zip(flags) {
                    *flag = scene.any_hit(&double(ray));
                }
            }
            Kind::Own(own) => own.scene.any_hits(rays, flags),
        }
    }
}

fn double(ray: &Ray) -> DoubleRay {
    DoubleRay {
        origin: ray.origin.as_dvec3(),
        direction: ray.direction.as_dvec3(),
        t_min: ray.t_min.into(),
        t_max: ray.t_max.into(),
    }
}

fn single(hit: DoubleHit) -> Hit {
    #[expect(clippy::cast_possible_truncation, reason = "what f32 can hold of it")]
    let [t, u, v] = [hit.t, hit.u, hit.v].map(|x| x as f32);
    Hit { t, u, v, prim_id: hit.prim_id }
}

/// Room for the answers, allocated once.
#[derive(Default)]
pub(crate) struct Answers {
    pub(crate) hits: Vec<Hit>,
    pub(crate) flags: Vec<bool>,
}

impl Answers {
    /// Traces all rays once on the current pool.
    pub(crate) fn trace(&mut self, engine: &Engine<'_>, rays: &[Ray], any_hit: bool) -> Duration {
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

    pub(crate) fn hits(&self, any_hit: bool) -> usize {
        if any_hit {
            self.flags.iter().filter(|flag| **flag).count()
        } else {
            self.hits.iter().filter(|hit| hit.is_hit()).count()
        }
    }
}

/// The name of the scalar reference kernel over binary trees.
pub(crate) const BINARY: &str = "binary";

/// What is put behind the name of a peer for its robust mode.
pub(crate) const ROBUST: &str = "_robust";

/// The name of the scalar kernel in double precision.
pub(crate) const DOUBLE: &str = "double";

/// How many structures of its own a peer makes for its own kernels: Embree one for its default
/// mode, and one for its robust mode if that was asked for.
pub(crate) fn own_structures(source: Source, robust: bool) -> usize {
    match source {
        Source::Niwaki => 0,
        Source::Embree => 1 + usize::from(robust),
        Source::Obvhs => 1,
    }
}

/// What traces a tree by our kernels, and by the scalar one over the binary tree if that is wanted.
pub(crate) fn ours<'a>(
    method: &Method,
    group: &mut Group<'_>,
    builder: &'a TreeBuilder,
    bvh: &Bvh,
) -> Vec<Engine<'a>> {
    let mesh = group.mesh;
    let mut engines = Vec::new();
    for layout in TraceKernel::by_layout(&method.kernels) {
        let tree = group
            .all_cores
            .install(|| WideTree::new(layout[0], method.collapse, bvh, mesh))
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
        match group.all_cores.install(|| BinaryScene::new(bvh, mesh)) {
            Ok(scene) => engines.push(Engine {
                builder,
                kernel: BINARY.to_owned(),
                kind: Kind::Binary(Box::new(scene)),
            }),
            Err(error) => group.fail(builder, &error.into()),
        }
    }
    engines
}

/// The scalar kernel in double precision, over a tree of its own that a builder of ours makes.
pub(crate) fn in_double<'a>(group: &mut Group<'_>, builder: &'a TreeBuilder) -> Option<Engine<'a>> {
    let TreeBuilder::Ours(ours) = builder else { return None };
    let positions: Vec<_> = group.mesh.positions().iter().map(|p| p.as_dvec3()).collect();
    let ours: &dyn Builder = ours.as_ref();
    let made = group.all_cores.install(|| DoubleScene::new(ours, &positions, group.mesh.indices()));
    match made {
        Ok(scene) => {
            Some(Engine { builder, kernel: DOUBLE.to_owned(), kind: Kind::Double(Box::new(scene)) })
        }
        Err(error) => {
            group.fail(builder, &error.into());
            None
        }
    }
}

/// The structures of its own that a peer makes, each with the peer's kernel.
pub(crate) fn own<'a>(
    method: &Method,
    group: &mut Group<'_>,
    builder: &'a TreeBuilder,
) -> Vec<Engine<'a>> {
    let mut engines = Vec::new();
    for i in 0..own_structures(builder.source(), method.robust) {
        let robust = i == 1;
        let embree = group.embree.as_ref();
        match group.pool.install(|| builder.own_scene(group.mesh, embree, robust)) {
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
