//! Renders a scene by Whitted's method, prints which effects it took and why, and shows by FLIP
//! what fewer reflections would change.
//!
//! ```text
//! cargo run --release -p niwaki-render --example whitted_image -- [SCENE] [OUTPUT] [WIDTH] [DEPTH]
//! ```
//!
//! `SCENE` is a file or the name of a generator; by default a chessboard with spheres made here,
//! written to `out/whitted.png`, with ambient occlusion in `out/whitted-ao.png` and the error of a
//! single reflection in `out/whitted-flip.png`.

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, TriangleMesh, glam::Vec3, to_u32};
use niwaki_render::{
    AmbientOcclusion, OcclusionSettings, ToneCurve, Whitted, WhittedSettings,
    metrics::{FlipSettings, flip, psnr, ssim},
};
use niwaki_scene::{
    Camera, Environment, Light, LightKind, LoadOptions, Material, Scene, SceneFacts, generate,
};
use niwaki_trace::WideScene;
use std::{error::Error, f32::consts::PI, path::PathBuf, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let name = args.next();
    let output = PathBuf::from(args.next().unwrap_or_else(|| "out/whitted.png".into()));
    let width: u32 = args.next().map_or(Ok(320), |s| s.parse())?;
    let max_depth: u32 = args.next().map_or(Ok(8), |s| s.parse())?;
    let scene = match name.as_deref() {
        None => spheres()?,
        Some(name) => match generate::generate(name, 300_000, 1) {
            Some(scene) => scene,
            None => niwaki_scene::load(name.as_ref(), &LoadOptions::default())?,
        },
    };
    let height = width * 9 / 16;
    let settings =
        WhittedSettings { width, height, grid: 2, max_depth, ..WhittedSettings::default() };
    println!("{}: {}\n", scene.name, SceneFacts::new(&scene, settings.mirror_roughness));
    println!("{}\n", Whitted::new(settings.clone()).plan(&scene));
    let bvh = Binned::default().build(&scene.mesh.prim_refs())?;
    let tracer = WideScene::new(&bvh, &scene.mesh)?;
    let start = Instant::now();
    let (image, stats) =
        Whitted::new(settings.clone()).render_with(&scene, &tracer, |done, all| {
            if done % 64 == 0 {
                eprint!("\r{done} of {all} tiles");
            }
        });
    println!("\r{stats:?}\n{:.2} s", start.elapsed().as_secs_f64());

    let tone = ToneCurve::automatic().exposed_as(&image);
    if let Some(folder) = output.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let beside = |what: &str| output.with_file_name(format!("{stem}-{what}.png"));
    image.save_png(&output, &tone)?;

    let shallow = WhittedSettings { max_depth: 1, ..settings };
    let shallow = tone.apply(&Whitted::new(shallow).render(&scene, &tracer));
    let reference = tone.apply(&image);
    let map = flip(&shallow, &reference, &FlipSettings::default())?;
    let (db, structure) = (psnr(&shallow, &reference)?, ssim(&shallow, &reference)?);
    println!("depth 1: FLIP {:.4}, PSNR {db:.1} dB, SSIM {structure:.4}", map.mean());
    map.colorize().save_png(beside("flip"), &ToneCurve::default())?;

    let occlusion = OcclusionSettings { width, height, ..OcclusionSettings::for_scene(&scene) };
    let occlusion = AmbientOcclusion::new(occlusion).render(&scene, &tracer);
    occlusion.save_png(beside("ao"), &ToneCurve::default())?;
    println!("{}", output.display());
    Ok(())
}

/// A checkered floor with spheres of mirror, glass, gold and plastic under a sun and a lamp.
fn spheres() -> Result<Scene, Box<dyn Error>> {
    let mut scene = Scene {
        name: "spheres".into(),
        materials: vec![
            Material::matte("light", Vec3::splat(0.7)),
            Material { roughness: 0.1, ..Material::matte("dark", Vec3::new(0.15, 0.05, 0.05)) },
            Material::metal("mirror", Vec3::splat(0.95), 0.0),
            Material { absorption: Vec3::new(0.8, 0.2, 0.5), ..Material::glass("glass", 1.5) },
            Material::metal("gold", Vec3::new(1.0, 0.78, 0.34), 0.35),
            Material { roughness: 0.05, ..Material::matte("plastic", Vec3::new(0.1, 0.3, 0.6)) },
        ],
        cameras: vec![Camera::look_at(Vec3::new(-3.0, 2.6, 6.0), Vec3::Y * 0.7, Vec3::Y, 0.7)],
        lights: vec![
            Light {
                kind: LightKind::Directional,
                position: Vec3::ZERO,
                direction: Vec3::new(0.5, -1.0, -0.4).normalize(),
                intensity: Vec3::new(2.0, 1.9, 1.7),
            },
            Light {
                kind: LightKind::Point,
                position: Vec3::new(-2.0, 3.0, 3.0),
                direction: Vec3::NEG_Y,
                intensity: Vec3::new(4.0, 5.0, 8.0),
            },
        ],
        environment: Environment::DAYLIGHT,
        ..Scene::default()
    };
    let (mut positions, mut indices) = (vec![], vec![]);
    for z in -8_i32..8 {
        for x in -8_i32..8 {
            let first = to_u32(positions.len());
            let corner = Vec3::new(x as f32, 0.0, z as f32);
            positions.extend([
                corner,
                corner + Vec3::Z,
                corner + Vec3::X + Vec3::Z,
                corner + Vec3::X,
            ]);
            scene.normals.extend([Vec3::Y; 4]);
            indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            scene.material_ids.extend([u32::from((x + z) % 2 != 0); 2]);
        }
    }
    let n = 64;
    let spheres =
        [(-1.3, 0.3, 1.0, 2), (1.1, 0.6, 0.9, 3), (0.1, -1.6, 1.1, 4), (-0.1, 1.7, 0.5, 5)];
    for (x, z, radius, material) in spheres {
        let first = to_u32(positions.len());
        for i in 0..=n {
            for j in 0..=2 * n {
                let (theta, phi) = (PI * i as f32 / n as f32, PI * j as f32 / n as f32);
                let normal =
                    Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                positions.push(Vec3::new(x, radius, z) + normal * radius);
                scene.normals.push(normal);
                if i < n && j < 2 * n {
                    let a = first + i * (2 * n + 1) + j;
                    let b = a + 2 * n + 1;
                    indices.extend([[a, b + 1, b], [a, a + 1, b + 1]]);
                    scene.material_ids.extend([material; 2]);
                }
            }
        }
    }
    scene.mesh = TriangleMesh::new(positions, indices)?;
    Ok(scene)
}
