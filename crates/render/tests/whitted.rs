//! The Whitted integrator against closed formulas and against the path tracer.

mod common;

use common::{Parts, any_material, brute, camera, lambert, settings, tree};
use niwaki_core::glam::{Vec2, Vec3};
use niwaki_render::{
    AmbientLight, Image, PathSettings, PathTracer, Planning, RenderStats, View, Whitted,
    WhittedSettings,
    fresnel::{conductor, dielectric},
    shading::{Ambient, mean_fresnel},
};
use niwaki_scene::{AlphaMode, Environment, Light, LightKind, Material, Scene, Texture};
use proptest::prelude::*;
use std::f32::consts::PI;

/// A square image, no ambient light, nothing cut off.
fn exact(size: u32, max_depth: u32) -> WhittedSettings {
    WhittedSettings {
        width: size,
        height: size,
        max_depth,
        cutoff: 0.0,
        ambient: AmbientLight::NONE,
        ..WhittedSettings::default()
    }
}

fn render(scene: &Scene, settings: &WhittedSettings) -> (Image, RenderStats) {
    let tracer = Whitted::new(settings.clone());
    let (image, stats) = tracer.render_with(scene, &tree(&scene.mesh), |_, _| {});
    assert_eq!((stats.dropped_paths, stats.cut_rays), (0, 0));
    (image, stats)
}

/// The one colour of a scene seen through a camera that sees a point.
fn color(scene: &Scene, max_depth: u32) -> Vec3 {
    render(scene, &exact(1, max_depth)).0.get(0, 0)
}

fn lamp(kind: LightKind, position: Vec3, intensity: Vec3) -> Light {
    Light { kind, position, direction: Vec3::NEG_Y, intensity }
}

fn near(a: Vec3, b: Vec3, tolerance: f32) -> bool {
    (a - b).abs().max_element() <= tolerance * b.abs().max_element().max(1e-3)
}

/// A sheet in the plane z = `z` that faces +z.
fn sheet(parts: Parts, z: f32, material: &Material) -> Parts {
    parts.quad(Vec3::new(-50.0, -50.0, z), Vec3::X * 100.0, Vec3::Y * 100.0, material)
}

#[test]
fn a_mirror_sphere_shows_the_sky_that_its_normals_point_to() {
    let gold = Vec3::new(1.0, 0.78, 0.34);
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 12, false, &Material::metal("gold", gold, 0.0))
        .scene(camera(Vec3::new(0.3, 0.4, 4.0), Vec3::ZERO, 0.4), Environment::DAYLIGHT);
    let size = 24;
    let (image, stats) = render(&scene, &exact(size, 3));
    let view = View::new(&scene.cameras[0], size, size);
    let mut hits = 0;
    for y in 0..size {
        for x in 0..size {
            let ray = view.ray(x, y, Vec2::splat(0.5));
            let hit = niwaki_trace::brute_force(&scene.mesh, &ray);
            let d = ray.direction;
            let expected = if hit.is_hit() {
                let [a, b, c] = scene.mesh.triangle(hit.prim_id as usize).vertices();
                let n = (b - a).cross(c - a).normalize();
                hits += 1;
                let mirrored = d - 2.0 * d.dot(n) * n;
                conductor(-d.dot(n), gold) * Environment::DAYLIGHT.radiance(mirrored)
            } else {
                Environment::DAYLIGHT.radiance(d)
            };
            assert!(near(image.get(x, y), expected, 1e-4), "{x} {y}: {expected}");
        }
    }
    assert!(hits > 300);
    // A convex mirror reflects once.
    assert_eq!(stats.reflected_rays, hits);
    assert_eq!((stats.refracted_rays, stats.shadow_rays, stats.alpha_tests), (0, 0, 0));
}

