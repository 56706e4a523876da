//! Filters and all hits against brute force.

mod common;

use common::{bits, random_rays, scenes, scenes_of, split_tree};
use fastrand::Rng;
use niwaki_core::{Bvh, BvhNode, Hit, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_exact::{Verdict, settle};
use niwaki_hard_cases::{self as hard, median_tree, soup_mesh};
use niwaki_trace::{brute_force, brute_force_all};

/// Holes in a checkered pattern on every triangle, and some triangles not at all.
fn checkered(prim_id: u32, t: f32, u: f32, v: f32) -> bool {
    let cell = (u * 5.0).floor() + (v * 5.0).floor();
    !prim_id.is_multiple_of(7) && cell % 2.0 == 0.0 && t > 0.0
}

fn same(a: &[Hit], b: &[Hit]) -> bool {
    a.iter().map(bits).eq(b.iter().map(bits))
}

#[test]
fn filters_and_lists_equal_brute_force() {
    let (mut rejected, mut accepted, mut several) = (0, 0, 0);
    for (count, size, leaf) in [(1, 1.0, 1), (40, 0.8, 3), (1200, 0.3, 1), (900, 0.5, 8)] {
        let mesh = soup_mesh(count, size, count as u64);
        let scenes = scenes(&mesh, leaf);
        for ray in random_rays(250, 5) {
            let all = brute_force_all(&mesh, &ray);
            assert_eq!(all.first().map_or(Hit::MISS, |h| *h), brute_force(&mesh, &ray));
            let expected = all.iter().find(|h| checkered(h.prim_id, h.t, h.u, h.v));
            let expected = expected.copied().unwrap_or(Hit::MISS);
            rejected += usize::from(!all.is_empty() && !expected.is_hit());
            accepted += usize::from(expected.is_hit());
            several += usize::from(all.len() > 5);
            for (name, scene) in &scenes {
                let hit = scene.closest_filtered(&ray, &mut checkered);
                assert_eq!(bits(&hit), bits(&expected), "{name} {ray:?}");
                let any = scene.any_filtered(&ray, &mut checkered);
                assert_eq!(any, expected.is_hit(), "{name} {ray:?}");
                // All and nothing.
                let hit = scene.closest_filtered(&ray, &mut |_, _, _, _| true);
                assert_eq!(bits(&hit), bits(&scene.closest(&ray)), "{name} {ray:?}");
                assert!(!scene.any_filtered(&ray, &mut |_, _, _, _| false), "{name}");
                assert_eq!(scene.closest_filtered(&ray, &mut |_, _, _, _| false), Hit::MISS);
                assert!(same(&scene.nearest(&ray, usize::MAX), &all), "{name} {ray:?}");
                for most in [0, 1, 2, 3, 7, 20] {
                    let nearest = scene.nearest(&ray, most);
                    let first = &all[..most.min(all.len())];
                    assert!(same(&nearest, first), "{name}: {nearest:?} {first:?}");
                }
            }
        }
    }
    assert!(rejected > 20 && accepted > 200 && several > 100, "{rejected} {accepted} {several}");
}

#[test]
fn a_filter_sees_every_candidate_as_it_is_reported() {
    let mesh = soup_mesh(500, 0.5, 3);
    for (name, scene) in scenes(&mesh, 4) {
        for ray in random_rays(60, 9) {
            // Rejecting all shows all.
            let mut seen = Vec::new();
            let hit = scene.closest_filtered(&ray, &mut |prim_id, t, u, v| {
                seen.push(Hit { t, u, v, prim_id });
                false
            });
            assert_eq!(hit, Hit::MISS);
            seen.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.prim_id.cmp(&b.prim_id)));
            seen.dedup();
            assert!(same(&seen, &brute_force_all(&mesh, &ray)), "{name} {ray:?}");
        }
    }
}

#[test]
fn of_many_coplanar_copies_in_one_leaf_the_next_nearest_is_found() {
    // Layers one behind the other; the filter refuses the nearest ones, one more each time.
    let layers: Vec<Triangle> = (0..16)
        .map(|i| {
            let z = Vec3::Z * (((i * 7) % 16) as f32 + 1.0);
            Triangle::new(z - Vec3::X - Vec3::Y, z + Vec3::X * 3.0, z + Vec3::Y * 3.0)
        })
        .collect();
    let mesh = TriangleMesh::from_triangles(&layers).unwrap();
    let leaf =
        Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 16)], prim_ids: (0..16).collect() };
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    for (name, scene) in scenes_of(&leaf, &mesh, "one leaf") {
        for refused in 0..=16_u8 {
            let hit = scene.closest_filtered(&ray, &mut |_, t, _, _| t > f32::from(refused));
            let expected = if refused < 16 { f32::from(refused) + 1.0 } else { f32::INFINITY };
            assert_eq!(hit.t, expected, "{name} {refused}");
        }
    }
}

