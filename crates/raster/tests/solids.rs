//! Which parts of a mesh are closed, and how they wind around points.

use niwaki_core::{
    TriangleMesh,
    glam::{DVec3, Vec3},
};
use niwaki_raster::{Edges, Solids};
use niwaki_scene::generate;
use proptest::prelude::*;

fn solids(mesh: &TriangleMesh) -> Solids {
    Solids::of(mesh, &Edges::of(mesh))
}

/// The winding number by solid angles (van Oosterom and Strackee 1983); none for a point on a triangle.
fn by_angles(mesh: &TriangleMesh, solids: &Solids, solid: u32, point: Vec3) -> Option<f64> {
    let mut sum = 0.0;
    for (number, corners) in solids.of_triangles().iter().zip(mesh.indices()) {
        if *number != solid + 1 {
            continue;
        }
        let [a, b, c] = corners
            .map(|i| (mesh.positions()[i as usize].as_dvec3() - point.as_dvec3()).normalize());
        let volume = a.dot(b.cross(c));
        let below = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
        if volume.abs() < 1e-9 && below < 1e-9 {
            return None;
        }
        sum += 2.0 * volume.atan2(below);
    }
    Some(sum / (4.0 * std::f64::consts::PI))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A cone from a point over a closed walk through others is closed with a cone from a second
    /// point, whatever crosses what. Coordinates are few, so rays go through edges and corners.
    #[test]
    fn windings_are_those_of_solid_angles(
        places in prop::collection::vec(prop::array::uniform3(-4_i8..=4), 9),
        walk in prop::collection::vec(2_u32..9, 3..14),
        points in prop::collection::vec(prop::array::uniform3(-5_i8..=5), 24),
    ) {
        let at = |p: &[i8; 3]| Vec3::from_array(p.map(f32::from));
        let mut indices = Vec::new();
        for (k, from) in walk.iter().enumerate() {
            let to = walk[(k + 1) % walk.len()];
            indices.extend([[0, *from, to], [1, to, *from]]);
        }
        let mesh = TriangleMesh::new(places.iter().map(at).collect(), indices).unwrap();
        let solids = solids(&mesh);
        for point in &points {
            // Just off the grid of coordinates in x, so that points are not on most surfaces.
            let point = at(point) + Vec3::X * 0.37;
            for solid in 0..u32::try_from(solids.len()).unwrap() {
                // A point on a surface may count to either side.
                let Some(angles) = by_angles(&mesh, &solids, solid, point) else { continue };
                let found = solids.winding(&mesh, solid as usize, point);
                prop_assert!((f64::from(found) - angles).abs() < 1e-6, "{} {} {}", solid, point, angles);
            }
        }
    }
}

/// Twelve triangles around a box, wound outward.
fn cuboid(positions: &mut Vec<Vec3>, indices: &mut Vec<[u32; 3]>, middle: Vec3, half: f32) {
    let first = u32::try_from(positions.len()).unwrap();
    for i in 0..8_u8 {
        let pick = |bit: u8| if i & bit == 0 { -half } else { half };
        positions.push(middle + Vec3::new(pick(1), pick(2), pick(4)));
    }
    let quads: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for q in quads {
        let q = q.map(|i| i + first);
        indices.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    }
}

#[test]
fn open_parts_and_inconsistent_ones_are_no_solids() {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for x in 0..4_u8 {
        cuboid(&mut positions, &mut indices, Vec3::X * f32::from(3 * x), 0.5);
    }
    // The second box lacks a triangle, of the third one is turned, and the fourth is inside out.
    indices[25].swap(0, 1);
    indices[36..].iter_mut().for_each(|t| t.swap(0, 1));
    indices.remove(15);
    // A point and a line are nothing to cast.
    indices.extend([[0, 0, 0], [8, 9, 9]]);
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    let solids = solids(&mesh);
    assert_eq!(solids.len(), 2);
    let of = solids.of_triangles();
    assert!(of[..12].iter().all(|s| *s == 1) && of[12..35].iter().all(|s| *s == 0));
    assert!(of[35..47].iter().all(|s| *s == 2) && of[47] == 0);
    for (x, both) in [(0.0, [1, 0]), (9.0, [0, -1]), (3.0, [0, 0]), (0.6, [0, 0]), (-0.2, [1, 0])] {
        let point = Vec3::new(x, 0.0, 0.0);
        assert_eq!([0, 1].map(|s| solids.winding(&mesh, s, point)), both, "{x}");
    }
    assert_eq!(solids.winding(&mesh, 2, Vec3::ZERO), 0, "there is no third");
    assert!(Solids::of(&TriangleMesh::default(), &Edges::default()).is_empty());
}

/// Shapes of the studies are closed though their vertices are split at seams; the hills are not.
#[test]
fn shapes_of_the_studies_are_closed() {
    for (name, open) in [("tessellated", &["ground"][..]), ("serpents", &[])] {
        let scene = generate::generate(name, 20_000, 1).unwrap();
        let solids = solids(&scene.mesh);
        for object in &scene.objects {
            let range = object.triangles.start as usize..object.triangles.end as usize;
            let closed = solids.of_triangles()[range.clone()].iter().filter(|s| **s > 0).count();
            println!("{name}, {}: {closed} of {} triangles", object.name, range.len());
            if object.name == "dragon" || name == "tessellated" {
                let expected = if open.contains(&object.name.as_str()) { 0 } else { range.len() };
                assert_eq!(closed, expected, "{name}, {}", object.name);
            }
        }
    }
}

/// Rays from points in an array hit nothing but corners and edges of a box.
#[test]
fn rays_through_corners_and_edges_cross_once() {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    cuboid(&mut positions, &mut indices, Vec3::ZERO, 1.0);
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    let solids = solids(&mesh);
    for y in [-1.0, 0.0, 1.0_f32] {
        for z in [-1.0, 0.0, 1.0_f32] {
            let left = solids.winding(&mesh, 0, Vec3::new(-1.0 + 1e-3, y, z));
            let inside = DVec3::new(0.0, f64::from(y), f64::from(z)).abs().max_element() < 1.0;
            // On the box's own edges either answer is right, but the same from wherever along x.
            assert_eq!(left, solids.winding(&mesh, 0, Vec3::new(0.5, y, z)), "{y} {z}");
            assert!(!inside || left == 1, "{y} {z}: {left}");
        }
    }
}
