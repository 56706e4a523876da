//! Trees for tests, from a builder too simple to be wrong.

use niwaki_core::{Aabb, Bvh, BvhNode, PrimRef, TriangleMesh, to_u32};

/// Halves the list along the longest axis until at most `leaf` references are left.
pub(crate) fn median_tree(mesh: &TriangleMesh, leaf: usize) -> Bvh {
    let mut prims = mesh.prim_refs();
    let bounds = |p: &[PrimRef]| p.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
    let mut nodes = Vec::new();
    if !prims.is_empty() {
        nodes.push(BvhNode::leaf(bounds(&prims), 0, to_u32(prims.len())));
    }
    let mut open = 0;
    while open < nodes.len() {
        let node: BvhNode = nodes[open];
        let range = node.prim_range();
        if range.len() > leaf {
            let axis = node.aabb().longest_axis();
            let part = &mut prims[range.clone()];
            let half = part.len() / 2;
            part.sort_by(|a, b| a.centroid2()[axis].total_cmp(&b.centroid2()[axis]));
            let (a, b) = part.split_at(half);
            nodes[open] = BvhNode::inner(node.aabb(), to_u32(nodes.len()));
            nodes.push(BvhNode::leaf(bounds(a), to_u32(range.start), to_u32(a.len())));
            nodes.push(BvhNode::leaf(bounds(b), to_u32(range.start + half), to_u32(b.len())));
        }
        open += 1;
    }
    Bvh { nodes, prim_ids: prims.iter().map(|p| p.prim_id).collect() }
}
