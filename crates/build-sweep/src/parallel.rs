//! The parallel engine.

use crate::kernel::Kernel;
use crate::rule::SplitRule;
use crate::workspace::SweepWorkspace;
use niwaki_core::{Bvh, PrimRef, layout};

/// Builds a tree over `prims`, whose bounds must be finite, on the current rayon pool. The result
/// does not depend on the number of threads or the kernel.
#[must_use]
pub fn build_tree(prims: &[PrimRef], rule: SplitRule, kernel: Kernel) -> Bvh {
    if prims.is_empty() {
        return Bvh::default();
    }
    let mut nodes = layout::slots(prims.len());
    let mut ids = vec![0; prims.len()];
    let mut workspace = SweepWorkspace::new(kernel);
    workspace.prims.extend_from_slice(prims);
    let used = workspace.build(&rule, &mut nodes, &mut ids, 0);
    nodes.truncate(used);
    Bvh { nodes, prim_ids: ids }
}

/// Bytes that [`build_tree`] allocates at once for `count` primitives, the result included.
pub(crate) const fn memory_bound(count: usize) -> usize {
    SweepWorkspace::bytes(count) + 68 * count + 4096
}
