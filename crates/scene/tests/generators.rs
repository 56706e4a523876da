//! The procedural scenes.

use niwaki_core::glam::Vec3;
use niwaki_scene::{
    Scene, automatic_camera, automatic_path,
    generate::{EFFECTS, NAMES, SHAPES, STUDIES, TOURS, describe, generate},
};

fn make(name: &str, triangles: usize, seed: u64) -> Scene {
    generate(name, triangles, seed).expect("the name is in the list")
}

#[test]
fn sizes_keep_to_the_request() {
    for name in NAMES {
        for wanted in [1000, 1777, 5000, 20_000, 100_000, 333_333] {
            let made = make(name, wanted, 3).mesh.len();
            if (*name, wanted) == ("serpents", 1000) {
                // The smallest building with the smallest dragons.
                assert!((1000..1300).contains(&made), "{made}");
                continue;
            }
            let off = (made as f64 / wanted as f64 - 1.0).abs();
            assert!(off <= 0.05, "{name}: {made} for {wanted}");
        }
    }
    assert!(generate("castle", 1000, 1).is_none());
}

#[test]
fn scenes_are_consistent_and_lit() {
    for name in NAMES {
        let scene = make(name, 5000, 1);
        assert_eq!(scene.material_ids.len(), scene.mesh.len());
        assert!(scene.material_ids.iter().all(|&id| (id as usize) < scene.materials.len()));
        assert!(!scene.lights.is_empty() || !scene.environment.is_dark());
        let bounds = scene.mesh.bounds();
        assert!(bounds.is_finite() && bounds.extent().max_element() < 1e4, "{name}: {bounds:?}");
        for camera in &scene.cameras {
            assert!((camera.forward.length() - 1.0).abs() < 1e-5);
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_any_number_of_threads() {
    for name in NAMES {
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool");
        let one = pool(1).install(|| make(name, 8000, 7));
        let three = pool(3).install(|| make(name, 8000, 7));
        assert_eq!(one, three, "{name}");
        assert_ne!(one.mesh, make(name, 8000, 8).mesh, "{name}: the seed changes nothing");
    }
}

#[test]
fn the_dragon_is_closed_and_even() {
    let scene = make("dragon", 20_000, 1);
    let mut edges = std::collections::HashMap::new();
    for t in scene.mesh.indices() {
        for k in 0..3 {
            *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
        }
    }
    assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
    let mut areas: Vec<f64> = scene.mesh.triangles().map(|t| t.area()).collect();
    areas.sort_by(f64::total_cmp);
    assert!(areas[areas.len() * 95 / 100] < 8.0 * areas[areas.len() * 5 / 100]);
}

#[test]
fn an_interior_is_seen_from_inside_and_an_object_from_outside() {
    let inside = automatic_camera(&make("atrium", 60_000, 1).mesh);
    assert!(inside.inside, "{inside:?}");
    for name in ["dragon", "hair"] {
        let scene = make(name, 60_000, 1);
        let view = automatic_camera(&scene.mesh);
        assert!(!view.inside, "{name}");
        assert!(!scene.mesh.bounds().contains_point(view.camera.position));
        let to_center = (scene.mesh.bounds().center() - view.camera.position).normalize();
        assert!(view.camera.forward.dot(to_center) > 0.999);
    }
    let nothing = automatic_camera(&niwaki_core::TriangleMesh::default());
    assert!(!nothing.inside && nothing.camera.position != Vec3::ZERO);
}

#[test]
fn every_scene_is_described() {
    assert_eq!([SHAPES, EFFECTS, TOURS, STUDIES].concat(), NAMES);
    assert!(NAMES.iter().all(|name| describe(name).is_some_and(|text| !text.is_empty())));
    assert!(describe("castle").is_none());
}

#[test]
fn scenes_for_renderers_have_unit_normals_and_a_path_and_move() {
    for name in EFFECTS.iter().chain(TOURS) {
        let (frames, moves) = if TOURS.contains(name) { (100, false) } else { (200, true) };
        for triangles in [1000, 30_000] {
            let scene = make(name, triangles, 2);
            assert_eq!(scene.normals.len(), scene.mesh.positions().len(), "{name}");
            assert!(scene.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4), "{name}");
            assert_eq!(scene.path.as_ref().map(|path| path.frames), Some(frames), "{name}");
            assert_eq!(scene.animation.as_ref().is_some_and(|a| a.duration > 6.0), moves, "{name}");
            // The path begins with the first camera.
            let (first, camera) = (scene.camera_path().frame(0), scene.cameras[0]);
            assert!(first.position.distance(camera.position) < 1e-4, "{name}");
            assert!(first.forward.dot(camera.forward) > 0.999, "{name}");
        }
    }
    for name in STUDIES {
        let scene = make(name, 20_000, 2);
        assert_eq!(scene.normals.len(), scene.mesh.positions().len(), "{name}");
        assert_eq!(scene.path.as_ref().map(|path| path.frames), Some(200), "{name}");
        assert!(scene.animation.is_none(), "{name}");
        assert!(scene.materials.iter().all(|m| m.transmission == 0.0 || m.name == "glass"));
    }
    for name in SHAPES {
        let scene = make(name, 1000, 2);
        assert!(scene.normals.is_empty() && scene.animation.is_none(), "{name}");
    }
}

/// Vertex normals show to the side to which the triangles wind.
#[test]
fn normals_agree_with_the_winding() {
    for name in EFFECTS.iter().chain(TOURS).chain(STUDIES) {
        let scene = make(name, 60_000, 1);
        let mut against = 0;
        for t in scene.mesh.indices() {
            let [a, b, c] = t.map(|i| scene.mesh.positions()[i as usize]);
            let normal = (b - a).cross(c - a);
            let mean: Vec3 = t.iter().map(|&i| scene.normals[i as usize]).sum();
            against += usize::from(normal.dot(mean) < 0.0);
        }
        // Slivers where a surface folds sharply may lean over.
        assert!(against * 1000 < scene.mesh.len(), "{name}: {against} of {}", scene.mesh.len());
    }
}

#[test]
fn chess_has_its_figures_and_everything_but_the_floor_moves() {
    let scene = make("chess", 120_000, 1);
    let named = |name: &str| scene.objects.iter().filter(|o| o.name.contains(name)).count();
    assert_eq!((named("mirror ball"), named("board"), named("pawn")), (9, 9, 144));
    assert_eq!((named("white"), named("black")), (144, 144));
    assert_eq!((named("king"), named("knight"), named("queen")), (18, 36, 18));
    assert_eq!(scene.objects.iter().filter(|o| !o.dynamic).count(), 1);
    // Everything reflects.
    assert!(scene.materials.iter().all(|m| m.roughness == 0.0));
}

#[test]
fn figures_and_glassware_are_closed() {
    let closed = |name: &str, parts: &[&str]| {
        let scene = make(name, 150_000, 1);
        let objects = scene.objects.iter().filter(|o| parts.iter().any(|p| o.name.contains(p)));
        let mut seen = 0;
        for object in objects {
            seen += 1;
            let mut edges = std::collections::HashMap::new();
            // By place, as edges that show have their vertices doubled.
            let place = |i: u32| scene.mesh.positions()[i as usize].to_array().map(f32::to_bits);
            for t in object.triangles.clone() {
                let t = scene.mesh.indices()[t as usize].map(place);
                for k in 0..3 {
                    *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
                }
            }
            let closed = edges.iter().all(|(&(a, b), &n)| edges.get(&(b, a)) == Some(&n));
            assert!(closed, "{name}: {}", object.name);
        }
        assert!(seen > 0, "{name}: {parts:?}");
    };
    closed("chess", &["pawn", "rook", "knight", "bishop", "queen", "king", "mirror ball"]);
    closed("courtyard", &["wineglass", "wine", "bottle", "carafe", "water", "tumbler", "plate"]);
    closed("gallery", &["statue", "mirror ball", "pedestals"]);
    closed("one_mirror", &["animal", "serpent", "lamp", "ball"]);
}

#[test]
fn the_effects_are_those_of_the_materials() {
    let mirrors = |name: &str| {
        let scene = make(name, 20_000, 1);
        let is_mirror = |t: usize| {
            let m = scene.material(t);
            m.metallic > 0.5 && m.roughness == 0.0
        };
        let glass = (0..scene.mesh.len()).filter(|&t| scene.material(t).transmission > 0.0);
        let area = |t: usize| scene.mesh.triangle(t).area();
        let mirror: f64 = (0..scene.mesh.len()).filter(|&t| is_mirror(t)).map(area).sum();
        (mirror, glass.count() > 0)
    };
    assert_eq!(mirrors("plain"), (0.0, false));
    let (mirror, glass) = mirrors("one_mirror");
    assert!((mirror - 0.4 * 0.55).abs() < 1e-3 && !glass);
    let (mirror, glass) = mirrors("gallery");
    assert!(mirror > 10.0 && glass);
    assert!(mirrors("courtyard").1);
    let plain = make("plain", 5000, 1);
    assert!(
        plain.materials.iter().all(|m| m.roughness == 1.0 && m.metallic == 0.0 && m.ior == 1.0)
    );
}

/// On every frame the camera is well clear of every triangle, as they stand then.
#[test]
fn camera_paths_run_through_free_space() {
    for name in EFFECTS.iter().chain(TOURS).chain(STUDIES) {
        let scene = make(name, 30_000, 1);
        let path = scene.camera_path();
        for frame in (0..path.frames).step_by(15) {
            let camera = path.frame(frame);
            let now = scene.frozen(f64::from(frame) / 30.0).expect("finite");
            let near = now
                .mesh
                .triangles()
                .map(|t| distance(camera.position, t.vertices()))
                .fold(f32::INFINITY, f32::min);
            assert!(near > 0.15, "{name}: frame {frame} is {near} from a triangle, {camera:?}");
        }
    }
}

/// From a point to a triangle (Ericson 2005, "Real-time collision detection", §5.1.5, by its
/// regions: the inside, or else the nearest edge).
fn distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let edge = |a: Vec3, b: Vec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-30)).clamp(0.0, 1.0);
        p.distance(a + (b - a) * t)
    };
    let normal = (b - a).cross(c - a);
    let inside = |a: Vec3, b: Vec3| (b - a).cross(p - a).dot(normal) >= 0.0;
    if normal != Vec3::ZERO && inside(a, b) && inside(b, c) && inside(c, a) {
        return (p - a).dot(normal.normalize()).abs();
    }
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

