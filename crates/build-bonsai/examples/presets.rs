//! Build time by step and tree quality of the three presets, against a full sweep, on a mesh of
//! small triangles with a few large ones among them.

use niwaki_build_bonsai::Bonsai;
use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, SahConstants, Triangle, TriangleMesh, glam::Vec3};
use niwaki_metrics::sah;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut state = 1_u32;
    let mut point = |size: f32| {
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        Vec3::new(random(), random(), random()) * size
    };
    let triangles: Vec<Triangle> = (0..200_000)
        .map(|i| {
            let (place, size) = if i % 500 == 0 { (0.5, 0.5) } else { (1.0, 0.01) };
            let at = point(place);
            Triangle { v0: at + point(size), v1: at + point(size), v2: at + point(size) }
        })
        .collect();
    let mesh = TriangleMesh::from_triangles(&triangles)?;

    let start = Instant::now();
    let sweep = Sweep::default().build_mesh(&mesh)?;
    let sweep_time = start.elapsed();
    let sweep_cost = sah(&sweep, &SahConstants::THESIS_IV);
    println!("sweep: {sweep_time:?}, SAH {sweep_cost:.2}");
    for bonsai in [Bonsai::bonsai(), Bonsai::bonsai_p(), Bonsai::bonsai_p_star()] {
        let (bvh, timings) = bonsai.build_mesh_timed(&mesh)?;
        let time = timings.total().as_secs_f64() / sweep_time.as_secs_f64();
        let cost = sah(&bvh, &SahConstants::THESIS_IV) / sweep_cost;
        println!("{}: {time:.2} of the time, {cost:.3} of the cost", bonsai.name());
        for (step, time) in timings.steps() {
            println!("  {step}: {time:?}");
        }
    }
    Ok(())
}
