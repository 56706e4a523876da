//! Metrics of a median tree over a bumpy sheet of 100,000 triangles.

use criterion::{Criterion, criterion_group, criterion_main};
use niwaki_core::{Ray, SahConstants, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::{median_tree, sheet};
use niwaki_metrics::{TreeStats, epo, epo_sampled, leaf_counts, sah, validate};
use std::hint::black_box;

/// A sheet of `cells`² squares over the unit square, with waves.
fn waves(cells: u32) -> TriangleMesh {
    sheet(cells, |i, j| {
        let (x, y) = (i as f32 / cells as f32, j as f32 / cells as f32);
        Vec3::new(x, y, 0.1 * (20.0 * x).sin() * (17.0 * y).cos())
    })
}

fn metrics(c: &mut Criterion) {
    let mesh = waves(224);
    let bvh = median_tree(&mesh, 2);
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