#[test]
fn a_slab_of_glass_follows_fresnel_and_beer_at_every_depth() {
    let absorption = Vec3::new(0.3, 1.0, 2.0);
    let (ior, thickness) = (1.5, 0.7);
    let glass = Material { absorption, ..Material::glass("glass", ior) };
    // Seen from straight ahead: R = 0.04 at each face, e^(−σd) at each crossing.
    let before = Vec3::new(2.0, 1.0, 0.5);
    let behind = Vec3::new(1.0, 3.0, 5.0);
    let build = |eye: Vec3| {
        // Small faces, so that little of the way is lost where rays start off them.
        let side = Vec3::new(-5.0, -5.0, 0.0);
        let mut parts = Parts::new().quad(side, Vec3::X * 10.0, Vec3::Y * 10.0, &glass);
        parts =
            parts.quad(Vec3::new(-5.0, -5.0, -thickness), Vec3::Y * 10.0, Vec3::X * 10.0, &glass);
        parts = sheet(parts, -3.0, &Material { base_color: Vec3::ZERO, ..emitter(behind) });
        parts = parts.quad(
            Vec3::new(-50.0, -50.0, 9.0),
            Vec3::Y * 100.0,
            Vec3::X * 100.0,
            &Material { base_color: Vec3::ZERO, ..emitter(before) },
        );
        parts.scene(camera(eye, Vec3::new(0.0, 0.0, 0.0), 1e-4), Environment::DARK)
    };
    for eye in [Vec3::new(0.0, 0.0, 5.0), Vec3::new(6.0, 0.0, 5.0)] {
        let scene = build(eye);
        let cosine = eye.normalize().z;
        let r = dielectric(cosine, ior);
        let inside = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).sqrt();
        let a = (-absorption * thickness / inside).exp();
        // Depth 0 sees nothing, 1 the first reflection, 2 through the slab, 3 one ray back inside,
        // 4 that ray come out in front, and so on.
        let steps = [
            Vec3::ZERO,
            r * before,
            r * before + (1.0 - r) * (1.0 - r) * a * behind,
            r * before
                + (1.0 - r) * (1.0 - r) * a * behind
                + (1.0 - r) * r * (1.0 - r) * a * a * before,
            r * before
                + (1.0 - r) * (1.0 - r) * a * behind
                + (1.0 - r) * r * (1.0 - r) * a * a * before
                + (1.0 - r) * r * r * (1.0 - r) * a * a * a * behind,
        ];
        for (depth, expected) in (0..).zip(steps) {
            let seen = color(&scene, depth);
            assert!(near(seen, expected, 2e-4), "{eye} depth {depth}: {seen} {expected}");
        }
    }
}

fn emitter(radiance: Vec3) -> Material {
    Material { ior: 1.0, ..Material::emitter("light", radiance) }
}

