//! The device, small scenes, and exact shadows.
#![allow(dead_code, reason = "every test file uses a part of it")]

use niwaki_build_binned::Binned;
use niwaki_core::{TriangleMesh, glam::Vec3};
use niwaki_raster::{
    Algorithm, Exact, ExactShadows, FrameError, Gpu, Judged, Renderer, Settings, ShadowError,
    SpotLight,
};
use niwaki_scene::{Camera, Scene};
use std::sync::{Arc, OnceLock};

/// The device; `None` where there is none, unless `NIWAKI_REQUIRE_VULKAN` asks for one.
pub(crate) fn gpu() -> Option<Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| match Gpu::new() {
        Ok(gpu) => Some(gpu),
        Err(error @ FrameError::NoAdapter(_)) => {
            let required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    })
    .clone()
}

pub(crate) const SIZE: [u32; 2] = [160, 90];

/// Radius of silhouette pixels, in pixels.
pub(crate) const RADIUS: f64 = 0.25;

pub(crate) fn settings(algorithm: Algorithm) -> Settings {
    Settings::new(algorithm, SIZE[0], SIZE[1])
}

/// A scene without shading normals.
pub(crate) fn scene(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Arc<Scene> {
    let material_ids = vec![0; indices.len()];
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    Arc::new(Scene { mesh, material_ids, ..Scene::default() })
}

/// How far the shadows of all lights are from exact ones, and what rays say of the last.
pub(crate) fn error(
    renderer: &mut Renderer,
    camera: &Camera,
    size: [u32; 2],
) -> (ShadowError, Vec<Judged>) {
    let exact = ExactShadows::new(&Binned::default(), &renderer.scene().mesh).unwrap();
    let mut sum = ShadowError::default();
    let mut last = Vec::new();
    for light in 0..renderer.lights().len() {
        let (shares, _) = renderer.shares(camera, size[0], size[1], light).unwrap();
        last = exact.judge(camera, &shares, &renderer.lights()[light], RADIUS);
        sum = sum.plus(ShadowError::of(&shares, &last));
    }
    (sum, last)
}

/// The same for a scene and its lights by shadow volumes, and how many pixels are in shadow and
/// how many are not, by the last light.
pub(crate) fn volumes(
    scene: &Arc<Scene>,
    lights: &[SpotLight],
    camera: &Camera,
) -> Option<(ShadowError, [usize; 2])> {
    let gpu = gpu()?;
    let settings = settings(Algorithm::ShadowVolumes);
    let mut renderer = Renderer::new(&gpu, Arc::clone(scene), lights.to_vec(), settings).unwrap();
    let (error, judged) = error(&mut renderer, camera, SIZE);
    let count = |exact| judged.iter().filter(|j| j.exact == exact).count();
    let shadowed = count(Exact::Shadowed) + count(Exact::Averted);
    Some((error, [shadowed, count(Exact::Lit)]))
}

/// A square of two triangles that winds around `up`, of side 2 `half`, seen from above.
pub(crate) fn square(
    positions: &mut Vec<Vec3>,
    indices: &mut Vec<[u32; 3]>,
    middle: Vec3,
    [u, v]: [Vec3; 2],
) {
    let i = u32::try_from(positions.len()).unwrap();
    positions.extend([middle - u - v, middle + u - v, middle + u + v, middle - u + v]);
    indices.extend([[i, i + 1, i + 2], [i, i + 2, i + 3]]);
}

/// A ground of 12 by 12 in the plane y = 0.
pub(crate) fn ground() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    square(&mut positions, &mut indices, Vec3::ZERO, [Vec3::Z * 6.0, Vec3::X * 6.0]);
    (positions, indices)
}
