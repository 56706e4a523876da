//! The algorithms against each other and against rays.

mod common;

use common::{RADIUS, SIZE, error, gpu, settings};
use niwaki_raster::{Algorithm, Renderer, Settings, study};

#[test]
fn forward_prepass_and_deferred_give_one_picture() {
    let Some(gpu) = gpu() else { return };
    for study in [study::atrium(6_000, 1), study::tessellated(6_000, 1)] {
        for share in [0.0, 0.4, 0.8] {
            let camera = study.path.at(share);
            let pictures = Algorithm::PRIMARY.map(|algorithm| {
                let lights = study.lights.clone();
                let settings = settings(algorithm);
                let mut renderer =
                    Renderer::new(&gpu, study.scene.clone(), lights, settings).unwrap();
                let report = renderer.draw(&camera, SIZE[0], SIZE[1]).unwrap();
                assert_eq!((report.lights, report.algorithm), (32, algorithm));
                renderer.picture().unwrap()
            });
            let colors: std::collections::HashSet<_> = pictures[0].pixels.iter().collect();
            assert!(colors.len() > 500, "a picture of {} colours", colors.len());
            for other in &pictures[1..] {
                let (most, count) = pictures[0].difference(other).unwrap();
                assert!(most <= 1, "{}: {count} pixels differ, by {most}", study.scene.name);
            }
        }
    }
}

#[test]
fn shadow_volumes_are_exact_but_for_silhouettes() {
    let Some(gpu) = gpu() else { return };
    for study in [study::atrium(6_000, 1), study::tessellated(6_000, 1)] {
        let settings = settings(Algorithm::ShadowVolumes);
        let lights = study.shadow_lights(4);
        let mut renderer = Renderer::new(&gpu, study.scene.clone(), lights, settings).unwrap();
        for share in [0.1, 0.6] {
            let (error, _) = error(&mut renderer, &study.path.at(share), SIZE);
            println!("{} {share}: {error:?} with radius {RADIUS}", study.scene.name);
            assert!(error.reached > 5_000, "{error:?}");
            assert_eq!(
                error.wrong_elsewhere + error.wrong_averted,
                0,
                "{}: {error:?}",
                study.scene.name
            );
        }
    }
}

/// Closed parts cast from one side only: the shadows are the same, from fewer caps and walls.
#[test]
fn shadow_volumes_from_one_side_are_those_from_both() {
    let Some(gpu) = gpu() else { return };
    for study in [study::atrium(6_000, 1), study::tessellated(6_000, 1)] {
        let one = settings(Algorithm::ShadowVolumes);
        let both = Settings { one_sided: false, ..one.clone() };
        let lights = study.shadow_lights(2);
        let mut renderer = Renderer::new(&gpu, study.scene.clone(), lights, one.clone()).unwrap();
        for share in [0.3, 0.8] {
            let camera = study.path.at(share);
            let mut differ = 0;
            for light in 0..2 {
                let [a, b] = [&one, &both].map(|settings| {
                    renderer.set_settings(settings.clone());
                    let (shares, _) = renderer.shares(&camera, SIZE[0], SIZE[1], light).unwrap();
                    (shares, renderer.volume_counts().unwrap().unwrap())
                });
                let [fronts, backs, walls] = a.1;
                let all = b.1;
                assert!(fronts + backs < all[0] + all[1] && walls < all[2], "{:?} {all:?}", a.1);
                differ += a.0.share.iter().zip(&b.0.share).filter(|(a, b)| a != b).count();
            }
            // What differs can only be along silhouettes; all else agrees with rays both ways.
            println!("{} {share}: {differ} pixels differ", study.scene.name);
            assert!(differ <= 20, "{}: {differ} pixels differ", study.scene.name);
        }
    }
}
