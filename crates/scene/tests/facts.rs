//! Facts about scenes: each follows from one thing in the scene, textures included.

use niwaki_core::{
    TriangleMesh,
    glam::{Vec2, Vec3},
};
use niwaki_scene::{
    AlphaMode, Camera, Environment, Light, LightKind, Material, MaterialClass, MaterialFacts,
    Scene, SceneFacts, Texture,
};

/// One triangle a material, side by side along x.
fn scene(materials: Vec<Material>) -> Scene {
    let positions: Vec<Vec3> = (0..materials.len())
        .flat_map(|i| {
            let x = Vec3::X * i as f32;
            [x, x + Vec3::X, x + Vec3::Y]
        })
        .collect();
    let ids = 0..u32::try_from(materials.len()).unwrap();
    let indices = ids.clone().map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Scene {
        name: "facts".into(),
        uvs: vec![Vec2::ZERO; positions.len()],
        mesh: TriangleMesh::new(positions, indices).unwrap(),
        material_ids: ids.collect(),
        materials,
        cameras: vec![Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0)],
        environment: Environment::DARK,
        ..Scene::default()
    }
}

fn facts_of(material: Material, textures: Vec<Texture>) -> MaterialFacts {
    let scene = Scene { textures, ..scene(vec![material]) };
    SceneFacts::new(&scene, SceneFacts::MIRROR_ROUGHNESS).materials[0]
}

fn class_of(material: Material) -> MaterialClass {
    facts_of(material, vec![]).class()
}

fn two_pixels(a: [u8; 4], b: [u8; 4]) -> Vec<Texture> {
    vec![Texture::new("two", 2, 1, vec![a, b], false).unwrap()]
}

#[test]
fn classes_follow_from_the_numbers() {
    let matte = Material { ior: 1.0, ..Material::default() };
    assert_eq!(class_of(matte.clone()), MaterialClass::Diffuse);
    assert_eq!(class_of(Material::default()), MaterialClass::Glossy, "a rough coat");
    let polished = Material { roughness: 0.05, ..Material::default() };
    assert_eq!(class_of(polished), MaterialClass::Mirror, "a smooth coat");
    assert_eq!(class_of(Material::metal("m", Vec3::ONE, 0.05)), MaterialClass::Mirror);
    assert_eq!(class_of(Material::metal("m", Vec3::ONE, 0.5)), MaterialClass::Glossy);
    assert_eq!(class_of(Material::glass("g", 1.5)), MaterialClass::Glass);
    let air = facts_of(Material::glass("air", 1.0), vec![]);
    assert!(air.transmissive && !air.reflective, "no step in the index reflects nothing");
    // All metal: nothing is left that transmission could share.
    let metal = Material { transmission: 1.0, ..Material::metal("m", Vec3::ONE, 0.5) };
    assert_eq!(class_of(metal), MaterialClass::Glossy);
    let metal =
        Material { transmission: 1.0, absorption: Vec3::X, ..Material::metal("m", Vec3::ONE, 0.5) };
    let metal = facts_of(metal, vec![]);
    assert!(metal.absorbing && !metal.transmissive, "alpha may let rays in all the same");
    let broken = Material { metallic: f32::NAN, roughness: f32::NAN, ior: f32::NAN, ..matte };
    assert_eq!(class_of(broken), MaterialClass::Mirror, "NaN reads as 0");
    let black = facts_of(Material::matte("black", Vec3::ZERO), vec![]);
    assert!(!black.diffuse && black.glossy);
}

