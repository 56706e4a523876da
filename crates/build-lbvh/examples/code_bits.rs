//! What the length of Morton codes means for a scene with a small, detailed object in a big one.

use niwaki_build_lbvh::Lbvh;
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, TriangleMesh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A wavy sheet a thousandth as wide as the scene, its triangles in no useful order.
    let side: u32 = 200;
    let mut positions = Vec::new();
    let mut indices = vec![];
    for i in 0..side * side {
        let (x, z) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
        positions.push(Vec3::new(x, 0.1 * (9.0 * x).sin() * (7.0 * z).cos(), z));
        let i = i * 7919 % (side * side);
        if i % side + 1 < side && i / side + 1 < side {
            indices.extend([[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]);
        }
    }
    // Two far corners of the floor: codes are cells of the bounds of all centroids.
    for corner in [-500.0, 500.0] {
        let first = u32::try_from(positions.len())?;
        positions.extend([Vec3::X, Vec3::Z, Vec3::NEG_X].map(|v| v + corner));
        indices.push([first, first + 1, first + 2]);
    }
    let mesh = TriangleMesh::new(positions, indices)?;
    for code_bits in [30, 63] {
        let bvh = Lbvh { code_bits, ..Lbvh::default() }.build_mesh(&mesh)?;
        // The SAH of the whole hardly sees the sheet; rays that reach it do. So: boxes that such
        // a ray meets, in areas of the sheet.
        let inside = bvh.nodes.iter().map(|n| n.aabb().area()).filter(|&area| area < 3.0);
        println!(
            "{code_bits} bits: {:.1} boxes a ray through the sheet",
            inside.sum::<f64>() / 2.5
        );
    }
    Ok(())
}
