//! The parallel engine: large nodes with all threads, small ones each on one.

#[cfg(target_arch = "x86_64")]
use crate::avx2;
use crate::kernel::{Kernel, Split};
use crate::pool::WorkspacePool;
use crate::rule::{Decision, SplitRule};
use crate::scalar;
use crate::workspace::SweepWorkspace;
use niwaki_core::float::sortable_bits;
use niwaki_core::layout::{self, Subtree};
use niwaki_core::{Aabb, Bvh, PrimRef, radix};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed};

/// Nodes of up to this many primitives are copied and built by one thread inside its L2 cache.
const LOCAL: usize = 1 << 14;
/// Primitives that one task of a parallel loop handles.
const CHUNK: usize = 1 << 13;

/// What all tasks share.
struct Shared<'a> {
    prims: &'a [PrimRef],
    rule: SplitRule,
    kernel: Kernel,
    /// By primitive, 1 if it is on the right of the split at hand. Nodes hold different
    /// primitives, so no two tasks use the same entry; atomics say so without `unsafe`, and a
    /// relaxed access is a plain one.
    side: Vec<AtomicU8>,
    /// By primitive, its place in the copy that a small node is built from.
    place: Vec<AtomicU32>,
}

/// A node that has not been built.
struct Task<'a> {
    subtree: Subtree<'a>,
    /// Its primitives sorted along each axis.
    order: [&'a mut [u32]; 3],
    /// Areas while sweeping, entries that go right while partitioning.
    work: [&'a mut [u32]; 3],
    /// Its part of the primitive ids of the tree.
    ids: &'a mut [u32],
    first: usize,
}

/// Builds a tree over `prims`, whose bounds must be finite, on the current rayon pool. The result
/// does not depend on the number of threads or the kernel.
///
/// Complexity: O(n log n) for trees of depth O(log n).
#[must_use]
pub fn build_tree(prims: &[PrimRef], rule: SplitRule, kernel: Kernel) -> Bvh {
    let count = prims.len();
    if count == 0 {
        return Bvh::default();
    }
    let mut ids = vec![0; count];
    if count <= LOCAL {
        let mut workspace = SweepWorkspace::with_capacity(kernel, count);
        workspace.prims.extend_from_slice(prims);
        let nodes = workspace.build(&rule, &mut ids, 0).to_vec();
        return Bvh { nodes, prim_ids: ids };
    }
    let mut nodes = layout::slots(count);
    let mut order = sorted(prims);
    let mut work = [const { Vec::new() }; 3].map(|_: Vec<u32>| bytemuck::zeroed_vec(count));
    let shared = Shared {
        prims,
        rule,
        kernel: kernel.or_fallback(),
        side: (0..count).into_par_iter().map(|_| AtomicU8::new(0)).collect(),
        place: (0..count).into_par_iter().map(|_| AtomicU32::new(0)).collect(),
    };
    let pool = WorkspacePool::new(kernel, LOCAL);
    if let Some(subtree) = Subtree::root(&mut nodes) {
        let [x, y, z] = &mut order;
        let [a, b, c] = &mut work;
        layout::divide(
            Task { subtree, order: [x, y, z], work: [a, b, c], ids: &mut ids, first: 0 },
            LOCAL / 4,
            |task| task.ids.len(),
            || pool.take(),
            |task, workspace| step(task, &shared, workspace),
        );
    }
    drop((shared, order, work, pool));
    layout::finish(nodes, ids)
}

/// Bytes that [`build_tree`] allocates at once for `count` primitives, the result included.
#[must_use]
pub fn tree_memory_bound(count: usize) -> usize {
    let result = 68 * count;
    if count <= LOCAL {
        return result + SweepWorkspace::bytes(count).max(result) + 1024;
    }
    // Orders, work, sides and places. The keys of the sort take less than work and are gone before
    // it is allocated.
    let lists = (12 + 12 + 1 + 4) * count;
    // A thread that waits for another may start a task inside its own and need a second one.
    let workspaces = 2 * rayon::current_num_threads() * SweepWorkspace::bytes(LOCAL);
    // Or, while nodes are compacted, a second array and the new place of each pair.
    result + (lists + workspaces).max(result) + 65536
}

/// The primitives in the order of their centroids along each axis; equal ones by index.
fn sorted(prims: &[PrimRef]) -> [Vec<u32>; 3] {
    let mut keys: Vec<u64> = bytemuck::zeroed_vec(prims.len());
    let mut spare: Vec<u64> = bytemuck::zeroed_vec(prims.len());
    [0, 1, 2].map(|axis| {
        keys.par_iter_mut().zip(prims).enumerate().with_min_len(CHUNK).for_each(
            |(i, (key, prim))| {
                let centroid2 = prim.min[axis] + prim.max[axis];
                *key = u64::from(sortable_bits(centroid2)) << 32 | i as u64;
            },
        );
        // SAFETY: the key is computed from the item alone.
        unsafe { radix::sort_by_key(&mut keys, &mut spare, 32, |key| key >> 32) };
        #[expect(clippy::cast_possible_truncation, reason = "the low half is the index")]
        keys.par_iter().with_min_len(CHUNK).map(|&key| key as u32).collect()
    })
}

/// Splits a large node, finishes a small one.
fn step<'a>(
    task: Task<'a>,
    shared: &Shared<'_>,
    workspace: &mut SweepWorkspace,
) -> Option<[Task<'a>; 2]> {
    let count = task.ids.len();
    if count <= LOCAL {
        build_local(task, shared, workspace);
        return None;
    }
    let Task { subtree, order, mut work, ids, first } = task;
    let rule = &shared.rule;
    let mut found = [(Aabb::EMPTY, Split::NONE); 3];
    order
        .par_iter()
        .zip(&mut work)
        .zip(&mut found)
        .enumerate()
        .for_each(|(axis, ((order, work), found))| *found = sweep_axis(shared, order, axis, work));
    let bounds = found[0].0;
    let mut split = found[0].1;
    for (_, other) in &found[1..] {
        if other.cost < split.cost {
            split = *other;
        }
    }
    match rule.decide(count, bounds.half_area(rule.scale), split.cost) {
        Decision::Leaf => {
            for (id, &i) in ids.iter_mut().zip(order[0].iter()) {
                *id = shared.prims[i as usize].prim_id;
            }
            subtree.leaf(bounds, first, count);
            return None;
        }
        Decision::Best => {}
        Decision::Halve => {
            split = Split { axis: widest(shared.prims, &order), left: count / 2, cost: 0.0 };
        }
    }
    let left = split.left;
    order[split.axis].par_iter().enumerate().with_min_len(CHUNK).for_each(|(i, &p)| {
        shared.side[p as usize].store(u8::from(i >= left), Relaxed);
    });
    let mut order = order;
    order.par_iter_mut().zip(&mut work).enumerate().for_each(|(axis, (order, work))| {
        if axis != split.axis {
            scalar::partition(order, work, |p| shared.side[p].load(Relaxed));
        }
    });
    let [a, b] = subtree.split(bounds, left);
    let [x, y, z] = order.map(|order| order.split_at_mut(left));
    let [u, v, w] = work.map(|work| work.split_at_mut(left));
    let (ids_left, ids_right) = ids.split_at_mut(left);
    Some([
        Task { subtree: a, order: [x.0, y.0, z.0], work: [u.0, v.0, w.0], ids: ids_left, first },
        Task {
            subtree: b,
            order: [x.1, y.1, z.1],
            work: [u.1, v.1, w.1],
            ids: ids_right,
            first: first + left,
        },
    ])
}

