//! Ambient occlusion against form factors.

mod common;

use common::{Parts, brute, camera, lambert, mean_and_error};
use niwaki_core::glam::Vec3;
use niwaki_render::{AmbientOcclusion, Image, OcclusionSettings};
use niwaki_scene::{AlphaMode, Environment, Material, Scene};

fn render(scene: &Scene, size: u32, radius: f32) -> Image {
    let settings = OcclusionSettings {
        width: size,
        height: size,
        radius,
        ..OcclusionSettings::for_scene(scene)
    };
    AmbientOcclusion::new(settings).render(scene, &brute(&scene.mesh))
}

/// A floor with a wall on its edge x = 0, seen at x = 1.
fn corner(wall: &Material) -> Scene {
    Parts::new()
        .quad(Vec3::new(0.0, 0.0, -500.0), Vec3::Z * 1000.0, Vec3::X * 500.0, &lambert(0.5))
        .quad(Vec3::new(0.0, 0.0, -500.0), Vec3::Y, Vec3::Z * 1000.0, wall)
        .scene(camera(Vec3::new(2.0, 3.0, 0.0), Vec3::X, 1e-4), Environment::DARK)
}

#[test]
fn a_long_wall_hides_its_form_factor() {
    // A long strip perpendicular to the surface, of height h at distance d on one side, hides
    // (1 − cos φ) / 2 with tan φ = h / d (Howell, factor B-71): here φ = 45°.
    let hidden = 0.5 * (1.0 - std::f64::consts::FRAC_1_SQRT_2);
    let (mean, error) = mean_and_error(&render(&corner(&lambert(0.5)), 24, f32::INFINITY));
    assert!(error < 2e-3 && (mean - (1.0 - hidden)).abs() < 4.0 * error, "{mean} ± {error}");
    let veil = Material { alpha_mode: AlphaMode::Blend, alpha: 0.5, ..lambert(0.5) };
    let (mean, error) = mean_and_error(&render(&corner(&veil), 24, f32::INFINITY));
    assert!((mean - (1.0 - 0.5 * hidden)).abs() < 4.0 * error, "{mean} ± {error}");
}

#[test]
fn the_radius_ends_what_counts() {
    let scene = corner(&lambert(0.5));
    for radius in [0.99, 0.0, -1.0, f32::NAN] {
        assert_eq!(mean_and_error(&render(&scene, 4, radius)).0, 1.0, "{radius}");
    }
    let (near, far) = (render(&scene, 16, 1.2), render(&scene, 16, 5.0));
    assert!(near.mean().x < 1.0 && far.mean().x < near.mean().x);
}

#[test]
fn inside_a_closed_box_nothing_is_open_and_outside_everything_is() {
    let inside = Parts::new()
        .cuboid(Vec3::splat(-1.0), Vec3::ONE, &lambert(0.5))
        .scene(camera(Vec3::new(0.1, 0.23, -0.07), Vec3::X, 1.2), Environment::DARK);
    assert_eq!(render(&inside, 8, f32::INFINITY), Image::black(8, 8));
    let outside = Scene { cameras: vec![camera(Vec3::splat(4.0), Vec3::ZERO, 0.9)], ..inside };
    assert_eq!(mean_and_error(&render(&outside, 8, f32::INFINITY)).0, 1.0);
}