#[test]
fn a_prism_reflects_totally() {
    // A ray along −x enters a right-angled prism straight, meets its hypotenuse at 45°, past the
    // critical angle of 41.8°, and leaves straight along −y: (1 − 0.04)² of what lies there.
    let glass = Material::glass("glass", 1.5);
    let floor = Vec3::new(1.0, 2.0, 3.0);
    let scene = Parts::new()
        .quad(Vec3::new(1.0, 0.0, -5.0), Vec3::Y * 2.0, Vec3::Z * 10.0, &glass) // faces +x
        .quad(Vec3::new(-1.0, 0.0, -5.0), Vec3::X * 2.0, Vec3::Z * 10.0, &glass) // faces −y
        .quad(Vec3::new(-1.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::new(2.0, 2.0, 0.0), &glass)
        .quad(Vec3::new(-9.0, -3.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, &emitter(floor))
        .scene(camera(Vec3::new(6.0, 1.0, 0.0), Vec3::Y, 1e-4), Environment::DARK);
    let (image, stats) = render(&scene, &exact(1, 3));
    let seen = image.get(0, 0);
    assert!(near(seen, 0.96 * 0.96 * floor, 1e-4), "{seen}");
    // At the hypotenuse nothing is refracted: in, and out at the bottom.
    assert_eq!(stats.refracted_rays, 2);
}

#[test]
fn shadows_have_sharp_edges_where_geometry_says() {
    // A square of side 1 at height 1 under a lamp at height 2 casts one of side 2.
    let white = lambert(1.0);
    let mut scene = Parts::new()
        .quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, &white)
        .quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::Z, Vec3::X, &white)
        .scene(camera(Vec3::Y * 0.9, Vec3::ZERO, 1.0), Environment::DARK);
    scene.lights.push(lamp(LightKind::Point, Vec3::Y * 2.0, Vec3::splat(PI)));
    let at = |x: f32| {
        let mut scene = scene.clone();
        scene.cameras[0] = camera(Vec3::new(x, 0.5, 0.0), Vec3::new(x, 0.0, 0.0), 1e-5);
        color(&scene, 0)
    };
    assert_eq!((at(0.0), at(0.9999)), (Vec3::ZERO, Vec3::ZERO));
    // E cos θ / d² with d² = 1 + 4 and cos θ = 2/√5; the albedo over π takes the intensity's π.
    let lit = Vec3::splat(2.0 / 5.0_f32.powf(1.5));
    assert!(near(at(1.0001), lit, 1e-3), "{} {lit}", at(1.0001));
    // A spot light lights its cone only, a directional light knows no distance.
    let spot = LightKind::Spot { inner: 0.3, outer: 0.6 };
    scene.lights = vec![lamp(spot, Vec3::new(3.0, 2.0, 0.0), Vec3::splat(PI))];
    let inside = color(&seen_at(&scene, 3.0), 0);
    assert!(near(inside, Vec3::splat(0.25), 1e-4), "{inside}");
    assert_eq!(color(&seen_at(&scene, 3.0 - 2.0 * 0.61_f32.tan()), 0), Vec3::ZERO);
    scene.lights = vec![lamp(LightKind::Directional, Vec3::ZERO, Vec3::splat(PI))];
    assert!(near(color(&seen_at(&scene, 7.0), 0), Vec3::ONE, 1e-5));
    assert_eq!(color(&seen_at(&scene, 0.49), 0), Vec3::ZERO);
}

#[test]
fn another_camera_shows_what_it_would_as_the_scenes_own() {
    let scene = Parts::new()
        .cuboid(Vec3::splat(-1.0), Vec3::ONE, &Material::default())
        .scene(camera(Vec3::Z * 4.0, Vec3::ZERO, 0.8), Environment::DAYLIGHT);
    let other = camera(Vec3::new(2.0, 3.0, -3.0), Vec3::ZERO, 0.6);
    let moved = Scene { cameras: vec![other], ..scene.clone() };
    let whitted = Whitted::new(exact(8, 2));
    let tracer = tree(&scene.mesh);
    let from = whitted.render_from(&other, &scene, &tracer, |_, _| {});
    assert_eq!(from, whitted.render_with(&moved, &tracer, |_, _| {}));
    assert_ne!(from.0, whitted.render(&scene, &tracer));
    let path = PathTracer::new(settings(8, 2, 2));
    let from = path.render_from(&other, &scene, &tracer, |_, _| {});
    assert_eq!(from, path.render_with(&moved, &tracer, |_, _| {}));
}

fn seen_at(scene: &Scene, x: f32) -> Scene {
    let eye = camera(Vec3::new(x, 0.5, 0.0), Vec3::new(x, 0.0, 0.0), 1e-5);
    Scene { cameras: vec![eye], ..scene.clone() }
}

#[test]
fn depth_limits_and_cutoffs_end_rays_where_they_say() {
    let mirror = Material::metal("mirror", Vec3::splat(0.5), 0.0);
    let scene = sheet(Parts::new(), -1.0, &mirror)
        .quad(Vec3::new(-50.0, -50.0, 1.0), Vec3::Y * 100.0, Vec3::X * 100.0, &mirror)
        .scene(camera(Vec3::ZERO, Vec3::NEG_Z, 1e-3), Environment::Constant(Vec3::ONE));
    for depth in [0, 1, 9, 20_000] {
        let (image, stats) = render(&scene, &exact(1, depth));
        // Halves underflow after 150 reflections, and then count nothing.
        assert_eq!(stats.reflected_rays, u64::from(depth.min(149)));
        assert_eq!(image.get(0, 0), Vec3::ZERO);
    }
    let cut = WhittedSettings { cutoff: 0.1, ..exact(1, 9) };
    assert_eq!(render(&scene, &cut).1.reflected_rays, 3, "1/2, 1/4, 1/8");
    let white = Parts::new()
        .cuboid(Vec3::splat(-1.0), Vec3::ONE, &Material::metal("mirror", Vec3::ONE, 0.0))
        .scene(camera(Vec3::new(0.1, 0.23, -0.07), Vec3::X, 1.2), Environment::Constant(Vec3::ONE));
    let (image, stats) = render(&white, &exact(1, 50_000));
    assert_eq!((stats.reflected_rays, image.get(0, 0)), (50_000, Vec3::ZERO));
}

