//! Mini trees: one sweep tree a group (thesis paper IV, section 5.3).

use niwaki_build_sweep::{Kernel, SplitRule, WorkspacePool};
use niwaki_core::midpoint::Source;
use niwaki_core::{BvhNode, PrimRef, to_u32};
use niwaki_split::Group;
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

/// How mini trees are built.
pub(crate) struct Build<'a> {
    pub(crate) rule: &'a SplitRule,
    pub(crate) kernel: Kernel,
    /// No group is larger.
    pub(crate) size: usize,
}

/// Neighbouring groups, by their sizes and what is known of each, and their places in the list of
/// ids.
struct Task<'a, G> {
    groups: Vec<(usize, G)>,
    first: usize,
    ids: &'a mut [u32],
}

impl Build<'_> {
    /// Builds the tree of every group: `ids` goes in by group and comes out in leaf order.
    pub(crate) fn over_source<S: Source + ?Sized>(
        &self,
        source: &S,
        groups: &[Range<u32>],
        ids: &mut [u32],
    ) -> Vec<Batch> {
        self.run(groups.iter().map(|group| (group.len(), ())), ids, |&(), ids, prims| {
            prims.extend(ids.iter().map(|&id| source.prim(id)));
        })
    }

    /// As [`Build::over_source`], from groups of references: `ids` only comes out.
    pub(crate) fn over_groups<'g>(
        &self,
        groups: impl Iterator<Item = Group<'g>>,
        ids: &mut [u32],
    ) -> Vec<Batch> {
        self.run(groups.map(|group| (group.len(), group)), ids, |group, _, prims| {
            for part in group.parts() {
                prims.extend_from_slice(part);
            }
        })
    }

    /// `groups` are sizes and what `fill` needs to know of each.
    fn run<G: Send>(
        &self,
        groups: impl Iterator<Item = (usize, G)>,
        mut ids: &mut [u32],
        fill: impl Fn(&G, &[u32], &mut Vec<PrimRef>) + Sync,
    ) -> Vec<Batch> {
        let mut tasks = Vec::new();
        let (mut first, mut count, mut waiting) = (0, 0, Vec::new());
        for (len, group) in groups {
            waiting.push((len, group));
            count += len;
            if count >= GRAIN {
                let (ids_here, ids_after) = ids.split_at_mut(count);
                tasks.push(Task { groups: std::mem::take(&mut waiting), first, ids: ids_here });
                ids = ids_after;
                first += count;
                count = 0;
            }
        }
        tasks.push(Task { groups: waiting, first, ids });
        let pool = WorkspacePool::new(self.kernel, self.size);
        tasks
            .into_par_iter()
            .map_init(
                || pool.take(),
                |workspace, Task { groups, mut first, mut ids }| {
                    let most = 2 * ids.len();
                    let mut batch = Batch {
                        // Trees with leaves of a few primitives need no more.
                        nodes: Vec::with_capacity(ids.len()),
                        ends: Vec::with_capacity(groups.len()),
                    };
                    for (len, group) in &groups {
                        let (ids_here, ids_after) = ids.split_at_mut(*len);
                        ids = ids_after;
                        workspace.prims.clear();
                        fill(group, ids_here, &mut workspace.prims);
                        let nodes = workspace.build(self.rule, ids_here, first);
                        if batch.nodes.capacity() - batch.nodes.len() < nodes.len() {
                            batch.nodes.reserve_exact(most - batch.nodes.len());
                        }
                        batch.nodes.extend_from_slice(nodes);
                        first += len;
                        batch.ends.push((to_u32(batch.nodes.len()), to_u32(first)));
                    }
                    batch
                },
            )
            .collect()
    }
}
