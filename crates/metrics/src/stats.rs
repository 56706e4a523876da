//! Counts and distributions.

use crate::preorder::{Preorder, prim_range};
use niwaki_core::Bvh;

/// What a tree consists of. Counts nodes that can be reached from the root.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct TreeStats {
    /// Inner nodes and leaves.
    pub nodes: usize,
    /// Nodes with two children.
    pub inner_nodes: usize,
    /// Nodes with primitives.
    pub leaf_nodes: usize,
    /// The deepest leaf; the root has depth 0.
    pub depth_max: usize,
    /// Mean depth of the leaves; 0 without leaves.
    pub depth_mean: f64,
    /// `leaf_depths[d]` leaves have depth `d`.
    pub leaf_depths: Vec<usize>,
    /// `leaf_sizes[n]` leaves hold `n` references; leaves with more than
    /// [`TreeStats::LARGEST_LEAF_SIZE`] are counted with those of that size.
    pub leaf_sizes: Vec<usize>,
    /// References of the largest leaf.
    pub leaf_size_max: usize,
    /// Mean number of references a leaf; 0 without leaves.
    pub leaf_size_mean: f64,
    /// Entries of all leaves.
    pub references: usize,
    /// Different primitives among them.
    pub primitives: usize,
    /// References per primitive: 1 unless a builder split primitives; 0 without primitives.
    pub duplication: f64,
    /// Bytes of nodes and ids ([`Bvh::bytes`]).
    pub bytes: usize,
}

impl TreeStats {
    /// Where the histogram [`TreeStats::leaf_sizes`] ends.
    pub const LARGEST_LEAF_SIZE: usize = 1024;

    /// Walks the tree once.
    #[must_use]
    pub fn of(bvh: &Bvh) -> Self {
        let order = Preorder::of(bvh);
        let mut stats = Self { nodes: order.nodes.len(), bytes: bvh.bytes(), ..Self::default() };
        let mut depth_sum = 0_u64;
        let mut ids: Vec<u32> = Vec::with_capacity(bvh.prim_ids.len());
        for (node, &depth) in order.nodes.iter().zip(&order.depths) {
            if !bvh.nodes[node.index as usize].is_leaf() {
                stats.inner_nodes += 1;
                continue;
            }
            stats.leaf_nodes += 1;
            depth_sum += u64::from(depth);
            count(&mut stats.leaf_depths, depth as usize);
            let range = prim_range(bvh, node.index);
            stats.leaf_size_max = stats.leaf_size_max.max(range.len());
            count(&mut stats.leaf_sizes, range.len().min(Self::LARGEST_LEAF_SIZE));
            ids.extend_from_slice(&bvh.prim_ids[range]);
        }
        stats.depth_max = stats.leaf_depths.len().saturating_sub(1);
        stats.references = ids.len();
        ids.sort_unstable();
        ids.dedup();
        stats.primitives = ids.len();
        if stats.leaf_nodes > 0 {
            stats.depth_mean = depth_sum as f64 / stats.leaf_nodes as f64;
            stats.leaf_size_mean = stats.references as f64 / stats.leaf_nodes as f64;
        }
        if stats.primitives > 0 {
            stats.duplication = stats.references as f64 / stats.primitives as f64;
        }
        stats
    }
}

fn count(histogram: &mut Vec<usize>, bin: usize) {
    if histogram.len() <= bin {
        histogram.resize(bin + 1, 0);
    }
    histogram[bin] += 1;
}
