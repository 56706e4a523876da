//! The top-down subdivision: large nodes one after the other with all threads each, the subtrees
//! below them side by side.

use crate::Binned;
use crate::parallel;
use niwaki_core::bins::{Bins, CHUNK, Kernel, Mapping};
use niwaki_core::float::sortable_bits;
use niwaki_core::layout::{Subtree, divide, finish, slots};
use niwaki_core::{Aabb, AreaScale, BuildError, Bvh, BvhNode, PrimRef, scene_bounds};
use rayon::prelude::*;

/// Larger nodes are binned and partitioned by all threads. The order that this leaves differs
/// from that of one thread, so the limit is the same for any number of them.
const PARALLEL_FROM: usize = 4 * CHUNK;

/// Subtrees below this size stay on one thread.
const GRAIN: usize = 2048;

/// Levels of binned splits; deeper nodes are halved by number, which keeps the time within
/// O(n (`BINNED_LEVELS` + log n)) for inputs that make the heuristic peel off one primitive after
/// the other.
pub(crate) const BINNED_LEVELS: u32 = 256;

/// A node to build: its slots, its primitives and where they begin in the order of the leaves, how
/// many levels lie above, the box, and the bounds of twice the centroids.
struct Task<'a> {
    subtree: Subtree<'a>,
    prims: &'a mut [PrimRef],
    first: usize,
    level: u32,
    bounds: Aabb,
    centroids: Aabb,
}

pub(crate) fn build(
    mut prims: Vec<PrimRef>,
    config: &Binned,
    kernel: Kernel,
) -> Result<Bvh, BuildError> {
    let scene = scene_bounds(&prims)?;
    let mut nodes = slots(prims.len());
    if let Some(subtree) = Subtree::root(&mut nodes) {
        let (bounds, centroids) = (scene.bounds, scene.centroid2_bounds);
        let mut large =
            vec![Task { subtree, prims: &mut prims, first: 0, level: 0, bounds, centroids }];
        let mut small = Vec::new();
        let mut bins = Bins::new();
        while let Some(task) = large.pop() {
            if task.prims.len() < PARALLEL_FROM {
                small.push(task);
            } else if let Some(children) = step(task, &mut bins, config, kernel) {
                large.extend(children);
            }
        }
        small.into_par_iter().for_each(|task| {
            divide(
                task,
                GRAIN,
                |task| task.prims.len(),
                Bins::new,
                |task, bins| step(task, bins, config, kernel),
            );
        });
    }
    let ids = prims.par_iter().with_min_len(4096).map(|p| p.prim_id).collect();
    drop(prims); // Before the nodes are moved, where memory use peaks.
    Ok(finish(nodes, ids))
}

/// See [`niwaki_core::Builder::memory_bound`].
pub(crate) fn memory_bound(count: usize) -> usize {
    // Twice the nodes and 4 bytes of new place per pair of nodes while holes are closed, beside
    // the leaf order. (References, nodes and leaf order before that are less.) The rest is for
    // task lists, which the bound on the depth keeps short, and for each thread's bins.
    let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
    let working = (256 << 10) + rayon::current_num_threads() * 8 * size_of::<Bins>();
    2 * nodes + count * 2 * size_of::<u32>() + working + count / 8
}

/// Makes a node a leaf, or an inner node and returns its children.
fn step<'a>(
    task: Task<'a>,
    bins: &mut Bins,
    config: &Binned,
    kernel: Kernel,
) -> Option<[Task<'a>; 2]> {
    let Task { subtree, prims, first, level, bounds, centroids } = task;
    let count = prims.len();
    let sah = &config.sah;
    // Costs relative to the node's own area.
    let leaf = sah.leaf + sah.triangle * count as f32;
    if count == 1 || (count <= config.max_leaf_size && leaf <= sah.inner) {
        subtree.leaf(bounds, first, count);
        return None;
    }
    let is_large = count >= PARALLEL_FROM;
    let scale = AreaScale::of(&bounds);
    let number = config.bins_for(count);
    let mapping = Mapping::new(&centroids, number);
    let split = if level >= BINNED_LEVELS {
        None
    } else if is_large {
        *bins = *kernel.fill_parallel(prims, &mapping);
        kernel.best(bins, number, scale, sah)
    } else {
        bins.clear(number);
        kernel.fill(bins, prims, &mapping);
        kernel.best(bins, number, scale, sah)
    };
    if count <= config.max_leaf_size {
        let area = bounds.half_area(scale);
        let inner = split.map_or(f32::INFINITY, |split| sah.inner * area + split.cost);
        if leaf * area <= inner {
            subtree.leaf(bounds, first, count);
            return None;
        }
    }
    let level = level + 1;
    if let Some(split) = split {
        let boxes = bins.sides(&split, number);
        let parted = if is_large {
            parallel::partition(kernel, prims, &mapping, &split)
        } else {
            kernel.partition(prims, &mapping, &split)
        };
        let [c0, c1] = parted.centroids.map(|c| c.aabb());
        let (left, right) = prims.split_at_mut(parted.left);
        let [a, b] = subtree.split(bounds, parted.left);
        return Some([
            Task { subtree: a, prims: left, first, level, bounds: boxes[0], centroids: c0 },
            Task {
                subtree: b,
                prims: right,
                first: first + parted.left,
                level,
                bounds: boxes[1],
                centroids: c1,
            },
        ]);
    }
    let half = halve(prims, &centroids);
    let (left, right) = prims.split_at_mut(half);
    let [a, b] = subtree.split(bounds, half);
    Some([measured(a, left, first, level), measured(b, right, first + half, level)])
}

/// A task whose bounds are not known yet.
fn measured<'a>(
    subtree: Subtree<'a>,
    prims: &'a mut [PrimRef],
    first: usize,
    level: u32,
) -> Task<'a> {
    let empty = (Aabb::EMPTY, Aabb::EMPTY);
    let (bounds, centroids) =
        prims.iter().fold(empty, |(b, c), p| (b.union(p.aabb()), c.grow(p.centroid2())));
    Task { subtree, prims, first, level, bounds, centroids }
}

/// Moves the lower half by centroid along the longest axis to the front and returns its size.
fn halve(prims: &mut [PrimRef], centroids: &Aabb) -> usize {
    let axis = centroids.longest_axis();
    let middle = prims.len() / 2;
    prims.select_nth_unstable_by_key(middle, |p| {
        u64::from(sortable_bits(p.centroid2()[axis])) << 32 | u64::from(p.prim_id)
    });
    middle
}
