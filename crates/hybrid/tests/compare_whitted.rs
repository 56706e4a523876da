//! The hybrid image against the Whitted integrator's, which is its limit.

mod common;

use common::{flip, gpu, parlour_scene, render, show, small, whitted};
use niwaki_hybrid::{NearRegion, Settings, Shadows};
use niwaki_render::metrics;

#[test]
fn a_region_that_holds_the_scene_gives_the_whitted_image() {
    let Some(gpu) = gpu() else { return };
    let scene = parlour_scene();
    let settings = Settings { max_depth: 6, ..small(Settings::exact()) };
    let frame = render(&gpu, &scene, &settings);
    let reference = whitted(&scene, &settings);
    let map = metrics::flip(&frame.image, &reference, &metrics::FlipSettings::default()).unwrap();
    show("exact", &frame.image);
    show("whitted", &reference);
    show("error", &map.colorize());
    println!("FLIP mean {:.5}, largest {:.3}", map.mean(), map.max());
    assert!(map.mean() <= 0.005, "{}", map.mean());
    let counters = frame.report.counters;
    assert_eq!((counters.face_marches, counters.map_hits, counters.cut_rays), (0, 0, 0));
    assert!(counters.tree_hits > 1000 && counters.shadow_rays > 10_000, "{counters:?}");
}

#[test]
fn larger_regions_come_nearer() {
    let Some(gpu) = gpu() else { return };
    let scene = parlour_scene();
    let at =
        |half| small(Settings { near_region: NearRegion::HalfSize(half), ..Settings::default() });
    let reference = whitted(&scene, &at(1.0));
    let mut errors = Vec::new();
    for half in [1.0, 5.5, 9.0, 30.0] {
        let frame = render(&gpu, &scene, &at(half));
        show(&format!("hybrid-{half}"), &frame.image);
        errors.push(flip(&frame.image, &reference));
        println!(
            "half size {half}: FLIP {:.4}, {:?}",
            errors[errors.len() - 1],
            frame.report.counters
        );
    }
    assert!(errors[0] < 0.12, "{errors:?}");
    assert!(errors[3] < 0.005 && errors[3] < errors[2] && errors[2] < errors[0], "{errors:?}");
}

#[test]
fn shadow_maps_cast_nearly_the_shadows_of_rays() {
    let Some(gpu) = gpu() else { return };
    let scene = parlour_scene();
    let traced = small(Settings::exact());
    let maps = Settings { shadows: Shadows::Maps, shadow_resolution: 1024, ..traced.clone() };
    let none = Settings { shadows: Shadows::None, ..traced.clone() };
    let reference = render(&gpu, &scene, &traced);
    let frame = render(&gpu, &scene, &maps);
    show("maps", &frame.image);
    assert_eq!(frame.report.counters.shadow_rays, 0);
    let error = flip(&frame.image, &reference.image);
    let without = flip(&render(&gpu, &scene, &none).image, &reference.image);
    println!("maps {error:.4}, no shadows {without:.4}");
    assert!(error < 0.02 && error < 0.4 * without, "{error} {without}");
}
