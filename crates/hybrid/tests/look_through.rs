//! Glass, blended and cut-out surfaces that rays meet in the cube map.

mod common;

use common::{Parts, flip, gpu, render, show, small, sun, whitted};
use niwaki_core::glam::Vec3;
use niwaki_hybrid::{Behind, Decision, Effect, March, NearRegion, Settings};
use niwaki_scene::{AlphaMode, Camera, Environment, Material, Scene, Texture};

/// A mirror ahead that shows a striped wall behind the camera, and before that wall a pane.
fn behind_a_pane(pane: &Material, textures: Vec<Texture>) -> Scene {
    let mirror = Material::metal("mirror", Vec3::ONE, 0.0);
    let stripes = [Vec3::new(0.9, 0.1, 0.1), Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.8, 0.8, 0.1)];
    let mut parts = Parts::default()
        .quad(Vec3::new(-2.0, -1.0, -3.0), Vec3::X * 4.0, Vec3::Y * 3.0, &mirror)
        .quad(Vec3::new(2.0, -1.0, 4.0), Vec3::X * -4.0, Vec3::Y * 3.0, pane);
    for k in 0..12_u8 {
        let stripe = Material::matte("stripe", stripes[usize::from(k % 3)]);
        let x = 6.0 - f32::from(k);
        parts = parts.quad(Vec3::new(x, -3.0, 6.0), Vec3::NEG_X, Vec3::Y * 8.0, &stripe);
    }
    let eye = Vec3::new(0.0, 0.6, 0.3);
    let camera = Camera::look_at(eye, Vec3::new(0.0, 0.5, -3.0), Vec3::Y, 0.6);
    let mut scene = parts.build(camera, vec![sun()], Environment::Constant(Vec3::splat(0.6)));
    scene.textures = textures;
    scene
}

fn near(settings: Settings) -> Settings {
    small(Settings { near_region: NearRegion::HalfSize(0.5), ..settings })
}

/// FLIP with and without looking through, and with a setting in either case.
fn errors(name: &str, scene: &Scene) -> [f64; 2] {
    let Some(gpu) = gpu() else { return [0.0, 1.0] };
    let seen = near(Settings::default());
    let wanted = whitted(scene, &seen);
    show(&format!("{name}-whitted"), &wanted);
    let frame = render(&gpu, scene, &seen);
    show(name, &frame.image);
    assert!(frame.report.counters.map_hits > 1_000, "{:?}", frame.report.counters);
    let opaque = render(&gpu, scene, &Settings { look_through: false, ..seen.clone() });
    show(&format!("{name}-opaque"), &opaque.image);
    let pass = frame.plan.pass(Effect::SecondLayer).unwrap();
    assert!(matches!(pass.decision, Decision::Run { .. }), "{}", frame.plan);
    assert!(pass.reason.contains("glass, blended"), "{}", pass.reason);
    assert_eq!(opaque.plan.decision(Effect::SecondLayer), Decision::Skip, "{}", opaque.plan);
    let errors = [&frame, &opaque].map(|f| flip(&f.image, &wanted));
    println!("{name}: FLIP {:.4}, not looked through {:.4}", errors[0], errors[1]);
    // Other ways to march see the same.
    for (march, behind, layers) in [
        (March::Pixels, Behind::GoOn, 1),
        (March::LINEAR, Behind::GoOn, 1),
        (March::Hierarchical, Behind::Sky, 1),
        (March::Hierarchical, Behind::GoOn, 2),
    ] {
        let other = render(&gpu, scene, &Settings { march, behind, layers, ..seen.clone() });
        let apart = flip(&other.image, &frame.image);
        println!("{name}: {march:?}, {behind:?}, {layers} layers: {apart:.4} apart");
        assert!(apart < 0.01, "{march:?} {behind:?} {layers}: {apart}");
    }
    errors
}

#[test]
fn blended_surfaces_show_what_is_behind() {
    let pane = Material {
        alpha_mode: AlphaMode::Blend,
        alpha: 0.3,
        ..Material::matte("pane", Vec3::new(0.1, 0.6, 0.2))
    };
    let [seen, opaque] = errors("blended", &behind_a_pane(&pane, vec![]));
    assert!(seen < 0.1 && opaque > 3.0 * seen, "{seen} {opaque}");
}

