//! Small scenes and a brute-force tracer for the tests.
#![allow(dead_code, reason = "each test file uses its own part")]

use niwaki_build_binned::Binned;
use niwaki_core::{
    Builder, Triangle, TriangleMesh,
    glam::{Vec2, Vec3},
};
use niwaki_render::{Image, PathSettings, PathTracer, RenderStats};

use niwaki_scene::{AlphaMode, Camera, Environment, Material, Scene};
use niwaki_trace::{BruteForce, Mode, WideScene};
use proptest::prelude::*;

/// Answers rays by testing every triangle.
pub(crate) fn brute(mesh: &TriangleMesh) -> BruteForce<'_> {
    BruteForce::new(Mode::Watertight, mesh)
}

/// Answers rays through a tree, for tests that trace many.
pub(crate) fn tree(mesh: &TriangleMesh) -> WideScene {
    let bvh = Binned::default().build(&mesh.prim_refs()).unwrap();
    WideScene::new(&bvh, mesh).unwrap()
}

/// Geometry with one material a part.
#[derive(Default)]
pub(crate) struct Parts {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<[u32; 3]>,
    material_ids: Vec<u32>,
    materials: Vec<Material>,
}

impl Parts {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    fn vertex(&mut self, p: Vec3, n: Vec3, uv: Vec2) -> u32 {
        self.positions.push(p);
        self.normals.push(n);
        self.uvs.push(uv);
        u32::try_from(self.positions.len() - 1).unwrap()
    }

    fn material(&mut self, material: &Material) -> u32 {
        self.materials.push(material.clone());
        u32::try_from(self.materials.len() - 1).unwrap()
    }

    /// A parallelogram from a corner along two edges; the front is where a × b shows.
    pub(crate) fn quad(mut self, corner: Vec3, a: Vec3, b: Vec3, material: &Material) -> Self {
        let id = self.material(material);
        let n = a.cross(b).normalize();
        let v = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(s, t)| self.vertex(corner + a * s + b * t, n, Vec2::new(s, t)));
        self.indices.extend([[v[0], v[1], v[2]], [v[0], v[2], v[3]]]);
        self.material_ids.extend([id, id]);
        self
    }

    /// A closed box with its front outside.
    pub(crate) fn cuboid(self, min: Vec3, max: Vec3, material: &Material) -> Self {
        let e = max - min;
        let (x, y, z) = (Vec3::X * e.x, Vec3::Y * e.y, Vec3::Z * e.z);
        self.quad(min, y, x, material)
            .quad(min, z, y, material)
            .quad(min, x, z, material)
            .quad(max, -x, -y, material)
            .quad(max, -y, -z, material)
            .quad(max, -z, -x, material)
    }

    /// A sphere of 2·n² triangles; `smooth` gives it the normals of the true sphere.
    pub(crate) fn sphere(
        mut self,
        center: Vec3,
        radius: f32,
        n: u32,
        smooth: bool,
        material: &Material,
    ) -> Self {
        let id = self.material(material);
        let at = |i: u32, j: u32| {
            let theta = std::f32::consts::PI * i as f32 / n as f32;
            let phi = std::f32::consts::TAU * (j % (2 * n)) as f32 / (2 * n) as f32;
            // Poles meet exactly, so that the surface is closed.
            let ring = if i == 0 || i == n { 0.0 } else { theta.sin() };
            Vec3::new(ring * phi.cos(), theta.cos(), ring * phi.sin())
        };
        for i in 0..n {
            for j in 0..2 * n {
                let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                for [a, b, c] in [[0, 2, 1], [0, 3, 2]].map(|t| t.map(|k: usize| corners[k])) {
                    let flat = (b - a).cross(c - a);
                    if flat.length() < 1e-9 {
                        continue;
                    }
                    let flat = flat.normalize();
                    let triangle = [a, b, c].map(|p| {
                        let normal = if smooth { p } else { flat };
                        self.vertex(center + p * radius, normal, Vec2::ZERO)
                    });
                    self.indices.push(triangle);
                    self.material_ids.push(id);
                }
            }
        }
        self
    }

    /// The scene, seen by `camera`, in this environment.
    pub(crate) fn scene(self, camera: Camera, environment: Environment) -> Scene {
        Scene {
            name: "test".into(),
            mesh: TriangleMesh::new(self.positions, self.indices).unwrap(),
            normals: self.normals,
            uvs: self.uvs,
            material_ids: self.material_ids,
            materials: self.materials,
            cameras: vec![camera],
            environment,
            ..Scene::default()
        }
    }
}

/// A diffuse surface without coat.
pub(crate) fn lambert(albedo: f32) -> Material {
    Material { ior: 1.0, ..Material::matte("lambert", Vec3::splat(albedo)) }
}

/// A camera that sees a cone of this half angle around the direction to `target`.
pub(crate) fn camera(position: Vec3, target: Vec3, fov: f32) -> Camera {
    let up = if (target - position).normalize().y.abs() > 0.9 { Vec3::Z } else { Vec3::Y };
    let mut camera = Camera::look_at(position, target, up, 1.0);
    camera.vertical_fov = fov;
    camera
}

/// Renders by brute force and asserts that no path was dropped.
pub(crate) fn render(scene: &Scene, settings: &PathSettings) -> (Image, RenderStats) {
    let tracer = PathTracer::new(settings.clone());
    let (image, stats) = tracer.render_with(scene, &brute(&scene.mesh), |_, _| {});
    assert_eq!(stats.dropped_paths, 0, "a path was not finite");
    (image, stats)
}

/// Settings for a small square image.
pub(crate) fn settings(size: u32, samples: u32, max_depth: u32) -> PathSettings {
    PathSettings { width: size, height: size, samples, max_depth, ..PathSettings::default() }
}

/// Mean over pixels and channels, and its standard error from the spread of the pixels' own means.
pub(crate) fn mean_and_error(image: &Image) -> (f64, f64) {
    let n = image.pixels().len() as f64;
    let values: Vec<f64> =
        image.pixels().iter().map(|p| f64::from(p.element_sum()) / 3.0).collect();
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// One triangle as a mesh.
pub(crate) fn single(triangle: Triangle) -> TriangleMesh {
    TriangleMesh::from_triangles(&[triangle]).unwrap()
}

/// Materials of every kind, extremes included.
pub(crate) fn any_material() -> impl Strategy<Value = Material> {
    let color = || prop::array::uniform3(0.0_f32..=1.0).prop_map(Vec3::from);
    let unit = || prop_oneof![Just(0.0_f32), Just(1.0), 0.0_f32..=1.0];
    let alpha_mode = prop_oneof![
        Just(AlphaMode::Opaque),
        unit().prop_map(AlphaMode::Mask),
        Just(AlphaMode::Blend)
    ];
    (color(), unit(), unit(), unit(), 1.0_f32..2.5, color(), alpha_mode, unit()).prop_map(
        |(base_color, metallic, roughness, transmission, ior, absorption, alpha_mode, alpha)| {
            Material {
                base_color,
                metallic,
                roughness,
                transmission,
                ior,
                absorption,
                alpha_mode,
                alpha,
                ..Material::default()
            }
        },
    )
}
