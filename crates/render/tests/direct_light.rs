//! Direct light against closed formulas, and light sampling against its absence.

mod common;

use common::{Parts, camera, lambert, mean_and_error, render, settings};
use niwaki_core::glam::{Vec2, Vec3};
use niwaki_render::PathSettings;
use niwaki_scene::{AlphaMode, Camera, Environment, Light, LightKind, Material, Scene, Texture};
use std::f32::consts::PI;

/// A camera that looks from the side at a spot so small that radiance is constant over it.
fn at_origin() -> Camera {
    camera(Vec3::new(3.0, 4.0, 0.5), Vec3::ZERO, 1e-4)
}

fn floor(material: &Material) -> Parts {
    Parts::new().quad(Vec3::new(-50.0, 0.0, -50.0), Vec3::Z * 100.0, Vec3::X * 100.0, material)
}

fn point_light(position: Vec3, intensity: f32) -> Light {
    Light {
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(intensity),
    }
}

#[test]
fn a_point_light_follows_the_inverse_square_and_the_cosine() {
    for position in [Vec3::Y, Vec3::new(0.0, 2.0, 0.0), Vec3::new(1.5, 0.5, -2.0)] {
        let mut scene = floor(&lambert(0.8)).scene(at_origin(), Environment::DARK);
        scene.lights.push(point_light(position, 10.0));
        let (mean, _) = mean_and_error(&render(&scene, &settings(2, 2, 1)).0);
        let d2 = position.length_squared();
        let expected = f64::from(0.8 / PI * 10.0 * (position.y / d2.sqrt()) / d2);
        assert!((mean / expected - 1.0).abs() < 1e-3, "{position}: {mean} {expected}");
    }
}

#[test]
fn several_lights_add_up() {
    let mut scene = floor(&lambert(0.5)).scene(at_origin(), Environment::DARK);
    let lights = [
        point_light(Vec3::new(0.0, 1.0, 0.0), 1.0),
        point_light(Vec3::new(2.0, 2.0, 0.0), 20.0),
        Light { kind: LightKind::Directional, ..point_light(Vec3::ZERO, 0.5) },
        point_light(Vec3::new(0.0, -1.0, 0.0), 1e3), // behind the floor
    ];
    let single: f64 = lights
        .iter()
        .map(|light| {
            scene.lights = vec![*light];
            mean_and_error(&render(&scene, &settings(2, 1, 1)).0).0
        })
        .sum();
    scene.lights = lights.to_vec();
    let (mean, error) = mean_and_error(&render(&scene, &settings(32, 64, 1)).0);
    assert!(single > 0.5, "{single}");
    assert!((mean - single).abs() < 5.0 * error, "{mean} ± {error} against {single}");
}

#[test]
fn light_that_lies_on_a_surface_still_shines_and_blockers_block() {
    let mut parts = floor(&lambert(0.8));
    parts = parts.quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, &lambert(0.8));
    let mut scene = parts.scene(at_origin(), Environment::DARK);
    scene.lights.push(point_light(Vec3::new(0.1, 2.0, 0.1), 10.0));
    let on_the_ceiling = mean_and_error(&render(&scene, &settings(2, 1, 1)).0).0;
    let expected = f64::from(0.8 / PI * 10.0 / 4.02 * (2.0 / 4.02_f32.sqrt()));
    assert!((on_the_ceiling / expected - 1.0).abs() < 1e-3, "{on_the_ceiling} {expected}");
    scene.lights[0].position.y = 2.001;
    assert_eq!(mean_and_error(&render(&scene, &settings(2, 1, 1)).0).0, 0.0);
}

/// Form factor from a surface element to a parallel rectangle whose corner lies on its normal at
/// unit distance (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3).
fn corner_factor(x: f64, y: f64) -> f64 {
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / (2.0 * std::f64::consts::PI)
}

#[test]
fn a_rectangular_emitter_casts_its_form_factor() {
    let (albedo, radiance, height) = (0.7, 5.0, 1.5);
    let emitter = Material::emitter("light", Vec3::splat(radiance));
    // From x = −0.5 to 1.2 and z = −0.4 to 2.
    let scene = floor(&lambert(albedo))
        .quad(Vec3::new(-0.5, height, -0.4), Vec3::X * 1.7, Vec3::Z * 2.4, &emitter)
        .scene(camera(Vec3::new(6.0, 1.2, 0.5), Vec3::ZERO, 1e-4), Environment::DARK);
    let h = f64::from(height);
    let factor: f64 = [(0.5, 0.4), (0.5, 2.0), (1.2, 0.4), (1.2, 2.0)]
        .iter()
        .map(|(x, z)| corner_factor(x / h, z / h))
        .sum();
    let expected = f64::from(albedo * radiance) * factor;
    let (mean, error) = mean_and_error(&render(&scene, &settings(16, 128, 1)).0);
    assert!(error < 0.01 * expected, "{error}");
    assert!((mean - expected).abs() < 4.0 * error, "{mean} ± {error}, expected {expected}");
}

