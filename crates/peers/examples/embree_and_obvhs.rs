//! Builds one procedural scene with every peer, and prints build times, SAH cost and ray rates.
//!
//! ```text
//! ci/setup-embree.sh
//! cargo run --release -p niwaki-peers --example embree_and_obvhs
//! ```

use niwaki_core::{Intersector, Ray, SahConstants, Triangle, TriangleMesh, glam::Vec3};
use niwaki_metrics::sah;
use niwaki_peers::{
    Embree, EmbreeScene, ObvhsKernel, ObvhsPreset, ObvhsScene, PeerBuild, PeerError, Quality,
};
use std::time::{Duration, Instant};

/// A tessellated sphere with bumps: 2·n² triangles.
fn blob(n: u32) -> Result<TriangleMesh, niwaki_core::MeshError> {
    let vertex = |i: u32, j: u32| {
        let (a, b) = (i as f32 / n as f32, j as f32 / n as f32);
        let (theta, phi) = (a * std::f32::consts::PI, b * std::f32::consts::TAU);
        let radius = 1.0 + 0.1 * (9.0 * theta).sin() * (7.0 * phi).cos();
        radius * Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let triangles: Vec<Triangle> = (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] =
                [vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)];
            [Triangle::new(a, b, c), Triangle::new(c, b, d)]
        })
        .collect();
    TriangleMesh::from_triangles(&triangles)
}

fn tree(name: &str, built: &PeerBuild) {
    let cost = sah(&built.bvh, &SahConstants::THESIS_V);
    let references = built.bvh.prim_ids.len();
    println!("{name:26} {:>9.1?} build   SAH {cost:5.1}   {references} references", built.build);
}

fn kernel(name: &str, build: Duration, scene: &impl Intersector, rays: &[Ray]) {
    let start = Instant::now();
    let hits = rays.iter().filter(|ray| scene.closest_hit(ray).is_hit()).count();
    let rate = rays.len() as f64 / start.elapsed().as_secs_f64() / 1e6;
    println!("{name:26} {build:>9.1?} build   {rate:5.2} million rays a second   {hits} hits");
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = blob(200)?;
    let rays: Vec<Ray> = (0..300_000_u32)
        .map(|i| {
            // Directions on a golden spiral, from a point inside.
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 300_000.0;
            let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Ray::new(Vec3::new(0.1, 0.2, -0.3), Vec3::new(r * cos, r * sin, z))
        })
        .collect();
    match Embree::load() {
        Ok(embree) => {
            println!("Embree {} from {}", embree.version(), embree.library());
            for quality in Quality::ALL {
                let name = format!("embree {}", quality.name());
                tree(&name, &embree.build_bvh(quality, &mesh)?);
                let scene = EmbreeScene::new(&embree, &mesh, quality, false)?;
                kernel(&name, scene.commit_time(), &scene, &rays);
            }
        }
        Err(error @ PeerError::NotFound { .. }) => println!("{error}"),
        Err(error) => return Err(error.into()),
    }
    for preset in ObvhsPreset::ALL {
        let name = format!("obvhs {}", preset.name());
        tree(&name, &preset.build(&mesh)?);
        let scene = ObvhsScene::new(&mesh, preset, ObvhsKernel::CwBvh)?;
        kernel(&name, scene.build_time(), &scene, &rays);
    }
    Ok(())
}