#[test]
fn glass_between_glass_ends_by_the_ray_budget_and_says_so() {
    let glass = Material::glass("glass", 2.0);
    let mut parts = Parts::new();
    for i in 0..8 {
        let r = 1.0 - 0.1 * i as f32;
        parts = parts.cuboid(Vec3::splat(-r), Vec3::splat(r), &glass);
    }
    let scene = parts
        .scene(camera(Vec3::new(0.2, 0.3, 4.0), Vec3::ZERO, 0.1), Environment::Constant(Vec3::ONE));
    let settings = WhittedSettings { max_rays: 500, ..exact(2, 100_000) };
    let tracer = Whitted::new(settings);
    let (image, stats) = tracer.render_with(&scene, &brute(&scene.mesh), |_, _| {});
    assert!(stats.cut_rays > 0 && stats.closest_hit_rays <= 4 * 500, "{stats:?}");
    assert!(image.pixels().iter().all(|p| p.min_element() > 0.0 && p.max_element() <= 1.001));
}

#[test]
fn direct_light_is_that_of_the_path_tracer() {
    let materials = [
        lambert(0.7),
        Material::metal("rough metal", Vec3::new(0.9, 0.6, 0.3), 0.4),
        Material::metal("matte metal", Vec3::new(0.9, 0.6, 0.3), 1.0),
        Material { metallic: 1.0, ior: 1.0, roughness: 0.5, ..Material::default() },
    ];
    let mut parts = Parts::new();
    for (i, material) in (0..).zip(&materials) {
        parts = parts.sphere(Vec3::X * (i as f32 * 2.2 - 3.3), 1.0, 8, true, material);
    }
    let mut scene = parts
        .quad(Vec3::new(-9.0, -1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, &lambert(0.5))
        .scene(camera(Vec3::new(0.0, 3.0, 9.0), Vec3::ZERO, 0.7), Environment::DARK);
    // One light, so that the path tracer has nothing to choose.
    scene.lights.push(lamp(LightKind::Point, Vec3::new(2.0, 5.0, 4.0), Vec3::splat(60.0)));
    let size = 40;
    let ours = render(&scene, &WhittedSettings { grid: 8, ..exact(size, 0) }).0;
    let reference = PathTracer::new(settings(size, 64, 1)).render(&scene, &tree(&scene.mesh));
    let (mut sum, mut sum_squared) = (0.0_f64, 0.0_f64);
    for (a, b) in ours.pixels().iter().zip(reference.pixels()) {
        let difference = f64::from((*a - *b).element_sum());
        sum += difference;
        sum_squared += difference * difference;
    }
    let n = f64::from(size * size);
    let level = reference.mean().element_sum();
    // Pixels differ by where in them the samples lie, all in all nothing is left.
    assert!((sum / n).abs() < 2e-3 * level, "{} of {level}", sum / n);
    assert!((sum_squared / n).sqrt() < 0.1 * level, "{}", (sum_squared / n).sqrt());
    // The centre of a pixel inside a sphere, exactly.
    for x in [-3.3_f32, -1.1, 1.1, 3.3] {
        let mut scene = scene.clone();
        scene.cameras[0] = camera(Vec3::new(0.0, 3.0, 9.0), Vec3::new(x, 0.5, 0.6), 1e-5);
        let ours = color(&scene, 0);
        let reference = common::render(&scene, &settings(1, 1, 1)).0.get(0, 0);
        assert!(
            reference.max_element() > 0.01 && near(ours, reference, 1e-3),
            "{ours} {reference}"
        );
    }
}

#[test]
fn a_coat_lets_the_base_get_what_is_left() {
    let plastic = Material { roughness: 0.0, ..Material::matte("plastic", Vec3::splat(0.6)) };
    let mut scene = Parts::new()
        .quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, &plastic)
        .scene(camera(Vec3::new(3.0, 4.0, 0.0), Vec3::ZERO, 1e-4), Environment::DARK);
    scene.lights.push(lamp(LightKind::Directional, Vec3::ZERO, Vec3::splat(PI)));
    let cosine = 0.8;
    let r = dielectric(cosine, 1.5);
    let expected = 0.6 * (1.0 - r) * (1.0 - 0.04) / (1.0 - mean_fresnel(1.5));
    let seen = color(&scene, 1);
    assert!(near(seen, Vec3::splat(expected), 1e-4), "{seen} {expected}");
    // The path tracer's table gives the same to its own accuracy.
    let reference = common::render(&scene, &settings(1, 1, 1)).0.get(0, 0);
    assert!(near(seen, reference, 5e-3), "{seen} {reference}");
    // The sky shines back from the coat.
    scene.lights.clear();
    scene.environment = Environment::Constant(Vec3::ONE);
    let seen = color(&scene, 1);
    assert!(near(seen, Vec3::splat(r), 1e-4), "{seen} {r}");
}