/// A room with a small and a large light, a sky through the open side, and one object.
fn mixed_scene(object: &Material) -> Scene {
    let wall = lambert(0.6);
    Parts::new()
        .quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, &wall)
        .quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::X * 4.0, Vec3::Y * 3.0, &wall)
        .quad(
            Vec3::new(-0.8, 2.5, -0.8),
            Vec3::X * 1.6,
            Vec3::Z * 1.6,
            &Material::emitter("large", Vec3::new(2.0, 1.5, 1.0)),
        )
        .quad(
            Vec3::new(1.5, 0.5, -0.5),
            Vec3::Y * 0.7,
            Vec3::Z * 0.7,
            &Material::emitter("small", Vec3::new(2.0, 4.0, 6.0)),
        )
        .cuboid(Vec3::new(-0.7, 0.01, -0.7), Vec3::new(0.7, 1.2, 0.7), object)
        .scene(camera(Vec3::new(-1.0, 1.6, 4.0), Vec3::Y * 0.7, 0.6), Environment::DAYLIGHT)
}

#[test]
fn light_sampling_does_not_change_the_expectation() {
    let objects = [
        lambert(0.5),
        Material { roughness: 0.35, ..Material::matte("plastic", Vec3::new(0.6, 0.2, 0.1)) },
        Material { roughness: 0.0, ..Material::matte("glossy", Vec3::splat(0.5)) },
        Material::metal("brushed", Vec3::new(0.9, 0.7, 0.3), 0.4),
        Material { metallic: 0.5, roughness: 0.5, ..Material::matte("half", Vec3::splat(0.7)) },
        Material { roughness: 0.5, ..Material::glass("frosted", 1.5) },
        Material { transmission: 0.5, roughness: 0.4, ..Material::default() },
        Material { alpha_mode: AlphaMode::Blend, alpha: 0.4, ..lambert(0.9) },
    ];
    for object in objects {
        let scene = mixed_scene(&object);
        // Without roulette the depth is what ends paths, in both alike.
        let with = PathSettings { roulette_start: u32::MAX, ..settings(24, 32, 5) };
        let without = PathSettings { light_sampling: false, samples: 96, seed: 9, ..with.clone() };
        let (with, _) = render(&scene, &with);
        let (without, stats) = render(&scene, &without);
        assert_eq!(stats.shadow_rays, 0);
        let both = with.pixels().iter().zip(without.pixels());
        // Pixel by pixel the scene cancels and only noise is left.
        let differences: Vec<f64> =
            both.map(|(a, b)| f64::from((*a - *b).element_sum()) / 3.0).collect();
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let error = (variance / n).sqrt();
        let level = with.mean().x;
        assert!(error < 0.02 * level, "{}: too noisy to tell, {error} of {level}", object.name);
        assert!(mean.abs() < 4.5 * error, "{}: {mean} ± {error} of {level}", object.name);
    }
}

#[test]
fn cut_out_surfaces_pass_light_where_alpha_says_so() {
    // A quad between floor and sun whose texture is opaque for u < 1/2 only.
    let mask = Texture::new("mask", 2, 1, vec![[255; 4], [255, 255, 255, 0]], false).unwrap();
    let build = |alpha_mode, u: f32| {
        let leaf = Material { base_color_texture: Some(0), alpha_mode, ..lambert(0.8) };
        // Move the quad so that the point under the sun ray has the wanted u.
        let corner = Vec3::new(-4.0 * u, 1.0, -2.0);
        let mut scene = floor(&lambert(PI.recip()))
            .quad(corner, Vec3::X * 4.0, Vec3::Z * 4.0, &leaf)
            .scene(camera(Vec3::new(0.0, 0.5, 9.0), Vec3::ZERO, 1e-4), Environment::DARK);
        scene.textures.push(mask.clone());
        scene
            .lights
            .push(Light { kind: LightKind::Directional, ..point_light(Vec3::ZERO, PI * PI) });
        mean_and_error(&render(&scene, &settings(4, 4, 1)).0).0
    };
    assert_eq!(build(AlphaMode::Mask(0.5), 0.25), 0.0);
    assert!((build(AlphaMode::Mask(0.5), 0.75) - 1.0).abs() < 1e-4);
    assert_eq!(build(AlphaMode::Opaque, 0.75), 0.0);
    // Halfway between the pixel centres alpha is 1/2.
    assert!((build(AlphaMode::Blend, 0.5) - 0.5).abs() < 1e-3);
}

#[test]
fn textures_colour_what_they_cover() {
    let pixels = vec![[255, 0, 0, 255], [0, 255, 0, 255]];
    let mut material = lambert(1.0);
    material.base_color_texture = Some(0);
    for (x, expected) in [(-10.0, Vec3::X), (10.0, Vec3::Y)] {
        let mut scene = Parts::new()
            .quad(Vec3::new(-20.0, -20.0, 0.0), Vec3::X * 40.0, Vec3::Y * 40.0, &material)
            .scene(
                camera(Vec3::new(x, 0.0, 5.0), Vec3::new(x, 0.0, 0.0), 1e-3),
                Environment::Constant(Vec3::ONE),
            );
        scene.textures.push(Texture::new("halves", 2, 1, pixels.clone(), true).unwrap());
        assert!((scene.textures[0].sample(Vec2::new(0.25, 0.5)).x - 1.0).abs() < 1e-6);
        let color = render(&scene, &settings(2, 2, 1)).0.get(0, 0);
        assert!((color - expected).abs().max_element() < 1e-4, "{x}: {color}");
    }
}
