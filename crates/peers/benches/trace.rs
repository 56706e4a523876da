//! One ray at a time through the peers' own kernels: what our calls add to theirs shows here.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_core::{Hit, Intersector, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_peers::{Embree, EmbreeScene, ObvhsKernel, ObvhsPreset, ObvhsScene, Quality};
use std::hint::black_box;

/// A field of 20,000 small triangles, and rays that cross it.
fn scene() -> (TriangleMesh, Vec<Ray>) {
    let mut state = 1_u32;
    let mut unit = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let mut point = || Vec3::new(unit(), unit(), unit());
    let triangles: Vec<Triangle> = (0..20_000)
        .map(|_| {
            let p = point();
            Triangle::new(p, p + (point() - 0.5) * 0.05, p + (point() - 0.5) * 0.05)
        })
        .collect();
    let mesh = TriangleMesh::from_triangles(&triangles).unwrap_or_default();
    let rays = (0..1000).map(|_| Ray::new(point(), (point() - 0.5).normalize())).collect();
    (mesh, rays)
}

fn trace(c: &mut Criterion) {
    let (mesh, rays) = scene();
    let mut group = c.benchmark_group("closest_hit");
    group.throughput(Throughput::Elements(rays.len() as u64));
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut run = |name: &str, scene: &dyn Intersector| {
        group.bench_function(name, |b| {
            b.iter(|| scene.closest_hits(black_box(&rays), &mut hits));
        });
    };
    if let Ok(embree) = Embree::load() {
        for robust in [false, true] {
            if let Ok(scene) = EmbreeScene::new(&embree, &mesh, Quality::Medium, robust) {
                run(if robust { "embree robust" } else { "embree" }, &scene);
            }
        }
    }
    for kernel in ObvhsKernel::ALL {
        if let Ok(scene) = ObvhsScene::new(&mesh, ObvhsPreset::Medium, kernel) {
            run(&format!("obvhs {}", kernel.name()), &scene);
        }
    }
    group.finish();
}

criterion_group!(benches, trace);
criterion_main!(benches);
