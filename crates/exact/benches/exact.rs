//! The oracle on easy rays (the f64 pass decides), on exact ties (integers decide), and a scan.

use criterion::{Criterion, criterion_group, criterion_main};
use niwaki_core::{Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_exact::{Anchor, closest_in_mesh, contact, t_error_bound};
use std::hint::black_box;

fn exact(c: &mut Criterion) {
    let tri = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let down = |x, y| Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z);
    c.bench_function("contact, interior", |b| {
        b.iter(|| contact(black_box(&down(0.3, 0.2)), &tri));
    });
    c.bench_function("contact, miss", |b| b.iter(|| contact(black_box(&down(0.9, 0.9)), &tri)));
    c.bench_function("contact, corner", |b| b.iter(|| contact(black_box(&down(0.0, 0.0)), &tri)));
    c.bench_function("t_error_bound", |b| {
        b.iter(|| t_error_bound(black_box(&down(0.3, 0.2)), &tri, Anchor::First));
    });
    let triangles: Vec<_> = (0..1_000_000_u32)
        .map(|i| {
            let corner = Vec3::new((i % 1000) as f32, (i / 1000) as f32, 0.0);
            Triangle::new(corner, corner + Vec3::X, corner + Vec3::Y)
        })
        .collect();
    let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
    c.bench_function("closest in 1M triangles", |b| {
        b.iter(|| closest_in_mesh(black_box(&down(500.3, 500.2)), &mesh));
    });
}

criterion_group!(benches, exact);
criterion_main!(benches);
