//! Plans: what calls for an effect runs it, nothing else does.

use niwaki_core::{TriangleMesh, glam::Vec3};
use niwaki_hybrid::{
    Decision, Effect, EffectPlan, Face, FrameFacts, Kept, March, NearRegion, ObjectFacts, Quality,
    Settings, Shadows,
};
use niwaki_scene::{AlphaMode, Camera, Environment, Light, LightKind, Material, Scene, SceneFacts};
use proptest::prelude::*;

/// Small triangles of one material each, one object each.
struct Stage {
    scene: Scene,
    facts: SceneFacts,
    objects: Vec<ObjectFacts>,
}

fn stage(parts: &[(Vec3, Material)]) -> Stage {
    let mut positions = Vec::new();
    for (p, _) in parts {
        positions.extend([*p, *p + Vec3::X * 0.1, *p + Vec3::Y * 0.1]);
    }
    let count = u32::try_from(parts.len()).unwrap();
    let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let base = niwaki_scene::generate::generate("hair", 256, 1).unwrap();
    let scene = Scene {
        mesh: TriangleMesh::new(positions, indices).unwrap(),
        normals: Vec::new(),
        uvs: Vec::new(),
        material_ids: (0..count).collect(),
        materials: parts.iter().map(|(_, m)| m.clone()).collect(),
        lights: Vec::new(),
        environment: Environment::DARK,
        cameras: vec![Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 1.0)],
        ..base
    };
    let facts = SceneFacts::new(&scene, 0.15);
    let objects = (0..count).map(|i| ObjectFacts::of_range(&scene, &facts, i..i + 1)).collect();
    Stage { scene, facts, objects }
}

impl Stage {
    fn relit(mut self, lights: Vec<Light>, environment: Environment) -> Self {
        self.scene.lights = lights;
        self.scene.environment = environment;
        self.facts = SceneFacts::new(&self.scene, 0.15);
        self
    }

    fn plan(&self, settings: &Settings, kept: Option<&Kept>) -> EffectPlan {
        self.plan_from(&self.scene.cameras[0], settings, kept)
    }

    fn plan_from(&self, camera: &Camera, settings: &Settings, kept: Option<&Kept>) -> EffectPlan {
        EffectPlan::decide(&FrameFacts {
            scene: &self.facts,
            objects: &self.objects,
            camera,
            width: 64,
            height: 36,
            settings,
            kept,
        })
    }
}

fn near(half: f32) -> Settings {
    Settings { near_region: NearRegion::HalfSize(half), ..Settings::default() }
}

fn lamp() -> Light {
    Light {
        kind: LightKind::Point,
        position: Vec3::Y,
        direction: Vec3::NEG_Y,
        intensity: Vec3::ONE,
    }
}

const AHEAD: Vec3 = Vec3::new(0.0, 0.0, -2.0);

#[test]
fn a_scene_of_matte_surfaces_in_the_dark_calls_for_its_view_alone() {
    let stage = stage(&[(AHEAD, Material::default())]);
    let plan = stage.plan(&near(1.0), None);
    let running: Vec<_> = Effect::ALL.into_iter().filter(|e| plan.uses(*e)).collect();
    assert_eq!(running, [Effect::PrimaryView], "{plan}");
}

#[test]
fn mirrors_in_view_call_for_rays_the_region_and_the_faces_that_hold_something() {
    let parts = [
        (AHEAD, Material::metal("mirror", Vec3::ONE, 0.0)),
        (Vec3::new(0.0, 0.0, 5.0), Material::default()),
        (Vec3::splat(0.2), Material::default()),
    ];
    let plan = stage(&parts).plan(&near(1.0), None);
    for effect in [
        Effect::ReflectionRays,
        Effect::NearRegion,
        Effect::CubeFace(Face::NegZ),
        Effect::CubeFace(Face::PosZ),
    ] {
        assert!(plan.runs(effect), "{plan}");
    }
    for effect in [Effect::RefractionRays, Effect::CubeFace(Face::PosX), Effect::ShadowMaps] {
        assert_eq!(plan.decision(effect), Decision::Skip, "{plan}");
    }
    assert_eq!(plan.in_region, [2]);
    assert_eq!(plan.visible, [0]);
}

