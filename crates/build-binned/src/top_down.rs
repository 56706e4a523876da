//! The top-down subdivision.

use crate::Binned;
use crate::bins::{BinMapping, Bins};
use niwaki_core::float::sortable_bits;
use niwaki_core::layout::{Subtree, divide, finish, slots};
use niwaki_core::{Aabb, AreaScale, BuildError, Bvh, BvhNode, PrimRef, scene_bounds};
use rayon::prelude::*;

/// Subtrees below this size stay on one thread.
const GRAIN: usize = 2048;

/// Levels of binned splits; deeper nodes are halved by number, which keeps the time within
/// O(n (`BINNED_LEVELS` + log n)) for inputs that make the heuristic peel off one primitive after
/// the other.
const BINNED_LEVELS: u32 = 256;

struct Task<'a> {
    subtree: Subtree<'a>,
    prims: &'a mut [PrimRef],
    first: usize,
    level: u32,
    bounds: Aabb,
    centroids: Aabb,
}

pub(crate) fn build(mut prims: Vec<PrimRef>, config: &Binned) -> Result<Bvh, BuildError> {
    let scene = scene_bounds(&prims)?;
    let mut nodes = slots(prims.len());
    if let Some(subtree) = Subtree::root(&mut nodes) {
        divide(
            Task {
                subtree,
                prims: &mut prims,
                first: 0,
                level: 0,
                bounds: scene.bounds,
                centroids: scene.centroid2_bounds,
            },
            GRAIN,
            |task| task.prims.len(),
            || Box::new(Bins::new()),
            |task, bins| step(task, bins, config),
        );
    }
    let ids = prims.par_iter().with_min_len(4096).map(|p| p.prim_id).collect();
    drop(prims);
    Ok(finish(nodes, ids))
}

pub(crate) fn memory_bound(count: usize) -> usize {
    let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
    2 * nodes + count * 2 * size_of::<u32>() + (256 << 10) + count / 8
}

fn step<'a>(task: Task<'a>, bins: &mut Bins, config: &Binned) -> Option<[Task<'a>; 2]> {
    let Task { subtree, prims, first, level, bounds, centroids } = task;
    let count = prims.len();
    if count == 1 {
        subtree.leaf(bounds, first, 1);
        return None;
    }
    let scale = AreaScale::of(&bounds);
    let mapping = BinMapping::new(&centroids, config.bins);
    let split = if level < BINNED_LEVELS {
        bins.fill(prims, &mapping);
        bins.best(config.bins, scale, &config.sah)
    } else {
        None
    };
    if count <= config.max_leaf_size {
        let area = bounds.half_area(scale);
        let leaf = (config.sah.leaf + config.sah.triangle * count as f32) * area;
        let inner = split.map_or(f32::INFINITY, |split| {
            config.sah.inner * area
                + config.sah.leaf * split.areas
                + config.sah.triangle * split.cost
        });
        // `!(<)`: a NaN makes a leaf.
        if !(inner < leaf) {
            subtree.leaf(bounds, first, count);
            return None;
        }
    }
    let left = match split {
        Some(split) => {
            let mut low = 0;
            for i in 0..count {
                if mapping.bin(&prims[i])[split.axis] < split.bin {
                    prims.swap(low, i);
                    low += 1;
                }
            }
            low
        }
        None => halve(prims, &centroids),
    };
    let (left_prims, right_prims) = prims.split_at_mut(left);
    let [a, b] = subtree.split(bounds, left);
    Some([child(a, left_prims, first, level), child(b, right_prims, first + left, level)])
}

fn child<'a>(subtree: Subtree<'a>, prims: &'a mut [PrimRef], first: usize, level: u32) -> Task<'a> {
    let (bounds, centroids) = prims.iter().fold((Aabb::EMPTY, Aabb::EMPTY), |(b, c), p| {
        (b.union(p.aabb()), c.grow(p.centroid2()))
    });
    Task { subtree, prims, first, level: level + 1, bounds, centroids }
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
