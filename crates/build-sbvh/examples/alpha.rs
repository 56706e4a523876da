//! What spatial splits cost and gain: references, time and SAH cost for several values of alpha.
//!
//! `cargo run --release -p niwaki-build-sbvh --example alpha -- [triangles]`

use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Builder, SahConstants, Triangle, TriangleMesh, glam::Vec3};
use niwaki_metrics::sah;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let triangles = std::env::args().nth(1).map_or(Ok(50_000), |a| a.parse::<usize>())?;
    let mesh = scene(triangles)?;
    println!("{:<12}{:>10}{:>16}{:>10}{:>10}", "preset", "alpha", "references", "ms", "SAH");
    for preset in [Sbvh::default(), Sbvh::sweep()] {
        for alpha in [1.0, 1e-3, 1e-5, 0.0] {
            let builder = Sbvh { alpha, ..preset };
            let start = Instant::now();
            let bvh = builder.build_mesh(&mesh)?;
            let time = start.elapsed().as_secs_f64() * 1e3;
            let references = bvh.prim_ids.len() as f64 / mesh.len() as f64;
            let cost = sah(&bvh, &SahConstants::THESIS_IV);
            let name = preset.name();
            println!("{name:<12}{alpha:>10.0e}{references:>16.3}{time:>10.1}{cost:>10.2}");
        }
    }
    Ok(())
}

/// Long thin triangles in all directions, among many small ones.
fn scene(count: usize) -> Result<TriangleMesh, niwaki_core::MeshError> {
    let mut state = 1_u64;
    let mut unit = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut point = |size: f32| (Vec3::new(unit(), unit(), unit()) - 0.5) * size;
    let triangles: Vec<Triangle> = (0..count)
        .map(|i| {
            let (center, along) = (point(10.0), point(if i % 8 == 0 { 2.0 } else { 0.1 }));
            Triangle::new(center - along, center + along, center + point(0.1))
        })
        .collect();
    TriangleMesh::from_triangles(&triangles)
}
