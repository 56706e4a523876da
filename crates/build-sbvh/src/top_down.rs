//! The top-down subdivision: large nodes one after the other with all threads each, the subtrees
//! below them side by side.

use crate::object::{self, Finder};
use crate::partition::{Side, scatter, straddlers};
use crate::spatial::{Bins, Planes};
use crate::weight::Weights;
use crate::{ObjectSplit, Sbvh};
use niwaki_core::bins::{CHUNK, Kernel};
use niwaki_core::layout::{Subtree, divide, finish_with_holes, slots};
use niwaki_core::{
    Aabb, AreaScale, BuildError, Bvh, BvhNode, Clip, PrimRef, SceneBounds, scene_bounds, to_u32,
};
use rayon::prelude::*;

/// Nodes from this size on are binned and partitioned by all threads.
const PARALLEL_FROM: usize = 4 * CHUNK;

/// Subtrees below this size stay on one thread.
const GRAIN: usize = 2048;

/// Levels of splits by cost; deeper nodes are halved by number, which bounds depth and time for
/// inputs that make the heuristic peel off one reference after the other.
pub(crate) const SPLIT_LEVELS: u32 = 100;

/// A node to build.
struct Task<'a> {
    subtree: Subtree<'a>,
    /// Places for all references that the subtree may have; the first `count` are in use.
    refs: &'a mut [PrimRef],
    /// As many places, for the children.
    spare: &'a mut [PrimRef],
    /// As many places of the leaf order, which begin at `first`.
    ids: &'a mut [u32],
    first: usize,
    count: usize,
    level: u32,
    bounds: Aabb,
    /// Around twice the centroids.
    centroids: Aabb,
}

/// What does not change during a build.
struct Context<'a, C> {
    config: &'a Sbvh,
    clip: &'a C,
    scene: SceneBounds,
    /// Spatial splits are tried for overlaps of more than this half area.
    overlap: f32,
    weights: Weights,
}

/// Memory of one thread.
struct Scratch {
    finder: Finder,
    spatial: Bins,
    sides: Vec<u8>,
}

impl Scratch {
    fn new() -> Self {
        Self { finder: Finder::new(Kernel::fastest()), spatial: Bins::new(), sides: Vec::new() }
    }
}

pub(crate) fn build<C: Clip>(
    prims: &[PrimRef],
    config: &Sbvh,
    clip: &C,
) -> Result<Bvh, BuildError> {
    let scene = scene_bounds(prims)?;
    let count = prims.len();
    let capacity = config.reference_bound(count);
    let mut ids: Vec<u32> = bytemuck::zeroed_vec(capacity);
    let mut nodes = slots(capacity);
    let overlap = config.alpha * scene.bounds.half_area(scene.area_scale);
    let context = Context { config, clip, scene, overlap, weights: Weights::new(config) };
    if let Some(subtree) = Subtree::root(&mut nodes) {
        let mut refs: Vec<PrimRef> = bytemuck::zeroed_vec(capacity);
        let mut spare: Vec<PrimRef> = bytemuck::zeroed_vec(capacity);
        refs.par_chunks_mut(CHUNK)
            .zip(prims.par_chunks(CHUNK))
            .for_each(|(to, from)| to[..from.len()].copy_from_slice(from));
        let mut large = vec![Task {
            subtree,
            refs: &mut refs,
            spare: &mut spare,
            ids: &mut ids,
            first: 0,
            count,
            level: 0,
            bounds: scene.bounds,
            centroids: scene.centroid2_bounds,
        }];
        let mut small = Vec::new();
        let mut scratch = Scratch::new();
        while let Some(task) = large.pop() {
            if task.count < PARALLEL_FROM {
                small.push(task);
            } else if let Some(children) = step(task, &context, &mut scratch) {
                large.extend(children);
            }
        }
        drop(scratch);
        small.into_par_iter().for_each(|task| {
            divide(
                task,
                GRAIN,
                |task| task.count,
                Scratch::new,
                |task, scratch| step(task, &context, scratch),
            );
        });
    }
    Ok(finish_with_holes(nodes, ids))
}

/// See [`niwaki_core::Builder::memory_bound`].
pub(crate) fn memory_bound(config: &Sbvh, count: usize) -> usize {
    let capacity = config.reference_bound(count);
    let nodes = (2 * capacity).saturating_sub(1) * size_of::<BvhNode>();
    let ids = capacity * size_of::<u32>();
    // While nodes are built: two arrays of references, or the mesh's and one; what straddles a
    // plane; sides; the memory of sweeps.
    let threads = 2 * rayon::current_num_threads() + 1;
    let swept = match config.object_split {
        ObjectSplit::Bins(_) => 0,
        ObjectSplit::Sweep { up_to } => {
            // One large node at a time, and small ones of each thread.
            let small = up_to.min(count).min(PARALLEL_FROM) * threads;
            Finder::bytes(small.max(up_to.min(count)) + small)
        }
    };
    let straddling = (capacity - count) * 2 * size_of::<PrimRef>();
    let building = 3 * capacity * size_of::<PrimRef>() + straddling + 6 * capacity + swept;
    // While holes are closed: the nodes again, 4 bytes for the new place of each pair; the leaf
    // order again, with 12 bytes for each 64 places.
    let finishing = nodes + capacity * 4 + ids + capacity / 4;
    let working = (256 << 10)
        + Weights::BYTES
        + threads * (size_of::<niwaki_core::bins::Bins>() + Bins::bytes(config.spatial_bins)) * 4;
    nodes + ids + building.max(finishing) + working
}

