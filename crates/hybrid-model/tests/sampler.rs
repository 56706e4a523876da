//! What the sampler says of a view, against exact counts of the same view.

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, glam::Vec3};
use niwaki_hybrid::{Gpu, HybridError, HybridRenderer, NearRegion, Settings};
use niwaki_hybrid_model::{ViewSampler, ViewSampling, ViewWork};
use niwaki_scene::{Camera, Scene, generate};
use niwaki_trace::QuantisedScene;
use std::sync::Arc;

fn sampler(scene: &Arc<Scene>, sampling: ViewSampling) -> ViewSampler {
    let bvh = Binned::default().build(&scene.mesh.prim_refs()).unwrap();
    let traced = Arc::new(QuantisedScene::<8>::new(&bvh, &scene.mesh).unwrap());
    ViewSampler::new(scene, traced, &Settings::default(), sampling).unwrap()
}

fn gallery() -> Arc<Scene> {
    Arc::new(generate::generate("gallery", 6_000, 1).unwrap())
}

#[test]
fn rays_are_as_many_as_the_renderer_counts() {
    let gpu = match Gpu::new() {
        Ok(gpu) => gpu,
        Err(error @ HybridError::NoAdapter(_)) => {
            let required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            return;
        }
        Err(error) => panic!("{error}"),
    };
    let scene = gallery();
    let sampler = sampler(&scene, ViewSampling::default());
    // Where all is traced, rays go where Whitted's do.
    let base = Settings { near_region: NearRegion::WholeScene, ..Settings::default() };
    let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), base.clone()).unwrap();
    let (width, height) = (128, 72);
    let pixels = f64::from(width * height);
    let mut seen = 0;
    for frame in [0, 60, 120] {
        let camera = scene.camera_path().frame(frame);
        let work = sampler.sample(&camera);
        for max_depth in [1, 4] {
            let settings = Settings { max_depth, ..base.clone() };
            renderer.set_settings(settings.clone());
            let (plan, report) = renderer.draw(&camera, width, height, 0.0).unwrap();
            let c = report.counters;
            let counted = (c.reflected_rays + c.refracted_rays + c.continued_rays) as f64 / pixels;
            let sampled = work.rays_up_to(max_depth);
            assert!(
                (sampled - counted).abs() <= 0.03 + 0.15 * counted,
                "frame {frame}, depth {max_depth}: {sampled} rays a pixel, counted {counted}"
            );
            assert_eq!(work.planned(&settings).follows, plan.follows_rays());
            let visible = c.primary_pixels as f64 / pixels;
            assert!((work.visible - visible).abs() < 0.03, "{} {visible}", work.visible);
            seen += usize::from(counted > 0.05);
        }
    }
    assert!(seen >= 4, "only {seen} of 6 views have rays worth the name");
}

#[test]
fn what_is_near_is_counted_by_distance() {
    let scene = gallery();
    let camera = scene.cameras[0];
    // Every triangle is looked at.
    let all = ViewSampling { triangles: scene.mesh.len(), ..ViewSampling::default() };
    let work = sampler(&scene, all).sample(&camera);
    let mut last = (0.0, 0.0);
    for share in [0.01, 0.05, 0.1, 0.2, 0.5, 2.0] {
        let settings =
            Settings { near_region: NearRegion::ShareOfScene(share), ..Settings::default() };
        let half = share * work.longest;
        let is_near = |i: &usize| {
            let t = scene.mesh.triangle(*i);
            let middle = (t.v0 + t.v1 + t.v2) / 3.0;
            (middle - camera.position).abs().max_element() <= half
        };
        let count = (0..scene.mesh.len()).filter(is_near).count() as f64;
        assert!((work.near_triangles(&settings) - count).abs() < 0.5, "{share}");
        let now = (work.near_triangles(&settings), work.near_share(&settings));
        assert!(now.0 >= last.0 && now.1 >= last.1);
        last = now;
    }
    assert_eq!(last, (scene.mesh.len() as f64, 1.0));
}

#[test]
fn empty_scenes_and_views_of_nothing_ask_for_nothing() {
    let empty = Arc::new(Scene::default());
    let work = sampler(&empty, ViewSampling::default()).sample(&empty.cameras[0]);
    assert_eq!((work.visible, work.triangles, work.rays_up_to(16)), (0.0, 0, 0.0));
    assert_eq!(work.near_triangles(&Settings::default()), 0.0);

    let scene = gallery();
    let far = scene.mesh.bounds().max + Vec3::splat(1e3);
    let away = Camera::look_at(far, far + Vec3::ONE, Vec3::Y, 0.9);
    let work = sampler(&scene, ViewSampling::default()).sample(&away);
    assert_eq!((work.visible, work.rays_up_to(16)), (0.0, 0.0));
    assert!(work.planned.iter().all(|(_, plans)| plans.iter().all(|p| !p.follows && p.faces == 0)));
}

#[test]
fn sampling_is_repeatable() {
    let scene = gallery();
    let camera = scene.camera_path().frame(60);
    let sample = || -> ViewWork { sampler(&scene, ViewSampling::default()).sample(&camera) };
    assert_eq!(sample(), sample());
}
