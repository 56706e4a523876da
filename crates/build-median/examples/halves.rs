//! Builds a spiral staircase by object median and by spatial median and compares the trees.

use niwaki_build_median::{ObjectMedian, SpatialMedian};
use niwaki_core::glam::{Quat, Vec3};
use niwaki_core::{Builder, SahConstants, TriangleMesh};
use niwaki_metrics::{TreeStats, sah};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let steps: u32 = 2000;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..steps {
        // Steps get narrower towards the top, so that number and space disagree on the middle.
        let height = 10.0 * (1.0 - 0.998_f32.powf(i as f32));
        let turn = Quat::from_rotation_y(i as f32 * 0.05);
        positions.extend([
            Vec3::Y * height,
            turn * Vec3::X + Vec3::Y * height,
            turn * Vec3::new(1.0, 0.0, 0.1) + Vec3::Y * height,
        ]);
        indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let mesh = TriangleMesh::new(positions, indices)?;
    let builders: [&dyn Builder; 2] = [&ObjectMedian::default(), &SpatialMedian::default()];
    for builder in builders {
        let bvh = builder.build_mesh(&mesh)?;
        println!(
            "{:<16}{:>6} nodes, depth {:>3}, SAH {:.2}",
            builder.name(),
            bvh.nodes.len(),
            TreeStats::of(&bvh).depth_max,
            sah(&bvh, &SahConstants::THESIS_IV),
        );
    }
    Ok(())
}
