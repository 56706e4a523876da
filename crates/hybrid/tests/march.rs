//! Following rays through the cube map: what the pyramid changes, and what not.

mod common;

use common::{Parts, flip, gpu, parlour_scene, render, show, small, whitted};
use niwaki_core::glam::Vec3;
use niwaki_hybrid::{Behind, Effect, Frame, March, NearRegion, SampleRule, Settings, Stage};
use niwaki_scene::{Camera, Environment, Material, Scene};

fn near(half: f32, march: March, layers: u32) -> Settings {
    let near_region = NearRegion::HalfSize(half);
    small(Settings { near_region, march, layers, ..Settings::default() })
}

fn differing(a: &Frame, b: &Frame) -> usize {
    let pairs = a.image.pixels().iter().zip(b.image.pixels());
    pairs.filter(|(a, b)| (**a - **b).abs().max_element() > 1e-4 * (1.0 + a.max_element())).count()
}

#[test]
fn the_pyramid_passes_nothing_that_a_ray_meets() {
    let Some(gpu) = gpu() else { return };
    let scene = parlour_scene();
    // Sides that are and are not powers of two, one and two layers, both ways to go behind.
    for (side, layers, behind) in [
        (256, 1, Behind::GoOn),
        (100, 1, Behind::GoOn),
        (300, 2, Behind::GoOn),
        (128, 1, Behind::Sky),
        (1, 1, Behind::GoOn),
    ] {
        let with = |march| Settings { face_resolution: side, behind, ..near(1.5, march, layers) };
        let pixels = render(&gpu, &scene, &with(March::Pixels));
        let cells = render(&gpu, &scene, &with(March::Hierarchical));
        show(&format!("march-{side}-{layers}"), &cells.image);
        let (a, b) = (pixels.report.counters, cells.report.counters);
        println!(
            "side {side}, {layers} layers: {} pixels, {} and {} cells, {} hits",
            a.march_samples, b.march_samples, b.pyramid_cells, b.map_hits
        );
        // Of either kernel the compiler makes something else, and rounds otherwise.
        assert!(differing(&pixels, &cells) <= 4, "{side}: {} differ", differing(&pixels, &cells));
        assert!(a.map_hits.abs_diff(b.map_hits) <= 4, "{a:?} {b:?}");
        assert!(a.behind_misses.abs_diff(b.behind_misses) <= 4, "{a:?} {b:?}");
        assert_eq!(a.pyramid_cells, 0);
        assert!(pixels.report.stage(Stage::Effect(Effect::DepthPyramid)).is_none());
        if side > 1 {
            assert!(a.map_hits > 100, "{a:?}");
            assert!(b.march_samples + b.pyramid_cells < a.march_samples, "{a:?} {b:?}");
            let stage = cells.report.stage(Stage::Effect(Effect::DepthPyramid)).unwrap();
            assert!(stage.dispatches > 0 && cells.plan.runs(Effect::DepthPyramid));
        }
    }
}

/// A mirror that shows a row of thin posts behind the camera.
fn posts() -> Scene {
    let mirror = Material::metal("mirror", Vec3::ONE, 0.0);
    let post = Material::emitter("post", Vec3::new(1.0, 0.9, 0.2));
    let mut parts =
        Parts::default().quad(Vec3::new(-2.0, -1.5, -3.0), Vec3::X * 4.0, Vec3::Y * 3.0, &mirror);
    for i in 0..12_u8 {
        let x = -5.5 + f32::from(i);
        let at = Vec3::new(x - 0.1, -4.0, 8.0);
        parts = parts.quad(at, Vec3::Y * 8.0, Vec3::X * 0.2, &post);
    }
    let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 0.8);
    let sky = Environment::Constant(Vec3::new(0.1, 0.15, 0.3));
    let mut scene = parts.build(camera, Vec::new(), sky);
    for post in &mut scene.materials[1..] {
        post.thickness = 0.0;
    }
    scene
}

#[test]
fn what_lies_between_samples_is_found_pixel_by_pixel() {
    let Some(gpu) = gpu() else { return };
    let scene = posts();
    let few = March::Linear { n_min: 4, n_max: 4, rule: SampleRule::Grazing };
    // Posts of several pixels, so that four of them behind a post still count as its own.
    let with = |march| Settings { face_resolution: 2048, ..near(1.0, march, 1) };
    let reference = whitted(&scene, &with(few));
    let linear = render(&gpu, &scene, &with(few));
    let walked = render(&gpu, &scene, &with(March::Hierarchical));
    show("posts-linear", &linear.image);
    show("posts", &walked.image);
    show("posts-whitted", &reference);
    let (a, b) = (flip(&linear.image, &reference), flip(&walked.image, &reference));
    println!("FLIP with 4 samples {a:.4}, pixel by pixel {b:.4}");
    println!("{:?}\n{:?}", linear.report.counters, walked.report.counters);
    assert!(b < 0.3 * a, "{a} {b}");
}
