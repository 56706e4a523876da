//! The same bits on any number of threads.

mod common;

use common::{Parts, brute, camera, lambert, settings};
use niwaki_core::glam::Vec3;
use niwaki_render::{
    AmbientOcclusion, OcclusionSettings, PathTracer, RecordSettings, Whitted, WhittedSettings,
    random_rays, record_rays,
};
use niwaki_scene::{Environment, Material, Scene};
use std::sync::atomic::{AtomicUsize, Ordering};

fn scene() -> Scene {
    Parts::new()
        .quad(Vec3::new(-5.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, &lambert(0.6))
        .cuboid(Vec3::new(-2.0, 0.2, -1.0), Vec3::new(-1.0, 1.5, 0.5), &Material::default())
        .cuboid(Vec3::splat(0.3), Vec3::splat(1.3), &Material::glass("glass", 1.5))
        .quad(
            Vec3::new(-1.0, 3.0, -1.0),
            Vec3::X * 2.0,
            Vec3::Z * 2.0,
            &Material::emitter("lamp", Vec3::new(5.0, 4.0, 3.0)),
        )
        .scene(camera(Vec3::new(0.5, 2.0, 6.0), Vec3::ZERO, 0.8), Environment::DAYLIGHT)
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn images_do_not_depend_on_the_number_of_threads() {
    let scene = scene();
    // Not a multiple of the tile size, so that border tiles are cut.
    let mut settings = settings(37, 4, 6);
    settings.height = 21;
    let render = |threads| {
        let calls = AtomicUsize::new(0);
        let tracer = PathTracer::new(settings.clone());
        let result = with_threads(threads, || {
            tracer.render_with(&scene, &brute(&scene.mesh), |done, all| {
                assert!(done >= 1 && done <= all && all == 3 * 2);
                calls.fetch_add(1, Ordering::Relaxed);
            })
        });
        assert_eq!(calls.into_inner(), 6);
        result
    };
    let one = render(1);
    assert!(one.0.mean().min_element() > 0.05, "a black image would prove nothing");
    for threads in [2, 8] {
        let other = render(threads);
        assert_eq!(one.1, other.1);
        let bits = |i: &niwaki_render::Image| -> Vec<[u32; 3]> {
            i.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
        };
        assert_eq!(bits(&one.0), bits(&other.0), "{threads} threads");
    }
    let mut reseeded = PathTracer::new(settings.clone());
    reseeded.settings.seed = 1;
    assert_ne!(reseeded.render(&scene, &brute(&scene.mesh)), one.0);
}

#[test]
fn recorded_rays_do_not_depend_on_the_number_of_threads() {
    let scene = scene();
    let settings = RecordSettings { max_rays: 700, ..RecordSettings::default() };
    let record =
        |threads| with_threads(threads, || record_rays(&scene, &brute(&scene.mesh), &settings));
    let one = record(1);
    assert!(one.sets.iter().all(|(_, _, rays)| rays.len() > 100));
    for threads in [2, 8] {
        assert_eq!(one, record(threads));
    }
    let bounds = scene.mesh.bounds();
    let random = |threads| with_threads(threads, || random_rays(&bounds, 1000, 5));
    assert_eq!(random(1), random(8));
    assert_ne!(random(1), random_rays(&bounds, 1000, 6));
}

#[test]
fn whitted_and_occlusion_do_not_depend_on_the_number_of_threads() {
    let scene = scene();
    let whitted = WhittedSettings { width: 37, height: 21, grid: 2, ..WhittedSettings::default() };
    let occlusion =
        OcclusionSettings { width: 37, height: 21, ..OcclusionSettings::for_scene(&scene) };
    let render = |threads| {
        with_threads(threads, || {
            let tracer = brute(&scene.mesh);
            let whitted = Whitted::new(whitted.clone());
            let occlusion = AmbientOcclusion::new(occlusion.clone());
            [
                whitted.render_with(&scene, &tracer, |done, all| assert!(done <= all && all == 6)),
                occlusion.render_with(&scene, &tracer, |_, _| {}),
            ]
        })
    };
    let one = render(1);
    assert!(one.iter().all(|(image, _)| image.mean().min_element() > 0.05));
    for threads in [2, 8] {
        assert_eq!(one, render(threads));
    }
}
