//! Draws what a scene's first camera sees, shaded by a lamp at the camera.
//!
//! ```text
//! cargo run --release -p niwaki-scene --example preview -- atrium out.png 100000
//! cargo run --release -p niwaki-scene --example preview -- path/to/scene.glb out.png
//! ```

#![expect(
    clippy::cast_possible_truncation,
    reason = "pixels are small numbers, and converting floats saturates"
)]

use niwaki_core::glam::{Vec2, Vec3};
use niwaki_scene::{LoadOptions, Scene, generate, load};
use std::{error::Error, path::Path, time::Instant};

const WIDTH: usize = 480;
const HEIGHT: usize = 320;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "atrium".into());
    let out = args.next();
    let triangles = args.next().map_or(Ok(100_000), |n| n.parse())?;
    let start = Instant::now();
    let scene = match generate::generate(&name, triangles, 1) {
        Some(scene) => scene,
        None => load(Path::new(&name), &LoadOptions::default())?,
    };
    let bounds = scene.mesh.bounds();
    println!(
        "{}: {} triangles, {} vertices, {} materials, {} textures, {} lights in {:.2?}\n\
         from {:?} to {:?}\ncamera {:?}\n{}",
        scene.name,
        scene.mesh.len(),
        scene.mesh.positions().len(),
        scene.materials.len(),
        scene.textures.len(),
        scene.lights.len(),
        start.elapsed(),
        bounds.min,
        bounds.max,
        scene.cameras[0],
        scene.dropped,
    );
    if let Some(out) = out {
        let pixels = draw(&scene).into_iter().flatten().collect();
        image::RgbImage::from_raw(WIDTH as u32, HEIGHT as u32, pixels)
            .ok_or("the image has another size")?
            .save(out)?;
    }
    Ok(())
}

/// A depth-buffered picture, row by row from the top.
fn draw(scene: &Scene) -> Vec<[u8; 3]> {
    let camera = &scene.cameras[0];
    let (right, forward, up) = (camera.right(), camera.forward, camera.up);
    let focal = HEIGHT as f32 * 0.5 / (camera.vertical_fov * 0.5).tan();
    let near = scene.mesh.bounds().extent().length() * 1e-4;
    let sky = |row: usize| {
        let y = (HEIGHT as f32 * 0.5 - row as f32) / focal;
        to_srgb(scene.environment.radiance(forward + up * y) * 0.5)
    };
    let mut image: Vec<[u8; 3]> = (0..WIDTH * HEIGHT).map(|i| sky(i / WIDTH)).collect();
    let mut depth = vec![0.0_f32; WIDTH * HEIGHT];
    for (i, triangle) in scene.mesh.triangles().enumerate() {
        let local = triangle.vertices().map(|v| {
            let d = v - camera.position;
            Vec3::new(d.dot(right), d.dot(up), d.dot(forward))
        });
        // Cut off what is behind the camera.
        let mut polygon = Vec::with_capacity(4);
        for k in 0..3 {
            let (a, b) = (local[k], local[(k + 1) % 3]);
            if a.z >= near {
                polygon.push(a);
            }
            if (a.z >= near) != (b.z >= near) {
                polygon.push(a.lerp(b, (near - a.z) / (b.z - a.z)));
            }
        }
        if polygon.len() < 3 {
            continue;
        }
        let normal = (local[1] - local[0]).cross(local[2] - local[0]).normalize_or_zero();
        let middle = (local[0] + local[1] + local[2]).normalize_or_zero();
        let material = scene.material(i);
        let shade = 0.15 + 0.6 * normal.dot(middle).abs();
        let color = to_srgb(material.base_color * shade + material.emission);
        let screen: Vec<(Vec2, f32)> = polygon
            .iter()
            .map(|p| {
                let x = WIDTH as f32 * 0.5 + p.x / p.z * focal;
                (Vec2::new(x, HEIGHT as f32 * 0.5 - p.y / p.z * focal), 1.0 / p.z)
            })
            .collect();
        for k in 1..screen.len() - 1 {
            fill([screen[0], screen[k], screen[k + 1]], color, &mut image, &mut depth);
        }
    }
    image
}

fn fill(t: [(Vec2, f32); 3], color: [u8; 3], image: &mut [[u8; 3]], depth: &mut [f32]) {
    let [(a, za), (b, zb), (c, zc)] = t;
    let area = (b - a).perp_dot(c - a);
    let low = a.min(b).min(c).max(Vec2::ZERO);
    let high = a.max(b).max(c).min(Vec2::new(WIDTH as f32 - 1.0, HEIGHT as f32 - 1.0));
    if area == 0.0 || !(low.cmple(high).all()) {
        return;
    }
    for y in low.y as usize..=high.y as usize {
        for x in low.x as usize..=high.x as usize {
            let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let u = (p - a).perp_dot(c - a) / area;
            let v = (b - a).perp_dot(p - a) / area;
            let w = 1.0 - u - v;
            let z = w * za + u * zb + v * zc;
            if u.min(v).min(w) >= -1e-4 && z > depth[y * WIDTH + x] {
                depth[y * WIDTH + x] = z;
                image[y * WIDTH + x] = color;
            }
        }
    }
}

fn to_srgb(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0) as u8)
}
