//! Renders a scene to PNG and EXR.
//!
//! ```text
//! cargo run --release -p niwaki-render --example render -- [SCENE] [OUTPUT] [SAMPLES] [WIDTH] [FRAME]
//! ```
//!
//! `SCENE` is a file, or the name of a generator, perhaps with a number of triangles as in
//! `chess:100000`; `FRAME` (from 0, 30 a second) moves the camera along the scene's path, and what
//! moves in the scene with it. By default: a small garden of spheres made here,
//! written to `out/render.png`.

use niwaki_build_binned::Binned;
use niwaki_core::{
    Builder, TriangleMesh,
    glam::{Vec2, Vec3},
};
use niwaki_render::{PathSettings, PathTracer, ToneCurve};
use niwaki_scene::{Camera, Environment, LoadOptions, Material, Scene, generate};
use niwaki_trace::AutoScene;
use std::{error::Error, path::PathBuf, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let name = args.next();
    let output = PathBuf::from(args.next().unwrap_or_else(|| "out/render.png".into()));
    let samples = args.next().map_or(Ok(16), |s| s.parse())?;
    let width: u32 = args.next().map_or(Ok(320), |s| s.parse())?;
    let frame: Option<u32> = args.next().map(|s| s.parse()).transpose()?;
    let mut scene = match name.as_deref() {
        None => spheres()?,
        Some(name) => {
            let (plain, triangles) = name.split_once(':').unwrap_or((name, "300000"));
            match triangles.parse().ok().and_then(|n| generate::generate(plain, n, 1)) {
                Some(scene) => scene,
                None => niwaki_scene::load(name.as_ref(), &LoadOptions::default())?,
            }
        }
    };
    if let Some(frame) = frame {
        let camera = scene.camera_path().frame(frame);
        scene = scene.frozen(f64::from(frame) / 30.0)?;
        scene.cameras[0] = camera;
    }
    println!("{}: {} triangles, {} lights", scene.name, scene.mesh.len(), scene.lights.len());
    println!("{:?}\n{:?}\n{}", scene.cameras[0], scene.environment, scene.dropped);
    let bvh = Binned::default().build(&scene.mesh.prim_refs())?;
    let tracer = AutoScene::new(&bvh, &scene.mesh)?;
    let settings =
        PathSettings { width, height: width * 9 / 16, samples, ..PathSettings::default() };
    let start = Instant::now();
    let (image, stats) = PathTracer::new(settings).render_with(&scene, &tracer, |done, all| {
        if done % 64 == 0 {
            eprint!("\r{done} of {all} tiles");
        }
    });
    let seconds = start.elapsed().as_secs_f64();
    let rays = stats.closest_hit_rays + stats.shadow_rays;
    println!("\n{stats:?}\n{:.2} million rays/s", rays as f64 / seconds * 1e-6);
    if let Some(folder) = output.parent() {
        std::fs::create_dir_all(folder)?;
    }
    image.save_png(&output, &ToneCurve::automatic())?;
    image.save_exr(output.with_extension("exr"))?;
    println!("{}", output.display());
    Ok(())
}

/// Nine spheres of different materials on a floor, lit by a sky and one lamp.
fn spheres() -> Result<Scene, Box<dyn Error>> {
    let mut materials = vec![
        Material::matte("floor", Vec3::splat(0.5)),
        Material::emitter("lamp", Vec3::new(12.0, 10.0, 8.0)),
    ];
    let (mut positions, mut normals, mut indices, mut ids) = (vec![], vec![], vec![], vec![]);
    let mut quad = |corner: Vec3, a: Vec3, b: Vec3, id: u32| {
        let first = niwaki_core::to_u32(positions.len());
        positions.extend([corner, corner + a, corner + a + b, corner + b]);
        normals.extend([a.cross(b).normalize(); 4]);
        indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        ids.extend([id, id]);
    };
    quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, 0);
    quad(Vec3::new(-1.0, 5.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, 1);
    let n = 64;
    for k in 0..9 {
        let (row, column) = (k / 3, k % 3);
        let t = column as f32 / 2.0;
        materials.push(match row {
            0 => Material::metal("metal", Vec3::new(1.0, 0.78, 0.34), 0.5 * t),
            1 => Material { roughness: 0.4 * t, ..Material::glass("glass", 1.5) },
            _ => Material { roughness: t, ..Material::matte("plastic", Vec3::new(0.1, 0.3, 0.6)) },
        });
        let id = niwaki_core::to_u32(materials.len() - 1);
        let center = Vec3::new(column as f32 * 2.2 - 2.2, 1.0, row as f32 * 2.2 - 2.2);
        let first = niwaki_core::to_u32(positions.len());
        for i in 0..=n {
            for j in 0..=2 * n {
                let theta = std::f32::consts::PI * i as f32 / n as f32;
                let phi = std::f32::consts::PI * j as f32 / n as f32;
                let normal =
                    Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                positions.push(center + normal);
                normals.push(normal);
                if i < n && j < 2 * n {
                    let a = first + i * (2 * n + 1) + j;
                    let b = a + 2 * n + 1;
                    indices.extend([[a, b + 1, b], [a, a + 1, b + 1]]);
                    ids.extend([id, id]);
                }
            }
        }
    }
    Ok(Scene {
        name: "spheres".into(),
        uvs: vec![Vec2::ZERO; positions.len()],
        mesh: TriangleMesh::new(positions, indices)?,
        normals,
        material_ids: ids,
        materials,
        cameras: vec![Camera::look_at(Vec3::new(-5.0, 5.0, 8.0), Vec3::Y * 0.6, Vec3::Y, 0.65)],
        environment: Environment::DAYLIGHT,
        ..Scene::default()
    })
}
