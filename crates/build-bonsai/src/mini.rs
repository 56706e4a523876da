//! Mini trees: one sweep tree a group (thesis paper IV, section 5.3).

use crate::source::Source;
use niwaki_build_sweep::{Kernel, SplitRule, WorkspacePool};
use niwaki_core::{BvhNode, to_u32};
use rayon::prelude::*;
use std::ops::Range;

/// A mini tree. Its nodes start at slot `2·prims.start` of the common array and name each other
/// relative to that; its leaves name places in the common list of ids.
#[derive(Clone, Debug)]
pub(crate) struct MiniTree {
    pub(crate) prims: Range<u32>,
    /// How many nodes it has.
    pub(crate) nodes: u32,
}

/// Builds the tree of every group: `ids` goes in by group and comes out in leaf order, `nodes` has
/// two slots for each primitive, and no group is larger than `size`.
pub(crate) fn build<S: Source + ?Sized>(
    source: &S,
    rule: &SplitRule,
    kernel: Kernel,
    size: usize,
    groups: &[Range<u32>],
    ids: &mut [u32],
    nodes: &mut [BvhNode],
) -> Vec<MiniTree> {
    let mut tasks = Vec::with_capacity(groups.len());
    let (mut ids, mut nodes) = (ids, nodes);
    for group in groups {
        let (ids_here, ids_after) = ids.split_at_mut(group.len());
        let (nodes_here, nodes_after) = nodes.split_at_mut(2 * group.len());
        tasks.push((group.clone(), ids_here, nodes_here));
        (ids, nodes) = (ids_after, nodes_after);
    }
    let pool = WorkspacePool::new(kernel, size);
    tasks
        .into_par_iter()
        .map_init(
            || pool.take(),
            |workspace, (prims, ids, nodes)| {
                workspace.prims.clear();
                workspace.prims.extend(ids.iter().map(|&id| source.prim(id)));
                let nodes = to_u32(workspace.build(rule, nodes, ids, prims.start as usize));
                MiniTree { prims, nodes }
            },
        )
        .collect()
}
