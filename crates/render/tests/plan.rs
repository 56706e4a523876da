//! Plans leave out what nothing calls for, counters show it, and images stay the same bit for bit.

mod common;

use common::{Parts, any_material, brute, camera, lambert, settings};
use niwaki_core::glam::Vec3;
use niwaki_render::{
    AmbientLight, AmbientOcclusion, Effect, Image, OcclusionSettings, PathSettings, PathTracer,
    Planning, RenderStats, Whitted, WhittedSettings,
};
use niwaki_scene::{AlphaMode, Environment, Light, LightKind, Material, Scene, Texture};
use proptest::prelude::*;

fn bits(image: &Image) -> Vec<[u32; 3]> {
    image.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

fn whitted(scene: &Scene, planning: Planning) -> (Image, RenderStats) {
    let settings = WhittedSettings {
        width: 20,
        height: 20,
        max_depth: 3,
        cutoff: 0.0,
        planning,
        ..WhittedSettings::default()
    };
    Whitted::new(settings).render_with(scene, &brute(&scene.mesh), |_, _| {})
}

fn path(scene: &Scene, planning: Planning) -> (Image, RenderStats) {
    let settings = PathSettings { planning, ..settings(12, 4, 4) };
    PathTracer::new(settings).render_with(scene, &brute(&scene.mesh), |_, _| {})
}

fn occlusion(scene: &Scene, planning: Planning) -> (Image, RenderStats) {
    let settings = OcclusionSettings {
        width: 12,
        height: 12,
        samples: 8,
        planning,
        ..OcclusionSettings::for_scene(scene)
    };
    AmbientOcclusion::new(settings).render_with(scene, &brute(&scene.mesh), |_, _| {})
}

fn sun() -> Light {
    Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.3, -0.9, -0.2).normalize(),
        intensity: Vec3::splat(2.0),
    }
}

