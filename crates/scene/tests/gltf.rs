//! glTF files: what is read, and how what is broken is named.

mod common;

use common::{Folder, glb, load, square, square_json};
use niwaki_core::glam::Vec3;
use niwaki_scene::{LightKind, LoadError, LoadOptions, load_instanced};

fn error_of(json: &str) -> LoadError {
    let folder = Folder::new();
    let path = folder.file("broken.glb", glb(json, &square()));
    load(&path).expect_err("the file is broken")
}

#[test]
fn transforms_instances_cameras_and_lights() {
    let nodes = r#"{"children":[1,2,3,4]},
        {"mesh":0,"translation":[5,0,0]},
        {"mesh":0,"scale":[-2,2,2]},
        {"camera":0,"translation":[0,0,9]},
        {"translation":[0,7,0],"rotation":[-0.70710678,0,0,0.70710678],
            "extensions":{"KHR_lights_punctual":{"light":0}}}"#;
    let more = r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}],
        "extensions":{"KHR_lights_punctual":{"lights":[
            {"type":"spot","intensity":3,"color":[1,0.5,0],"spot":{}}]}}"#;
    let folder = Folder::new();
    let path = folder.file("two.glb", glb(&square_json(nodes, more), &square()));
    let instanced = load_instanced(&path, &LoadOptions::default()).unwrap();
    assert_eq!((instanced.parts.len(), instanced.instances.len()), (1, 2));
    let scene = load(&path).unwrap();
    assert_eq!(scene.name, "two");
    assert_eq!(scene.mesh.len(), 4);
    assert!(scene.dropped.is_empty(), "{}", scene.dropped);
    assert_eq!(scene.mesh.triangle(0).v0, Vec3::new(5.0, 0.0, 0.0));
    // A mirrored instance still faces the same way.
    for t in scene.mesh.triangles() {
        assert!((t.v1 - t.v0).cross(t.v2 - t.v0).z > 0.0, "{t:?}");
    }
    assert_eq!(scene.cameras.len(), 1);
    let camera = scene.cameras[0];
    assert_eq!((camera.position, camera.forward), (Vec3::new(0.0, 0.0, 9.0), Vec3::NEG_Z));
    let light = scene.lights[0];
    assert!(matches!(light.kind, LightKind::Spot { .. }));
    assert_eq!(light.intensity, Vec3::new(3.0, 1.5, 0.0));
    // Turned by −90° around X, −Z points down.
    assert!((light.direction - Vec3::NEG_Y).length() < 1e-6, "{}", light.direction);
    // There is light, so there is no sky.
    assert!(scene.environment.is_dark());
}

#[test]
fn materials_and_their_extensions() {
    let more = r#","materials":[{"name":"lamp","emissiveFactor":[1,0.5,0.25],
        "pbrMetallicRoughness":{"baseColorFactor":[0.1,0.2,0.3,1],"metallicFactor":0.5,
            "roughnessFactor":0.25},
        "extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":8},
            "KHR_materials_ior":{"ior":1.33},
            "KHR_materials_transmission":{"transmissionFactor":0.75}}}]"#;
    let json =
        square_json(r#"{"mesh":0}"#, more).replace("\"indices\":1", "\"indices\":1,\"material\":0");
    let folder = Folder::new();
    let scene = load(&folder.file("m.glb", glb(&json, &square()))).unwrap();
    let m = scene.material(0);
    assert_eq!((m.name.as_str(), m.base_color), ("lamp", Vec3::new(0.1, 0.2, 0.3)));
    assert_eq!((m.metallic, m.roughness, m.transmission, m.ior), (0.5, 0.25, 0.75, 1.33));
    assert_eq!(m.emission, Vec3::new(8.0, 4.0, 2.0));
    assert_eq!(scene.emissive_triangles(), [0, 1]);
}

