//! Leaving out what the plan leaves out changes nothing, and leaves nothing to do.

mod common;

use common::{Parts, eye, gpu, lamp, parlour, parlour_scene, render, show, small, sun};
use niwaki_core::glam::Vec3;
use niwaki_hybrid::{Decision, Effect, Gpu, HybridRenderer, NearRegion, Settings, Shadows, Stage};
use niwaki_scene::{AlphaMode, Camera, Environment, Material, Scene};
use std::sync::Arc;

/// A room without mirrors and glass.
fn plain() -> Scene {
    // An index of refraction of 1 leaves no coat, so nothing is glossy either.
    let matte = |r: f32, g: f32, b: f32| Material::matte("plain", Vec3::new(r, g, b));
    Parts::default()
        .quad(Vec3::new(-5.0, 0.0, 5.0), Vec3::X * 10.0, Vec3::Z * -10.0, &matte(0.5, 0.5, 0.4))
        .sphere(Vec3::new(0.0, 1.0, 0.0), 1.0, &matte(0.7, 0.2, 0.1))
        .sphere(Vec3::new(2.0, 0.6, -2.0), 0.6, &matte(0.2, 0.6, 0.3))
        .build(eye(), vec![sun()], Environment::DAYLIGHT)
}

/// Leaves that are cut out and a veil before a mirror.
fn veiled() -> Scene {
    let leaf = Material {
        alpha_mode: AlphaMode::Blend,
        alpha: 0.4,
        ..Material::matte("veil", Vec3::new(0.2, 0.7, 0.3))
    };
    let gone = Material { alpha_mode: AlphaMode::Mask(0.5), alpha: 0.2, ..leaf.clone() };
    parlour()
        .quad(Vec3::new(-3.0, 0.0, 1.5), Vec3::X * 3.0, Vec3::Y * 2.0, &leaf)
        .quad(Vec3::new(-9.0, -1.0, 3.0), Vec3::X * 18.0, Vec3::Y * 9.0, &gone)
        .build(eye(), vec![sun()], Environment::DAYLIGHT)
}

fn same(gpu: &Gpu, name: &str, scene: &Scene, settings: &Settings) {
    let planned = render(gpu, scene, settings);
    let forced = render(gpu, scene, &Settings { force_all: true, ..settings.clone() });
    show(name, &planned.image);
    assert!(forced.plan.passes.iter().all(|p| matches!(p.decision, Decision::Run { .. })));
    let differing = planned
        .image
        .pixels()
        .iter()
        .zip(forced.image.pixels())
        // Other variants of a kernel may round otherwise.
        .filter(|(a, b)| (**a - **b).abs().max_element() > 1e-4 * (1.0 + a.max_element()))
        .count();
    assert!(differing <= 4, "{name}: {differing} pixels differ\n{}", planned.plan);
    assert!(planned.image.pixels().iter().all(|p| p.is_finite()));
    assert!(planned.image.mean().max_element() > 0.01, "{name} is black");
}

#[test]
fn forcing_every_pass_gives_the_same_image() {
    let Some(gpu) = gpu() else { return };
    let near =
        |half| small(Settings { near_region: NearRegion::HalfSize(half), ..Settings::default() });
    same(&gpu, "plain", &plain(), &near(2.0));
    same(&gpu, "veiled", &veiled(), &near(4.0));
    same(&gpu, "parlour-maps", &parlour_scene(), &Settings { shadows: Shadows::Maps, ..near(4.0) });
    same(&gpu, "parlour-exact", &parlour_scene(), &small(Settings::exact()));
    let dark = parlour().build(eye(), Vec::new(), Environment::Constant(Vec3::splat(0.5)));
    same(&gpu, "no-lamps", &dark, &near(6.0));
}

#[test]
fn a_scene_without_mirrors_and_glass_pays_nothing_for_them() {
    let Some(gpu) = gpu() else { return };
    let settings = Settings { shadows: Shadows::Maps, ..small(Settings::default()) };
    let frame = render(&gpu, &plain(), &settings);
    let c = frame.report.counters;
    assert_eq!((c.spawning_pixels, c.reflected_rays, c.refracted_rays), (0, 0, 0));
    assert_eq!((c.tree_traversals, c.face_marches, c.march_samples, c.sky_misses), (0, 0, 0, 0));
    assert!(c.primary_pixels > 0);
    assert!(frame.report.stage(Stage::RayTraversal).is_none(), "{:?}", frame.report);
    for pass in &frame.plan.passes {
        if pass.decision == Decision::Skip {
            assert!(frame.report.stage(Stage::Effect(pass.effect)).is_none(), "{pass}");
        }
    }
    assert_eq!(frame.plan.decision(Effect::NearRegion), Decision::Skip);
}

#[test]
fn frames_that_keep_what_holds_look_like_fresh_ones() {
    let Some(gpu) = gpu() else { return };
    let scene = Arc::new(parlour_scene());
    let settings =
        small(Settings { near_region: NearRegion::HalfSize(5.0), ..Settings::default() });
    let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), settings.clone()).unwrap();
    let fresh = |camera: &Camera| {
        let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), settings.clone()).unwrap();
        renderer.render(camera, 96, 54, 0.0).unwrap().image
    };
    let other = Camera::look_at(Vec3::new(-2.0, 1.2, 3.0), Vec3::new(0.5, 0.8, -2.0), Vec3::Y, 0.9);
    let first = renderer.render(&eye(), 96, 54, 0.0).unwrap();
    assert_eq!(first.image, fresh(&eye()));
    let again = renderer.render(&eye(), 96, 54, 0.0).unwrap();
    assert_eq!(again.plan.decision(Effect::NearRegion), Decision::Keep, "{}", again.plan);
    assert!(again.report.stage(Stage::Effect(Effect::NearRegion)).is_none());
    assert_eq!(again.image, first.image);
    let moved = renderer.render(&other, 96, 54, 0.0).unwrap();
    assert_eq!(moved.plan.decision(Effect::ShadowMaps), Decision::Keep, "{}", moved.plan);
    assert_eq!(moved.image, fresh(&other));
    assert_eq!(renderer.render(&eye(), 96, 54, 0.0).unwrap().image, first.image);
}

#[test]
fn veils_show_what_lies_behind_in_its_share() {
    let Some(gpu) = gpu() else { return };
    let veil = |alpha| Material {
        alpha_mode: AlphaMode::Blend,
        alpha,
        emission: Vec3::ONE,
        ior: 1.0,
        ..Material::matte("veil", Vec3::ZERO)
    };
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 0.5);
    let scene = Parts::default()
        .quad(Vec3::new(-9.0, -9.0, 0.0), Vec3::X * 18.0, Vec3::Y * 18.0, &veil(0.25))
        .quad(Vec3::new(-9.0, -9.0, -1.0), Vec3::X * 18.0, Vec3::Y * 18.0, &veil(0.5))
        .build(camera, vec![lamp(Vec3::Y)], Environment::Constant(Vec3::splat(0.2)));
    let frame = render(&gpu, &scene, &small(Settings { ambient: 0.0, ..Settings::exact() }));
    // 1/4 of 1, 3/4 of (1/2 of 1 and 1/2 of the sky).
    let expected = 0.25 + 0.75 * (0.5 + 0.5 * 0.2);
    for p in frame.image.pixels() {
        assert!((*p - Vec3::splat(expected)).abs().max_element() < 1e-3, "{p} {expected}");
    }
    assert!(frame.plan.runs(Effect::TransparencyRays) && !frame.plan.runs(Effect::ReflectionRays));
}
