//! Frames of the device beside those of the CPU.

mod common;

use common::{device, scene_and_tree};
use niwaki_core::glam::Vec3;
use niwaki_gpu_tracer::{FrameSettings, FrameTracer, TracedScene, reference};
use niwaki_render::Image;
use niwaki_scene::{Camera, Environment, Light, LightKind, Scene};
use niwaki_trace::{BinaryScene, Mode};
use niwaki_trace_vulkan::TreeLayout;

const SMALL: FrameSettings =
    FrameSettings { width: 96, height: 64, shadows: true, ao_rays: 6, ao_radius: 0.8, seed: 3 };

/// Pixels that differ by more than rounding: an arithmetic that rounds otherwise turns a ray at an
/// edge, and with it a shadow or a direction.
fn different(a: &Image, b: &Image) -> usize {
    assert_eq!(a.pixels().len(), b.pixels().len());
    let far = |(a, b): &(&Vec3, &Vec3)| {
        !(a.is_finite() && (**a - **b).abs().max_element() <= 2e-3 * (1.0 + b.max_element()))
    };
    a.pixels().iter().zip(b.pixels()).filter(far).count()
}

fn compare(name: &str, settings: &FrameSettings, change: impl Fn(&mut Scene)) {
    let Some(device) = device() else { return };
    let (mut scene, bvh) = scene_and_tree(name, 6_000);
    change(&mut scene);
    let camera = scene.camera_path().frame(0);
    let on_cpu = BinaryScene::new(&bvh, &scene.mesh).unwrap();
    let wanted = reference::draw(&scene, &on_cpu, &camera, settings);
    let mut tracer = FrameTracer::new(&device).unwrap();
    for layout in TreeLayout::ALL {
        let traced =
            TracedScene::upload_in(&device, layout, Mode::Watertight, &bvh, &scene).unwrap();
        let times = tracer.draw(&traced, &camera, settings).unwrap();
        assert!(times.total() > 0.0);
        let off = different(&tracer.image().unwrap(), &wanted);
        // A direction more or less is 1/6 of the ambient light.
        assert!(off * 100 <= wanted.pixels().len(), "{name}, {layout:?}: {off} pixels differ");
    }
    assert_eq!(device.messages(), Vec::<String>::new());
}

#[test]
fn frames_are_those_of_the_cpu() {
    compare("fairy", &SMALL, |_| {});
    compare("cabin", &FrameSettings { ao_rays: 0, ..SMALL }, |_| {});
    compare("atrium", &FrameSettings { shadows: false, ao_radius: f32::INFINITY, ..SMALL }, |_| {});
}

#[test]
fn lights_of_every_kind() {
    compare("plain", &FrameSettings { ao_rays: 0, ..SMALL }, |scene| {
        let bounds = scene.mesh.bounds();
        let place = bounds.center() + Vec3::Y * (0.2 * bounds.extent().y);
        let light = |kind| Light {
            kind,
            position: place,
            direction: Vec3::new(0.3, -0.9, 0.1).normalize(),
            intensity: Vec3::new(3.0, 4.0, 5.0),
        };
        scene.lights = vec![
            light(LightKind::Point),
            light(LightKind::Spot { inner: 0.2, outer: 0.6 }),
            light(LightKind::Directional),
        ];
    });
}

/// More directions than one dispatch takes on a driver that ends long loops.
#[test]
fn many_directions() {
    compare("fairy", &FrameSettings { width: 24, height: 16, ao_rays: 70, ..SMALL }, |_| {});
}

#[test]
fn counts_are_those_of_rays() {
    let Some(device) = device() else { return };
    let (scene, bvh) = scene_and_tree("fairy", 6_000);
    let camera = scene.camera_path().frame(0);
    let traced = TracedScene::upload(&device, &bvh, &scene).unwrap();
    let mut tracer = FrameTracer::new(&device).unwrap();
    let none = FrameSettings { shadows: false, ao_rays: 0, ..SMALL };
    let before = tracer.count(&traced, &camera, &none).unwrap();
    assert_eq!(before.shade, niwaki_trace::Counts::default());
    assert!(before.covered > 1000 && before.primary.nodes >= before.covered);
    let few = tracer.count(&traced, &camera, &FrameSettings { shadows: false, ..SMALL }).unwrap();
    let more = FrameSettings { shadows: false, ao_rays: 24, ..SMALL };
    let more = tracer.count(&traced, &camera, &more).unwrap();
    assert_eq!(few.primary, before.primary);
    let ratio = more.shade.nodes as f64 / few.shade.nodes as f64;
    assert!((3.8..4.2).contains(&ratio), "{ratio}");
}

#[test]
fn empty_views_scenes_and_images() {
    let Some(device) = device() else { return };
    let (mut scene, bvh) = scene_and_tree("fairy", 1_000);
    scene.environment = Environment::Constant(Vec3::new(0.1, 0.2, 0.3));
    let traced = TracedScene::upload(&device, &bvh, &scene).unwrap();
    let mut tracer = FrameTracer::new(&device).unwrap();
    let away = Camera::look_at(Vec3::Y * 50.0, Vec3::Y * 90.0, Vec3::X, 0.8);
    tracer.draw(&traced, &away, &SMALL).unwrap();
    let image = tracer.image().unwrap();
    let sky = Vec3::new(0.1, 0.2, 0.3);
    assert!(image.pixels().iter().all(|p| p.distance(sky) < 1e-6));
    let nothing = FrameSettings { width: 0, ..SMALL };
    tracer.draw(&traced, &away, &nothing).unwrap();
    assert_eq!(tracer.image().unwrap().pixels().len(), 0);
    let huge = FrameSettings { width: 1 << 17, height: 1 << 17, ..SMALL };
    assert!(tracer.draw(&traced, &away, &huge).is_err());
    // A radius that is no number counts no occluders, as on the CPU.
    let odd = FrameSettings { ao_radius: f32::NAN, ..SMALL };
    tracer.draw(&traced, &scene.camera_path().frame(0), &odd).unwrap();
    assert!(tracer.image().unwrap().pixels().iter().all(|p| p.is_finite()));
}
