//! Traces a rippled surface with every kernel and prints what it looks like.

use niwaki_core::{Intersector, Ray, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::{median_tree, sheet};
use niwaki_trace::{AutoScene, Kernel, Mode};
use std::time::Instant;

/// A grid of `n`² quads over the unit square, lifted by a ripple.
fn ripple(n: u32) -> TriangleMesh {
    sheet(n, |i, j| {
        let (x, y) = (i as f32 / n as f32, j as f32 / n as f32);
        Vec3::new(x, y, 0.1 * (20.0 * (x - 0.5).hypot(y - 0.5)).sin())
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = ripple(200);
    let bvh = median_tree(&mesh, 2); // The builder crates do better.
    let (width, height) = (72_u16, 28_u16);
    for kernel in Kernel::available() {
        let scene = AutoScene::for_kernel(kernel, Mode::default(), &bvh, &mesh)?;
        let start = Instant::now();
        let mut picture = String::new();
        for y in 0..height {
            for x in 0..width {
                let (u, v) = (f32::from(x) / f32::from(width), f32::from(y) / f32::from(height));
                let ray =
                    Ray::new(Vec3::new(0.5, -0.8, 0.9), Vec3::new(u - 0.5, 1.0, -0.35 - 0.8 * v));
                let hit = scene.closest_hit(&ray);
                let shade = if hit.is_hit() {
                    let t = mesh.triangle(hit.prim_id as usize);
                    let n = (t.v1 - t.v0).cross(t.v2 - t.v0).normalize();
                    match n.dot(Vec3::new(0.6, 0.3, 0.74)).abs() {
                        d if d > 0.9 => '@',
                        d if d > 0.6 => 'o',
                        d if d > 0.3 => ':',
                        _ => '.',
                    }
                } else {
                    ' '
                };
                picture.push(shade);
            }
            picture.push('\n');
        }
        let time = start.elapsed();
        println!("{picture}{kernel}: {} rays in {time:.1?}", u32::from(width) * u32::from(height));
    }
    Ok(())
}