#[test]
fn mirrors_and_glass_are_those_of_the_path_tracer() {
    let scene = Parts::new()
        .sphere(Vec3::new(-1.1, 0.0, 0.0), 1.0, 10, true, &Material::glass("glass", 1.5))
        .sphere(
            Vec3::new(1.1, 0.0, 0.0),
            1.0,
            10,
            false,
            &Material::metal("metal", Vec3::new(0.9, 0.8, 0.5), 0.0),
        )
        .scene(camera(Vec3::new(0.0, 1.0, 6.0), Vec3::ZERO, 0.5), Environment::DAYLIGHT);
    let size = 32;
    let ours = render(&scene, &WhittedSettings { grid: 4, ..exact(size, 12) }).0;
    let path = PathSettings { roulette_start: u32::MAX, ..settings(size, 128, 13) };
    let reference = PathTracer::new(path).render(&scene, &tree(&scene.mesh));
    let (ours, reference) = (ours.mean(), reference.mean());
    // Smooth normals on coarse spheres end some of the path tracer's rays.
    assert!((ours - reference).abs().max_element() < 0.01, "{ours} {reference}");
}

#[test]
fn in_a_uniform_surrounding_white_things_cannot_be_seen() {
    // Ambient light and rays together give each lobe all of its light: a furnace without shadows.
    let ambient = AmbientLight::Environment(1.0);
    for material in [
        Material::matte("white", Vec3::ONE),
        Material { roughness: 0.0, ..Material::matte("polished", Vec3::ONE) },
        Material::metal("mirror", Vec3::ONE, 0.1),
        Material::metal("half a mirror", Vec3::ONE, 0.22),
        Material::metal("rough", Vec3::ONE, 0.8),
        Material { metallic: 0.4, roughness: 0.2, ..Material::matte("half a metal", Vec3::ONE) },
        Material { transmission: 0.5, ..Material::matte("half glass", Vec3::ONE) },
        Material {
            alpha: 0.3,
            alpha_mode: AlphaMode::Blend,
            ..Material::matte("faint", Vec3::ONE)
        },
    ] {
        let scene = Parts::new().cuboid(Vec3::splat(-1.0), Vec3::ONE, &material).scene(
            camera(Vec3::new(2.0, 3.0, 4.0), Vec3::ZERO, 0.6),
            Environment::Constant(Vec3::ONE),
        );
        let settings = WhittedSettings { ambient, ..exact(9, 14) };
        let (image, _) = render(&scene, &settings);
        for pixel in image.pixels() {
            assert!(near(*pixel, Vec3::ONE, 1e-3), "{}: {pixel}", material.name);
        }
    }
}

