//! Judges an object-median tree over a bumpy sheet and says how long each metric takes.
//!
//! `cargo run --release -p niwaki-metrics --example judge -- 1000000`

use niwaki_core::{Aabb, Bvh, BvhNode, Ray, SahConstants, TriangleMesh, glam::Vec3, to_u32};
use niwaki_metrics::{TreeStats, epo, epo_sampled, leaf_counts, sah, validate};
use std::time::Instant;

/// A sheet of `cells`² squares over the unit square, with waves.
fn sheet(cells: u32) -> TriangleMesh {
    let vertex = |i: u32, j: u32| {
        let (x, y) = (i as f32 / cells as f32, j as f32 / cells as f32);
        Vec3::new(x, y, 0.1 * (20.0 * x).sin() * (17.0 * y).cos())
    };
    let row = cells + 1;
    let positions = (0..row * row).map(|k| vertex(k % row, k / row)).collect();
    let cell = |k: u32| {
        let a = k / cells * row + k % cells;
        [[a, a + 1, a + row], [a + row, a + 1, a + row + 1]]
    };
    TriangleMesh::new(positions, (0..cells * cells).flat_map(cell).collect())
        .expect("a finite sheet")
}

/// Halves the references at the median of the longest axis, down to leaves of two.
fn median(mesh: &TriangleMesh) -> Bvh {
    let mut prims = mesh.prim_refs();
    let mut nodes = vec![BvhNode::leaf(Aabb::EMPTY, 0, 1)];
    let mut stack = vec![(0, 0, prims.len())];
    while let Some((slot, first, end)) = stack.pop() {
        let part = &mut prims[first..end];
        let bounds = part.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
        if part.len() <= 2 {
            nodes[slot] = BvhNode::leaf(bounds, to_u32(first), to_u32(end - first));
            continue;
        }
        let axis = bounds.longest_axis();
        let half = part.len() / 2;
        part.select_nth_unstable_by(half, |a, b| {
            a.centroid2()[axis].total_cmp(&b.centroid2()[axis])
        });
        let children = nodes.len();
        nodes[slot] = BvhNode::inner(bounds, to_u32(children));
        nodes.extend([BvhNode::leaf(Aabb::EMPTY, 0, 1); 2]);
        stack.push((children, first, first + half));
        stack.push((children + 1, first + half, end));
    }
    Bvh { nodes, prim_ids: prims.iter().map(|p| p.prim_id).collect() }
}

fn timed<T: std::fmt::Debug>(what: &str, f: impl FnOnce() -> T) {
    let start = Instant::now();
    let value = f();
    println!("{what:<22} {:>8.1} ms  {value:?}", start.elapsed().as_secs_f64() * 1e3);
}

fn main() {
    let triangles: u32 = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(20_000);
    let mesh = sheet((triangles / 2).isqrt().clamp(1, 4000));
    let bvh = median(&mesh);
    let constants = SahConstants::THESIS_IV;
    let stats = TreeStats::of(&bvh);
    println!("{} triangles, {} nodes, depth {}", mesh.len(), stats.nodes, stats.depth_max);
    let rays: Vec<Ray> = (0..10_000_u16)
        .map(|i| {
            let f = f32::from(i) / 10_000.0;
            Ray::new(Vec3::new(f, 0.5, 1.0), Vec3::new(0.5 - f, 0.3 * f, -1.0))
        })
        .collect();
    timed("sah", || sah(&bvh, &constants));
    timed("epo", || epo(&bvh, &mesh, &constants));
    timed("epo, 10,000 samples", || epo_sampled(&bvh, &mesh, &constants, 10_000, 1));
    timed("leaves of 10,000 rays", || leaf_counts(&bvh, &mesh, &rays));
    timed("validate", || validate(&bvh, &mesh));
}
