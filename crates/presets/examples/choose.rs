//! Which preset pays for so many rays, what the cost model expects of it, and the tree it builds.
//!
//! `cargo run --release -p niwaki-presets --example choose [RAYS]`

use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
use niwaki_metrics::sah;
use niwaki_presets::{CostModel, Preset};
use std::time::Instant;

/// A wavy sheet of 2·`side`² triangles and, above it, long thin diagonal struts of two triangles
/// each, whose boxes are mostly empty.
fn sheet_with_struts(side: u32) -> Result<TriangleMesh, niwaki_core::MeshError> {
    let size = side as f32;
    let mut positions: Vec<Vec3> = (0..=side)
        .flat_map(|y| (0..=side).map(move |x| (x as f32, y as f32)))
        .map(|(x, y)| Vec3::new(x, y, 4.0 * (0.1 * x).sin() * (0.13 * y).cos()))
        .collect();
    let row = side + 1;
    let mut indices: Vec<[u32; 3]> = (0..side)
        .flat_map(|y| (0..side).map(move |x| y * row + x))
        .flat_map(|i| [[i, i + 1, i + row], [i + row, i + 1, i + row + 1]])
        .collect();
    for x in (0..side).step_by(8) {
        let first = niwaki_core::to_u32(positions.len());
        let (x, far) = (x as f32, size - x as f32);
        positions.extend([
            Vec3::new(x, 0.0, 5.0),
            Vec3::new(far, size, 9.0),
            Vec3::new(far + 0.2, size, 9.0),
            Vec3::new(x + 0.2, 0.0, 5.0),
        ]);
        indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    TriangleMesh::new(positions, indices)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rays: u64 = match std::env::args().nth(1) {
        Some(text) => text.parse().map_err(|e| format!("`{text}` is no number of rays: {e}"))?,
        None => 1_000_000,
    };
    let mesh = sheet_with_struts(120)?;
    let model = CostModel::measured();
    println!("{} triangles, {rays} rays; by the cost model:", mesh.len());
    println!("{:10} {:>10} {:>10} {:>12}", "preset", "build ms", "ray ns", "total ms");
    for preset in Preset::ALL {
        println!(
            "{preset:10} {:10.2} {:10.1} {:12.2}",
            model.build_ms(preset, mesh.len()),
            model.ray_ns(preset, mesh.len()),
            model.total_ms(preset, rays, mesh.len()),
        );
    }
    let preset = Preset::for_rays(rays, mesh.len());
    let start = Instant::now();
    let bvh = preset.build_mesh(&mesh)?;
    println!(
        "chosen: {preset}; its binary tree took {:.2} ms here, SAH cost {:.2}, {} references",
        start.elapsed().as_secs_f64() * 1e3,
        sah(&bvh, &niwaki_core::SahConstants::default()),
        bvh.prim_ids.len(),
    );
    Ok(())
}
