//! The procedural scenes.

use niwaki_core::glam::Vec3;
use niwaki_scene::{
    Scene, automatic_camera,
    generate::{NAMES, generate},
};

fn make(name: &str, triangles: usize, seed: u64) -> Scene {
    generate(name, triangles, seed).expect("the name is in the list")
}

#[test]
fn sizes_keep_to_the_request() {
    for name in NAMES {
        for wanted in [1000, 1777, 5000, 20_000, 100_000, 333_333] {
            let made = make(name, wanted, 3).mesh.len();
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