#[test]
fn split_trees_report_each_triangle_once() {
    // Long triangles across the scene, each in many leaves.
    let mut rng = Rng::with_seed(8);
    let mut point = || Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 4.0;
    let triangles: Vec<_> =
        (0..150).map(|_| Triangle::new(point(), point(), point() * 0.2)).collect();
    let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
    let bvh = split_tree(&mesh);
    assert!(bvh.prim_ids.len() > mesh.len() + 20, "{} references", bvh.prim_ids.len());
    let scenes = scenes_of(&bvh, &mesh, "split");
    let mut repeated = 0;
    for ray in random_rays(300, 4) {
        let expected = brute_force_all(&mesh, &ray);
        for (name, scene) in &scenes {
            let mut shown = 0;
            scene.closest_filtered(&ray, &mut |_, _, _, _| {
                shown += 1;
                false
            });
            repeated += usize::from(shown > expected.len());
            assert!(same(&scene.nearest(&ray, usize::MAX), &expected), "{name} {ray:?}");
            let most = expected.len() / 2;
            assert!(same(&scene.nearest(&ray, most), &expected[..most]), "{name} {ray:?}");
        }
    }
    assert!(repeated > 20, "some ray must meet a triangle in two leaves: {repeated}");
}

#[test]
fn from_a_point_on_both_the_smallest_id_wins_though_one_distance_is_minus_zero() {
    // Coplanar triangles in two leaves, seen from both sides from a point on them: t is +0.0 for
    // one winding and −0.0 for the other.
    let a = Triangle::new(Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0);
    let b = Triangle::new(Vec3::ZERO, Vec3::Y * 4.0, Vec3::X * 4.0);
    for pair in [[a, b], [b, a]] {
        let mesh = TriangleMesh::from_triangles(&pair).unwrap();
        for order in [[0, 1], [1, 0]] {
            let boxes = mesh.bounds();
            // Leaves too large to be joined into one.
            let ids = order.iter().flat_map(|&id| [id; 16]).collect();
            let bvh = Bvh {
                nodes: vec![
                    BvhNode::inner(boxes, 1),
                    BvhNode::leaf(boxes, 0, 16),
                    BvhNode::leaf(boxes, 16, 16),
                ],
                prim_ids: ids,
            };
            for (name, scene) in scenes_of(&bvh, &mesh, "two leaves") {
                for direction in [Vec3::Z, -Vec3::Z, Vec3::new(0.1, 0.2, 1.0)] {
                    let ray = Ray::new(Vec3::ONE.with_z(0.0), direction);
                    let hit = scene.closest(&ray);
                    assert_eq!((hit.prim_id, hit.t), (0, 0.0), "{name} {order:?}");
                    let ids: Vec<_> =
                        scene.nearest(&ray, 9).iter().map(|hit| hit.prim_id).collect();
                    assert_eq!(ids, [0, 1], "{name} {order:?}");
                }
            }
        }
    }
}

#[test]
fn lists_on_the_hard_cases_differ_by_rounding_alone() {
    for case in hard::meshes().iter().filter(|case| case.mesh.len() <= 3_000) {
        let mesh = &case.mesh;
        let scenes = scenes_of(&median_tree(mesh, 2), mesh, case.name);
        let mut rays = hard::rays(mesh, 4, 31);
        rays.extend(hard::aimed_at_borders(mesh, 8, 32));
        for ray in &rays {
            let expected = brute_force_all(mesh, ray);
            for (name, scene) in &scenes {
                let hits = scene.nearest(ray, usize::MAX);
                assert!(hits.windows(2).all(|w| {
                    w[0].t < w[1].t || (w[0].t == w[1].t && w[0].prim_id < w[1].prim_id)
                }));
                let filtered = scene.closest_filtered(ray, &mut |_, _, _, _| true);
                assert_eq!(bits(&filtered), bits(&scene.closest(ray)), "{name}");
                if same(&hits, &expected) {
                    continue;
                }
                let missing = |from: &[Hit], of: &[Hit]| -> Vec<Hit> {
                    of.iter().filter(|a| from.iter().all(|b| bits(a) != bits(b))).copied().collect()
                };
                for hit in [missing(&hits, &expected), missing(&expected, &hits)].concat() {
                    let triangle = mesh.triangle(hit.prim_id as usize);
                    let alone = TriangleMesh::from_triangles(&[triangle]).unwrap();
                    let hit = Hit { prim_id: 0, ..hit };
                    let verdicts = [
                        settle(ray, &alone, &hit, &Hit::MISS),
                        settle(ray, &alone, &Hit::MISS, &hit),
                    ];
                    assert!(
                        verdicts.contains(&Verdict::Rounding),
                        "{name}: {verdicts:?} {hit:?} {ray:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn rays_that_hit_nothing_by_definition_show_nothing() {
    for case in hard::meshes().iter().filter(|case| case.mesh.len() <= 300) {
        for (name, scene) in scenes_of(&median_tree(&case.mesh, 1), &case.mesh, case.name) {
            for ray in hard::bad_rays(&case.mesh) {
                let mut filter = |_, _, _, _| -> bool { panic!("{name} shows a hit") };
                assert_eq!(scene.closest_filtered(&ray, &mut filter), Hit::MISS);
                assert!(!scene.any_filtered(&ray, &mut filter));
                assert!(scene.nearest(&ray, 5).is_empty());
            }
        }
    }
}
