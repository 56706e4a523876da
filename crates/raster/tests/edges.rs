//! The edges of a mesh, and what is left of them, for any mesh and any light.

use niwaki_core::{TriangleMesh, glam::Vec3};
use niwaki_raster::Edges;
use proptest::prelude::*;
use std::collections::HashMap;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Walls and caps close every volume: at each vertex as many walls begin as end, whatever
    /// triangles there are and whichever way each of them faces.
    #[test]
    fn what_is_left_of_edges_has_no_ends(
        triangles in prop::collection::vec(prop::array::uniform3(0_u32..12), 1..60),
        facings in prop::collection::vec(-1_i32..=1, 60),
    ) {
        let positions = (0..12_u8).map(|i| Vec3::new(f32::from(i), f32::from(i * i), 1.0));
        let mesh = TriangleMesh::new(positions.collect(), triangles.clone()).unwrap();
        let edges = Edges::of(&mesh);
        let mut ends: HashMap<u32, i32> = HashMap::new();
        for edge in &edges.edges {
            let net = edges.net(edge, |t| facings[t as usize]);
            prop_assert!(net.unsigned_abs() <= edge.count);
            *ends.entry(edge.a).or_default() += net;
            *ends.entry(edge.b).or_default() -= net;
        }
        prop_assert!(ends.values().all(|&n| n == 0));
        // Every side of a triangle is listed once, those without length excepted.
        let sides = triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]);
        prop_assert_eq!(edges.incidences.len(), sides.filter(|(a, b)| a != b).count());
    }
}

#[test]
fn a_closed_mesh_has_two_triangles_an_edge_and_seams_are_closed() {
    // A tetrahedron whose triangles share no vertices, some with a zero of the other sign.
    let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let minus = Vec3::new(-0.0, 0.0, -0.0);
    let positions = vec![a, c, b, minus, b, d, b, c, d, minus, d, c];
    let indices = vec![[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
    let edges = Edges::of(&TriangleMesh::new(positions, indices).unwrap());
    assert_eq!(edges.edges.len(), 6);
    for edge in &edges.edges {
        assert_eq!(edge.count, 2);
        assert_eq!(edges.net(edge, |_| 1), 0, "all facing: nothing is left");
    }
    assert_eq!(Edges::of(&TriangleMesh::default()), Edges::default());
}
