//! Rays per second of each kernel on incoherent rays through a cloud of triangles.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fastrand::Rng;
use niwaki_core::{Hit, Intersector, Ray, glam::Vec3};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{BinaryScene, QuantisedScene, WideScene};
use std::hint::black_box;

/// In a cube from −1 to 1.
fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 2.0
}

fn kernels(c: &mut Criterion) {
    let count = 100_000;
    let mesh = soup_mesh(count, (count as f32).cbrt().recip(), 1);
    let bvh = median_tree(&mesh, 1);
    let mut rng = Rng::with_seed(2);
    let rays: Vec<Ray> =
        (0..4096).map(|_| Ray::new(point(&mut rng), point(&mut rng).normalize_or_zero())).collect();
    let wide = WideScene::new(&bvh, &mesh).expect("a tree of this mesh");
    let quantised = QuantisedScene::new(&bvh, &mesh).expect("a tree of this mesh");
    let binary = BinaryScene::new(&bvh, &mesh).expect("a tree of this mesh");
    let mut scenes: Vec<(String, Box<dyn Intersector>)> =
        vec![("binary".to_owned(), Box::new(binary))];
    for kernel in WideScene::<8>::kernels() {
        let scene = wide.clone().with_kernel(kernel).expect("available");
        scenes.push((kernel.to_string(), Box::new(scene)));
        let scene = quantised.clone().with_kernel(kernel).expect("available");
        scenes.push((format!("{kernel}, quantised"), Box::new(scene)));
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    for (name, run) in [("closest_hit", true), ("any_hit", false)] {
        let mut group = c.benchmark_group(name);
        group.throughput(Throughput::Elements(rays.len() as u64));
        for (kernel, scene) in &scenes {
            group.bench_function(kernel, |b| {
                b.iter(|| {
                    if run {
                        scene.closest_hits(black_box(&rays), &mut hits);
                    } else {
                        scene.any_hits(black_box(&rays), &mut occluded);
                    }
                });
            });
        }
        group.finish();
    }
    let mut group = c.benchmark_group("layout");
    group.throughput(Throughput::Elements(mesh.len() as u64));
    group.bench_function("wide_scene", |b| b.iter(|| WideScene::new(black_box(&bvh), &mesh)));
    group.bench_function("quantised_scene", |b| {
        b.iter(|| QuantisedScene::new(black_box(&bvh), &mesh));
    });
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
