//! Ordinary geometry and a tree over it, for benchmarks, examples and the easy half of tests.

use crate::meshes::soup;
use glam::Vec3;
use niwaki_core::{Aabb, Bvh, BvhNode, PrimRef, TriangleMesh, to_u32};

/// [`soup`] as a mesh in which no two triangles share a vertex.
///
/// # Panics
/// If `size` is not finite.
#[must_use]
pub fn soup_mesh(count: usize, size: f32, seed: u64) -> TriangleMesh {
    TriangleMesh::from_triangles(&soup(count, size, seed)).expect("finite")
}

/// A sheet of `side`² squares, two triangles each, row by row, with shared vertices: `vertex(x, y)`
/// says where the vertex of column `x` and row `y` lies, each from 0 to `side`.
///
/// # Panics
/// If `vertex` gives a position that is not finite, or there are more vertices than 32 bits count.
#[must_use]
pub fn sheet(side: u32, vertex: impl Fn(u32, u32) -> Vec3) -> TriangleMesh {
    let rows = || (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y)));
    let positions = rows().map(|(x, y)| vertex(x, y)).collect();
    let corners = |(x, y)| {
        let a = y * (side + 1) + x;
        let b = a + side + 1;
        [[a, a + 1, b], [b, a + 1, b + 1]]
    };
    let squares = rows().filter(|&(x, y)| x < side && y < side);
    TriangleMesh::new(positions, squares.flat_map(corners).collect()).expect("finite and in range")
}

/// A tree from a builder too simple to be wrong: halves the list at the median of the longest axis
/// until at most `max_leaf_size` references are left, at least 1. No triangles have no nodes.
#[must_use]
pub fn median_tree(mesh: &TriangleMesh, max_leaf_size: usize) -> Bvh {
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
        if range.len() > max_leaf_size.max(1) {
            let axis = node.aabb().longest_axis();
            let part = &mut prims[range.clone()];
            let half = part.len() / 2;
            part.select_nth_unstable_by(half, |a, b| {
                a.centroid2()[axis].total_cmp(&b.centroid2()[axis])
            });
            let (a, b) = part.split_at(half);
            nodes[open] = BvhNode::inner(node.aabb(), to_u32(nodes.len()));
            nodes.push(BvhNode::leaf(bounds(a), to_u32(range.start), to_u32(a.len())));
            nodes.push(BvhNode::leaf(bounds(b), to_u32(range.start + half), to_u32(b.len())));
        }
        open += 1;
    }
    Bvh { nodes, prim_ids: prims.iter().map(|p| p.prim_id).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_sheet_covers_its_square_once() {
        let mesh = sheet(5, |x, y| Vec3::new(x as f32, y as f32, 0.0));
        assert_eq!((mesh.len(), mesh.positions().len()), (50, 36));
        assert!(mesh.triangles().all(|t| (t.v1 - t.v0).cross(t.v2 - t.v0) == Vec3::Z));
        assert_eq!(mesh.bounds(), Aabb::new(Vec3::ZERO, Vec3::new(5.0, 5.0, 0.0)));
        assert!(sheet(0, |_, _| Vec3::ZERO).is_empty());
    }

    #[test]
    fn a_median_tree_holds_every_triangle_once_within_its_boxes() {
        for (count, leaf) in [(0, 1), (1, 1), (2, 1), (1000, 1), (1000, 0), (1000, 7)] {
            let mesh = soup_mesh(count, 0.1, 5);
            let bvh = median_tree(&mesh, leaf);
            let mut ids = bvh.prim_ids.clone();
            ids.sort_unstable();
            assert!(ids.into_iter().eq(0..to_u32(count)));
            let mut held = 0;
            for node in &bvh.nodes {
                if node.is_leaf() {
                    held += node.prim_range().len();
                    assert!(node.prim_range().len() <= leaf.max(1));
                    for &id in bvh.leaf_prims(node) {
                        let triangle = mesh.triangle(id as usize).bounds();
                        assert_eq!(node.aabb().union(triangle), node.aabb());
                    }
                } else {
                    let below = node.children().map(|child| bvh.nodes[child].aabb());
                    assert_eq!(below.into_iter().reduce(|a, b| a.union(b)), Some(node.aabb()));
                }
            }
            assert_eq!(held, count);
        }
    }
}