/// Makes a node a leaf, or an inner node and returns its children.
fn step<'a, C: Clip>(
    task: Task<'a>,
    context: &Context<'_, C>,
    scratch: &mut Scratch,
) -> Option<[Task<'a>; 2]> {
    let Context { config, clip, weights, .. } = context;
    let sah = &config.sah;
    let Task { count, bounds, centroids, level, .. } = task;
    let refs = &task.refs[..count];
    // Costs relative to the node's own area.
    let leaf = sah.leaf + sah.triangle * count as f32;
    if count == 1 || (count <= config.max_leaf_size && leaf <= sah.inner) {
        return make_leaf(task);
    }
    let parallel = count >= PARALLEL_FROM;
    let scale = AreaScale::of(&bounds);
    let Scratch { finder, spatial, sides } = scratch;
    sides.clear();
    sides.resize(count, 0);
    let object = if level >= SPLIT_LEVELS {
        None
    } else {
        finder.find(refs, &centroids, scale, config, weights, parallel)
    };
    let area = bounds.half_area(scale);
    let mut best = object.map_or(area * weights.of(to_u32(count)), |split| split.cost);
    let mut parts = None;
    let room = task.refs.len() - count;
    if room > 0 && level < SPLIT_LEVELS && object.is_none_or(|split| overlaps(&split, context)) {
        let planes = Planes::new(&bounds, config.spatial_bins);
        if parallel {
            spatial.fill_parallel(refs, &planes, *clip);
        } else {
            spatial.fill(refs, &planes, *clip);
        }
        if let Some(split) = spatial.best(&planes, scale, weights)
            && split.cost < best
            && let Some(straddlers) =
                straddlers(refs, sides, &split, &planes, *clip, room, scale, weights, parallel)
            && straddlers.cost < best
        {
            best = straddlers.cost;
            parts = Some((straddlers.parts, straddlers.boxes));
        }
    }
    if count <= config.max_leaf_size && leaf * area <= sah.inner * area + best {
        return make_leaf(task);
    }
    let (parts, boxes) = match (parts, object) {
        (Some(split), _) => split,
        // A split that makes no box smaller, as among equal boxes, would go on for one reference a
        // level.
        (None, Some(split)) if split.boxes.iter().any(|b| b.half_area(scale) < area) => {
            finder.sides(&split, refs, sides, parallel);
            (Vec::new(), split.boxes)
        }
        _ => {
            object::halve(refs, &centroids, sides);
            (Vec::new(), [bounds; 2])
        }
    };
    // Where boxes are large, references are likely to be cut again.
    let need = boxes.map(|b| b.half_area(scale));
    let Task { subtree, refs, spare, ids, first, .. } = task;
    let (children, border) = scatter(&refs[..count], sides, &parts, spare, need, parallel);
    let [a, b] = subtree.split(bounds, border);
    let (spare_a, spare_b) = refs.split_at_mut(border);
    let (refs_a, refs_b) = spare.split_at_mut(border);
    let (ids_a, ids_b) = ids.split_at_mut(border);
    let child = |subtree, refs, spare, ids, first, side: Side| Task {
        subtree,
        refs,
        spare,
        ids,
        first,
        count: side.count,
        level: level + 1,
        bounds: side.bounds.aabb(),
        centroids: side.centroids.aabb(),
    };
    Some([
        child(a, refs_a, spare_a, ids_a, first, children[0]),
        child(b, refs_b, spare_b, ids_b, first + border, children[1]),
    ])
}

/// True if the children of an object split overlap so much that a plane may do better.
fn overlaps<C>(split: &object::Split, context: &Context<'_, C>) -> bool {
    let [a, b] = split.boxes;
    let overlap = a.intersection(b);
    !overlap.is_empty() && overlap.half_area(context.scene.area_scale) > context.overlap
}

fn make_leaf<'a>(task: Task<'a>) -> Option<[Task<'a>; 2]> {
    let refs = &task.refs[..task.count];
    let mut count = 0;
    for (i, p) in refs.iter().enumerate() {
        // References of one primitive only meet where the caller gave them.
        if !refs[..i].iter().any(|q| (q.prim_id, q.geom_id) == (p.prim_id, p.geom_id)) {
            task.ids[count] = p.prim_id;
            count += 1;
        }
    }
    task.subtree.leaf(task.bounds, task.first, count);
    None
}
