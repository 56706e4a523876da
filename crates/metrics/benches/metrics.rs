//! Metrics of a binned tree over a bumpy sheet of 100,000 triangles.

use criterion::{Criterion, criterion_group, criterion_main};
use niwaki_core::{Aabb, Bvh, BvhNode, Ray, SahConstants, TriangleMesh, glam::Vec3, to_u32};
use niwaki_metrics::{TreeStats, epo, epo_sampled, leaf_counts, sah, validate};
use std::hint::black_box;

/// A sheet over the unit square with waves.
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
    TriangleMesh::new(positions, (0..cells * cells).flat_map(cell).collect()).unwrap()
}

/// Object median of the longest axis, leaves of at most two.
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

fn metrics(c: &mut Criterion) {
    let mesh = sheet(224);
    let bvh = median(&mesh);
    let rays: Vec<Ray> = (0..10_000)
        .map(|i| {
            let f = i as f32 / 10_000.0;
            Ray::new(Vec3::new(f, 0.5, 1.0), Vec3::new(0.5 - f, 0.3 * f, -1.0))
        })
        .collect();
    let constants = SahConstants::THESIS_IV;
    let mut group = c.benchmark_group("100k");
    group.sample_size(10);
    group.bench_function("sah", |b| b.iter(|| sah(black_box(&bvh), &constants)));
    group.bench_function("stats", |b| b.iter(|| TreeStats::of(black_box(&bvh))));
    group.bench_function("epo", |b| b.iter(|| epo(black_box(&bvh), &mesh, &constants)));
    group.bench_function("epo_sampled_10k", |b| {
        b.iter(|| epo_sampled(black_box(&bvh), &mesh, &constants, 10_000, 1));
    });
    group.bench_function("leaf_counts_10k", |b| {
        b.iter(|| leaf_counts(black_box(&bvh), &mesh, &rays));
    });
    group.bench_function("validate", |b| b.iter(|| validate(black_box(&bvh), &mesh)));
    group.finish();
}

criterion_group!(benches, metrics);
criterion_main!(benches);