#[test]
fn mirrors_out_of_view_call_for_nothing() {
    let parts = [
        (AHEAD, Material::default()),
        (Vec3::new(0.0, 0.0, 5.0), Material::metal("mirror", Vec3::ONE, 0.0)),
    ];
    let stage = stage(&parts);
    let plan = stage.plan(&near(1.0), None);
    assert!(!plan.follows_rays() && !plan.uses(Effect::NearRegion), "{plan}");
    // Turning around brings the mirror into view.
    let back = Camera::look_at(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
    assert!(stage.plan_from(&back, &near(1.0), None).follows_rays());
    let shallow = Settings { max_depth: 0, ..near(1.0) };
    assert!(!stage.plan_from(&back, &shallow, None).follows_rays());
}

#[test]
fn lamps_call_for_shadows_and_a_region_that_holds_all_for_no_maps() {
    let parts = [(AHEAD, Material::default()), (AHEAD * 2.0, Material::default())];
    let stage = stage(&parts).relit(vec![lamp()], Environment::DARK);
    let traced = stage.plan(&near(2.5), None);
    assert!(traced.runs(Effect::ShadowMaps) && traced.runs(Effect::ShadowRays), "{traced}");
    assert!(traced.runs(Effect::NearRegion));
    let whole = stage.plan(&Settings::exact(), None);
    assert!(!whole.uses(Effect::ShadowMaps) && whole.runs(Effect::ShadowRays), "{whole}");
    let maps = stage.plan(&Settings { shadows: Shadows::Maps, ..near(2.5) }, None);
    assert!(maps.runs(Effect::ShadowMaps) && !maps.uses(Effect::NearRegion), "{maps}");
    let none = stage.plan(&Settings { shadows: Shadows::None, ..near(2.5) }, None);
    assert!(!none.uses(Effect::ShadowMaps) && !none.uses(Effect::ShadowRays), "{none}");
}

#[test]
fn glass_alpha_and_sky_call_for_their_effects() {
    let leaf = Material { alpha_mode: AlphaMode::Mask(0.5), alpha: 0.2, ..Material::default() };
    let parts = [(AHEAD, Material::glass("glass", 1.5)), (AHEAD, leaf)];
    let plan = stage(&parts).relit(Vec::new(), Environment::DAYLIGHT).plan(&near(1.0), None);
    for effect in [Effect::RefractionRays, Effect::ReflectionRays, Effect::Alpha, Effect::Sky] {
        assert!(plan.runs(effect), "{plan}");
    }
}

#[test]
fn what_holds_is_kept_and_what_changed_is_made_anew() {
    let parts = [
        (AHEAD, Material::metal("mirror", Vec3::ONE, 0.0)),
        (Vec3::new(0.0, 0.0, 5.0), Material::default()),
        (Vec3::splat(0.2), Material::default()),
    ];
    let mut stage = stage(&parts).relit(vec![lamp()], Environment::DARK);
    let settings = near(1.0);
    let first = stage.plan(&settings, None);
    let second = stage.plan(&settings, Some(&first.kept));
    for effect in [
        Effect::NearRegion,
        Effect::CubeFace(Face::NegZ),
        Effect::CubeFace(Face::PosZ),
        Effect::ShadowMaps,
    ] {
        assert_eq!(second.decision(effect), Decision::Keep, "{second}");
    }
    assert_eq!(second.kept, first.kept);

    // The object behind the camera moves: its face, not the other; all shadows; not the tree.
    let from = stage.objects[1].bounds;
    stage.objects[1].bounds.max += 0.5;
    stage.objects[1].moved_from = Some(from);
    let third = stage.plan(&settings, Some(&second.kept));
    assert!(third.runs(Effect::CubeFace(Face::PosZ)) && third.runs(Effect::ShadowMaps), "{third}");
    assert_eq!(third.decision(Effect::CubeFace(Face::NegZ)), Decision::Keep, "{third}");
    assert_eq!(third.decision(Effect::NearRegion), Decision::Keep, "{third}");

    // The camera moves: the map and the tree are those of another place.
    stage.objects[1].moved_from = None;
    let moved = Camera::look_at(Vec3::splat(0.1), AHEAD, Vec3::Y, 1.0);
    let fourth = stage.plan_from(&moved, &settings, Some(&third.kept));
    assert!(fourth.runs(Effect::NearRegion) && fourth.runs(Effect::CubeFace(Face::NegZ)));
    assert_eq!(fourth.decision(Effect::ShadowMaps), Decision::Keep, "{fourth}");

    // A tree of everything holds wherever the camera is.
    let first = stage.plan(&Settings::exact(), None);
    let next = stage.plan_from(&moved, &Settings::exact(), Some(&first.kept));
    assert_eq!(next.decision(Effect::NearRegion), Decision::Keep, "{next}");
}

#[test]
fn pyramid_and_second_layer_follow_the_faces_and_the_settings() {
    let parts = [
        (AHEAD, Material::metal("mirror", Vec3::ONE, 0.0)),
        (Vec3::new(0.0, 0.0, 5.0), Material::default()),
    ];
    let mut stage = stage(&parts);
    let with = |march, layers| Settings { march, layers, ..near(1.0) };
    let plain = stage.plan(&with(March::LINEAR, 1), None);
    for effect in [Effect::SecondLayer, Effect::DepthPyramid] {
        assert_eq!(plain.decision(effect), Decision::Skip, "{plain}");
        assert!(plain.pass(effect).unwrap().reason.starts_with("the settings"), "{plain}");
    }
    let both = with(March::Hierarchical, 2);
    let first = stage.plan(&both, None);
    for effect in [Effect::SecondLayer, Effect::DepthPyramid] {
        let quality = Quality::Faces { faces: 2, resolution: both.face_resolution };
        assert_eq!(first.decision(effect), Decision::Run { quality }, "{first}");
    }
    let second = stage.plan(&both, Some(&first.kept));
    for effect in [Effect::SecondLayer, Effect::DepthPyramid] {
        assert_eq!(second.decision(effect), Decision::Keep, "{second}");
    }
    // The object behind the camera moves: one face, and what is made from it.
    let from = stage.objects[1].bounds;
    stage.objects[1].moved_from = Some(from);
    let third = stage.plan(&both, Some(&second.kept));
    let quality = Quality::Faces { faces: 1, resolution: both.face_resolution };
    assert_eq!(third.decision(Effect::DepthPyramid), Decision::Run { quality }, "{third}");
    // Nobody looks into a map that holds nothing.
    let whole = Settings { near_region: NearRegion::WholeScene, ..both };
    let whole = stage.plan(&whole, None);
    assert_eq!(whole.decision(Effect::DepthPyramid), Decision::Skip, "{whole}");
    assert_eq!(whole.decision(Effect::SecondLayer), Decision::Skip, "{whole}");
}

#[test]
fn spot_lights_take_one_map_unless_they_are_wide() {
    let spot = |outer| Light { kind: LightKind::Spot { inner: 0.1, outer }, ..lamp() };
    let parts = [(AHEAD, Material::default()), (AHEAD * 2.0, Material::default())];
    for (lights, layers) in [
        (vec![spot(0.5)], 1),
        (vec![spot(1.5)], 6),
        (vec![spot(0.5), spot(1.5), lamp(), spot(1.0)], 14),
    ] {
        let plan = stage(&parts).relit(lights.clone(), Environment::DARK).plan(&near(2.5), None);
        let Decision::Run { quality: Quality::Maps { layers: planned, .. } } =
            plan.decision(Effect::ShadowMaps)
        else {
            panic!("{plan}");
        };
        assert_eq!(planned, layers, "{plan}");
        let expected = if lights.len() == 1 { "1 lamp casts" } else { "4 lamps cast" };
        assert!(plan.to_string().contains(expected), "{plan}");
    }
}

#[test]
fn forcing_runs_everything_and_says_so() {
    let stage = stage(&[(AHEAD, Material::default())]);
    let plan = stage.plan(&Settings { force_all: true, ..near(1.0) }, None);
    for effect in Effect::ALL {
        assert!(plan.runs(effect), "{effect}");
    }
    assert!(plan.to_string().contains("forced; no surface is a mirror"), "{plan}");
}

#[test]
fn plans_survive_storage_and_name_every_effect() {
    let parts = [(AHEAD, Material::glass("glass", 1.5))];
    let plan = stage(&parts).plan(&near(1.0), None);
    let text = serde_json::to_string(&plan).unwrap();
    assert_eq!(serde_json::from_str::<EffectPlan>(&text).unwrap(), plan);
    let printed = plan.to_string();
    for effect in Effect::ALL {
        assert!(printed.contains(&effect.to_string()), "{printed}");
    }
}

#[test]
fn settings_survive_storage_and_stay_in_range() {
    for march in [March::LINEAR, March::Pixels, March::Hierarchical] {
        let settings = Settings { march, layers: 2, ..Settings::default() };
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings);
        assert_eq!(settings.sanitized(), settings);
    }
    let March::Linear { rule, .. } = March::LINEAR else { panic!("LINEAR is not linear") };
    let wild = |n_min, n_max, layers| {
        let march = March::Linear { n_min, n_max, rule };
        Settings { march, layers, ..Settings::default() }.sanitized()
    };
    for (n_min, n_max, layers) in [(0, 0, 0), (9, 3, 7), (u32::MAX, 0, u32::MAX)] {
        let settings = wild(n_min, n_max, layers);
        let March::Linear { n_min, n_max, .. } = settings.march else { panic!("{settings:?}") };
        assert!(1 <= n_min && n_min <= n_max && n_max <= 4096, "{settings:?}");
        assert!((1..=2).contains(&settings.layers), "{settings:?}");
    }
}

