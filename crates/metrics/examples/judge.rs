//! Judges an object-median tree over a bumpy sheet and says how long each metric takes.
//!
//! `cargo run --release -p niwaki-metrics --example judge -- 1000000`

use niwaki_core::{Ray, SahConstants, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::{median_tree, sheet};
use niwaki_metrics::{TreeStats, epo, epo_sampled, leaf_counts, sah, validate};
use std::time::Instant;

/// A sheet of `cells`² squares over the unit square, with waves.
fn waves(cells: u32) -> TriangleMesh {
    sheet(cells, |i, j| {
        let (x, y) = (i as f32 / cells as f32, j as f32 / cells as f32);
        Vec3::new(x, y, 0.1 * (20.0 * x).sin() * (17.0 * y).cos())
    })
}

fn timed<T: std::fmt::Debug>(what: &str, f: impl FnOnce() -> T) {
    let start = Instant::now();
    let value = f();
    println!("{what:<22} {:>8.1} ms  {value:?}", start.elapsed().as_secs_f64() * 1e3);
}

fn main() {
    let triangles: u32 = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(20_000);
    let mesh = waves((triangles / 2).isqrt().clamp(1, 4000));
    let bvh = median_tree(&mesh, 2);
    let constants = SahConstants::THESIS_IV;
    let stats = TreeStats::of(&bvh);
    println!("{} triangles, {} nodes, depth {}", mesh.len(), stats.nodes, stats.depth_max);
    let rays: Vec<Ray> = (0..10_000_u16)
        .map(|i| {
            let f = f32::from(i) / 10_000.0;
            Ray::new(Vec3::new(f, 0.5, 1.0), Vec3::new(0.5 - f, 0.3 * f, -1.0))
        })
        .collect();
    timed("sah", || sah(&bvh, &constants));
    timed("epo", || epo(&bvh, &mesh, &constants));
    timed("epo, 10,000 samples", || epo_sampled(&bvh, &mesh, &constants, 10_000, 1));
    timed("leaves of 10,000 rays", || leaf_counts(&bvh, &mesh, &rays));
    timed("validate", || validate(&bvh, &mesh));
}
