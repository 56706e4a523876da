//! Leaves with holes, how many of them a ray passes, what lies near a point and in a box.

use niwaki_core::{Aabb, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::median_tree;
use niwaki_trace::{AutoScene, HitQueries, MaskedScene, MeshQueries};

/// Ten square leaves one behind the other, two triangles each.
fn leaves() -> Result<TriangleMesh, niwaki_core::MeshError> {
    let triangles: Vec<Triangle> = (0..10)
        .flat_map(|i| {
            let corner = |x: f32, y: f32| Vec3::new(x, y, i as f32);
            let (a, b, c, d) = (corner(0., 0.), corner(1., 0.), corner(1., 1.), corner(0., 1.));
            [Triangle::new(a, b, c), Triangle::new(a, c, d)]
        })
        .collect();
    TriangleMesh::from_triangles(&triangles)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = leaves()?;
    let bvh = median_tree(&mesh, 2); // The builder crates do better.
    let scene = AutoScene::new(&bvh, &mesh)?;
    let ray = Ray::new(Vec3::new(0.3, 0.86, -1.0), Vec3::new(0.02, -0.03, 1.0));

    // An alpha mask: a leaf is solid only around its middle, where both weights are near a third.
    let is_solid =
        |_prim_id: u32, _t: f32, u: f32, v: f32| (u - 0.33).abs() < 0.1 && (v - 0.33).abs() < 0.1;
    let (plain, masked) = (scene.any_hit_filtered(&ray, |_, _, _, _| true), {
        scene.closest_hit_filtered(&ray, is_solid)
    });
    println!("hits anything: {plain}; first solid point at t = {:.2}", masked.t);

    let mut hits = Vec::new();
    scene.all_hits(&ray, &mut hits);
    let depths: Vec<_> = hits.iter().map(|hit| hit.t).collect();
    println!("passes {} triangles, at {depths:.2?}", hits.len());
    scene.nearest_hits(&ray, 3, &mut hits);
    println!("the nearest three are {:?}", hits.iter().map(|hit| hit.prim_id).collect::<Vec<_>>());

    // Shadow rays (bit 1) do not see the first leaf.
    let mut masks = vec![0b11; mesh.len()];
    masks[..2].fill(0b01);
    let masked = MaskedScene::new(scene, masks);
    println!(
        "camera rays hit at {:.2}, shadow rays at {:.2}",
        masked.closest_hit(&ray, 0b01).t,
        masked.closest_hit(&ray, 0b10).t
    );

    let queries = MeshQueries::new(&bvh, &mesh)?;
    if let Some(nearest) = queries.nearest(Vec3::new(2.0, 0.5, 3.3), f64::INFINITY) {
        println!(
            "nearest to (2, 0.5, 3.3): triangle {} at {}, {:.3} away",
            nearest.prim_id, nearest.point, nearest.distance
        );
    }
    let mut near = Vec::new();
    queries.within(Vec3::new(0.5, 0.5, 4.5), 0.6, &mut near);
    println!("{} triangles are within 0.6 of (0.5, 0.5, 4.5)", near.len());
    let mut ids = Vec::new();
    queries.overlapping(&Aabb::new(Vec3::new(0.8, 0.0, 1.5), Vec3::new(2.0, 0.1, 4.5)), &mut ids);
    println!("a box at the lower right meets triangles {ids:?}");
    Ok(())
}
