//! Ambient occlusion by rays in the near region, against the CPU's.

mod common;

use common::{SIZE, flip, gpu, parlour, parlour_scene, render, show, small, whitted};
use niwaki_build_binned::Binned;
use niwaki_core::{Builder, glam::Vec3};
use niwaki_hybrid::{DebugView, Decision, Effect, NearRegion, Quality, Settings};
use niwaki_render::{AmbientOcclusion, Image, OcclusionSettings};
use niwaki_scene::{Environment, Scene};
use niwaki_trace::WideScene;

const RAYS: u32 = 16;

fn occluded(settings: Settings) -> Settings {
    small(Settings { occlusion_rays: RAYS, ..settings })
}

/// The share of open rays by the CPU's integrator.
fn reference(scene: &Scene) -> Image {
    let [width, height] = SIZE;
    let settings =
        OcclusionSettings { width, height, samples: RAYS, ..OcclusionSettings::for_scene(scene) };
    let tree = Binned::default().build_mesh(&scene.mesh).unwrap();
    AmbientOcclusion::new(settings).render(scene, &WideScene::new(&tree, &scene.mesh).unwrap())
}

fn mean_difference(a: &Image, b: &Image) -> f64 {
    let pairs = a.pixels().iter().zip(b.pixels());
    let sum: f64 = pairs.map(|(a, b)| f64::from((a.x - b.x).abs())).sum();
    sum / a.pixels().len() as f64
}

#[test]
fn shares_are_those_of_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let scene = parlour_scene();
    let wanted = reference(&scene);
    let settings = Settings { debug_view: DebugView::Occlusion, ..occluded(Settings::exact()) };
    let frame = render(&gpu, &scene, &settings);
    show("occlusion", &frame.image);
    show("occlusion-cpu", &wanted);
    let off = mean_difference(&frame.image, &wanted);
    let pairs = frame.image.pixels().iter().zip(wanted.pixels());
    // Directions are the same, so a pixel differs by whole rays: those that graze an edge.
    let by_a_ray = pairs.filter(|(a, b)| (a.x - b.x).abs() > 0.5 / RAYS as f32).count();
    println!("mean difference {off:.5}, {by_a_ray} pixels by a ray");
    assert!(off < 0.002, "{off}");
    assert!(by_a_ray * 50 < wanted.pixels().len(), "{by_a_ray} pixels");
    let closed = wanted.pixels().iter().filter(|p| p.x < 0.9).count();
    assert!(closed * 10 > wanted.pixels().len(), "nothing is occluded: {closed}");
}

#[test]
fn images_are_those_of_the_whitted_integrator() {
    let Some(gpu) = gpu() else { return };
    // No lamps: ambient light is all there is.
    let scene = parlour().build(common::eye(), vec![], Environment::DAYLIGHT);
    let settings = occluded(Settings::exact());
    let frame = render(&gpu, &scene, &settings);
    let wanted = whitted(&scene, &settings);
    let without = render(&gpu, &scene, &small(Settings::exact()));
    show("with-occlusion", &frame.image);
    show("with-occlusion-cpu", &wanted);
    let (error, plain) = (flip(&frame.image, &wanted), flip(&without.image, &wanted));
    println!("FLIP {error:.5}, without occlusion {plain:.5}");
    assert!(error < 0.006 && plain > 4.0 * error, "{error} {plain}");
    let pass = frame.plan.decision(Effect::OcclusionRays);
    assert_eq!(pass, Decision::Run { quality: Quality::Rays(RAYS) });
    assert!(frame.report.counters.occlusion_rays > 100_000, "{:?}", frame.report.counters);
}

#[test]
fn no_edge_shows_where_the_region_ends() {
    let Some(gpu) = gpu() else { return };
    let scene = parlour_scene();
    let view = |near_region| {
        let view = DebugView::Occlusion;
        let settings = Settings { near_region, debug_view: view, ..Settings::default() };
        render(&gpu, &scene, &occluded(settings))
    };
    let wanted = view(NearRegion::WholeScene).image;
    let far = |half| {
        let image = view(NearRegion::HalfSize(half)).image;
        show(&format!("occlusion-{half}"), &image);
        mean_difference(&image, &wanted)
    };
    let errors = [2.0, 6.0, 16.0].map(far);
    println!("{errors:?}");
    assert!(errors[0] > errors[1] && errors[1] > errors[2] && errors[2] < 0.002, "{errors:?}");
}

#[test]
fn what_has_no_ambient_light_traces_none() {
    let Some(gpu) = gpu() else { return };
    let dark = parlour().build(common::eye(), vec![common::sun()], Environment::DARK);
    let lit = parlour_scene();
    let none = Settings { occlusion_rays: 0, ..occluded(Settings::default()) };
    let no_share = Settings { ambient: 0.0, ..occluded(Settings::default()) };
    let no_length = Settings { occlusion_radius: f32::NAN, ..occluded(Settings::default()) };
    for (scene, settings, why) in [
        (&dark, occluded(Settings::default()), "no ambient light"),
        (&lit, no_share, "no ambient light"),
        (&lit, none, "ask for none"),
    ] {
        let frame = render(&gpu, scene, &settings);
        let pass = frame.plan.pass(Effect::OcclusionRays).unwrap();
        assert_eq!(pass.decision, Decision::Skip, "{}", frame.plan);
        assert!(pass.reason.contains(why), "{}", pass.reason);
        assert_eq!(frame.report.counters.occlusion_rays, 0);
        let forced = render(&gpu, scene, &Settings { force_all: true, ..settings });
        assert_eq!(forced.image, frame.image, "{why}");
    }
    assert!(no_length.sanitized().occlusion_radius > 0.0);
    let sheet = common::Parts::default()
        .quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X, Vec3::NEG_Z, &niwaki_scene::Material::default())
        .build(common::eye(), vec![], Environment::DAYLIGHT);
    let frame = render(&gpu, &sheet, &occluded(Settings::exact()));
    // Rays run, so the tree is built though nothing reflects.
    assert!(frame.plan.runs(Effect::NearRegion), "{}", frame.plan);
}