/// A floor and one object in the dark.
fn scene(object: &Material) -> Scene {
    Parts::new()
        .quad(Vec3::new(-5.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, &lambert(0.6))
        .cuboid(Vec3::new(-1.0, 0.2, -1.0), Vec3::new(1.0, 1.8, 1.0), object)
        .scene(camera(Vec3::new(2.0, 3.0, 5.0), Vec3::Y, 0.7), Environment::DARK)
}

/// Scenes in which each effect is called for or not.
fn scenes() -> Vec<(&'static str, Scene)> {
    let leaf = Material { alpha_mode: AlphaMode::Mask(0.5), ..lambert(0.5) };
    let mut holes = scene(&Material { base_color_texture: Some(0), ..leaf });
    let pixels = vec![[255; 4], [255, 255, 255, 0]];
    holes.textures.push(Texture::new("holes", 2, 1, pixels, false).unwrap());
    let blend = Material { alpha_mode: AlphaMode::Blend, alpha: 0.5, ..lambert(0.5) };
    let absorbing = Material { absorption: Vec3::X, ..Material::glass("glass", 1.5) };
    let absorbing_blend =
        Material { alpha_mode: AlphaMode::Blend, alpha: 0.5, ..absorbing.clone() };
    let mut all = vec![
        ("matte", scene(&lambert(0.5))),
        ("plastic", scene(&Material::default())),
        ("polished", scene(&Material { roughness: 0.1, ..Material::default() })),
        ("mirror", scene(&Material::metal("metal", Vec3::ONE, 0.0))),
        ("half a mirror", scene(&Material::metal("metal", Vec3::ONE, 0.2))),
        ("rough metal", scene(&Material::metal("metal", Vec3::ONE, 0.6))),
        ("glass", scene(&Material::glass("glass", 1.5))),
        ("absorbing", scene(&absorbing)),
        ("air", scene(&Material::glass("air", 1.0))),
        ("lamp", scene(&Material::emitter("lamp", Vec3::splat(3.0)))),
        ("holes", holes),
        ("blend", scene(&blend)),
        // Metal leaves no share for transmission, but rays that alpha lets in are absorbed.
        ("dark metal", scene(&Material { metallic: 1.0, ..absorbing_blend })),
    ];
    for i in 0..all.len() {
        let (name, dark) = all[i].clone();
        let sky = Scene { environment: Environment::DAYLIGHT, ..dark.clone() };
        let both = Scene { lights: vec![sun()], ..sky.clone() };
        all.extend([(name, Scene { lights: vec![sun()], ..dark }), (name, sky), (name, both)]);
    }
    all
}

#[test]
fn leaving_out_never_changes_an_image() {
    let mut black = 0;
    for (name, scene) in scenes() {
        for (kind, render) in [
            ("whitted", whitted as fn(&Scene, Planning) -> (Image, RenderStats)),
            ("path", path),
            ("occlusion", occlusion),
        ] {
            let (planned, few) = render(&scene, Planning::Scene);
            let (forced, many) = render(&scene, Planning::Everything);
            assert_eq!(bits(&planned), bits(&forced), "{kind}: {name} {:?}", scene.environment);
            assert!(few.closest_hit_rays <= many.closest_hit_rays);
            assert!(few.shadow_rays <= many.shadow_rays && few.alpha_tests <= many.alpha_tests);
            black += usize::from(planned.mean() == niwaki_core::glam::DVec3::ZERO);
        }
    }
    assert!(black <= 2 * 13, "black images prove little: {black}");
}

#[test]
fn counters_show_what_is_left_out_and_that_forcing_costs() {
    let find = |wanted: &str, lights: usize, sky: bool| {
        let fits = |(name, s): &(&str, Scene)| {
            *name == wanted && s.lights.len() == lights && s.environment.is_dark() != sky
        };
        scenes().into_iter().find(fits).map(|(_, scene)| scene).unwrap()
    };
    let (_, matte) = whitted(&find("matte", 1, true), Planning::Scene);
    assert!(matte.shadow_rays > 100);
    assert_eq!((matte.reflected_rays, matte.refracted_rays, matte.alpha_tests), (0, 0, 0));
    assert_eq!(matte.closest_hit_rays, 400, "one ray a pixel");
    let (_, forced) = whitted(&find("matte", 1, true), Planning::Everything);
    assert!(forced.reflected_rays > 100 && forced.refracted_rays > 100 && forced.alpha_tests > 400);

    let (_, unlit) = whitted(&find("matte", 0, true), Planning::Scene);
    assert_eq!(unlit.shadow_rays, 0);
    let (_, mirror) = whitted(&find("mirror", 1, true), Planning::Scene);
    assert!(mirror.reflected_rays > 50 && mirror.refracted_rays == 0);
    let (_, air) = whitted(&find("air", 1, true), Planning::Scene);
    assert!(air.refracted_rays > 50 && air.reflected_rays == 0);
    let (_, holes) = whitted(&find("holes", 1, true), Planning::Scene);
    assert!(holes.alpha_tests > 100 && holes.continued_rays > 20);

    let (_, path_dark) = path(&find("matte", 0, false), Planning::Scene);
    assert_eq!((path_dark.shadow_rays, path_dark.alpha_tests), (0, 0));
    let (_, path_forced) = path(&find("matte", 0, false), Planning::Everything);
    assert!(path_forced.shadow_rays > 100 && path_forced.alpha_tests > 100);
    let (_, open) = occlusion(&find("matte", 0, false), Planning::Scene);
    assert!(open.occlusion_rays > 500 && open.alpha_tests == 0 && open.shadow_rays == 0);
}

#[test]
fn plans_say_what_runs_and_why() {
    let plain = Scene { lights: vec![sun()], ..scene(&lambert(0.5)) };
    let integrator = Whitted::new(WhittedSettings::default());
    let plan = integrator.plan(&plain);
    assert!(plan.runs(Effect::PunctualLight));
    for off in [Effect::Reflection, Effect::Refraction, Effect::Alpha, Effect::Sky, Effect::Ambient]
    {
        assert!(!plan.runs(off), "{off}");
    }
    assert!(!plan.runs(Effect::AreaLight), "which this integrator does not have");
    let text = plan.to_string();
    assert!(
        text.contains("1 punctual light shines") && text.contains("no material transmits"),
        "{text}"
    );
    assert_eq!(text.lines().count(), plan.decisions().len());

    let glass = scene(&Material::glass("glass", 1.5));
    assert!(integrator.plan(&glass).runs(Effect::Refraction));
    let shallow = WhittedSettings { max_depth: 0, ..WhittedSettings::default() };
    assert!(!Whitted::new(shallow).plan(&glass).runs(Effect::Refraction));
    let constant = AmbientLight::Constant(Vec3::ONE);
    let constant = WhittedSettings { ambient: constant, ..WhittedSettings::default() };
    assert!(Whitted::new(constant).plan(&glass).runs(Effect::Ambient));
    let forced = WhittedSettings { planning: Planning::Everything, ..WhittedSettings::default() };
    let forced = Whitted::new(forced).plan(&plain);
    assert!(forced.runs(Effect::Refraction) && forced.to_string().contains("forced, though no"));
    // A scene of mirrors alone lights nothing.
    let mirrors = Parts::new()
        .cuboid(Vec3::splat(-1.0), Vec3::ONE, &Material::metal("m", Vec3::ONE, 0.0))
        .scene(camera(Vec3::Z * 4.0, Vec3::ZERO, 0.5), Environment::DAYLIGHT);
    let mirrors = Scene { lights: vec![sun()], ..mirrors };
    assert!(!integrator.plan(&mirrors).runs(Effect::PunctualLight));
    assert_eq!(whitted(&mirrors, Planning::Scene).1.shadow_rays, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn no_material_makes_the_path_tracer_depend_on_planning(
        outer in any_material(),
        inner in any_material(),
        lit in any::<bool>(),
    ) {
        let mut scene = scene(&outer);
        scene.materials[0] = inner;
        scene.environment = Environment::DAYLIGHT;
        if lit {
            scene.lights.push(sun());
        }
        let (planned, forced) = (path(&scene, Planning::Scene), path(&scene, Planning::Everything));
        prop_assert_eq!(bits(&planned.0), bits(&forced.0));
    }
}
