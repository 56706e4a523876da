//! What a view asks of a GPU, sampled at several resolutions, and how long sampling takes.
//!
//! `sample_view [triangles]`

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, glam::Vec3};
use niwaki_gpu_model::workload::{CountingKernel, LightSample, Pattern, Sampling, View};
use niwaki_scene::generate::generate;
use niwaki_trace::{BinaryScene, Kernel, QuantisedScene};
use std::{error::Error, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let triangles = std::env::args().nth(1).map_or(Ok(174_000), |word| word.parse())?;
    let mesh = generate("foliage", triangles, 1);
    let mesh = mesh.ok_or("no such scene")?.mesh;
    let bvh = Binned::default().build_mesh(&mesh)?;
    let bounds = mesh.bounds();
    let eye = bounds.center() + bounds.extent() * Vec3::new(0.3, 0.35, 0.4);
    let view = View::look_at(eye, bounds.center(), Vec3::Y, 0.9, 16.0 / 9.0);
    let radius = 0.1 * bounds.extent().length();
    println!("{} triangles", mesh.len());
    // As GPUs have it, by the best kernel and by the scalar one.
    let wide = QuantisedScene::<8>::new(&bvh, &mesh)?;
    let kernels: [(&str, Box<dyn CountingKernel>); 3] = [
        ("binary", Box::new(BinaryScene::new(&bvh, &mesh)?)),
        ("wide, scalar", Box::new(wide.clone().with_kernel(Kernel::Scalar)?)),
        ("wide", Box::new(wide)),
    ];
    for (name, kernel) in &kernels {
        for pattern in
            [Pattern::Regular, Pattern::Jittered, Pattern::LowDiscrepancy, Pattern::Blocks]
        {
            for (width, height) in [(32, 18), (64, 36)] {
                let sampling = Sampling {
                    pattern,
                    width,
                    height,
                    ao_radius: radius,
                    lights: vec![LightSample::Directional(Vec3::new(0.4, -1.0, 0.3))],
                    ..Sampling::default()
                };
                let mut seconds: Vec<f64> = (0..15)
                    .map(|_| {
                        let begin = Instant::now();
                        std::hint::black_box(sampling.sample(&**kernel, &mesh, &view));
                        begin.elapsed().as_secs_f64()
                    })
                    .collect();
                seconds.sort_by(f64::total_cmp);
                let w = sampling.sample(&**kernel, &mesh, &view);
                println!(
                    "{name} {width}×{height} {pattern:?}: {:.2} ms; p_t {:.1} p_i {:.1} t_v {:.2} a_t {:.1} a_w {:.1} m {:.2}, divergence {:.2} and {:.2}",
                    seconds[seconds.len() / 2] * 1e3,
                    w.primary_traversals,
                    w.primary_intersections,
                    w.visible_triangles,
                    w.ao_traversals,
                    w.ao_intersections,
                    w.coalescing,
                    w.primary_divergence,
                    w.secondary_divergence
                );
            }
        }
    }
    Ok(())
}
