//! Key frames and skins of glTF files: where vertices are, and how what is broken is named.

mod common;

use common::{
    Folder,
    animated::{File, NO_TURN, QUARTER, loaded, near, shape_at},
    load,
};
use niwaki_core::glam::{Affine3A, DAffine3, DQuat, DVec3, Quat, Vec3};
use niwaki_scene::{LoadError, LoadOptions, Scene};
use proptest::prelude::*;

fn refused(bytes: &[u8]) -> LoadError {
    let folder = Folder::new();
    load(&folder.file("broken.glb", bytes)).expect_err("the file is broken")
}

fn positions_at(scene: &Scene, time: f64) -> Vec<Vec3> {
    shape_at(scene, time).0
}

#[test]
fn nodes_carry_what_hangs_on_them() {
    let mut file = File::default();
    let mesh = file.square();
    file.channel(0, "translation", "LINEAR", &[1.0, 3.0], &[[0.0, 0.0, 0.0], [0.0, 8.0, 0.0]]);
    file.channel(1, "rotation", "LINEAR", &[0.0, 4.0], &[NO_TURN, QUARTER]);
    // The first rests elsewhere than its keys say; between the two lies one that does not move.
    let nodes = r#"{"children":[2,4],"translation":[5,5,5]},
        {"children":[3]},{"children":[1],"translation":[10,0,0]},{"mesh":0,"scale":[2,2,2]},
        {"mesh":0,"translation":[0,0,-1]}"#;
    let scene = loaded(&file.glb(&file.json(nodes, &mesh, "")));
    assert!(scene.dropped.is_empty(), "{}", scene.dropped);
    assert_eq!(scene.objects.len(), 2);
    assert!(scene.objects.iter().all(|o| o.dynamic));
    assert_eq!(scene.animation.as_ref().map(|a| a.duration), Some(4.0));
    // At rest it stands as the file says.
    assert!(near(scene.mesh.positions()[2], Vec3::new(17.0, 7.0, 5.0)));
    for (time, height, angle) in
        [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.25), (2.0, 4.0, 0.5), (4.0, 8.0, 1.0), (9.0, 8.0, 1.0_f32)]
    {
        let positions = positions_at(&scene, time);
        let turn = Quat::from_rotation_z(angle * std::f32::consts::FRAC_PI_2);
        let corner = Vec3::new(10.0, height, 0.0) + turn * Vec3::new(2.0, 2.0, 0.0);
        assert!(near(positions[2], corner), "{time}: {} {corner}", positions[2]);
        assert!(near(positions[6], Vec3::new(1.0, 1.0 + height, -1.0)), "{time}");
    }
    // A time that is no number is the beginning.
    assert_eq!(positions_at(&scene, f64::NAN), positions_at(&scene, 0.0));
    let frozen = scene.frozen(2.0).expect("finite");
    assert_eq!(frozen.mesh.positions(), positions_at(&scene, 2.0));
}

