//! AAC beside the clustering that it approximates, on a wavy sheet under scattered triangles.

use niwaki_build_aac::{Aac, Agglomerative};
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, SahConstants, TriangleMesh};
use niwaki_metrics::sah;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let side = 100_u32;
    let height = |x: f32, y: f32| (9.0 * x).sin() * (7.0 * y).cos() * 0.1;
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for i in 0..side * side {
        let (x, y) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
        positions.push(Vec3::new(x, y, height(x, y)));
        if i % side + 1 < side && i / side + 1 < side {
            indices.extend([[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]);
        }
    }
    let mut seed = 1_u32;
    let mut random = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32
    };
    for _ in 0..10_000 {
        let first = u32::try_from(positions.len())?;
        let center = Vec3::new(random(), random(), random());
        positions.extend([(); 3].map(|()| center + Vec3::new(random(), random(), random()) * 0.03));
        indices.push([first, first + 1, first + 2]);
    }
    let mesh = TriangleMesh::new(positions, indices)?;
    for builder in [&Aac::lq() as &dyn Builder, &Aac::hq(), &Agglomerative::default()] {
        let start = Instant::now();
        let bvh = builder.build_mesh(&mesh)?;
        let cost = sah(&bvh, &SahConstants::THESIS_IV);
        println!("{:14} SAH {cost:.2}, {:.0?}", builder.name(), start.elapsed());
    }
    Ok(())
}
