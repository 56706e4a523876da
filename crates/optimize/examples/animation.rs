//! A sheet that is rolled up, frame by frame: a tree that is only refitted, one that is refitted
//! with rotations, and one that is built anew.
//!
//! `cargo run --release -p niwaki-optimize --example animation`

use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, Bvh, SahConstants, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::sheet;
use niwaki_metrics::sah;
use niwaki_optimize::{RefitRotations, refit};

/// The sheet, rolled up along x by `turns`.
fn frame(turns: f32) -> TriangleMesh {
    sheet(200, |x, y| {
        let along = x as f32 / 200.0;
        let angle = along * turns * std::f32::consts::TAU;
        let radius = 1.0 + 0.2 * along;
        let flat = Vec3::new(along * 6.0, 0.0, y as f32 * 0.02);
        let rolled = Vec3::new(radius * angle.sin(), 1.0 - radius * angle.cos(), flat.z);
        flat.lerp(rolled, turns.min(1.0))
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let cost = |bvh: &Bvh| sah(bvh, &SahConstants::default());
    let mut plain = Sweep::default().build_mesh(&frame(0.0))?;
    let mut rotated = plain.clone();
    println!("turns  refit  with rotations  built anew");
    for step in 1..=16 {
        let turns = step as f32 * 0.25;
        let mesh = frame(turns);
        refit(&mut plain, &mesh)?;
        RefitRotations::default().refit(&mut rotated, &mesh)?;
        let anew = Sweep::default().build_mesh(&mesh)?;
        println!("{turns:5.2} {:6.2} {:15.2} {:11.2}", cost(&plain), cost(&rotated), cost(&anew));
    }
    Ok(())
}
