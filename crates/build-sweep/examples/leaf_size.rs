//! What the SAH constants do to a sweep tree: cheaper traversal means more and smaller leaves.

use niwaki_build_sweep::Sweep;
use niwaki_core::{Aabb, Builder, PrimRef, SahConstants, glam::Vec3};

fn main() -> Result<(), niwaki_core::BuildError> {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let prims: Vec<PrimRef> = (0..50_000)
        .map(|id| {
            let min = Vec3::new(random(), random(), random());
            PrimRef::new(Aabb::new(min, min + Vec3::splat(0.02 * random())), id)
        })
        .collect();
    for inner in [0.5, 1.0, 1.2, 2.0, 4.0] {
        let constants = SahConstants { inner, ..SahConstants::default() };
        let bvh = Sweep { constants, ..Sweep::default() }.build(&prims)?;
        let leaves = bvh.nodes.iter().filter(|node| node.is_leaf()).count();
        let mean = prims.len() as f64 / leaves as f64;
        println!("C_I = {inner}: {leaves} leaves of {mean:.2} primitives");
    }
    Ok(())
}
