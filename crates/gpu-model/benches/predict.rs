//! One prediction, and the default sampler on 174,000 triangles.

use criterion::{Criterion, criterion_group, criterion_main};
use niwaki_build_binned::Binned;
use niwaki_core::{Builder, glam::Vec3};
use niwaki_gpu_model::{
    Device, Form, FrameModel, KernelCounts, RaySettings, Workload,
    hong_kim::Model,
    workload::{CountingKernel, LightSample, Sampling, View},
};
use niwaki_scene::generate::generate;
use niwaki_trace::{BinaryScene, Kernel, QuantisedScene};
use std::hint::black_box;

const COUNTS: KernelCounts = KernelCounts {
    compute_per_traversal: 95.0,
    compute_per_intersection: 156.0,
    compute_constant: 703.0,
    memory_per_traversal: 6.0,
    memory_per_intersection: 3.0,
    memory_constant: 5.0,
    bytes_per_memory_instruction: 16.0,
};

fn predict(c: &mut Criterion) {
    let view = Workload {
        primary_traversals: 30.0,
        primary_intersections: 4.0,
        visible_triangles: 0.9,
        ao_traversals: 18.0,
        ao_intersections: 3.0,
        coalescing: 0.6,
        ..Workload::default()
    };
    let settings = RaySettings { ao_rays: 8.0, shadows: true };
    let device = Device::builtin("geforce-580").expect("it comes with the crate");
    for (name, form) in
        [("shortened", Form::Shortened), ("hong_kim", Form::HongKim(Model::default()))]
    {
        let model = FrameModel { form, ..FrameModel::new(device.clone(), COUNTS, 1280 * 720) };
        c.bench_function(&format!("predict/{name}"), |b| {
            b.iter(|| model.predict(black_box(&view), black_box(&settings)));
        });
    }
}

fn sample(c: &mut Criterion) {
    let mesh = generate("foliage", 174_000, 1).expect("a known scene").mesh;
    let bvh = Binned::default().build_mesh(&mesh).expect("a finite mesh");
    // As GPUs have it, by the best kernel and by the scalar one, and the binary tree.
    let best = QuantisedScene::<8>::new(&bvh, &mesh).expect("its own mesh");
    let scalar = best.clone().with_kernel(Kernel::Scalar).expect("every processor has it");
    let binary = BinaryScene::new(&bvh, &mesh).expect("its own mesh");
    let bounds = mesh.bounds();
    let eye = bounds.center() + bounds.extent() * Vec3::new(0.3, 0.35, 0.4);
    let view = View::look_at(eye, bounds.center(), Vec3::Y, 0.9, 16.0 / 9.0);
    let sampling = Sampling {
        ao_radius: 0.1 * bounds.extent().length(),
        lights: vec![LightSample::Directional(Vec3::new(0.4, -1.0, 0.3))],
        ..Sampling::default()
    };
    let kernels: [(&str, &dyn CountingKernel); 3] =
        [("wide", &best), ("wide, scalar", &scalar), ("binary", &binary)];
    for (name, kernel) in kernels {
        c.bench_function(&format!("sample/174k, {name}"), |b| {
            b.iter(|| sampling.sample(kernel, &mesh, &view));
        });
    }
}

criterion_group!(benches, predict, sample);
criterion_main!(benches);
