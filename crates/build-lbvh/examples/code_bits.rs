//! What the length of Morton codes means for a scene with a small, detailed object in a big one.

use niwaki_build_lbvh::Lbvh;
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, SahConstants, TriangleMesh};
use niwaki_metrics::sah;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A wavy sheet a thousandth as wide as the floor below it.
    let side: u32 = 200;
    let mut positions = Vec::new();
    let mut indices = vec![];
    for i in 0..side * side {
        let (x, z) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
        positions.push(Vec3::new(x, 0.1 * (9.0 * x).sin() * (7.0 * z).cos(), z));
        if i % side + 1 < side && i / side + 1 < side {
            indices.extend([[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]);
        }
    }
    positions.extend([Vec3::new(-500.0, -1.0, -500.0), Vec3::new(500.0, -1.0, -500.0)]);
    positions.push(Vec3::new(0.0, -1.0, 500.0));
    indices.push([side * side, side * side + 1, side * side + 2]);
    let mesh = TriangleMesh::new(positions, indices)?;
    for code_bits in [30, 63] {
        let bvh = Lbvh { code_bits, ..Lbvh::default() }.build_mesh(&mesh)?;
        println!("{code_bits} bits: SAH {:.4}", sah(&bvh, &SahConstants::THESIS_IV));
    }
    Ok(())
}
