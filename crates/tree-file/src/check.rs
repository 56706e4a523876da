//! Whether nodes and references are a binary tree.

use crate::TreeFault;
use niwaki_core::Bvh;

/// Checks links, ranges and boxes, in time linear in nodes and references.
pub(crate) fn check(bvh: &Bvh) -> Result<(), TreeFault> {
    let (nodes, references) = (bvh.nodes.len(), bvh.prim_ids.len());
    let mut has_parent = vec![false; nodes];
    let mut is_used = vec![false; references];
    for (i, node) in bvh.nodes.iter().enumerate() {
        if !node.aabb().is_finite() || node.aabb().is_empty() {
            return Err(TreeFault::Box { node: i });
        }
        if !node.is_leaf() {
            let [a, b] = node.children();
            if a <= i || b >= nodes {
                return Err(TreeFault::Child { node: i, first_child: node.first, nodes });
            }
            for child in [a, b] {
                if std::mem::replace(&mut has_parent[child], true) {
                    return Err(TreeFault::TwoParents { node: child });
                }
            }
            continue;
        }
        let end = u64::from(node.first) + u64::from(node.count);
        if end > references as u64 {
            return Err(TreeFault::Leaf { node: i, end, references });
        }
        // Ends at the first that was used before: each reference is looked at twice at most.
        for reference in node.prim_range() {
            if std::mem::replace(&mut is_used[reference], true) {
                return Err(TreeFault::TwoLeaves { reference, node: i });
            }
        }
    }
    // Children come after their parents, so that one parent each leaves no room for a cycle.
    if let Some(node) = has_parent.iter().skip(1).position(|&has| !has) {
        return Err(TreeFault::Orphan { node: node + 1 });
    }
    match is_used.iter().position(|&used| !used) {
        Some(reference) => Err(TreeFault::Unused { reference }),
        None => Ok(()),
    }
}
