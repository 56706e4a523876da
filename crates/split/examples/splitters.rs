//! What each splitter adds, and what it does for a sweep tree, on small triangles with a few large
//! ones among them.

use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, SahConstants, Triangle, TriangleMesh, glam::Vec3};
use niwaki_metrics::sah;
use niwaki_split::{EarlySplit, EdgeVolume, KarrasAila, PreSplit, SplitPartition};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut state = 1_u32;
    let mut point = |size: f32| {
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        Vec3::new(random(), random(), random()) * size
    };
    let triangles: Vec<Triangle> = (0..50_000)
        .map(|i| {
            let (place, size) = if i % 100 == 0 { (0.5, 0.5) } else { (1.0, 0.02) };
            let at = point(place);
            Triangle { v0: at + point(size), v1: at + point(size), v2: at + point(size) }
        })
        .collect();
    let mesh = TriangleMesh::from_triangles(&triangles)?;

    let sweep = Sweep::default();
    let builders: [Box<dyn Builder>; 5] = [
        Box::new(sweep),
        Box::new(PreSplit::new(sweep, SplitPartition::default())),
        Box::new(PreSplit::new(sweep, EarlySplit::default())),
        Box::new(PreSplit::new(sweep, EdgeVolume::default())),
        Box::new(PreSplit::new(sweep, KarrasAila::default())),
    ];
    for builder in builders {
        let bvh = builder.build_mesh(&mesh)?;
        let references = bvh.prim_ids.len() as f64 / mesh.len() as f64;
        let cost = sah(&bvh, &SahConstants::THESIS_V);
        println!("{}: {references:.3} references a triangle, SAH {cost:.2}", builder.name());
    }
    Ok(())
}
