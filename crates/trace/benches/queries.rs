//! What filters, lists, points and boxes cost beside the closest hit.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fastrand::Rng;
use niwaki_core::{Aabb, Intersector, Ray, glam::Vec3};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{HitQueries, MeshQueries, WideScene};
use std::hint::black_box;

/// In a cube from −1 to 1.
fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 2.0
}

fn queries(c: &mut Criterion) {
    let count = 100_000;
    let mesh = soup_mesh(count, (count as f32).cbrt().recip(), 1);
    let bvh = median_tree(&mesh, 1);
    let scene = WideScene::new(&bvh, &mesh).expect("a tree of this mesh");
    let near = MeshQueries::new(&bvh, &mesh).expect("a tree of this mesh");
    let mut rng = Rng::with_seed(2);
    let rays: Vec<Ray> =
        (0..1024).map(|_| Ray::new(point(&mut rng), point(&mut rng).normalize_or_zero())).collect();
    let rays = black_box(&rays);
    let mut group = c.benchmark_group("queries");
    group.throughput(Throughput::Elements(rays.len() as u64));
    let mut each = |name: &str, ask: &mut dyn FnMut(&Ray) -> usize| {
        group.bench_function(name, |b| b.iter(|| rays.iter().map(&mut *ask).sum::<usize>()));
    };
    each("closest_hit", &mut |ray| scene.closest_hit(ray).prim_id as usize);
    each("closest_hit_filtered, all pass", &mut |ray| {
        scene.closest_hit_filtered(ray, |_, _, u, v| u + v < 2.0).prim_id as usize
    });
    each("closest_hit_filtered, half pass", &mut |ray| {
        scene.closest_hit_filtered(ray, |_, _, u, v| u < v).prim_id as usize
    });
    let mut hits = Vec::new();
    for most in [1, 4, 16, usize::MAX] {
        let name = if most == usize::MAX { "all_hits".into() } else { format!("nearest {most}") };
        each(&name, &mut |ray| {
            scene.nearest_hits(ray, most, &mut hits);
            hits.len()
        });
    }
    each("nearest point", &mut |ray| {
        near.nearest(ray.origin, f64::INFINITY).map_or(0, |found| found.prim_id as usize)
    });
    let mut ids = Vec::new();
    each("overlapping, 1/1000 of the space", &mut |ray| {
        let half = Vec3::splat(0.1);
        near.overlapping(&Aabb::new(ray.origin - half, ray.origin + half), &mut ids);
        ids.len()
    });
    group.finish();
}

criterion_group!(benches, queries);
criterion_main!(benches);