#[test]
fn an_image_without_pixels_and_a_scene_without_triangles_call_for_nothing() {
    let stage = stage(&[(AHEAD, Material::glass("glass", 1.5))]);
    let camera = stage.scene.cameras[0];
    let settings = Settings::default();
    let facts = FrameFacts {
        scene: &stage.facts,
        objects: &stage.objects,
        camera: &camera,
        width: 0,
        height: 9,
        settings: &settings,
        kept: None,
    };
    let plan = EffectPlan::decide(&facts);
    assert!(plan.passes.iter().all(|p| p.decision == Decision::Skip), "{plan}");
    let empty = EffectPlan::decide(&FrameFacts { objects: &[], width: 9, ..facts });
    assert!(empty.passes.iter().all(|p| p.decision == Decision::Skip), "{empty}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever a ray from the camera can hit is in the list of visible objects, and whatever lies
    /// in some direction from the centre is in the region or in a face.
    #[test]
    fn culling_never_loses_an_object(
        points in prop::collection::vec(prop::array::uniform3(-10.0_f32..10.0), 1..20),
        eye in prop::array::uniform3(-5.0_f32..5.0),
        toward in prop::array::uniform3(-5.0_f32..5.0),
        half in 0.01_f32..20.0,
        fov in 0.1_f32..2.5,
    ) {
        let parts: Vec<_> =
            points.iter().map(|p| (Vec3::from(*p), Material::metal("m", Vec3::ONE, 0.0))).collect();
        let stage = stage(&parts);
        let camera = Camera::look_at(eye.into(), toward.into(), Vec3::Y, fov);
        let plan = stage.plan_from(&camera, &near(half), None);
        let tangent = (0.5 * camera.vertical_fov).tan();
        for (i, (p, _)) in (0_u32..).zip(&parts) {
            let d = *p - camera.position;
            let z = d.dot(camera.forward);
            let (x, y) = (d.dot(camera.right()).abs(), d.dot(camera.up).abs());
            if z > 0.0 && y <= tangent * z && x <= tangent * (64.0 / 36.0) * z {
                prop_assert!(plan.visible.contains(&i));
            }
            let in_face = plan.in_faces.iter().any(|f| f.contains(&i));
            prop_assert!(in_face || plan.in_region.contains(&i));
            if d.abs().max_element() > plan.region.half_size {
                prop_assert!(in_face, "{} {}", d, plan.region.half_size);
            }
        }
    }
}
