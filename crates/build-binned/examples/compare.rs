//! Build time and SAH cost of the binned builder beside the median and linear builders, on
//! clustered random triangles: `cargo run --release --example compare -- [triangles] [threads]`.
//! Times are medians of alternating runs, without making references from the mesh.

use niwaki_build_binned::Binned;
use niwaki_build_lbvh::{Algorithm, Lbvh};
use niwaki_build_median::{ObjectMedian, SpatialMedian};
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, Builder, PrimRef, SahConstants, to_u32};
use niwaki_metrics::sah;
use std::time::Instant;

const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut numbers = std::env::args().skip(1).map(|a| a.parse::<usize>());
    let triangles = numbers.next().transpose()?.unwrap_or(100_000);
    let threads = numbers.next().transpose()?.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let prims = scene(triangles);

    let lbvh = |algorithm, code_bits| Lbvh { algorithm, code_bits, ..Lbvh::default() };
    let builders: [(&str, &dyn Builder); 9] = [
        ("binned", &Binned::default()),
        ("object median", &ObjectMedian::default()),
        ("spatial median", &SpatialMedian::default()),
        ("Lauterbach 30", &lbvh(Algorithm::Lauterbach, 30)),
        ("Lauterbach 63", &lbvh(Algorithm::Lauterbach, 63)),
        ("Karras 30", &lbvh(Algorithm::Karras, 30)),
        ("Karras 63", &lbvh(Algorithm::Karras, 63)),
        ("Apetrei 30", &lbvh(Algorithm::Apetrei, 30)),
        ("Apetrei 63", &lbvh(Algorithm::Apetrei, 63)),
    ];
    let mut times = vec![Vec::new(); builders.len()];
    let mut costs = vec![0.0; builders.len()];
    for _ in 0..ROUNDS {
        for (i, (_, builder)) in builders.iter().enumerate() {
            let start = Instant::now();
            let bvh = pool.install(|| builder.build(&prims))?;
            times[i].push(start.elapsed().as_secs_f64() * 1e9 / triangles as f64);
            costs[i] = sah(&bvh, &SahConstants::THESIS_IV);
        }
    }
    println!("{triangles} triangles, {} threads", pool.current_num_threads());
    println!("{:<16}{:>12}{:>10}{:>16}", "builder", "ns/triangle", "SAH", "SAH / binned");
    for (i, (name, _)) in builders.iter().enumerate() {
        times[i].sort_by(f64::total_cmp);
        let (time, cost) = (times[i][ROUNDS / 2], costs[i]);
        println!("{name:<16}{time:>12.1}{cost:>10.2}{:>16.3}", cost / costs[0]);
    }
    Ok(())
}

/// Boxes of triangles of many sizes in clusters.
fn scene(count: usize) -> Vec<PrimRef> {
    let mut state = 1_u64;
    let mut unit = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut point = || Vec3::new(unit(), unit(), unit()) - 0.5;
    let size = (count as f32).cbrt().recip();
    let mut cluster = Vec3::ZERO;
    (0..count)
        .map(|i| {
            if i % 64 == 0 {
                cluster = point() * 8.0;
            }
            let center = cluster + point();
            let spread = size * (0.4 + 20.0 * point().x.powi(4).abs());
            let corners = [(); 3].map(|()| center + point() * spread);
            PrimRef::new(Aabb::from_points(corners), to_u32(i))
        })
        .collect()
}