#[test]
fn ambient_light_comes_from_above_and_below() {
    let scene = Parts::new()
        .quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, &lambert(0.5))
        .scene(camera(Vec3::new(3.0, 4.0, 0.0), Vec3::ZERO, 1e-4), Environment::DAYLIGHT);
    let share = AmbientLight::Environment(0.25);
    let settings = WhittedSettings { ambient: share, ..exact(1, 0) };
    let expected = 0.5 * Ambient::of(&Environment::DAYLIGHT, 0.25).up;
    assert!(near(render(&scene, &settings).0.get(0, 0), expected, 1e-5));
    let constant = AmbientLight::Constant(Vec3::new(0.1, 0.2, 0.3));
    let settings = WhittedSettings { ambient: constant, ..settings };
    assert!(near(render(&scene, &settings).0.get(0, 0), Vec3::new(0.05, 0.1, 0.15), 1e-5));
}

#[test]
fn alpha_mixes_and_masks_cut_out() {
    let red = emitter(Vec3::X);
    let behind = emitter(Vec3::Y);
    let holes = Texture::new("holes", 2, 1, vec![[255; 4], [255, 255, 255, 0]], false).unwrap();
    let build = |alpha_mode, alpha, texture, x: f32| {
        let leaf = Material { alpha_mode, alpha, base_color_texture: texture, ..red.clone() };
        let mut parts = sheet(Parts::new(), -1.0, &behind);
        for z in [0.0, 0.5] {
            parts = parts.quad(Vec3::new(-2.0, -2.0, z), Vec3::X * 4.0, Vec3::Y * 4.0, &leaf);
        }
        let eye = Vec3::new(x, 0.0, 5.0);
        let mut scene = parts.scene(camera(eye, eye - Vec3::Z, 1e-4), Environment::DARK);
        scene.textures.push(holes.clone());
        color(&scene, 0)
    };
    // Two layers of 1/4: 1/4 + 3/4 · 1/4 red, the rest green.
    let seen = build(AlphaMode::Blend, 0.25, None, 1.0);
    assert!(near(seen, Vec3::new(0.4375, 0.5625, 0.0), 1e-5), "{seen}");
    assert_eq!(build(AlphaMode::Opaque, 0.25, None, 1.0), Vec3::X);
    assert_eq!(build(AlphaMode::Mask(0.5), 1.0, Some(0), -1.0), Vec3::X);
    assert_eq!(build(AlphaMode::Mask(0.5), 1.0, Some(0), 1.0), Vec3::Y);
}

#[test]
fn shadows_through_alpha_are_as_dark_as_it_says() {
    let veil = Material { alpha: 0.25, alpha_mode: AlphaMode::Blend, ..lambert(1.0) };
    let mut scene = Parts::new()
        .quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, &lambert(1.0))
        .quad(Vec3::new(-5.0, 2.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, &veil)
        .quad(Vec3::new(-5.0, 3.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, &veil)
        .scene(camera(Vec3::new(0.0, 0.5, 8.0), Vec3::ZERO, 1e-4), Environment::DARK);
    scene.lights.push(lamp(LightKind::Directional, Vec3::ZERO, Vec3::splat(PI)));
    let (image, stats) = render(&scene, &exact(1, 0));
    assert!(near(image.get(0, 0), Vec3::splat(0.5625), 1e-4), "{}", image.get(0, 0));
    assert_eq!((stats.shadow_rays, stats.continued_rays), (1, 2));
}

#[test]
fn textures_choose_between_mirror_and_matte() {
    // Green is roughness, blue is metallic: a mirror on the left, matte on the right.
    let map = Texture::new("map", 2, 1, vec![[0, 0, 255, 255], [0, 255, 0, 255]], false).unwrap();
    let material = Material {
        metallic: 1.0,
        metallic_roughness_texture: Some(0),
        ior: 1.0,
        ..Material::matte("map", Vec3::splat(0.5))
    };
    let at = |x: f32| {
        let eye = Vec3::new(x, 0.0, 5.0);
        let mut scene = Parts::new()
            .quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0, &material)
            .scene(camera(eye, eye - Vec3::Z, 1e-4), Environment::Constant(Vec3::ONE));
        scene.textures.push(map.clone());
        render(&scene, &exact(1, 1))
    };
    let (mirror, matte) = (at(-1.0), at(1.0));
    assert!(near(mirror.0.get(0, 0), Vec3::splat(0.5), 1e-5));
    assert_eq!((matte.0.get(0, 0), matte.1.reflected_rays), (Vec3::ZERO, 0));
}