#[test]
fn glass_shows_what_is_behind() {
    // So thin that nothing moves: what rays meet behind it is where it is.
    let pane = Material::glass("pane", 1.01);
    let scene = behind_a_pane(&pane, vec![]);
    let [seen, opaque] = errors("glass", &scene);
    assert!(seen < 0.1 && opaque > 3.0 * seen, "{seen} {opaque}");
    let Some(gpu) = gpu() else { return };
    let air = behind_a_pane(&Material::glass("air", 1.0), vec![]);
    let [with, without] =
        [scene, air].map(|scene| render(&gpu, &scene, &near(Settings::default())).image);
    assert!(flip(&with, &without) < 0.01);
}

#[test]
fn bodies_of_glass_bend_what_is_behind() {
    let Some(gpu) = gpu() else { return };
    let glass = Material { absorption: Vec3::new(0.5, 0.05, 0.3), ..Material::glass("ball", 1.5) };
    let mirror = Material::metal("mirror", Vec3::ONE, 0.0);
    let stripes = [Vec3::new(0.9, 0.1, 0.1), Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.8, 0.8, 0.1)];
    // One ball is seen in the mirror, one beside it.
    let mut parts = Parts::default()
        .quad(Vec3::new(-2.0, -1.0, -3.0), Vec3::X * 2.4, Vec3::Y * 3.0, &mirror)
        .sphere(Vec3::new(-1.0, 0.4, 3.5), 0.8, &glass)
        .sphere(Vec3::new(1.0, 0.4, -3.5), 0.5, &glass);
    for k in 0..12_u8 {
        let stripe = Material::matte("stripe", stripes[usize::from(k % 3)]);
        let x = 6.0 - f32::from(k);
        parts = parts.quad(Vec3::new(x, -3.0, 6.0), Vec3::NEG_X, Vec3::Y * 8.0, &stripe).quad(
            Vec3::new(x - 1.0, -3.0, -6.0),
            Vec3::X,
            Vec3::Y * 8.0,
            &stripe,
        );
    }
    let eye = Vec3::new(0.0, 0.6, 0.3);
    let camera = Camera::look_at(eye, Vec3::new(0.0, 0.5, -3.0), Vec3::Y, 0.6);
    let scene = parts.build(camera, vec![sun()], Environment::Constant(Vec3::splat(0.6)));
    let settings = near(Settings::default());
    let wanted = whitted(&scene, &settings);
    let bent = render(&gpu, &scene, &settings).image;
    let mut walls = scene;
    for wall in &mut walls.materials[1..3] {
        (wall.thin_walled, wall.thickness) = (true, 0.0);
    }
    let straight = render(&gpu, &walls, &settings).image;
    show("body-whitted", &wanted);
    show("body", &bent);
    show("body-straight", &straight);
    let [bent, straight] = [bent, straight].map(|image| flip(&image, &wanted));
    println!("bodies: FLIP {bent:.4}, as thin walls {straight:.4}");
    assert!(bent < 0.1 && straight > 1.4 * bent, "{bent} {straight}");
}

#[test]
fn cut_out_surfaces_have_holes() {
    let Some(gpu) = gpu() else { return };
    let pixels = (0..64).map(|i| [40, 160, 40, if (i + i / 8) % 2 == 0 { 0 } else { 255 }]);
    let texture = Texture::new("leaves", 8, 8, pixels.collect(), true).unwrap();
    let pane = Material {
        alpha_mode: AlphaMode::Mask(0.5),
        base_color_texture: Some(0),
        ..Material::matte("leaves", Vec3::ONE)
    };
    let scene = behind_a_pane(&pane, vec![texture]);
    let settings = near(Settings::default());
    let wanted = whitted(&scene, &settings);
    let frame = render(&gpu, &scene, &settings);
    show("cut-out", &frame.image);
    show("cut-out-whitted", &wanted);
    let mut filled = scene.clone();
    filled.materials[1].alpha_mode = AlphaMode::Opaque;
    let without = flip(&render(&gpu, &filled, &settings).image, &wanted);
    let error = flip(&frame.image, &wanted);
    println!("cut out: FLIP {error:.4}, filled {without:.4}");
    assert!(error < 0.12 && without > 2.0 * error, "{error} {without}");
    // Beside the holes, rays see what the leaves hide from the camera.
    assert!(frame.plan.runs(Effect::SecondLayer), "{}", frame.plan);
    assert!(frame.report.counters.second_layer_hits > 100, "{:?}", frame.report.counters);
}