#[test]
fn every_interpolation_is_that_of_the_specification() {
    let at = |how: &str, values: &[[f32; 3]], time: f64| {
        let mut file = File::default();
        let mesh = file.square();
        file.channel(0, "translation", how, &[1.0, 3.0], values);
        positions_at(&loaded(&file.glb(&file.json(r#"{"mesh":0}"#, &mesh, ""))), time)[0]
    };
    let [a, b] = [[0.0, 1.0, 0.0], [4.0, 1.0, 0.0]];
    assert!(near(at("STEP", &[a, b], 2.9), a.into()));
    assert!(near(at("STEP", &[a, b], 3.0), b.into()));
    assert!(near(at("LINEAR", &[a, b], 1.5), Vec3::new(1.0, 1.0, 0.0)));
    // In-tangent, value, out-tangent; the outer tangents must not matter.
    let flat = [[9.0; 3], a, [0.0; 3], [0.0; 3], b, [9.0; 3]];
    // 3t² − 2t³ of the way at t = 1/4.
    assert!(near(at("CUBICSPLINE", &flat, 1.5), Vec3::new(4.0 * 0.156_25, 1.0, 0.0)));
    // With the slope of the line for tangents it is the line.
    let slope = [2.0, 0.0, 0.0];
    let straight = [[9.0; 3], a, slope, slope, b, [9.0; 3]];
    assert!(near(at("CUBICSPLINE", &straight, 1.5), Vec3::new(1.0, 1.0, 0.0)));
    for (time, end) in [(0.0, a), (1.0, a), (3.0, b), (7.0, b)] {
        assert!(near(at("CUBICSPLINE", &flat, time), end.into()));
    }
}

#[test]
fn rotations_take_the_short_way_and_need_not_be_of_unit_length() {
    let mut file = File::default();
    let mesh = file.square();
    // The same rotation as QUARTER, the long way round, and 3 long.
    let keys = [NO_TURN, QUARTER.map(|x| -3.0 * x)];
    file.channel(0, "rotation", "LINEAR", &[0.0, 1.0], &keys);
    let scene = loaded(&file.glb(&file.json(r#"{"mesh":0}"#, &mesh, "")));
    let eighth = Quat::from_rotation_z(std::f32::consts::FRAC_PI_4) * Vec3::X;
    assert!(near(positions_at(&scene, 0.5)[1], eighth));
    assert!(near(positions_at(&scene, 1.0)[1], Vec3::Y));
}

#[test]
fn what_grows_from_nothing_grows_to_its_full_size() {
    for rest in ["[0,0,0]", "[0.001,0.001,0.001]", "[1,1,1]"] {
        let mut file = File::default();
        let mesh = file.square();
        file.channel(0, "scale", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [3.0; 3]]);
        let node = format!(r#"{{"mesh":0,"scale":{rest},"translation":[1000,0,0]}}"#);
        let scene = loaded(&file.glb(&file.json(&node, &mesh, "")));
        assert!(scene.objects[0].dynamic && scene.dropped.is_empty(), "{rest}");
        let grown = positions_at(&scene, 1.0)[2];
        assert!(grown.distance(Vec3::new(1003.0, 3.0, 0.0)) < 1e-3, "{rest}: {grown}");
        assert!(near(positions_at(&scene, 0.0)[2], Vec3::new(1000.0, 0.0, 0.0)), "{rest}");
    }
    // Never of any size: it rests, and is counted.
    let mut file = File::default();
    let mesh = file.square();
    file.channel(0, "scale", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0, 1.0, 0.0]]);
    let scene = loaded(&file.glb(&file.json(r#"{"mesh":0,"scale":[0,0,0]}"#, &mesh, "")));
    assert_eq!((scene.dropped.animations, scene.objects[0].dynamic), (1, false));
    assert!(scene.animation.is_none() && scene.dropped.to_string().contains("flat"));
}

/// A strip of three squares along X that hangs on two joints, the second at x = 1: the vertices at
/// x = 0 on the first, those at x = 1 on both, the others on the second.
fn strip(file: &mut File) -> (String, String) {
    let points: Vec<[f32; 3]> =
        (0..4_u8).flat_map(|x| [[f32::from(x), 0.0, 0.0], [f32::from(x), 1.0, 0.0]]).collect();
    let positions = file.floats(&points);
    let normals = file.floats(&[[0.0, 0.0, 1.0]; 8]);
    // Joint 7, which does not exist, has no weight.
    let joints: Vec<[u16; 4]> = (0..8)
        .map(|i| match i / 2 {
            0 => [0, 7, 7, 7],
            1 => [0, 1, 7, 7],
            _ => [1, 7, 7, 7],
        })
        .collect();
    let weights: Vec<[f32; 4]> = (0..8)
        .map(|i| if i / 2 == 1 { [0.5, 0.5, 0.0, 0.0] } else { [2.0, 0.0, 0.0, 0.0] })
        .collect();
    let (joints, weights) = (file.shorts(&joints), file.floats(&weights));
    let indices: Vec<[u16; 1]> =
        (0..3).flat_map(|s| [0, 2, 3, 0, 3, 1].map(|i| [2 * s + i])).collect();
    let indices = file.shorts(&indices);
    // Where the joints were when the strip was bound: at the origin, and at x = 1.
    let mut bind = [[0.0; 16]; 2];
    for matrix in &mut bind {
        for k in 0..4 {
            matrix[5 * k] = 1.0;
        }
    }
    bind[1][12] = -1.0;
    let bind = file.floats(&bind);
    let mesh = format!(
        r#"{{"primitives":[{{"attributes":{{"POSITION":{positions},"NORMAL":{normals},
        "JOINTS_0":{joints},"WEIGHTS_0":{weights}}},"indices":{indices}}}]}}"#
    );
    (mesh, format!(r#","skins":[{{"joints":[1,2],"inverseBindMatrices":{bind}}}]"#))
}

/// The strip's node, whose transform must not matter, and its joints one below the other.
const BONES: &str = r#"{"children":[1,3],"translation":[0,0,2]},{"children":[2]},
    {"translation":[1,0,0]},{"mesh":0,"skin":0,"translation":[77,0,0],"scale":[5,1,-1]}"#;

#[test]
fn joints_bend_what_hangs_on_them() {
    let mut file = File::default();
    let (mesh, skins) = strip(&mut file);
    file.channel(2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, QUARTER]);
    let scene = loaded(&file.glb(&file.json(BONES, &mesh, &skins)));
    assert_eq!((scene.objects.len(), scene.objects[0].dynamic), (1, true));
    let rest: Vec<Vec3> = scene.mesh.positions().to_vec();
    for (i, p) in rest.iter().enumerate() {
        let at = Vec3::new((i / 2) as f32, (i % 2) as f32, 2.0);
        assert!(near(*p, at), "{i}: {p}");
    }
    assert_eq!(positions_at(&scene, 0.0), rest);
    for (time, angle) in [(0.5, 0.5_f32), (1.0, 1.0)] {
        let joint = Affine3A::from_translation(Vec3::new(1.0, 0.0, 2.0))
            * Affine3A::from_rotation_z(angle * std::f32::consts::FRAC_PI_2)
            * Affine3A::from_translation(Vec3::NEG_X);
        for (i, got) in positions_at(&scene, time).into_iter().enumerate() {
            let bound = Vec3::new((i / 2) as f32, (i % 2) as f32, 0.0);
            let still = bound + 2.0 * Vec3::Z;
            let turned = joint.transform_point3(bound);
            let wanted = match i / 2 {
                0 => still,
                1 => (still + turned) / 2.0,
                _ => turned,
            };
            assert!(near(got, wanted), "{i} at {time}: {got} {wanted}");
        }
    }
    // Weights of 2, and joints that do not exist without weight, are put right without a word.
    assert!(scene.dropped.is_empty(), "{}", scene.dropped);
}

#[test]
fn a_skin_that_does_not_move_is_where_its_joints_rest() {
    let mut file = File::default();
    let (mesh, skins) = strip(&mut file);
    let scene = loaded(&file.glb(&file.json(BONES, &mesh, &skins)));
    assert!(scene.animation.is_none() && !scene.objects[0].dynamic);
    assert!(near(scene.mesh.positions()[7], Vec3::new(3.0, 1.0, 2.0)));
    // A mesh that hangs on joints, at a node without a skin, stands where the node is.
    let nodes = r#"{"mesh":0,"translation":[0,4,0]}"#;
    let scene = loaded(&file.glb(&file.json(nodes, &mesh, "")));
    assert!(near(scene.mesh.positions()[7], Vec3::new(3.0, 5.0, 0.0)));
}

#[test]
fn mirrored_skins_keep_their_front() {
    let mut file = File::default();
    let (mesh, skins) = strip(&mut file);
    file.channel(2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, QUARTER]);
    let bones = BONES.replacen(r#""translation":[0,0,2]"#, r#""scale":[-1,1,1]"#, 1);
    let scene = loaded(&file.glb(&file.json(&bones, &mesh, &skins)));
    for time in [0.0, 0.4, 0.8] {
        let frozen = scene.frozen(time).expect("finite");
        for (triangle, [i, ..]) in frozen.mesh.triangles().zip(frozen.mesh.indices()) {
            let front = (triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0);
            assert!(front.dot(frozen.normals[*i as usize]) > 0.0, "{time}: {triangle:?}");
            assert!(front.z > 0.0);
        }
    }
}

#[test]
fn the_four_largest_of_eight_weights_count() {
    let mut file = File::default();
    let (mesh, skins) = strip(&mut file);
    let joints = file.shorts(&[[1, 1, 1, 1]; 8]);
    let weights = file.floats(&[[10.0, 10.0, 10.0, 10.0]; 8]);
    let mesh = mesh.replace(
        "\"WEIGHTS_0\"",
        &format!("\"JOINTS_1\":{joints},\"WEIGHTS_1\":{weights},\"WEIGHTS_0\""),
    );
    file.channel(2, "translation", "STEP", &[0.0], &[[1.0, 9.0, 0.0]]);
    let scene = loaded(&file.glb(&file.json(BONES, &mesh, &skins)));
    let moved = positions_at(&scene, 0.0);
    assert!(near(moved[0], Vec3::new(0.0, 9.0, 2.0)), "{}", moved[0]);
}

#[test]
fn which_animation_moves_the_scene_can_be_chosen() {
    let mut file = File::default();
    let mesh = file.square();
    file.channel(0, "translation", "STEP", &[0.0], &[[1.0, 0.0, 0.0]]);
    file.channel(0, "translation", "STEP", &[0.0], &[[2.0, 0.0, 0.0]]);
    // Two channels for the same value: an animation each.
    let json = file.json(r#"{"mesh":0}"#, &mesh, "");
    let both = json.find("\"channels\":[").expect("channels") + "\"channels\":[".len();
    let (head, tail) = json.split_at(both);
    let (first, rest) = tail.split_once("}},").expect("two channels");
    let samplers = json.split_once("\"samplers\":[").expect("samplers").1;
    let samplers = samplers.split_once(']').expect("samplers end").0;
    let json = format!(
        "{head}{first}}}}}]}},{{\"name\":\"other\",\"samplers\":[{samplers}],\"channels\":[{rest}"
    );
    let folder = Folder::new();
    let path = folder.file("two.glb", file.glb(&json));
    for (animation, x) in [(Some(0), Some(1.0)), (Some(1), Some(2.0)), (None, None)] {
        let options = LoadOptions { animation, ..LoadOptions::default() };
        let scene = niwaki_scene::load(&path, &options).expect("it exists");
        assert_eq!(scene.animation.is_some(), x.is_some());
        assert_eq!(positions_at(&scene, 0.0)[0].x, x.unwrap_or(0.0));
        assert_eq!(x.is_some(), scene.dropped.notes.iter().any(|n| n.contains("move, other")));
        assert!(scene.dropped.is_empty());
    }
    let options = LoadOptions { animation: Some(2), ..LoadOptions::default() };
    let error = niwaki_scene::load(&path, &options).expect_err("there are two").to_string();
    assert!(error.contains("animations[2]") && error.contains("there are 2"), "{error}");
}

#[test]
fn channels_of_unknown_paths_are_counted_and_named() {
    let mut file = File::default();
    let mesh = file.square();
    file.channel(0, "colour", "LINEAR", &[0.0, 1.0], &[[0.0], [1.0]]);
    file.channel(0, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [1.0; 3]]);
    let scene = loaded(&file.glb(&file.json(r#"{"mesh":0}"#, &mesh, "")));
    assert_eq!(scene.dropped.animations, 1);
    assert!(scene.dropped.to_string().contains("animations[0].channels[0]"), "{}", scene.dropped);
    assert!(near(positions_at(&scene, 1.0)[0], Vec3::ONE));
}

#[test]
fn broken_motion_names_the_place() {
    let case = |change: &dyn Fn(&mut File), nodes: &str| {
        let mut file = File::default();
        let (mesh, skins) = strip(&mut file);
        change(&mut file);
        let json = file.json(nodes, &mesh, &skins);
        (file, json)
    };
    let still = |_: &mut File| {};
    let turn = |file: &mut File| {
        file.channel(2, "rotation", "LINEAR", &[0.0, 1.0], &[NO_TURN, QUARTER]);
    };
    let keys = |times: &'static [f32], values: &'static [[f32; 3]]| {
        move |file: &mut File| file.channel(0, "translation", "LINEAR", times, values)
    };
    let nan = f32::NAN;
    let mut cases = vec![
        (case(&keys(&[0.0, 2.0, 1.0], &[[0.0; 3]; 3]), BONES), "samplers[0].input", "key 2"),
        (case(&keys(&[0.0, f32::NAN], &[[0.0; 3]; 2]), BONES), "samplers[0].input", "key 1"),
        (case(&keys(&[], &[]), BONES), "samplers[0].input", "no keys"),
        (case(&keys(&[0.0, 1.0], &[[0.0; 3]; 3]), BONES), "samplers[0].output", "2 values"),
        (
            case(&keys(&[0.0, 1.0], &[[0.0; 3], [0.0, f32::INFINITY, 0.0]]), BONES),
            "samplers[0].output",
            "key 1",
        ),
        (
            case(&|f| f.channel(2, "rotation", "LINEAR", &[0.0], &[[0.0; 4]]), BONES),
            "samplers[0].output",
            "rotation",
        ),
        (
            case(&|f| f.channel(2, "scale", "CUBICSPLINE", &[0.0], &[[1.0; 3]]), BONES),
            "samplers[0].output",
            "3 values",
        ),
        (
            case(&|f| f.channel(2, "rotation", "LINEAR", &[0.0], &[[0.0; 3]]), BONES),
            "samplers[0].output",
            "vectors of 4",
        ),
        (
            case(&|f| f.channel(2, "scale", "SMOOTH", &[0.0], &[[1.0; 3]]), BONES),
            "samplers[0].interpolation",
            "LINEAR",
        ),
        (
            case(&|f| f.channel(9, "scale", "LINEAR", &[0.0], &[[1.0; 3]]), BONES),
            "channels[0].target.node",
            "nodes[9]",
        ),
        (
            case(
                &|f| {
                    f.channel(1, "scale", "LINEAR", &[0.0], &[[1.0; 3]]);
                    f.channel(1, "scale", "LINEAR", &[0.0], &[[2.0; 3]]);
                },
                BONES,
            ),
            "channels[1]",
            "nodes[1]",
        ),
        (
            case(
                &turn,
                &BONES.replace(
                    r#""translation":[1,0,0]"#,
                    r#""matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]"#,
                ),
            ),
            "nodes[2]",
            "matrix",
        ),
        (case(&still, &BONES.replace(r#""skin":0"#, r#""skin":4"#)), "skins[4]", "does not exist"),
    ];
    let with = |from: &str, to: &str| {
        let (file, json) = case(&turn, BONES);
        assert!(json.contains(from), "{from}");
        let json = json.replace(from, to);
        (file, json)
    };
    cases.extend([
        (with(r#""joints":[1,2]"#, r#""joints":[1,20]"#), "skins[0].joints[1]", "nodes[20]"),
        (with(r#""joints":[1,2]"#, r#""joints":[1,2,0]"#), "inverseBindMatrices", "2 matrices"),
        (with(r#""joints":[1,2]"#, r#""joints":[1]"#), "meshes[0].primitives[0]", "joint 1"),
        (with(r#""children":[1,3]"#, r#""children":[3]"#), "skins[0].joints[0]", "not part"),
        (with(r#""inverseBindMatrices":"#, r#""inverseBindMatrices":9"#), "accessors[9", "exist"),
        (with(r#""sampler":0"#, r#""sampler":3"#), "channels[0].sampler", "samplers[3]"),
        (with(r#""input":6"#, r#""input":66"#), "samplers[0].input", "accessors[66]"),
        (with(r#""WEIGHTS_0":3"#, r#""WEIGHTS_1":3"#), "attributes", "JOINTS_0"),
        (with(r#""WEIGHTS_0":3"#, r#""WEIGHTS_0":0"#), "WEIGHTS_0", "vectors of 4"),
        (with(r#""JOINTS_0":2"#, r#""JOINTS_0":3"#), "JOINTS_0", "F32"),
    ]);
    for ((file, json), place, reason) in cases {
        let error = refused(&file.glb(&json)).to_string();
        assert!(error.contains(place) && error.contains(reason), "{place}, {reason}: {error}");
        assert!(error.contains("broken.glb"), "{error}");
    }
    // Weights that are no numbers are mended and counted.
    let mut file = File::default();
    let (mesh, skins) = strip(&mut file);
    let weights = file.floats(&[[nan, -1.0, 0.0, 0.0]; 8]);
    let mesh = mesh.replace("\"WEIGHTS_0\":3", &format!("\"WEIGHTS_0\":{weights}"));
    turn(&mut file);
    let scene = loaded(&file.glb(&file.json(BONES, &mesh, &skins)));
    assert_eq!(scene.dropped.attributes, 1);
    assert!(scene.dropped.to_string().contains("8 vertices"), "{}", scene.dropped);
}

#[test]
fn limits_hold_for_keys_that_are_asked_for_again_and_again() {
    let mut file = File::default();
    let mesh = file.square();
    let times: Vec<f32> = (0..1000_u16).map(f32::from).collect();
    file.channel(0, "translation", "LINEAR", &times, &vec![[0.0; 3]; 1000]);
    let json = file.json(r#"{"mesh":0}"#, &mesh, "");
    let folder = Folder::new();
    let path = folder.file("keys.glb", file.glb(&json));
    let size = std::fs::metadata(&path).expect("it was written").len();
    let options = LoadOptions { max_bytes: size, ..LoadOptions::default() };
    niwaki_scene::load(&path, &options).expect("it fits");
    // 4 KiB of times and 12 KiB of values in a file of less.
    let twice = |i: usize| format!(r#"{{"children":[{}]}}"#, i + 1);
    let nodes: Vec<String> = (0..40).map(twice).chain([String::from(r#"{"mesh":0}"#)]).collect();
    let channels: Vec<String> = (0..40)
        .map(|n| format!(r#"{{"sampler":0,"target":{{"node":{n},"path":"translation"}}}}"#))
        .collect();
    let json = file.json(&nodes.join(","), &mesh, "");
    let at = json.find("\"channels\":[").expect("channels");
    let end = at + json[at..].find("]}]").expect("the end of the channels");
    let json = format!("{}\"channels\":[{}{}", &json[..at], channels.join(","), &json[end..]);
    let path = folder.file("often.glb", file.glb(&json));
    let size = std::fs::metadata(&path).expect("it was written").len();
    let options = LoadOptions { max_bytes: size, ..LoadOptions::default() };
    let error = niwaki_scene::load(&path, &options).expect_err("too much");
    assert!(matches!(error, LoadError::TooLarge { option: "max_bytes", .. }), "{error}");
}

#[test]
fn a_long_chain_that_moves_overflows_nothing() {
    let n = 200_000;
    let mut file = File::default();
    let mesh = file.square();
    file.channel(0, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [0.0, 0.0, 4.0]]);
    file.channel(n / 2, "translation", "LINEAR", &[0.0, 1.0], &[[0.0; 3], [0.0, 2.0, 0.0]]);
    let mut nodes: String = (1..n).map(|i| format!("{{\"children\":[{i}]}},")).collect();
    nodes.push_str(r#"{"mesh":0}"#);
    let scene = loaded(&file.glb(&file.json(&nodes, &mesh, "")));
    let rig = scene.animation.as_ref().map(|a| a.rig.nodes.len());
    assert_eq!(rig, Some(2), "nodes that do not move are folded into those that do");
    assert!(near(positions_at(&scene, 0.5)[0], Vec3::new(0.0, 1.0, 2.0)));
}

fn vector() -> impl Strategy<Value = [f32; 3]> {
    [-5.0..5.0_f32, -5.0..5.0_f32, -5.0..5.0_f32]
}

fn rotation() -> impl Strategy<Value = [f32; 4]> {
    [-1.0..1.0_f32, -1.0..1.0_f32, -1.0..1.0_f32, 0.2..1.0_f32]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    /// A chain of three nodes is the product of their transforms, whichever of them moves.
    #[test]
    fn chains_are_products(
        moves in prop::collection::vec((vector(), vector(), rotation(), rotation(), 0.5..2.0_f32), 3),
        which in 0..8_u8, t in 0.0..1.0_f64,
    ) {
        let mut file = File::default();
        let mesh = file.square();
        let mut nodes = Vec::new();
        let mut product = DAffine3::IDENTITY;
        let unit = |q: [f32; 4]| DQuat::from_array(q.map(f64::from)).normalize();
        for (i, (from, to, turn, after, scale)) in moves.iter().enumerate() {
            // A camera of its own, since looking for one takes longer than all else.
            let what = if i == 2 { r#""camera":0,"mesh":0"#.into() } else { format!("\"children\":[{}]", i + 1) };
            let q = unit(*turn).as_quat().to_array();
            nodes.push(format!(
                r#"{{{what},"translation":{from:?},"rotation":{q:?},"scale":[{scale},{scale},{scale}]}}"#
            ));
            let start = DVec3::from(from.map(f64::from));
            let (mut at, mut turned) = (start, unit(*turn));
            if which & 1 << i != 0 {
                file.channel(i, "translation", "LINEAR", &[0.0, 1.0], &[*from, *to]);
                file.channel(i, "rotation", "LINEAR", &[0.0, 1.0], &[*turn, *after]);
                at = start.lerp(DVec3::from(to.map(f64::from)), t);
                turned = unit(*turn).slerp(unit(*after), t);
            }
            let scale = DVec3::splat(f64::from(*scale));
            product *= DAffine3::from_scale_rotation_translation(scale, turned, at);
        }
        let camera =
            r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}]"#;
        let scene = loaded(&file.glb(&file.json(&nodes.join(","), &mesh, camera)));
        prop_assert_eq!(scene.objects[0].dynamic, which != 0);
        let wanted = product.transform_point3(DVec3::new(1.0, 1.0, 0.0)).as_vec3();
        let got = positions_at(&scene, t)[2];
        prop_assert!(got.distance(wanted) < 1e-3, "{} {}", got, wanted);
    }
}
