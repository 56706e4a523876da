//! Traces a rippled surface with every kernel and prints what it looks like.

use niwaki_core::{
    Aabb, Bvh, BvhNode, Intersector, PrimRef, Ray, TriangleMesh, glam::Vec3, to_u32,
};
use niwaki_trace::{Kernel, WideScene};
use std::time::Instant;

/// A grid of `n`² quads over the unit square, lifted by a ripple.
fn ripple(n: u32) -> Result<TriangleMesh, niwaki_core::MeshError> {
    let height = |x: f32, y: f32| 0.1 * (20.0 * (x - 0.5).hypot(y - 0.5)).sin();
    let positions = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (i as f32 / n as f32, j as f32 / n as f32)))
        .map(|(x, y)| Vec3::new(x, y, height(x, y)))
        .collect();
    let corner = |i, j| j * (n + 1) + i;
    let indices = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] =
                [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    TriangleMesh::new(positions, indices)
}

/// Halves along the longest axis; the builder crates do better.
fn build(prims: &mut [PrimRef]) -> Bvh {
    let bounds = |p: &[PrimRef]| p.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
    let mut nodes = vec![BvhNode::leaf(bounds(prims), 0, to_u32(prims.len()))];
    let mut open = 0;
    while open < nodes.len() {
        let node = nodes[open];
        let range = node.prim_range();
        if range.len() > 2 {
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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = ripple(200)?;
    let bvh = build(&mut mesh.prim_refs());
    let (width, height) = (72_u16, 28_u16);
    for kernel in Kernel::available() {
        let scene = WideScene::new(&bvh, &mesh)?.with_kernel(kernel)?;
        let start = Instant::now();
        let mut picture = String::new();
        for y in 0..height {
            for x in 0..width {
                let (u, v) = (f32::from(x) / f32::from(width), f32::from(y) / f32::from(height));
                let ray =
                    Ray::new(Vec3::new(0.5, -0.8, 0.9), Vec3::new(u - 0.5, 1.0, -0.35 - 0.8 * v));
                let hit = scene.closest_hit(&ray);
                let shade = if hit.is_hit() {
                    let t = mesh.triangle(hit.prim_id as usize);
                    let n = (t.v1 - t.v0).cross(t.v2 - t.v0).normalize();
                    match n.dot(Vec3::new(0.6, 0.3, 0.74)).abs() {
                        d if d > 0.9 => '@',
                        d if d > 0.6 => 'o',
                        d if d > 0.3 => ':',
                        _ => '.',
                    }
                } else {
                    ' '
                };
                picture.push(shade);
            }
            picture.push('\n');
        }
        let time = start.elapsed();
        println!("{picture}{kernel}: {} rays in {time:.1?}", u32::from(width) * u32::from(height));
    }
    Ok(())
}
