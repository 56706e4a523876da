//! Mini trees: one sweep tree a group (thesis paper IV, section 5.3).

use crate::source::Source;
use niwaki_build_sweep::{Kernel, SplitRule, WorkspacePool};
use niwaki_core::{BvhNode, PrimRef, to_u32};
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

/// How mini trees are built.
pub(crate) struct Build<'a> {
    pub(crate) rule: &'a SplitRule,
    pub(crate) kernel: Kernel,
    /// No group is larger.
    pub(crate) size: usize,
}

impl Build<'_> {
    /// Builds the tree of every group: `ids` goes in by group and comes out in leaf order, `nodes`
    /// has two slots for each primitive.
    pub(crate) fn over_source<S: Source + ?Sized>(
        &self,
        source: &S,
        groups: &[Range<u32>],
        ids: &mut [u32],
        nodes: &mut [BvhNode],
    ) -> Vec<MiniTree> {
        self.run(groups.iter().map(|group| (group.len(), ())), ids, nodes, |(), ids, prims| {
            prims.extend(ids.iter().map(|&id| source.prim(id)));
        })
    }

    /// As [`Build::over_source`], from groups of references: `ids` only comes out.
    pub(crate) fn over_groups<'g>(
        &self,
        groups: impl Iterator<Item = &'g [PrimRef]>,
        ids: &mut [u32],
        nodes: &mut [BvhNode],
    ) -> Vec<MiniTree> {
        self.run(groups.map(|group| (group.len(), group)), ids, nodes, |group, _, prims| {
            prims.extend_from_slice(group);
        })
    }

    /// `groups` are sizes and what `fill` needs to know of each.
    fn run<G: Send>(
        &self,
        groups: impl Iterator<Item = (usize, G)>,
        ids: &mut [u32],
        nodes: &mut [BvhNode],
        fill: impl Fn(G, &[u32], &mut Vec<PrimRef>) + Sync,
    ) -> Vec<MiniTree> {
        let mut tasks = Vec::with_capacity(groups.size_hint().0);
        let (mut ids, mut nodes, mut first) = (ids, nodes, 0);
        for (len, group) in groups {
            let (ids_here, ids_after) = ids.split_at_mut(len);
            let (nodes_here, nodes_after) = nodes.split_at_mut(2 * len);
            tasks.push((group, first, ids_here, nodes_here));
            (ids, nodes) = (ids_after, nodes_after);
            first += len;
        }
        let pool = WorkspacePool::new(self.kernel, self.size);
        tasks
            .into_par_iter()
            .map_init(
                || pool.take(),
                |workspace, (group, first, ids, nodes)| {
                    workspace.prims.clear();
                    fill(group, ids, &mut workspace.prims);
                    let nodes = to_u32(workspace.build(self.rule, nodes, ids, first));
                    MiniTree { prims: to_u32(first)..to_u32(first + ids.len()), nodes }
                },
            )
            .collect()
    }
}
