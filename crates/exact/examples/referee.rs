//! Lets the oracle judge a plain `f32` kernel on rays aimed at the corners and edges of a fan of
//! triangles, where `f32` has to guess.
//!
//! `cargo run --release -p niwaki-exact --example referee`

use niwaki_core::{Hit, Ray, Triangle, TriangleMesh, float::round_down, glam::Vec3};
use niwaki_exact::{Verdict, closest_in_mesh, settle};
use std::collections::BTreeMap;

/// Möller and Trumbore 1997, by the book.
fn moller_trumbore(ray: &Ray, triangle: &Triangle) -> Option<f32> {
    let (e1, e2) = (triangle.v1 - triangle.v0, triangle.v2 - triangle.v0);
    let p = ray.direction.cross(e2);
    let det = e1.dot(p);
    let s = ray.origin - triangle.v0;
    let q = s.cross(e1);
    let (u, v, t) = (s.dot(p) / det, ray.direction.dot(q) / det, e2.dot(q) / det);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= ray.t_min && t <= ray.t_max).then_some(t)
}

fn main() -> Result<(), niwaki_core::MeshError> {
    // A cone of 97 triangles around its tip.
    let rim = |i: u16| {
        let (sin, cos) = (f32::from(i) / 97.0 * std::f32::consts::TAU).sin_cos();
        Vec3::new(cos, sin, 0.3 * cos)
    };
    let mut positions = vec![Vec3::new(0.1, 0.2, 1.0)];
    positions.extend((0..97).map(rim));
    let mesh =
        TriangleMesh::new(positions, (0..97).map(|i| [0, 1 + i, 1 + (i + 1) % 97]).collect())?;

    let mut verdicts: BTreeMap<Verdict, u32> = BTreeMap::new();
    for i in 0..20_000_u32 {
        // At a point of an edge from the tip, from below.
        let corner = mesh.positions()[1 + i as usize % 97];
        let target = mesh.positions()[0].lerp(corner, (i % 211) as f32 / 220.0);
        let origin = Vec3::new((i % 13) as f32 * 0.03, (i % 7) as f32 * 0.05, -2.0);
        let ray = Ray::new(origin, target - origin);
        let exact = closest_in_mesh(&ray, &mesh).map_or(Hit::MISS, |hit| Hit {
            t: round_down(hit.t),
            u: 0.0,
            v: 0.0,
            prim_id: hit.ties[0].0,
        });
        let mut kernel = Hit::MISS;
        for (id, triangle) in (0..).zip(mesh.triangles()) {
            if let Some(t) = moller_trumbore(&ray, &triangle)
                && t < kernel.t
            {
                kernel = Hit { t, u: 0.0, v: 0.0, prim_id: id };
            }
        }
        *verdicts.entry(settle(&ray, &mesh, &exact, &kernel)).or_default() += 1;
    }
    for (verdict, count) in verdicts {
        println!("{verdict:<10} {count:>6}");
    }
    Ok(())
}