#[test]
fn textures_that_cannot_be_decoded_are_counted_and_named() {
    let more = r#","materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "textures":[{"source":0}],"images":[{"uri":"data:image/png;base64,AAAA"}]"#;
    let json =
        square_json(r#"{"mesh":0}"#, more).replace("\"indices\":1", "\"indices\":1,\"material\":0");
    let folder = Folder::new();
    let scene = load(&folder.file("t.glb", glb(&json, &square()))).unwrap();
    assert_eq!((scene.mesh.len(), scene.dropped.textures), (2, 1));
    assert_eq!(scene.material(0).base_color_texture, None);
    assert!(scene.dropped.notes[0].contains("textures[0]"), "{}", scene.dropped);
}

#[test]
fn bad_triangles_are_dropped_and_degenerate_ones_kept() {
    let mut binary = square();
    // The third corner is not finite, the last index out of range, the first triangle a point.
    binary[24..28].copy_from_slice(&f32::NAN.to_le_bytes());
    binary[48..60].copy_from_slice(&[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 9, 0]);
    let folder = Folder::new();
    let scene =
        load(&folder.file("b.glb", glb(&square_json(r#"{"mesh":0}"#, ""), &binary))).unwrap();
    assert_eq!(scene.mesh.len(), 1);
    assert_eq!(scene.mesh.indices()[0], [0, 0, 0]);
    let d = &scene.dropped;
    assert_eq!((d.index_out_of_range, d.non_finite_vertices, d.non_finite_triangles), (1, 1, 0));
    assert!(d.to_string().contains("meshes[0].primitives[0]"), "{d}");
}

#[test]
fn broken_files_name_the_place() {
    let good = square_json(r#"{"mesh":0}"#, "");
    let cases = [
        (square_json(r#"{"children":[1]},{"children":[0]}"#, ""), "nodes[0]"),
        (square_json(r#"{"children":[1,1]},{"mesh":0}"#, ""), "nodes[1]"),
        (square_json(r#"{"mesh":7}"#, ""), "meshes[7]"),
        (good.replace("\"count\":4", "\"count\":5"), "attributes.POSITION"),
        (good.replace("\"count\":4", "\"count\":4000000000000"), "attributes.POSITION"),
        (good.replace("\"byteOffset\":48", "\"byteOffset\":49"), "bufferViews[1]"),
        (
            good.replace("\"byteOffset\":48", "\"byteOffset\":18446744073709551615"),
            "bufferViews[1]",
        ),
        (good.replace("\"byteLength\":60", "\"byteLength\":61000"), "buffers[0]"),
        (good.replace("\"VEC3\"", "\"VEC2\""), "attributes.POSITION"),
        (good.replace("5123", "5126"), "indices"),
        (good.replace("\"POSITION\":0", "\"POSITION\":9"), "accessors[9]"),
        (good.replace("\"asset\"", "asset"), "JSON line 1"),
        (
            square_json(r#"{"mesh":0}"#, r#","extensionsRequired":["KHR_draco_mesh_compression"]"#),
            "extensionsRequired[0]",
        ),
    ];
    for (json, place) in cases {
        let error = error_of(&json);
        assert!(error.to_string().contains(place), "{place}: {error}");
        assert!(error.to_string().contains("broken.glb"), "{error}");
    }
}

#[test]
fn a_million_nodes_in_a_chain_overflow_nothing() {
    let n = 1_000_000;
    let mut nodes: String = (1..n).map(|i| format!("{{\"children\":[{i}]}},")).collect();
    nodes.push_str(r#"{"mesh":0}"#);
    let folder = Folder::new();
    let scene = load(&folder.file("deep.glb", glb(&square_json(&nodes, ""), &square()))).unwrap();
    assert_eq!(scene.mesh.len(), 2);
}

#[test]
fn a_sky_and_a_camera_where_the_file_has_none() {
    let folder = Folder::new();
    let path = folder.file("plain.glb", glb(&square_json(r#"{"mesh":0}"#, ""), &square()));
    let scene = load(&path).unwrap();
    assert!(!scene.environment.is_dark());
    let camera = scene.cameras[0];
    let to_center = (Vec3::new(0.5, 0.5, 0.0) - camera.position).normalize();
    assert!(camera.forward.dot(to_center) > 0.999);
}

#[test]
fn limits_are_errors_before_memory_is_used() {
    let folder = Folder::new();
    let path = folder.file("plain.glb", glb(&square_json(r#"{"mesh":0}"#, ""), &square()));
    let few = LoadOptions { max_triangles: 1, ..LoadOptions::default() };
    assert!(matches!(
        niwaki_scene::load(&path, &few),
        Err(LoadError::TooLarge { option: "max_triangles", .. })
    ));
    let small = LoadOptions { max_bytes: 100, ..LoadOptions::default() };
    assert!(matches!(
        niwaki_scene::load(&path, &small),
        Err(LoadError::TooLarge { option: "max_bytes", .. })
    ));
}

#[test]
fn buffers_beside_the_file_and_sparse_values() {
    let folder = Folder::new();
    folder.file("a square.bin", square());
    // The first corner moves to the third's place: index 0 and value 2 of the same buffer.
    let json = square_json(r#"{"mesh":0}"#, "")
        .replace("\"byteLength\":60", "\"byteLength\":60,\"uri\":\"a%20square.bin\"")
        .replace(
            "\"count\":4",
            r#""count":4,"sparse":{"count":1,
                "indices":{"bufferView":1,"componentType":5123},
                "values":{"bufferView":0,"byteOffset":24}}"#,
        );
    let scene = load(&folder.file("b.gltf", json.as_bytes())).unwrap();
    assert_eq!(scene.mesh.triangle(0).v0, Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(scene.mesh.triangle(0).v1, Vec3::X);
    let missing = json.replace("a%20square", "gone");
    let error = load(&folder.file("c.gltf", missing)).unwrap_err().to_string();
    assert!(error.contains("gone.bin"), "{error}");
}

#[test]
fn transforms_out_of_range_drop_their_triangles() {
    let nodes = r#"{"children":[1,2]},{"mesh":0},{"mesh":0,"scale":[3e38,3e38,1],
        "translation":[3e38,0,0]}"#;
    let folder = Folder::new();
    let scene = load(&folder.file("far.glb", glb(&square_json(nodes, ""), &square()))).unwrap();
    assert_eq!((scene.mesh.len(), scene.dropped.non_finite_triangles), (2, 2));
}

#[test]
fn every_instance_is_an_object_with_bounds_of_its_own() {
    let nodes = r#"{"mesh":0,"children":[1]},{"mesh":0,"translation":[5,0,0]}"#;
    let folder = Folder::new();
    let scene = load(&folder.file("two.glb", glb(&square_json(nodes, ""), &square()))).unwrap();
    let ranges: Vec<_> =
        scene.objects.iter().map(|o| (o.triangles.clone(), o.vertices.clone())).collect();
    assert_eq!(ranges, [(0..2, 0..4), (2..4, 4..8)]);
    let from: Vec<f32> = scene.objects.iter().map(|o| o.bounds.min.x).collect();
    assert_eq!(from, [0.0, 5.0]);
    assert!(scene.objects.iter().all(|o| !o.dynamic) && scene.animation.is_none());
    // Each is a sheet, a sixth of the scene long: neither wall nor ground, and without depth.
    assert_eq!(scene.material(0).thickness, 0.0);
}
