//! Morph targets of glTF files: where vertices are, and how what is broken is named.

mod common;

use common::{
    Folder,
    animated::{File, NO_TURN, QUARTER, loaded, near, shape_at},
    load,
};
use niwaki_core::glam::{Quat, Vec3};
use niwaki_scene::{
    FlattenError, LoadError, LoadOptions, Rig,
    animation::{Difference, MorphError, MorphWeights, Morphed, Targets},
    load_instanced,
};
use proptest::prelude::*;

const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// Looking for a camera takes longer than all else.
const CAMERA: &str =
    r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}]"#;

/// A mesh of the unit square with these targets; `more` begins with a comma or is empty.
fn square(file: &mut File, targets: &str, more: &str) -> String {
    let mesh = file.square();
    let mesh = mesh.replace(r#""indices""#, &format!(r#""targets":[{targets}],"indices""#));
    let open = mesh.strip_suffix('}').expect("a mesh");
    format!("{open}{more}}}")
}

/// The first target lifts the third corner, the second widens the square and tilts all normals.
fn two_targets(file: &mut File) -> String {
    let lift = file.floats(&[[0.0; 3], [0.0; 3], [0.0, 0.0, 2.0], [0.0; 3]]);
    let widen =
        file.floats(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
    let tilt = file.floats(&[[1.0, 0.0, 0.0]; 4]);
    format!(r#"{{"POSITION":{lift}}},{{"POSITION":{widen},"NORMAL":{tilt}}}"#)
}

#[test]
fn weights_of_mesh_and_node_shape_what_rests() {
    for (of_mesh, of_node, weights) in [
        ("", "", [0.0, 0.0]),
        (r#","weights":[0.5,2]"#, "", [0.5, 2.0]),
        (r#","weights":[0.5,2]"#, r#","weights":[-1,0.25]"#, [-1.0, 0.25_f32]),
        ("", r#","weights":[0,1]"#, [0.0, 1.0]),
    ] {
        let mut file = File::default();
        let targets = two_targets(&mut file);
        let mesh = square(&mut file, &targets, of_mesh);
        // Twice as large, so that normals differ from their differences in scale.
        let node = format!(r#"{{"mesh":0,"camera":0,"scale":[2,2,2]{of_node}}}"#);
        let scene = loaded(&file.glb(&file.json(&node, &mesh, CAMERA)));
        assert!(scene.dropped.is_empty(), "{}", scene.dropped);
        assert!(scene.animation.is_none() && !scene.objects[0].dynamic);
        let [lift, widen] = weights;
        let wanted = [
            Vec3::new(-widen, 0.0, 0.0),
            Vec3::new(1.0 + widen, 0.0, 0.0),
            Vec3::new(1.0 + widen, 1.0, 2.0 * lift),
            Vec3::new(-widen, 1.0, 0.0),
        ];
        for (got, wanted) in scene.mesh.positions().iter().zip(wanted) {
            assert!(near(*got, 2.0 * wanted), "{weights:?}: {got} {wanted}");
        }
        let tilted = Vec3::new(widen, 0.0, 1.0).normalize();
        assert!(scene.normals.iter().all(|n| near(*n, tilted)), "{weights:?}");
    }
}

#[test]
fn every_interpolation_is_that_of_the_specification() {
    let at = |how: &str, values: &[[f32; 1]], time: f64| {
        let mut file = File::default();
        let targets = two_targets(&mut file);
        let mesh = square(&mut file, &targets, r#","weights":[7,7]"#);
        file.channel(0, "weights", how, &[1.0, 3.0], values);
        let scene = loaded(&file.glb(&file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA)));
        assert!(scene.objects[0].dynamic && scene.dropped.is_empty(), "{}", scene.dropped);
        assert_eq!(scene.animation.as_ref().map(|a| a.duration), Some(3.0));
        // At rest as the mesh says.
        assert!(near(scene.mesh.positions()[2], Vec3::new(8.0, 1.0, 14.0)));
        let third = shape_at(&scene, time).0[2];
        [third.z / 2.0, third.x - 1.0]
    };
    let close = |a: [f32; 2], b: [f32; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    // Two keys of two weights: (0, 1), then (4, -1).
    let plain = [[0.0], [1.0], [4.0], [-1.0]];
    assert!(close(at("STEP", &plain, 2.9), [0.0, 1.0]));
    assert!(close(at("STEP", &plain, 3.0), [4.0, -1.0]));
    assert!(close(at("LINEAR", &plain, 1.5), [1.0, 0.5]));
    // Key by key the tangents that come in, the weights, the tangents that go out.
    let flat: Vec<[f32; 1]> =
        [9.0, 9.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 4.0, -1.0, 9.0, 9.0].map(|x| [x]).to_vec();
    // 3t² − 2t³ of the way at t = 1/4.
    let part = 0.156_25;
    assert!(close(at("CUBICSPLINE", &flat, 1.5), [4.0 * part, 1.0 - 2.0 * part]));
    // With the slopes of the lines for tangents it is the lines.
    let slopes: Vec<[f32; 1]> =
        [9.0, 9.0, 0.0, 1.0, 2.0, -1.0, 2.0, -1.0, 4.0, -1.0, 9.0, 9.0].map(|x| [x]).to_vec();
    assert!(close(at("CUBICSPLINE", &slopes, 1.5), [1.0, 0.5]));
    for how in ["STEP", "LINEAR"] {
        assert!(
            close(at(how, &plain, 0.0), [0.0, 1.0]) && close(at(how, &plain, 9.0), [4.0, -1.0])
        );
    }
}

#[test]
fn sparse_and_quantised_differences_are_read() {
    let mut file = File::default();
    let sparse = file.sparse(4, &[(2, [0.0, 0.0, 3.0])]);
    let bytes = file.normalized_bytes(&[[127, 0, 0], [0; 3], [-127, 0, 0], [0, 0, 64]]);
    let targets = format!(r#"{{"POSITION":{sparse}}},{{"POSITION":{bytes}}}"#);
    let mesh = square(&mut file, &targets, "");
    file.channel(0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [0.0], [1.0], [2.0]]);
    let json = file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA).replacen(
        r#""asset""#,
        r#""extensionsRequired":["KHR_mesh_quantization"],"asset""#,
        1,
    );
    let scene = loaded(&file.glb(&json));
    assert!(scene.dropped.is_empty(), "{}", scene.dropped);
    let moved = shape_at(&scene, 1.0).0;
    let wanted = [
        Vec3::new(2.0, 0.0, 0.0),
        Vec3::new(1.0, 0.0, 0.0),
        Vec3::new(-1.0, 1.0, 3.0),
        Vec3::new(0.0, 1.0, 2.0 * 64.0 / 127.0),
    ];
    assert!(moved.iter().zip(wanted).all(|(a, b)| near(*a, b)), "{moved:?}");
    // Only what moves takes room.
    let morphed = scene.animation.as_ref().and_then(|a| a.morphed(0)).expect("it morphs");
    assert_eq!(morphed.targets().differences().len(), 4);
}

#[test]
fn morphs_come_before_what_nodes_do() {
    let mut file = File::default();
    let targets = two_targets(&mut file);
    let mesh = square(&mut file, &targets, "");
    file.channel(0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [0.0], [1.0], [0.5]]);
    file.channel(0, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, QUARTER]);
    // Mirrored, and of different scales: normals go by the inverse transpose.
    let node = r#"{"mesh":0,"camera":0,"scale":[-2,1,4],"translation":[5,0,0]}"#;
    let scene = loaded(&file.glb(&file.json(node, &mesh, CAMERA)));
    assert!(near(scene.mesh.positions()[1], Vec3::new(3.0, 0.0, 0.0)));
    for w in [0.0, 0.5, 1.0_f32] {
        let time = f64::from(w);
        let (positions, normals) = shape_at(&scene, time);
        let turn = Quat::from_rotation_z(w * std::f32::consts::FRAC_PI_2);
        let scale = Vec3::new(-2.0, 1.0, 4.0);
        let place = |p: Vec3| Vec3::new(5.0, 0.0, 0.0) + turn * (scale * p);
        let third = Vec3::new(1.0 + 0.5 * w, 1.0, 2.0 * w);
        assert!(near(positions[2], place(third)), "{time}: {}", positions[2]);
        let normal = (turn * (Vec3::new(0.5 * w, 0.0, 1.0) / scale)).normalize();
        assert!(near(normals[0], normal), "{time}: {} {normal}", normals[0]);
    }
    let frozen = scene.frozen(0.5).expect("finite");
    assert_eq!(frozen.mesh.positions(), shape_at(&scene, 0.5).0);
}

#[test]
fn morphs_come_before_what_joints_do() {
    let mut file = File::default();
    let targets = two_targets(&mut file);
    let mesh = square(&mut file, &targets, "");
    let joints = file.shorts(&[[0_u16, 0, 0, 0]; 4]);
    let weights = file.floats(&[[1.0_f32, 0.0, 0.0, 0.0]; 4]);
    let mesh = mesh.replacen(
        "\"POSITION\"",
        &format!("\"JOINTS_0\":{joints},\"WEIGHTS_0\":{weights},\"POSITION\""),
        1,
    );
    file.channel(0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [0.0], [1.0], [1.0]]);
    // The mesh's own place must not matter, but that of its joint.
    let nodes = r#"{"mesh":0,"skin":0,"camera":0,"children":[1],"translation":[7,7,7]},
        {"translation":[0,0,-7],"scale":[-1,1,1]}"#;
    let skins = format!(r#","skins":[{{"joints":[1]}}]{CAMERA}"#);
    let still = loaded(&file.glb(&file.json(nodes, &mesh, &skins)));
    file.channel(1, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, QUARTER]);
    let turning = loaded(&file.glb(&file.json(nodes, &mesh, &skins)));
    for (scene, turns) in [(&still, 0.0), (&turning, 1.0)] {
        assert!(scene.objects[0].dynamic && scene.dropped.is_empty(), "{}", scene.dropped);
        for w in [0.0, 0.25, 1.0_f32] {
            let time = f64::from(w);
            let (positions, normals) = shape_at(scene, time);
            let turn = Quat::from_rotation_z(turns * w * std::f32::consts::FRAC_PI_2);
            let bent = |p: Vec3| Vec3::new(7.0, 7.0, 0.0) + turn * (p * Vec3::new(-1.0, 1.0, 1.0));
            for (k, corner) in CORNERS.into_iter().enumerate() {
                let side = if k == 1 || k == 2 { w } else { -w };
                let lift = if k == 2 { 2.0 * w } else { 0.0 };
                let wanted = bent(Vec3::from(corner) + Vec3::new(side, 0.0, lift));
                assert!(near(positions[k], wanted), "{k} at {time}: {} {wanted}", positions[k]);
            }
            let normal = turn * Vec3::new(-w, 0.0, 1.0).normalize();
            assert!(near(normals[0], normal), "{time}: {} {normal}", normals[0]);
            // Triangles keep their front.
            let frozen = scene.frozen(time).expect("finite");
            let t = frozen.mesh.triangle(0);
            let front = (t.v1 - t.v0).cross(t.v2 - t.v0);
            assert!(front.dot(frozen.normals[0]) > 0.0);
        }
    }
}

#[test]
fn meshes_without_normals_keep_those_of_their_triangles() {
    for (scale, sign) in [("[1,1,1]", 1.0), ("[-1,1,1]", 1.0), ("[1,-1,3]", 1.0_f32)] {
        let mut file = File::default();
        let lift = file.floats(&[[0.0; 3], [0.0; 3], [0.0, 0.0, 2.0], [0.0; 3]]);
        let smooth = file.square();
        let bare = square(&mut file, &format!(r#"{{"POSITION":{lift}}}"#), "");
        let cut = bare.find(r#","NORMAL":"#).expect("a normal");
        let end = cut + bare[cut..].find('}').expect("the end of the attributes");
        let bare = format!("{}{}", &bare[..cut], &bare[end..]);
        file.channel(1, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [1.0]]);
        let nodes =
            format!(r#"{{"mesh":0,"camera":0,"children":[1]}},{{"mesh":1,"scale":{scale}}}"#);
        let scene = loaded(&file.glb(&file.json(&nodes, &format!("{smooth},{bare}"), CAMERA)));
        assert_eq!(scene.objects[1].vertices.len(), 6, "its triangles share no vertices");
        for time in [0.0, 0.3, 1.0] {
            let frozen = scene.frozen(time).expect("finite");
            for t in 2..4 {
                let triangle = frozen.mesh.triangle(t);
                let front = (triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0);
                for i in frozen.mesh.indices()[t] {
                    let normal = frozen.normals[i as usize];
                    assert!(near(front.normalize() * sign, normal), "{scale} {time} {t}: {normal}");
                }
            }
            let _ = shape_at(&scene, time);
        }
    }
}

#[test]
fn broken_targets_name_mesh_and_primitive() {
    let refused = |file: &File, json: &str| {
        let folder = Folder::new();
        load(&folder.file("broken.glb", file.glb(json))).expect_err("the file is broken")
    };
    let base = || {
        let mut file = File::default();
        let targets = two_targets(&mut file);
        let mesh = square(&mut file, &targets, r#","weights":[0,1]"#);
        file.channel(0, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [0.0], [1.0], [0.5]]);
        let json = file.json(r#"{"mesh":0,"weights":[1,0]}"#, &mesh, "");
        (file, json)
    };
    let (file, json) = base();
    drop(load(&Folder::new().file("good.glb", file.glb(&json))).expect("it is good"));
    let cases: [(&str, &str, &str, &str); 11] = [
        (r#""weights":[0,1]"#, r#""weights":[0]"#, "meshes[0].weights", "1 weights for the 2"),
        (r#""weights":[1,0]"#, r#""weights":[1,0,0]"#, "nodes[0].weights", "meshes[0]"),
        (r#"{"mesh":0,"#, "{", "nodes[0]", "has no mesh"),
        (r#"{"POSITION":0},"#, "", "meshes[0].weights", "2 weights for the 1"),
        (
            r#"{"POSITION":0}"#,
            r#"{"POSITION":90}"#,
            "meshes[0].primitives[0].targets[0].POSITION",
            "accessors[90]",
        ),
        (
            r#"{"POSITION":0}"#,
            r#"{"POSITION":5}"#,
            "meshes[0].primitives[0].targets[0].POSITION",
            "6 elements for 4",
        ),
        (
            r#""NORMAL":2}],"#,
            r#""NORMAL":6}],"#,
            "meshes[0].primitives[0].targets[1].NORMAL",
            "2 elements for 4",
        ),
        (r#""target":{"node":0"#, r#""target":{"node":7"#, "channels[0].target.node", "nodes[7]"),
        (r#""output":7"#, r#""output":6"#, "samplers[0].output", "4 values, but there are 2"),
        (r#""output":7"#, r#""output":0"#, "samplers[0].output", "not vectors of 1"),
        ("\"LINEAR\"", "\"CUBICSPLINE\"", "samplers[0].output", "12 values"),
    ];
    for (from, to, place, reason) in cases {
        let (file, json) = base();
        assert!(json.contains(from), "{from} is not in {json}");
        let error = refused(&file, &json.replacen(from, to, 1)).to_string();
        assert!(error.contains(place) && error.contains(reason), "{to}: {error}");
        assert!(error.contains("broken.glb"), "{error}");
    }
    // What no f32 holds: parsers that read all digits refuse it themselves, and name the line.
    for (from, to, place) in [
        (r#""weights":[0,1]"#, r#""weights":[0,1e39]"#, "meshes[0].weights"),
        (r#""weights":[1,0]"#, r#""weights":[1,-1e39]"#, "nodes[0].weights"),
    ] {
        let (file, json) = base();
        let error = refused(&file, &json.replacen(from, to, 1)).to_string();
        let is_named = error.contains(place) && error.contains("inf");
        assert!(is_named || error.contains("number out of range"), "{to}: {error}");
    }
    // Primitives that differ.
    let (file, json) = base();
    let end = json.find(r#""indices":5}"#).expect("the primitive") + r#""indices":5}"#.len();
    let other = format!(
        r#"{},{{"attributes":{{"POSITION":3}},"targets":[{{"POSITION":0}}]}}{}"#,
        &json[..end],
        &json[end..]
    );
    let error = refused(&file, &other).to_string();
    assert!(
        error.contains("meshes[0].primitives[1].targets") && error.contains("has 1"),
        "{error}"
    );
    // Weights that move what has no targets, twice the same, and what is no number.
    let still = |change: &dyn Fn(&mut File)| {
        let mut file = File::default();
        let targets = two_targets(&mut file);
        let mesh = square(&mut file, &targets, "");
        let bare = file.square();
        change(&mut file);
        let nodes = r#"{"mesh":0,"children":[1,2]},{"mesh":1},{}"#;
        let json = file.json(nodes, &format!("{mesh},{bare}"), "");
        refused(&file, &json).to_string()
    };
    let keys = |file: &mut File, node: usize, last: f32| {
        file.channel(node, "weights", "LINEAR", &[0.0, 1.0], &[[0.0], [0.0], [1.0], [last]]);
    };
    let error = still(&|file| keys(file, 1, 0.0));
    assert!(error.contains("meshes[1].primitives[0] has no morph targets"), "{error}");
    let error = still(&|file| keys(file, 2, 0.0));
    assert!(error.contains("nodes[2] has no mesh"), "{error}");
    let error = still(&|file| keys(file, 0, f32::NAN));
    assert!(error.contains("samplers[0].output") && error.contains("key 1 is [NaN]"), "{error}");
    let error = still(&|file| {
        keys(file, 0, 0.0);
        keys(file, 0, 1.0);
    });
    assert!(error.contains("channels[1]") && error.contains("nodes[0] has keys"), "{error}");
}

#[test]
fn differences_that_are_not_finite_are_counted_and_count_as_none() {
    let mut file = File::default();
    let broken =
        file.floats(&[[0.0, 0.0, 1.0], [f32::NAN, 0.0, 0.0], [f32::INFINITY; 3], [0.0; 3]]);
    let mesh = square(&mut file, &format!(r#"{{"POSITION":{broken}}}"#), r#","weights":[1]"#);
    let scene = loaded(&file.glb(&file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA)));
    assert_eq!((scene.dropped.attributes, scene.dropped.triangles()), (1, 0));
    let text = scene.dropped.to_string();
    assert!(text.contains("meshes[0].primitives[0].targets[0]: 2 diff"), "{text}");
    assert!(
        near(scene.mesh.positions()[0], Vec3::Z)
            && near(scene.mesh.positions()[2], Vec3::new(1.0, 1.0, 0.0))
    );
}

#[test]
fn counts_that_no_bytes_stand_for_take_no_memory() {
    // A thousand targets without bytes of four billion elements, or of as many as there are vertices.
    for (count, is_good) in [(4_000_000_000_u32, false), (4, true)] {
        let mut file = File::default();
        let sparse = file.sparse(4, &[(1, [1.0, 0.0, 0.0])]);
        let target = format!(r#"{{"POSITION":{sparse}}}"#);
        let mesh = square(&mut file, &vec![target; 1000].join(","), "");
        let json = file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA).replace(
            r#""count":4,"type":"VEC3","sparse""#,
            &format!(r#""count":{count},"type":"VEC3","sparse""#),
        );
        let folder = Folder::new();
        let loaded = load(&folder.file("a.glb", file.glb(&json)));
        match loaded {
            Ok(scene) => assert!(is_good && scene.dropped.is_empty()),
            Err(error) => {
                assert!(!is_good && error.to_string().contains("4000000000 elements"), "{error}");
            }
        }
    }
}

#[test]
fn limits_hold_for_targets_that_are_asked_for_again_and_again() {
    let mut file = File::default();
    let lift = file.floats(&[[0.0, 0.0, 1.0]; 4]);
    let targets = vec![format!(r#"{{"POSITION":{lift}}}"#); 500].join(",");
    let mesh = square(&mut file, &targets, "");
    file.channel(0, "weights", "STEP", &[0.0], &[[0.0]; 500]);
    let folder = Folder::new();
    let json = file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA);
    let path = folder.file("often.glb", file.glb(&json));
    let with = |max_bytes: u64| LoadOptions { max_bytes, ..LoadOptions::default() };
    // 500 targets of 4 vertices, 36 bytes each.
    drop(niwaki_scene::load(&path, &with(1 << 17)).expect("it fits"));
    let error = niwaki_scene::load(&path, &with(70_000)).expect_err("too much");
    assert!(matches!(error, LoadError::TooLarge { what: "its morph targets", .. }), "{error}");
    // The same mesh at a hundred nodes.
    let children: Vec<String> = (1..=100).map(|i| i.to_string()).collect();
    let node = format!(r#"{{"camera":0,"children":[{}]}}"#, children.join(","));
    let zeros = vec!["1"; 500].join(",");
    let nodes = vec![format!(r#"{{"mesh":0,"weights":[{zeros}]}}"#); 100].join(",");
    let mut still = File::default();
    let lift = still.floats(&[[0.0, 0.0, 1.0]; 4]);
    let targets = vec![format!(r#"{{"POSITION":{lift}}}"#); 500].join(",");
    let mesh = square(&mut still, &targets, "");
    let path =
        folder.file("many.glb", still.glb(&still.json(&format!("{node},{nodes}"), &mesh, CAMERA)));
    let error = niwaki_scene::load(&path, &with(1 << 18)).expect_err("too much");
    let is_named = matches!(error, LoadError::TooLarge { option: "max_bytes", .. });
    assert!(is_named && error.to_string().contains("every node"), "{error}");
}

#[test]
fn primitives_that_share_their_vertices_keep_their_own_differences() {
    let mut file = File::default();
    let targets = two_targets(&mut file);
    let mesh = square(&mut file, &targets, r#","weights":[1,0]"#);
    // Two primitives of the same vertices, a triangle each; the second without vertex 1.
    let first = file.shorts(&[[0], [1], [2]]);
    let second = file.shorts(&[[0], [2], [3]]);
    let cut = mesh.find(r#""indices":"#).expect("indices");
    let end = cut + mesh[cut..].find('}').expect("the end of the primitive");
    let start = mesh.find(r#"{"attributes""#).expect("a primitive");
    let primitive = |indices: usize| format!(r#"{}"indices":{indices}}}"#, &mesh[start..cut]);
    let mesh =
        format!("{}{},{}{}", &mesh[..start], primitive(first), primitive(second), &mesh[end + 1..]);
    let scene = loaded(&file.glb(&file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA)));
    let corner = Vec3::new(1.0, 1.0, 2.0);
    let at = |t: usize, k: usize| scene.mesh.positions()[scene.mesh.indices()[t][k] as usize];
    assert!(near(at(0, 2), corner) && near(at(1, 1), corner), "{:?}", scene.mesh.positions());
    assert!(near(at(1, 2), Vec3::Y) && scene.mesh.positions().len() == 6);
}

#[test]
fn hand_made_targets_are_checked() {
    let difference =
        |target, x| Difference { position: Vec3::splat(x), target, ..Difference::default() };
    let broken = |found: &[(u32, Difference)]| Targets::new(2, 3, found).expect_err("broken");
    assert!(matches!(broken(&[(3, difference(0, 1.0))]), MorphError::Range { vertex: 3, .. }));
    assert!(matches!(broken(&[(0, difference(2, 1.0))]), MorphError::Range { target: 2, .. }));
    let nan = broken(&[(1, difference(1, f32::NAN))]);
    assert_eq!(nan, MorphError::NotFinite { vertex: 1, target: 1 });
    let targets = Targets::new(2, 3, &[(1, difference(1, 2.0))]).expect("good");
    for (weights, vertices, normals) in [(0..1, 3, 0), (0..2, 2, 0), (0..2, 3, 1)] {
        let (positions, normals) = (vec![Vec3::ZERO; vertices], vec![Vec3::Y; normals]);
        let error = Morphed::new(weights, positions, normals, targets.clone()).expect_err("broken");
        assert!(matches!(error, MorphError::Count { .. }), "{error}");
    }
    // A scene put together with fewer weights than targets.
    let mut file = File::default();
    let two = two_targets(&mut file);
    let mesh = square(&mut file, &two, "");
    file.channel(0, "weights", "STEP", &[0.0], &[[0.0], [1.0]]);
    let folder = Folder::new();
    let path = folder.file("a.glb", file.glb(&file.json(r#"{"mesh":0}"#, &mesh, "")));
    let mut scene = load_instanced(&path, &LoadOptions::default()).expect("good");
    let track = scene.rig.weights[0].track.clone();
    scene.rig.weights[0] = MorphWeights { rest: vec![1.0], track };
    let error = scene.flatten(&LoadOptions::default()).expect_err("one weight for two targets");
    assert!(matches!(error, FlattenError::Morph { .. }), "{error}");
}

fn vectors() -> impl Strategy<Value = Vec<[f32; 3]>> {
    prop::collection::vec([-3.0..3.0_f32, -3.0..3.0_f32, -3.0..3.0_f32], 4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Any targets, dense or sparse, at any weights add up vertex by vertex.
    #[test]
    fn shapes_are_sums(
        targets in prop::collection::vec((vectors(), vectors(), any::<bool>()), 1..5),
        from in prop::collection::vec(-2.0..2.0_f32, 5),
        to in prop::collection::vec(-2.0..2.0_f32, 5),
        t in 0.0..1.0_f32,
    ) {
        let mut file = File::default();
        let texts: Vec<String> = targets.iter().map(|(positions, normals, is_sparse)| {
            let of: Vec<(u16, [f32; 3])> = (0..4_u16).zip(positions.iter().copied()).collect();
            let p = if *is_sparse { file.sparse(4, &of) } else { file.floats(positions) };
            let n = file.floats(normals);
            format!(r#"{{"POSITION":{p},"NORMAL":{n}}}"#)
        }).collect();
        let mesh = square(&mut file, &texts.join(","), "");
        let n = targets.len();
        let keys: Vec<[f32; 1]> = from[..n].iter().chain(&to[..n]).map(|w| [*w]).collect();
        file.channel(0, "weights", "LINEAR", &[0.0, 1.0], &keys);
        let scene = loaded(&file.glb(&file.json(r#"{"mesh":0,"camera":0}"#, &mesh, CAMERA)));
        let (positions, normals) = shape_at(&scene, f64::from(t));
        for v in 0..4 {
            let mut p = Vec3::from(CORNERS[v]);
            let mut normal = Vec3::Z;
            for (k, (of_position, of_normal, _)) in targets.iter().enumerate() {
                let w = from[k] + (to[k] - from[k]) * t;
                p += Vec3::from(of_position[v]) * w;
                normal += Vec3::from(of_normal[v]) * w;
            }
            prop_assert!(positions[v].distance(p) < 1e-4, "{} {}", positions[v], p);
            if normal.length() > 1e-2 {
                prop_assert!(normals[v].distance(normal.normalize()) < 1e-3);
            }
        }
        // What a rig without weights says.
        prop_assert!(Rig::default().weights_at(Some(f64::from(t))).is_empty());
    }
}
