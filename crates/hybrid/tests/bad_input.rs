//! Bad input gives a named error or a sensible image, never a hang or a silent black one.

mod common;

use common::{Parts, eye, gpu, open, parlour_scene, small, sun};
use niwaki_core::glam::Vec3;
use niwaki_hybrid::{Gpu, HybridError, HybridRenderer, NearRegion, Settings};
use niwaki_scene::{Camera, Environment, Material, Scene};
use std::sync::Arc;

fn renderer(gpu: &Gpu, scene: Scene) -> HybridRenderer {
    HybridRenderer::new(gpu, Arc::new(scene), small(Settings::default())).unwrap()
}

#[test]
fn cameras_that_are_not_finite_are_named() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer(&gpu, parlour_scene());
    let good = eye();
    for bad in [
        Camera { position: Vec3::NAN, ..good },
        Camera { forward: Vec3::splat(f32::INFINITY), ..good },
        Camera { up: Vec3::ZERO, ..good },
        Camera { up: good.forward, ..good },
        Camera { vertical_fov: f32::NAN, ..good },
        Camera { vertical_fov: 0.0, ..good },
        Camera { vertical_fov: 4.0, ..good },
    ] {
        let error = renderer.render(&bad, 32, 18, 0.0).unwrap_err();
        assert!(matches!(error, HybridError::BadCamera(_)), "{error}");
    }
    // The renderer is none the worse for it.
    let frame = renderer.render(&good, 32, 18, f64::NAN).unwrap();
    assert!(frame.image.mean().min_element() > 0.01);
}

#[test]
fn empty_scenes_show_the_sky() {
    let Some(gpu) = gpu() else { return };
    let camera = eye();
    let scene = Scene { cameras: vec![camera], ..Scene::default() };
    let frame = renderer(&gpu, scene.clone()).render(&camera, 32, 18, 0.0).unwrap();
    let view = niwaki_render::View::new(&camera, 32, 18);
    for (x, y) in [(0, 0), (31, 17), (16, 9)] {
        let d = view.ray(x, y, niwaki_core::glam::Vec2::splat(0.5)).direction;
        let expected = scene.environment.radiance(d);
        assert!((frame.image.get(x, y) - expected).abs().max_element() < 1e-4);
    }
    assert_eq!(frame.report.counters, niwaki_hybrid::Counters::default());
}

#[test]
fn images_without_pixels_and_beyond_the_device_are_answered() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer(&gpu, parlour_scene());
    for (width, height) in [(0, 0), (0, 10), (10, 0)] {
        let frame = renderer.render(&eye(), width, height, 0.0).unwrap();
        assert!(frame.image.pixels().is_empty() && frame.report.stages.is_empty());
    }
    for (width, height) in [(16_384, 16_384), (1 << 20, 1), (u32::MAX, u32::MAX)] {
        match renderer.render(&eye(), width, height, 0.0) {
            Err(error @ HybridError::TooLarge { .. }) => {
                assert!(error.to_string().contains("smaller image"), "{error}");
            }
            // A device may have the room; this one has taken it.
            other => assert!(other.is_ok(), "{other:?}"),
        }
    }
    let settings = Settings { face_resolution: 1 << 20, ..small(Settings::default()) };
    renderer.set_settings(settings);
    let error = renderer.render(&eye(), 32, 18, 0.0).unwrap_err();
    assert!(matches!(error, HybridError::TooLarge { .. }), "{error}");
    renderer.set_settings(small(Settings::default()));
    assert!(renderer.render(&eye(), 1, 1, 0.0).unwrap().image.pixels()[0].is_finite());
    // 16384 pixels wide is within what devices draw.
    let wide = renderer.render(&eye(), 16_384, 1, 0.0).unwrap();
    assert_eq!(wide.image.width(), 16_384);
}

#[test]
fn cameras_within_objects_and_settings_out_of_range_give_finite_images() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer(&gpu, parlour_scene());
    // Within the gold sphere, within the glass one, on the floor.
    for p in [[-1.3, 1.0, -1.0], [1.2, 0.8, 0.0], [0.0, 0.0, 0.0]] {
        let camera = Camera::look_at(Vec3::from(p), Vec3::new(0.3, 0.5, -3.0), Vec3::Y, 1.0);
        let frame = renderer.render(&camera, 32, 18, 0.0).unwrap();
        assert!(frame.image.pixels().iter().all(|p| p.is_finite()), "{p:?}");
    }
    for settings in [
        Settings { near_region: NearRegion::HalfSize(f32::NAN), ..Settings::default() },
        Settings { near_region: NearRegion::HalfSize(-3.0), ..Settings::default() },
        Settings { near_region: NearRegion::ShareOfScene(f32::INFINITY), ..Settings::default() },
        Settings { max_depth: 1000, throughput_cutoff: f32::NAN, ..Settings::default() },
        Settings { thickness: f32::INFINITY, overlap: f32::NAN, ..Settings::default() },
    ] {
        renderer.set_settings(Settings { face_resolution: 0, ..small(settings) });
        let frame = renderer.render(&eye(), 32, 18, 0.0).unwrap();
        assert!(frame.image.pixels().iter().all(|p| p.is_finite()));
        assert!(frame.image.mean().min_element() > 0.01);
    }
}

#[test]
fn meshes_without_normals_and_coordinates_are_shaded_flat() {
    let Some(gpu) = gpu() else { return };
    let camera = eye();
    let red = Material { base_color_texture: Some(7), ..Material::matte("r", Vec3::X) };
    let mut scene = Parts::default()
        .sphere(Vec3::new(0.0, 1.0, 0.0), 1.0, &red)
        .sphere(Vec3::new(1.5, 1.0, 1.0), 0.6, &Material::metal("m", Vec3::ONE, 0.0))
        .build(camera, vec![sun()], Environment::DAYLIGHT);
    scene.normals.clear();
    scene.uvs.clear();
    let frame = renderer(&gpu, scene.clone()).render(&camera, 64, 36, 0.0).unwrap();
    let pixel = frame.image.get(30, 20);
    assert!(pixel.x > 0.05 && pixel.x > 1.5 * pixel.y, "{pixel}");
    scene.normals = vec![Vec3::NAN; scene.mesh.positions().len()];
    let again = renderer(&gpu, scene).render(&camera, 64, 36, 0.0).unwrap();
    assert_eq!(again.image, frame.image);
}

#[test]
fn a_device_that_is_given_up_is_reported_as_lost() {
    let Some(gpu) = open() else { return };
    let mut renderer = renderer(&gpu, Scene::default());
    renderer.render(&eye(), 16, 9, 0.0).unwrap();
    gpu.destroy();
    let error = renderer.render(&eye(), 16, 9, 0.0).unwrap_err();
    assert!(matches!(error, HybridError::DeviceLost(_)), "{error}");
    assert!(HybridRenderer::new(&gpu, Arc::new(parlour_scene()), Settings::default()).is_err());
}
