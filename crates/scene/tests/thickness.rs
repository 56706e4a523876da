//! How deep objects are taken to be where only their fronts are known.

use niwaki_core::{Aabb, TriangleMesh, glam::Vec3};
use niwaki_scene::{Material, Object, Scene};

/// Boxes between corners, each an object with a material of its own; `turned` ones face inwards.
fn boxes(list: &[(Vec3, Vec3)], turned: bool) -> Scene {
    let (mut positions, mut indices, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    let (mut objects, mut materials) = (Vec::new(), Vec::new());
    for (number, (low, high)) in (0_u32..).zip(list) {
        let (vertex, triangle) = (8 * number, 12 * number);
        positions.extend((0..8).map(|i| {
            let pick = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
            Vec3::new(pick(0), pick(1), pick(2))
        }));
        for (a, b, c, d) in
            [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        {
            for mut triangle in [[a, b, c], [a, c, d]] {
                if turned {
                    triangle.swap(1, 2);
                }
                indices.push(triangle.map(|i| vertex + i));
                ids.push(number);
            }
        }
        objects.push(Object {
            name: format!("box {number}"),
            triangles: triangle..triangle + 12,
            vertices: vertex..vertex + 8,
            bounds: Aabb { min: *low, max: *high },
            dynamic: false,
        });
        materials.push(Material::default());
    }
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    Scene { mesh, material_ids: ids, objects, materials, ..Scene::default() }
}

/// A ground of 100 by 100, and what stands on it.
fn with_ground(size: Vec3) -> Vec<(Vec3, Vec3)> {
    vec![(Vec3::new(-50.0, -1.0, -50.0), Vec3::new(50.0, 0.0, 50.0)), (Vec3::ZERO, size)]
}

fn thickness(mut scene: Scene, number: usize) -> (f32, f32) {
    scene.derive_thickness();
    let bounds = scene.mesh.bounds();
    (scene.materials[number].thickness, (bounds.max - bounds.min).length())
}

#[test]
fn bodies_are_as_deep_as_their_mean_chord() {
    let size = Vec3::new(3.0, 4.0, 5.0);
    // 4 V / S = 4 · 60 / 94.
    for turned in [false, true] {
        let (deep, diagonal) = thickness(boxes(&with_ground(size), turned), 1);
        assert!((deep * diagonal - 240.0 / 94.0).abs() < 1e-3, "{turned}: {}", deep * diagonal);
    }
}

#[test]
fn a_beam_is_no_wall_however_long() {
    // 4 · 80 / (2 (80 + 80 + 1)).
    let (deep, diagonal) = thickness(boxes(&with_ground(Vec3::new(80.0, 1.0, 1.0)), false), 1);
    assert!((deep * diagonal - 320.0 / 322.0).abs() < 1e-3, "{}", deep * diagonal);
}

#[test]
fn grounds_and_walls_have_no_end_unless_they_move() {
    let mut scene = boxes(&with_ground(Vec3::new(60.0, 60.0, 1.0)), false);
    assert_eq!(thickness(scene.clone(), 0).0, 1.0, "the ground");
    assert_eq!(thickness(scene.clone(), 1).0, 1.0, "the wall");
    scene.objects[1].dynamic = true;
    let (deep, diagonal) = thickness(scene, 1);
    assert!((deep * diagonal - 4.0 * 3600.0 / 7440.0).abs() < 1e-3, "a sliding door");
}

#[test]
fn sheets_and_points_are_thin() {
    let sheet = boxes(&with_ground(Vec3::new(3.0, 4.0, 0.0)), false);
    assert_eq!(thickness(sheet, 1).0, 0.0);
    let point = boxes(&with_ground(Vec3::ZERO), false);
    assert_eq!(thickness(point, 1).0, 0.0);
}

#[test]
fn bodies_of_glass_are_told_from_walls_of_glass() {
    let glass = |mut scene: Scene| {
        scene.materials[1] = Material::glass("glass", 1.5);
        scene
    };
    // The mean chord, and whether walls are thin.
    let derived = |mut scene: Scene| {
        let (deep, diagonal) = thickness(scene.clone(), 1);
        scene.derive_thickness();
        (deep * diagonal, scene.materials[1].thin_walled)
    };
    let (chord, thin) = derived(glass(boxes(&with_ground(Vec3::ONE), false)));
    assert!((chord - 4.0 / 6.0).abs() < 1e-3 && !thin, "{chord} {thin}");
    // A large one is no wall behind which nothing is seen.
    let (chord, thin) = derived(glass(boxes(&with_ground(Vec3::splat(60.0)), false)));
    assert!((chord - 40.0).abs() < 0.1 && !thin, "{chord} {thin}");
    // 4 V / S of a pane and of a sheet.
    let (chord, thin) = derived(glass(boxes(&with_ground(Vec3::new(3.0, 4.0, 0.05)), false)));
    assert!((chord - 2.4 / 24.7).abs() < 1e-3 && thin, "{chord} {thin}");
    assert_eq!(derived(glass(boxes(&with_ground(Vec3::new(3.0, 4.0, 0.0)), false))), (0.0, true));
    // A tank: a box, and in it one that faces inwards.
    let inner = boxes(&[(Vec3::splat(0.02), Vec3::splat(0.98))], true);
    let mut tank = glass(boxes(&with_ground(Vec3::ONE), false));
    let first = u32::try_from(tank.mesh.positions().len()).unwrap();
    let (mut positions, mut indices) = tank.mesh.into_parts();
    positions.extend(inner.mesh.positions());
    indices.extend(inner.mesh.indices().iter().map(|t| t.map(|i| i + first)));
    tank.mesh = TriangleMesh::new(positions, indices).unwrap();
    tank.material_ids.resize(tank.mesh.len(), 1);
    tank.objects[1].triangles.end = u32::try_from(tank.mesh.len()).unwrap();
    let wanted = 4.0 * (1.0 - 0.96_f32.powi(3)) / (6.0 * (1.0 + 0.96_f32.powi(2)));
    let (chord, thin) = derived(tank);
    assert!((chord - wanted).abs() < 1e-3 && thin, "{chord} {wanted} {thin}");
    // A frame of another material is part of the object: how deep the glass is nobody knows.
    let mut framed = glass(boxes(&with_ground(Vec3::ONE), false));
    *framed.material_ids.last_mut().unwrap() = 0;
    assert!(derived(framed).1);
    // Nothing that light does not pass has walls in this sense.
    assert!(!derived(boxes(&with_ground(Vec3::new(3.0, 4.0, 0.05)), false)).1);
}
