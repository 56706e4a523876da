//! Small scenes, the device, and the reference.
#![allow(dead_code, reason = "every test file uses a part of it")]

use niwaki_build_binned::Binned;
use niwaki_core::{
    Builder, TriangleMesh,
    glam::{Vec2, Vec3},
};
use niwaki_hybrid::{Frame, Gpu, HybridError, HybridRenderer, Settings};
use niwaki_render::{Image, ToneCurve, Whitted, WhittedSettings, metrics};
use niwaki_scene::{Camera, Environment, Light, LightKind, Material, Scene};
use niwaki_trace::WideScene;
use std::sync::{Arc, OnceLock};

/// The device; `None` where there is none, unless `NIWAKI_REQUIRE_VULKAN` asks for one.
/// One for all tests of a file, as kernels are compiled once a device.
pub(crate) fn gpu() -> Option<Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    GPU.get_or_init(open).clone()
}

/// A device of its own.
pub(crate) fn open() -> Option<Gpu> {
    match Gpu::new() {
        Ok(gpu) => Some(gpu),
        Err(error @ HybridError::NoAdapter(_)) => {
            let required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A scene put together from parts; every part is an object.
#[derive(Default)]
pub(crate) struct Parts {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<[u32; 3]>,
    ids: Vec<u32>,
    materials: Vec<Material>,
    objects: Vec<niwaki_scene::Object>,
}

impl Parts {
    fn vertex(&mut self, p: Vec3, n: Vec3, uv: Vec2) -> u32 {
        self.positions.push(p);
        self.normals.push(n);
        self.uvs.push(uv);
        u32::try_from(self.positions.len() - 1).unwrap()
    }

    fn close(mut self, vertices: usize, triangles: usize, material: &Material) -> Self {
        let id = u32::try_from(self.materials.len()).unwrap();
        self.materials.push(material.clone());
        self.ids.resize(self.indices.len(), id);
        let n = |x: usize| u32::try_from(x).unwrap();
        let bounds = niwaki_core::Aabb::from_points(self.positions[vertices..].iter().copied());
        self.objects.push(niwaki_scene::Object {
            name: material.name.clone(),
            triangles: n(triangles)..n(self.indices.len()),
            vertices: n(vertices)..n(self.positions.len()),
            bounds,
            dynamic: false,
        });
        self
    }

    pub(crate) fn quad(mut self, at: Vec3, a: Vec3, b: Vec3, material: &Material) -> Self {
        let (v, t) = (self.positions.len(), self.indices.len());
        let n = a.cross(b).normalize();
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let [c0, c1, c2, c3] =
            corners.map(|(x, y)| self.vertex(at + a * x + b * y, n, Vec2::new(x, y)));
        self.indices.extend([[c0, c1, c2], [c0, c2, c3]]);
        self.close(v, t, material)
    }

    pub(crate) fn sphere(mut self, center: Vec3, radius: f32, material: &Material) -> Self {
        let (v, t) = (self.positions.len(), self.indices.len());
        const N: u32 = 16;
        for i in 0..=N {
            for j in 0..=2 * N {
                let theta = std::f32::consts::PI * i as f32 / N as f32;
                let phi = std::f32::consts::PI * j as f32 / N as f32;
                let ring = theta.sin();
                let n = Vec3::new(ring * phi.cos(), theta.cos(), ring * phi.sin()).normalize();
                self.vertex(center + n * radius, n, Vec2::new(i as f32, j as f32) / N as f32);
            }
        }
        let first = u32::try_from(v).unwrap();
        let at = |i, j| first + i * (2 * N + 1) + j;
        for i in 0..N {
            for j in 0..2 * N {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                self.indices.extend([[a, c, b], [a, d, c]]);
            }
        }
        self.close(v, t, material)
    }

    pub(crate) fn build(self, camera: Camera, lights: Vec<Light>, sky: Environment) -> Scene {
        let mut scene = Scene {
            name: "parts".into(),
            mesh: TriangleMesh::new(self.positions, self.indices).unwrap(),
            normals: self.normals,
            uvs: self.uvs,
            material_ids: self.ids,
            materials: self.materials,
            objects: self.objects,
            cameras: vec![camera],
            lights,
            environment: sky,
            ..Scene::default()
        };
        scene.derive_thickness();
        scene
    }
}

pub(crate) fn sun() -> Light {
    Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.4, -0.8, -0.3).normalize(),
        intensity: Vec3::splat(2.5),
    }
}

pub(crate) fn lamp(position: Vec3) -> Light {
    Light {
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Y,
        intensity: Vec3::new(14.0, 12.0, 9.0),
    }
}

/// A floor with things on it, near and far: matte, metal, glass and a mirror on the wall.
pub(crate) fn parlour() -> Parts {
    let floor = Material { roughness: 0.9, ..Material::matte("floor", Vec3::new(0.5, 0.45, 0.4)) };
    let wall = Material::matte("wall", Vec3::new(0.3, 0.5, 0.6));
    let red = Material::matte("red", Vec3::new(0.8, 0.15, 0.1));
    let glass = Material { absorption: Vec3::new(0.6, 0.1, 0.3), ..Material::glass("glass", 1.5) };
    let gold = Material::metal("gold", Vec3::new(1.0, 0.78, 0.34), 0.0);
    let brass = Material::metal("brass", Vec3::new(0.9, 0.7, 0.35), 0.4);
    let mirror = Material::metal("mirror", Vec3::splat(0.9), 0.0);
    let glow = Material::emitter("glow", Vec3::new(1.5, 0.6, 0.2));
    Parts::default()
        .quad(Vec3::new(-8.0, 0.0, 8.0), Vec3::X * 16.0, Vec3::Z * -16.0, &floor)
        .quad(Vec3::new(-8.0, 0.0, -8.0), Vec3::X * 16.0, Vec3::Y * 5.0, &wall)
        .sphere(Vec3::new(-1.3, 1.0, -1.0), 1.0, &gold)
        .sphere(Vec3::new(1.2, 0.8, 0.0), 0.8, &glass)
        .sphere(Vec3::new(0.3, 0.5, -3.0), 0.5, &red)
        .sphere(Vec3::new(-4.0, 0.7, -5.0), 0.7, &brass)
        .sphere(Vec3::new(3.5, 0.4, 2.5), 0.4, &glow)
        .sphere(Vec3::new(4.0, 1.0, -5.5), 1.0, &red)
        .quad(Vec3::new(-2.0, 0.5, -7.5), Vec3::X * 4.0, Vec3::Y * 3.0, &mirror)
}

pub(crate) fn eye() -> Camera {
    Camera::look_at(Vec3::new(0.4, 1.8, 5.0), Vec3::new(0.0, 0.9, -1.0), Vec3::Y, 0.9)
}

pub(crate) fn parlour_scene() -> Scene {
    parlour().build(eye(), vec![sun(), lamp(Vec3::new(2.0, 3.5, 1.0))], Environment::DAYLIGHT)
}

/// Small maps, which software drivers draw in reasonable time.
pub(crate) fn small(settings: Settings) -> Settings {
    Settings { face_resolution: 256, shadow_resolution: 512, ..settings }
}

pub(crate) const SIZE: [u32; 2] = [160, 90];

pub(crate) fn render(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Frame {
    let mut renderer = HybridRenderer::new(gpu, Arc::new(scene.clone()), settings.clone()).unwrap();
    renderer.render(&scene.cameras[0], SIZE[0], SIZE[1], 0.0).unwrap()
}

pub(crate) fn whitted(scene: &Scene, settings: &Settings) -> Image {
    let tree = Binned::default().build_mesh(&scene.mesh).unwrap();
    let whitted = WhittedSettings {
        width: SIZE[0],
        height: SIZE[1],
        max_depth: settings.max_depth,
        cutoff: settings.throughput_cutoff,
        occlusion_rays: settings.occlusion_rays,
        occlusion_radius: settings.occlusion_radius * scene.mesh.bounds().extent().length(),
        ..WhittedSettings::default()
    };
    Whitted::new(whitted).render(scene, &WideScene::new(&tree, &scene.mesh).unwrap())
}

/// Mean FLIP of two images as they would be shown.
pub(crate) fn flip(image: &Image, reference: &Image) -> f64 {
    metrics::flip(image, reference, &metrics::FlipSettings::default()).unwrap().mean()
}

/// Keeps an image for people to look at if `NIWAKI_IMAGES` names a folder.
pub(crate) fn show(name: &str, image: &Image) {
    if let Some(folder) = std::env::var_os("NIWAKI_IMAGES") {
        let path = std::path::Path::new(&folder).join(format!("{name}.png"));
        image.save_png(path, &ToneCurve::default()).unwrap();
    }
}