/// The box of a node and its cheapest split along one axis.
fn sweep_axis(shared: &Shared<'_>, order: &[u32], axis: usize, work: &mut [u32]) -> (Aabb, Split) {
    let right: &mut [f32] = bytemuck::cast_slice_mut(work);
    #[cfg(target_arch = "x86_64")]
    if shared.kernel == Kernel::Avx2 {
        // SAFETY: this kernel is chosen only where AVX2 is present, and orders hold indices of
        // primitives.
        return unsafe { avx2::sweep_axis(shared.prims, order, axis, &shared.rule, right) };
    }
    let mut best = Split::NONE;
    let bounds = scalar::sweep_axis(shared.prims, order, axis, &shared.rule, right, &mut best);
    (bounds, best)
}

/// The axis along which the centroids spread most.
fn widest(prims: &[PrimRef], order: &[&mut [u32]; 3]) -> usize {
    let spread = |axis: usize| {
        let order = &order[axis];
        let key = |i: u32| prims[i as usize].centroid2()[axis];
        key(order[order.len() - 1]) - key(order[0])
    };
    (1..3).fold(0, |best, axis| if spread(axis) > spread(best) { axis } else { best })
}

/// Copies a small node into the cache of this thread and builds everything below it there.
fn build_local(task: Task<'_>, shared: &Shared<'_>, workspace: &mut SweepWorkspace) {
    let [x, y, z] = task.order;
    workspace.prims.clear();
    workspace.prims.extend(x.iter().zip(0..).map(|(&p, place)| {
        shared.place[p as usize].store(place, Relaxed);
        shared.prims[p as usize]
    }));
    let places = |order: &mut [u32]| {
        for p in order {
            *p = shared.place[*p as usize].load(Relaxed);
        }
    };
    places(y);
    places(z);
    for (p, place) in x.iter_mut().zip(0..) {
        *p = place;
    }
    let nodes = workspace.build_ordered(&shared.rule, [x, y, z], task.ids, task.first);
    task.subtree.fill(nodes);
}
