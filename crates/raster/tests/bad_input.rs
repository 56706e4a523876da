//! Inputs that are empty or broken, and the log of an animation.

mod common;

use common::{SIZE, gpu, ground, scene, settings};
use niwaki_core::glam::Vec3;
use niwaki_power::FrameLog;
use niwaki_raster::{Algorithm, Animation, FrameError, Renderer, SpotLight, study};
use niwaki_scene::{Camera, Scene};
use std::{sync::Arc, time::Duration};

#[test]
fn nothing_to_draw_is_drawn() {
    let Some(gpu) = gpu() else { return };
    let empty = Arc::new(Scene::default());
    let light = SpotLight::aimed(Vec3::Y, Vec3::ZERO, 0.5, 5.0, Vec3::ONE);
    for algorithm in Algorithm::ALL {
        for lights in [vec![], vec![light]] {
            let mut renderer =
                Renderer::new(&gpu, empty.clone(), lights, settings(algorithm)).unwrap();
            assert!(renderer.picture().unwrap().pixels.is_empty());
            renderer.draw(&empty.cameras[0], SIZE[0], SIZE[1]).unwrap();
            let picture = renderer.picture().unwrap();
            assert_eq!(picture.pixels.len(), (SIZE[0] * SIZE[1]) as usize);
            assert!(picture.pixels.iter().all(|p| p[2] > 50), "{algorithm}: the sky");
            let report = renderer.draw(&empty.cameras[0], 0, 7).unwrap();
            assert!(report.passes.is_empty() && renderer.picture().unwrap().pixels.is_empty());
        }
    }
}

#[test]
fn broken_lights_and_cameras_are_told_from_good_ones() {
    let Some(gpu) = gpu() else { return };
    let (positions, indices) = ground();
    let scene = scene(positions, indices);
    let good = SpotLight::aimed(Vec3::new(0.0, 3.0, 0.0), Vec3::ZERO, 0.7, 9.0, Vec3::splat(9.0));
    let camera = Camera::look_at(Vec3::new(2.0, 3.0, 4.0), Vec3::ZERO, Vec3::Y, 0.9);
    for algorithm in Algorithm::ALL {
        // A light on a corner of the ground, one in its plane, and ones that are no numbers.
        let lights = vec![
            good,
            SpotLight { position: Vec3::new(6.0, 0.0, 6.0), ..good },
            SpotLight { position: Vec3::new(1.0, 0.0, 1.0), direction: Vec3::X, ..good },
            SpotLight { position: Vec3::NAN, ..good },
            SpotLight { range: f32::INFINITY, ..good },
        ];
        let mut renderer = Renderer::new(&gpu, scene.clone(), lights, settings(algorithm)).unwrap();
        renderer.draw(&camera, SIZE[0], SIZE[1]).unwrap();
        let all = renderer.picture().unwrap();
        renderer.set_lights(vec![good]);
        renderer.draw(&camera, SIZE[0], SIZE[1]).unwrap();
        let (most, _) = renderer.picture().unwrap().difference(&all).unwrap();
        assert!(most <= 1, "{algorithm}: broken lights light nothing, and {most} differs");
        let broken = Camera { position: Vec3::NAN, ..camera };
        assert!(matches!(renderer.draw(&broken, 8, 8), Err(FrameError::BadCamera(_))));
        assert!(matches!(renderer.shares(&camera, 8, 8, 1), Err(FrameError::TooLarge { .. })));
        let huge = renderer.draw(&camera, 1 << 20, 1);
        assert!(matches!(huge, Err(FrameError::TooLarge { .. })), "{huge:?}");
        renderer.draw(&camera, SIZE[0], SIZE[1]).unwrap();
    }
}

#[test]
fn an_animation_is_logged_with_its_passes_and_markers() {
    let Some(gpu) = gpu() else { return };
    let study = study::tessellated(2_000, 1);
    let lights = study.shadow_lights(2);
    let mut renderer =
        Renderer::new(&gpu, study.scene.clone(), lights, settings(Algorithm::ShadowMaps)).unwrap();
    let animation = Animation {
        size: [64, 36],
        frames: 5,
        idle: Duration::from_millis(5),
        markers: 1,
        ..Animation::default()
    };
    let mut marks = 0;
    let log = animation.play(&mut renderer, &study.path, || marks += 1).unwrap();
    assert_eq!((log.frames.len(), marks), (5, 2));
    let markers: Vec<bool> = log.frames.iter().map(|f| f.marker).collect();
    assert_eq!(markers, [true, false, false, false, true]);
    for (i, frame) in log.frames.iter().enumerate() {
        assert_eq!((frame.frame, frame.lights), (i as u64, 2));
        assert_eq!((frame.width, frame.height, frame.algorithm.as_str()), (64, 36, "SM"));
        assert!(frame.end_ns > frame.start_ns);
        if gpu.has_timestamps() {
            let names: Vec<&str> = frame.passes.iter().map(|p| p.name.as_str()).collect();
            let expected =
                ["g_buffer", "base", "shadow_map", "light", "shadow_map", "light", "resolve"];
            assert_eq!(names, expected);
        }
    }
    assert!(log.frames.windows(2).all(|w| w[1].start_ns >= w[0].end_ns));
    let mut file = Vec::new();
    log.write_json_lines(&mut file).unwrap();
    assert_eq!(FrameLog::read(&file[..]).unwrap(), log);
}