#[test]
fn textures_decide_where_they_vary() {
    let textured = |metallic, roughness| Material {
        metallic,
        roughness,
        metallic_roughness_texture: Some(0),
        ior: 1.0,
        ..Material::default()
    };
    // Green is roughness, blue is metallic.
    let one_pixel_of_mirror = two_pixels([0, 255, 0, 255], [0, 10, 255, 255]);
    let facts = facts_of(textured(1.0, 1.0), one_pixel_of_mirror.clone());
    assert!(facts.reflective && facts.glossy && facts.diffuse && facts.textured);
    let facts = facts_of(textured(0.0, 1.0), one_pixel_of_mirror);
    assert!(!facts.reflective && !facts.glossy, "a factor of 0 wins");
    let rough = two_pixels([0, 255, 255, 255], [0, 200, 255, 255]);
    let facts = facts_of(textured(1.0, 1.0), rough);
    assert!(!facts.reflective && facts.glossy && !facts.diffuse);
    // A coat that is smooth in places only calls for no rays.
    let coat = Material { ior: 1.5, ..textured(0.0, 1.0) };
    let facts = facts_of(coat.clone(), two_pixels([0, 0, 0, 0], [0, 200, 0, 0]));
    assert!(!facts.reflective && !facts.polished && facts.glossy);
    let facts = facts_of(coat, two_pixels([0, 0, 0, 0], [0, 30, 0, 0]));
    assert!(facts.reflective && facts.polished && !facts.glossy);
    // Compression leaves traces of metal.
    let noisy = two_pixels([0, 0, 0, 255], [0, 255, 100, 255]);
    let facts = facts_of(textured(1.0, 1.0), noisy);
    assert!(!facts.reflective && facts.glossy && facts.diffuse);
    // A texture that the scene does not have reads as ones.
    let facts = facts_of(textured(1.0, 1.0), vec![]);
    assert!(!facts.textured && facts.glossy);

    let lamp = Material { emission_texture: Some(0), ..Material::emitter("lamp", Vec3::X) };
    assert!(facts_of(lamp.clone(), two_pixels([0, 9, 9, 9], [1, 0, 0, 0])).emissive);
    assert!(!facts_of(lamp, two_pixels([0, 9, 9, 9], [0, 9, 9, 9])).emissive, "no red to glow");
}

#[test]
fn alpha_counts_only_where_it_lets_something_pass() {
    let leaf = |alpha_mode, alpha| Material {
        alpha_mode,
        alpha,
        base_color_texture: Some(0),
        ..Material::default()
    };
    let opaque = two_pixels([255; 4], [255; 4]);
    let holes = two_pixels([255; 4], [255, 255, 255, 0]);
    let of = |mode, alpha, textures: &Vec<Texture>| {
        let facts = facts_of(leaf(mode, alpha), textures.clone());
        (facts.masked, facts.blended)
    };
    assert_eq!(of(AlphaMode::Opaque, 0.2, &holes), (false, false));
    assert_eq!(of(AlphaMode::Mask(0.5), 1.0, &opaque), (false, false));
    assert_eq!(of(AlphaMode::Mask(0.5), 1.0, &holes), (true, false));
    assert_eq!(of(AlphaMode::Mask(0.5), 0.4, &opaque), (true, false));
    assert_eq!(of(AlphaMode::Blend, 1.0, &opaque), (false, false));
    assert_eq!(of(AlphaMode::Blend, 1.0, &holes), (false, true));
    assert_eq!(of(AlphaMode::Blend, 0.9, &opaque), (false, true));
}

#[test]
fn only_what_is_worn_and_shines_counts() {
    let mut scene = scene(vec![
        Material::metal("mirror", Vec3::ONE, 0.0),
        Material { ior: 1.0, ..Material::default() },
        Material::emitter("lamp", Vec3::ONE),
        Material { absorption: Vec3::X, ..Material::glass("glass", 1.5) },
    ]);
    let facts = SceneFacts::new(&scene, 0.1);
    assert!(facts.has_reflective() && facts.has_transmissive() && facts.has_emissive());
    assert!(facts.has_lit() && !facts.has_alpha() && !facts.has_textures());
    assert!(facts.materials[3].absorbing && !facts.lights.is_dark());
    // The mirror stands at the left end, the glass at the right.
    assert_eq!((facts.specular_bounds().min.x, facts.specular_bounds().max.x), (0.0, 4.0));
    let text = facts.to_string();
    assert!(text.contains("glass: 1 materials on 1 triangles"), "{text}");

    scene.material_ids = vec![1, 1, 1, 99]; // the last one falls back to the mirror
    let facts = SceneFacts::new(&scene, 0.1);
    assert!(facts.has_reflective() && !facts.has_transmissive() && !facts.has_emissive());
    assert!(facts.lights.is_dark());
    assert_eq!(facts.materials.iter().map(|m| m.triangles).collect::<Vec<_>>(), [1, 3, 0, 0]);
    assert!(facts.materials[2].bounds.is_empty());

    let light = |kind, intensity| Light {
        kind,
        position: Vec3::Y,
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(intensity),
    };
    scene.lights = vec![
        light(LightKind::Point, 1.0),
        light(LightKind::Point, 0.0),
        light(LightKind::Directional, 2.0),
        light(LightKind::Spot { inner: 0.1, outer: 0.2 }, 3.0),
    ];
    scene.environment = Environment::DAYLIGHT;
    let lights = SceneFacts::new(&scene, 0.1).lights;
    assert_eq!((lights.point, lights.spot, lights.directional), (1, 1, 1));
    assert!(lights.punctual() == 3 && lights.environment);
}
