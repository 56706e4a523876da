//! What the search radius of PLOC costs and gives, on a few thousand bent rods.

use niwaki_build_ploc::Ploc;
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, SahConstants, TriangleMesh};
use niwaki_metrics::sah;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Rods of 60 triangles in directions that no axis likes, at seeded places.
    let mut seed = 1_u32;
    let mut random = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for _ in 0..4000 {
        let mut at = Vec3::new(random(), random(), random()) * 20.0;
        let mut along = Vec3::new(random(), random(), random()).normalize() * 0.1;
        let across = Vec3::new(random(), random(), random()) * 0.02;
        for segment in 0..=30 {
            let first = u32::try_from(positions.len())?;
            positions.extend([at - across, at + across]);
            if segment < 30 {
                indices.extend([[first, first + 1, first + 2], [first + 2, first + 1, first + 3]]);
            }
            at += along;
            along += Vec3::new(random(), random(), random()) * 0.02;
        }
    }
    let mesh = TriangleMesh::new(positions, indices)?;
    for radius in [1, 2, 4, 8, 14, 24, 32, 64] {
        let start = Instant::now();
        let bvh = Ploc { radius, ..Ploc::default() }.build_mesh(&mesh)?;
        let cost = sah(&bvh, &SahConstants::THESIS_IV);
        println!("radius {radius:2}: SAH {cost:.2}, {:.0?}", start.elapsed());
    }
    Ok(())
}
