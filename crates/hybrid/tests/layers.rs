//! The second layer of the cube map.

mod common;

use common::{Parts, flip, gpu, render, show, small, whitted};
use niwaki_core::glam::Vec3;
use niwaki_hybrid::{Behind, Decision, Effect, March, NearRegion, Settings, Stage};
use niwaki_scene::{Camera, Environment, Material, Scene};

/// A mirror that shows a wall behind a panel, in part from beside the panel; from the camera the
/// panel hides that part.
fn hidden_wall() -> Scene {
    let mirror = Material::metal("mirror", Vec3::ONE, 0.0);
    let panel = Material::emitter("panel", Vec3::new(0.8, 0.1, 0.1));
    let wall = Material::emitter("wall", Vec3::new(0.1, 0.7, 0.2));
    let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 0.5);
    let mut scene = Parts::default()
        .quad(Vec3::new(-1.0, -0.6, -3.0), Vec3::X * 2.0, Vec3::Y * 1.2, &mirror)
        .quad(Vec3::new(-1.5, -1.5, 6.0), Vec3::Y * 3.0, Vec3::X * 3.0, &panel)
        .quad(Vec3::new(-14.0, -14.0, 30.0), Vec3::Y * 28.0, Vec3::X * 28.0, &wall)
        .build(camera, Vec::new(), Environment::Constant(Vec3::new(0.1, 0.2, 0.9)));
    // The panel is thin: rays pass behind it.
    scene.materials[1].thickness = 0.001;
    scene
}

#[test]
fn the_second_layer_shows_what_the_first_hides() {
    let Some(gpu) = gpu() else { return };
    let scene = hidden_wall();
    let with = |march, layers| {
        let near_region = NearRegion::HalfSize(1.0);
        small(Settings { near_region, march, layers, ..Settings::default() })
    };
    let reference = whitted(&scene, &with(March::LINEAR, 1));
    show("hidden-whitted", &reference);
    for march in [March::LINEAR, March::Hierarchical] {
        let one = render(&gpu, &scene, &with(march, 1));
        let two = render(&gpu, &scene, &with(march, 2));
        show("hidden-one", &one.image);
        show("hidden-two", &two.image);
        let (a, b) = (flip(&one.image, &reference), flip(&two.image, &reference));
        println!("{march:?}: FLIP {a:.4} with one layer, {b:.4} with two");
        assert!(b < 0.2 * a, "{march:?}: {a} {b}");
        let (first, second) = (one.report.counters, two.report.counters);
        assert!(first.behind_misses > 500 && first.second_layer_hits == 0, "{first:?}");
        // Pixels at the edge of the panel know no better.
        assert!(second.behind_misses < first.behind_misses / 10, "{first:?} {second:?}");
        assert!(second.second_layer_hits > 500, "{second:?}");
        assert_eq!(one.plan.decision(Effect::SecondLayer), Decision::Skip, "{}", one.plan);
        assert!(one.report.stage(Stage::Effect(Effect::SecondLayer)).is_none());
        assert!(two.plan.runs(Effect::SecondLayer), "{}", two.plan);
        assert!(two.report.stage(Stage::Effect(Effect::SecondLayer)).unwrap().draws > 0);
    }
}

#[test]
fn what_stands_still_has_no_end_if_asked_for() {
    let Some(gpu) = gpu() else { return };
    let mut scene = hidden_wall();
    let with = |endless_when_still| {
        let near_region = NearRegion::HalfSize(1.0);
        let behind = Behind::Sky;
        small(Settings { near_region, behind, endless_when_still, ..Settings::default() })
    };
    let thin = render(&gpu, &scene, &with(false));
    let endless = render(&gpu, &scene, &with(true));
    let behind = |frame: &niwaki_hybrid::Frame| frame.report.counters.behind_misses;
    assert!(behind(&thin) > 500 && behind(&endless) == 0, "{} {}", behind(&thin), behind(&endless));
    // The same as a thickness of 1, whatever the factor.
    scene.materials[1].thickness = 1.0;
    assert_eq!(render(&gpu, &scene, &with(false)).image, endless.image);
    let none = Settings { thickness: 0.0, ..with(true) };
    assert_eq!(render(&gpu, &scene, &none).image, endless.image);
    // Rays pass behind what moves.
    scene.materials[1].thickness = 0.001;
    scene.objects[1].dynamic = true;
    assert_eq!(render(&gpu, &scene, &with(true)).image, thin.image);
}
