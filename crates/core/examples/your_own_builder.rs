//! A builder of your own in thirty lines: it halves the list of primitives until two are left.
//!
//! It shows the three pieces every top-down builder uses: the check of the input, node slots
//! whose place depends on sizes alone, and the work list that runs on all threads.

use niwaki_core::{
    Aabb, BuildError, Builder, Bvh, PrimRef, TriangleMesh, glam::Vec3, layout, scene_bounds,
};

struct Halving;

impl Builder for Halving {
    fn name(&self) -> &str {
        "halving"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        scene_bounds(prims)?;
        let mut nodes = layout::slots(prims.len());
        if let Some(root) = layout::Subtree::root(&mut nodes) {
            layout::divide(
                (root, 0),
                1024,
                |(subtree, _)| subtree.capacity(),
                || (),
                |(subtree, first): (layout::Subtree<'_>, usize), ()| {
                    let count = subtree.capacity();
                    let bounds = prims[first..first + count]
                        .iter()
                        .fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
                    if count <= 2 {
                        subtree.leaf(bounds, first, count);
                        return None;
                    }
                    let [left, right] = subtree.split(bounds, count / 2);
                    Some([(left, first), (right, first + count / 2)])
                },
            );
        }
        Ok(layout::finish(nodes, prims.iter().map(|p| p.prim_id).collect()))
    }

    fn memory_bound(&self, count: usize) -> usize {
        // References, node slots and their compacted copy with its index, and ids.
        count * (32 + 2 * 64 + 4 + 4)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let strip: Vec<Vec3> =
        (0..1002_u16).map(|i| Vec3::new(f32::from(i), f32::from(i % 2), 0.0)).collect();
    let mesh = TriangleMesh::new(strip, (0..1000).map(|i| [i, i + 1, i + 2]).collect())?;
    let bvh = Halving.build_mesh(&mesh)?;
    let leaves = bvh.nodes.iter().filter(|n| n.is_leaf()).count();
    println!(
        "{} triangles: {} nodes, {leaves} leaves, {} bytes",
        mesh.len(),
        bvh.nodes.len(),
        bvh.bytes()
    );
    assert_eq!(bvh.bounds(), mesh.bounds());
    Ok(())
}