#[test]
fn automatic_paths_begin_as_the_camera_and_keep_clear() {
    for name in ["atrium", "dragon", "foliage"] {
        let scene = make(name, 20_000, 1);
        let view = automatic_camera(&scene.mesh);
        let path = automatic_path(&scene.mesh, &view.camera);
        assert_eq!(path.closed, !view.inside, "{name}");
        let first = path.frame(0);
        assert!(first.position.distance(view.camera.position) < 1e-3, "{name}");
        assert!(first.forward.dot(view.camera.forward) > 0.999, "{name}");
        let mut walked = 0.0;
        for frame in (0..path.frames).step_by(5) {
            let (a, b) = (path.frame(frame), path.frame(frame + 5));
            walked += a.position.distance(b.position);
            let near = scene
                .mesh
                .triangles()
                .step_by(if view.inside { 1 } else { 50 })
                .map(|t| distance(a.position, t.vertices()))
                .fold(f32::INFINITY, f32::min);
            assert!(near > 0.1, "{name}: frame {frame}: {near}");
        }
        assert!(walked > 2.0, "{name}: {walked}");
    }
    let empty = niwaki_core::TriangleMesh::default();
    let camera = automatic_camera(&empty).camera;
    assert_eq!(automatic_path(&empty, &camera).frame(7), camera);
}
