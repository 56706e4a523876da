//! Mini trees: one sweep tree a group (thesis paper IV, section 5.3).

use crate::source::Source;
use niwaki_build_sweep::{Kernel, SplitRule, WorkspacePool};
use niwaki_core::{BvhNode, to_u32};
use rayon::prelude::*;
use std::ops::Range;

/// A task takes neighbouring groups until they have this many primitives.
const GRAIN: usize = 1 << 13;

/// A mini tree. Its nodes name each other by index in themselves; its leaves name places in the
/// common list of ids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MiniTree<'a> {
    /// Root first, then as [`niwaki_build_sweep::SweepWorkspace::build`] leaves them.
    pub(crate) nodes: &'a [BvhNode],
    /// Where its places end.
    pub(crate) end: u32,
}

/// The mini trees of neighbouring groups, without gaps: slots for what each tree might have needed
/// would be three times as long, and every page of them has to come from the system.
#[derive(Debug)]
pub(crate) struct Batch {
    nodes: Vec<BvhNode>,
    /// Where the nodes and the places of each tree end.
    ends: Vec<(u32, u32)>,
}

impl Batch {
    /// The trees in order.
    pub(crate) fn trees(&self) -> impl Iterator<Item = MiniTree<'_>> {
        let mut start = 0;
        self.ends.iter().map(move |&(nodes_end, end)| {
            let nodes = &self.nodes[start..nodes_end as usize];
            start = nodes_end as usize;
            MiniTree { nodes, end }
        })
    }
}

/// Bytes that the mini trees take at most, for each primitive.
pub(crate) const BYTES: usize = 2 * size_of::<BvhNode>() + size_of::<(u32, u32)>();

/// Bytes that each thread takes while a list of nodes that turned out too short is copied, with
/// groups of up to `size`.
pub(crate) const fn copy_bytes(size: usize) -> usize {
    (GRAIN + size) * size_of::<BvhNode>()
}

/// Builds the tree of every group: `ids` goes in by group and comes out in leaf order. No group is
/// larger than `size`.
pub(crate) fn build<S: Source + ?Sized>(
    source: &S,
    rule: &SplitRule,
    kernel: Kernel,
    size: usize,
    groups: &[Range<u32>],
    ids: &mut [u32],
) -> Vec<Batch> {
    let mut tasks = Vec::new();
    let (mut groups, mut ids) = (groups, ids);
    while let Some(first) = groups.first() {
        let full = |group: &Range<u32>| (group.end - first.start) as usize >= GRAIN;
        let count = groups.iter().position(full).map_or(groups.len(), |last| last + 1);
        let (groups_here, groups_after) = groups.split_at(count);
        let prims = (groups_here[count - 1].end - first.start) as usize;
        let (ids_here, ids_after) = ids.split_at_mut(prims);
        tasks.push((groups_here, ids_here));
        (groups, ids) = (groups_after, ids_after);
    }
    let pool = WorkspacePool::new(kernel, size);
    tasks
        .into_par_iter()
        .map_init(
            || pool.take(),
            |workspace, (groups, mut ids)| {
                let most = 2 * ids.len();
                let mut batch = Batch {
                    // Trees with leaves of a few primitives need no more.
                    nodes: Vec::with_capacity(ids.len()),
                    ends: Vec::with_capacity(groups.len()),
                };
                for group in groups {
                    let (ids_here, ids_after) = ids.split_at_mut(group.len());
                    ids = ids_after;
                    workspace.prims.clear();
                    workspace.prims.extend(ids_here.iter().map(|&id| source.prim(id)));
                    let nodes = workspace.build(rule, ids_here, group.start as usize);
                    if batch.nodes.capacity() - batch.nodes.len() < nodes.len() {
                        batch.nodes.reserve_exact(most - batch.nodes.len());
                    }
                    batch.nodes.extend_from_slice(nodes);
                    batch.ends.push((to_u32(batch.nodes.len()), group.end));
                }
                batch
            },
        )
        .collect()
}