#[test]
fn broken_input_neither_panics_nor_spreads() {
    let mut scene = Parts::new()
        .quad(Vec3::ZERO, Vec3::X, Vec3::X, &Material::default()) // no area
        .quad(Vec3::splat(-1.0), Vec3::X * 3.0, Vec3::Y * 3.0, &Material::glass("glass", 1.5))
        .scene(camera(Vec3::Z, Vec3::ZERO, 1.0), Environment::DAYLIGHT);
    scene.material_ids = vec![7];
    scene.normals.truncate(1);
    scene.uvs.clear();
    let finite = |scene: &Scene| {
        let tracer = Whitted::new(exact(6, 5));
        let image = tracer.render(scene, &brute(&scene.mesh));
        assert!(image.pixels().iter().all(|p| p.is_finite()));
    };
    finite(&scene);
    for material in &mut scene.materials {
        *material = Material {
            base_color: Vec3::NAN,
            ior: f32::NAN,
            roughness: f32::NAN,
            metallic: f32::NAN,
            transmission: f32::NAN,
            absorption: Vec3::NAN,
            emission: Vec3::splat(f32::INFINITY),
            ..Material::default()
        };
    }
    finite(&scene);
    scene.lights.push(lamp(LightKind::Point, Vec3::NAN, Vec3::INFINITY));
    finite(&scene);
    scene.cameras[0].position = Vec3::NAN;
    finite(&scene);
    scene.cameras[0].forward = Vec3::NAN;
    scene.cameras[0].vertical_fov = f32::NAN;
    finite(&scene);
    scene.cameras.clear();
    assert_eq!(Whitted::new(exact(4, 5)).render(&scene, &brute(&scene.mesh)), Image::black(4, 4));
    let empty = Parts::new().scene(camera(Vec3::Z, Vec3::ZERO, 1.0), Environment::DAYLIGHT);
    finite(&empty);
    for (width, height, grid) in [(0, 5, 1), (5, 0, 1), (3, 3, 0)] {
        let settings = WhittedSettings { width, height, grid, ..exact(0, 3) };
        let image = Whitted::new(settings).render(&empty, &brute(&empty.mesh));
        assert_eq!(image, Image::black(width, height));
    }
    let _ = PathTracer::new(settings(2, 1, 1)).render(&empty, &brute(&empty.mesh));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn no_material_makes_light_or_depends_on_planning(
        outer in any_material(),
        inner in any_material(),
        limit in 0.0_f32..=1.0,
    ) {
        // Two boxes in a uniform surrounding, which ambient light repeats: nothing is brighter.
        let scene = Parts::new()
            .cuboid(Vec3::splat(-1.0), Vec3::ONE, &outer)
            .cuboid(Vec3::splat(-0.5), Vec3::splat(0.6), &inner)
            .scene(camera(Vec3::new(2.0, 3.0, 4.0), Vec3::ZERO, 0.6), Environment::Constant(Vec3::ONE));
        let ambient = AmbientLight::Environment(1.0);
        let planned = WhittedSettings { ambient, mirror_roughness: limit, ..exact(5, 4) };
        let (image, _) = render(&scene, &planned);
        for pixel in image.pixels() {
            prop_assert!(pixel.min_element() >= 0.0 && pixel.max_element() <= 1.001, "{pixel}");
        }
        let forced = WhittedSettings { planning: Planning::Everything, ..planned };
        prop_assert_eq!(image, render(&scene, &forced).0);
    }
}
