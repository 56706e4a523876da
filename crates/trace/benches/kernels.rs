//! Rays per second of each kernel on incoherent rays through a cloud of triangles.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fastrand::Rng;
use niwaki_core::{
    Aabb, Bvh, BvhNode, Hit, Intersector, PrimRef, Ray, Triangle, TriangleMesh, glam::Vec3, to_u32,
};
use niwaki_trace::{BinaryScene, Kernel, WideScene};
use std::hint::black_box;

fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5)
}

fn cloud(count: usize) -> TriangleMesh {
    let mut rng = Rng::with_seed(1);
    let size = (count as f32).cbrt().recip();
    let triangles: Vec<_> = (0..count)
        .map(|_| {
            let p = point(&mut rng);
            let mut corner = || p + point(&mut rng) * size;
            Triangle::new(corner(), corner(), corner())
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).expect("finite")
}

fn build(mesh: &TriangleMesh) -> Bvh {
    let mut prims = mesh.prim_refs();
    let bounds = |p: &[PrimRef]| p.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
    let mut nodes = vec![BvhNode::leaf(bounds(&prims), 0, to_u32(prims.len()))];
    let mut open = 0;
    while open < nodes.len() {
        let node = nodes[open];
        let range = node.prim_range();
        if range.len() > 1 {
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

fn kernels(c: &mut Criterion) {
    let mesh = cloud(100_000);
    let bvh = build(&mesh);
    let mut rng = Rng::with_seed(2);
    let rays: Vec<Ray> =
        (0..4096).map(|_| Ray::new(point(&mut rng), point(&mut rng).normalize_or_zero())).collect();
    let wide = WideScene::new(&bvh, &mesh).expect("a tree of this mesh");
    let binary = BinaryScene::new(&bvh, &mesh).expect("a tree of this mesh");
    let mut scenes: Vec<(String, Box<dyn Intersector>)> =
        vec![("binary".to_owned(), Box::new(binary))];
    for kernel in Kernel::available() {
        let scene = wide.clone().with_kernel(kernel).expect("available");
        scenes.push((kernel.to_string(), Box::new(scene)));
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
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
