//! Shadow maps of spot lights.

mod common;

use common::{eye, flip, gpu, render, show, small};
use niwaki_core::glam::Vec3;
use niwaki_hybrid::{Decision, Effect, Quality, Settings, Shadows};
use niwaki_scene::{Environment, Light, LightKind};

#[test]
fn spot_lights_cast_shadows_from_one_map_or_from_six() {
    let Some(gpu) = gpu() else { return };
    for (outer, layers) in [(0.7, 1), (1.4, 6)] {
        let position = Vec3::new(2.0, 4.5, 2.0);
        let spot = Light {
            kind: LightKind::Spot { inner: 0.5 * outer, outer },
            position,
            direction: (Vec3::new(-0.5, 0.5, -1.0) - position).normalize(),
            intensity: Vec3::splat(60.0),
        };
        let scene =
            common::parlour().build(eye(), vec![spot], Environment::Constant(Vec3::splat(0.1)));
        let traced = render(&gpu, &scene, &small(Settings::exact()));
        let with =
            |shadows| Settings { shadows, shadow_resolution: 1024, ..small(Settings::exact()) };
        let maps = render(&gpu, &scene, &with(Shadows::Maps));
        let none = render(&gpu, &scene, &with(Shadows::None));
        show(&format!("spot-{layers}"), &maps.image);
        let error = flip(&maps.image, &traced.image);
        let without = flip(&none.image, &traced.image);
        println!("{layers} maps: {error:.4}, no shadows {without:.4}");
        assert!(error < 0.02 && error < 0.4 * without, "{error} {without}");
        let quality = Quality::Maps { layers, resolution: 1024 };
        assert_eq!(maps.plan.decision(Effect::ShadowMaps), Decision::Run { quality });
        assert!(maps.plan.to_string().contains("1 lamp casts shadows"), "{}", maps.plan);
    }
}
