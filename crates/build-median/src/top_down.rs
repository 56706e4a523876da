//! The subdivision that both builders share; they differ in where they cut.

use crate::SPATIAL_LEVELS;
use niwaki_core::builder::check_max_leaf_size;
use niwaki_core::float::sortable_bits;
use niwaki_core::layout::{Subtree, divide, finish, slots};
use niwaki_core::{Aabb, BuildError, Bvh, BvhNode, PrimRef, scene_bounds};
use rayon::prelude::*;

/// Subtrees below this size stay on one thread.
const GRAIN: usize = 2048;

/// Where a node is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// At the middle of the order.
    Object,
    /// At the middle of the box.
    Spatial,
}

/// A node to build: its slots, its primitives, the place of the first of them in the leaf order,
/// and how many levels lie above.
struct Task<'a> {
    subtree: Subtree<'a>,
    prims: &'a mut [PrimRef],
    first: usize,
    level: u32,
}

pub(crate) fn build(
    mut prims: Vec<PrimRef>,
    max_leaf_size: usize,
    rule: Rule,
) -> Result<Bvh, BuildError> {
    check_max_leaf_size(max_leaf_size)?;
    scene_bounds(&prims)?;
    let mut nodes = slots(prims.len());
    if let Some(subtree) = Subtree::root(&mut nodes) {
        divide(
            Task { subtree, prims: &mut prims, first: 0, level: 0 },
            GRAIN,
            |task| task.prims.len(),
            || (),
            |task, ()| step(task, max_leaf_size, rule),
        );
    }
    let ids = prims.par_iter().with_min_len(4096).map(|p| p.prim_id).collect();
    drop(prims); // Before the nodes are moved, where memory use peaks.
    Ok(finish(nodes, ids))
}

/// See [`niwaki_core::Builder::memory_bound`].
pub(crate) fn memory_bound(count: usize) -> usize {
    // Twice the nodes and 4 bytes of new place per pair of nodes while holes are closed, beside
    // the leaf order. (References, nodes and leaf order before that are less.) The constant is
    // for task lists, which the bound on the depth keeps short.
    let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
    2 * nodes + count * 2 * size_of::<u32>() + (256 << 10) + count / 8
}

fn step<'a>(task: Task<'a>, max_leaf_size: usize, rule: Rule) -> Option<[Task<'a>; 2]> {
    let Task { subtree, prims, first, level } = task;
    let mut bounds = Aabb::EMPTY;
    let mut centroids = Aabb::EMPTY;
    for p in prims.iter() {
        bounds = bounds.union(p.aabb());
        centroids = centroids.grow(p.centroid2());
    }
    if prims.len() <= max_leaf_size {
        subtree.leaf(bounds, first, prims.len());
        return None;
    }
    let left = match rule {
        Rule::Spatial if level < SPATIAL_LEVELS => {
            let cut = split_space(prims, &bounds);
            if cut == 0 || cut == prims.len() { split_order(prims, &centroids) } else { cut }
        }
        _ => split_order(prims, &centroids),
    };
    let (left_prims, right_prims) = prims.split_at_mut(left);
    let [a, b] = subtree.split(bounds, left);
    let level = level + 1;
    Some([
        Task { subtree: a, prims: left_prims, first, level },
        Task { subtree: b, prims: right_prims, first: first + left, level },
    ])
}

/// Moves the lower half by centroid to the front and returns its size.
fn split_order(prims: &mut [PrimRef], centroids: &Aabb) -> usize {
    let axis = centroids.longest_axis();
    let middle = prims.len() / 2;
    prims.select_nth_unstable_by_key(middle, |p| {
        u64::from(sortable_bits(p.centroid2()[axis])) << 32 | u64::from(p.prim_id)
    });
    middle
}

/// Moves the primitives below the middle of the box to the front and returns how many there are.
fn split_space(prims: &mut [PrimRef], bounds: &Aabb) -> usize {
    let axis = bounds.longest_axis();
    let middle2 = bounds.min[axis] + bounds.max[axis];
    let mut low = 0;
    for i in 0..prims.len() {
        if prims[i].centroid2()[axis] < middle2 {
            prims.swap(low, i);
            low += 1;
        }
    }
    low
}
