//! Whatever the bits of a ray, a point or a box: no panic, and sound answers.

mod common;

use common::{Queries, scenes};
use niwaki_core::{Aabb, Bvh, Hit, Intersector as _, Ray, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{
    BinaryScene, CustomScene, HitQueries, MaskedScene, MeshQueries, WideScene, brute_force_all,
    nearest_on_triangle, triangle_overlaps_box,
};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Any bits, but often numbers on which arithmetic is hard.
fn float() -> impl Strategy<Value = f32> {
    let hard = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        f32::EPSILON,
    ];
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        prop::sample::select(hard.to_vec()),
        -2.0_f32..2.0,
    ]
}

fn vector() -> impl Strategy<Value = Vec3> {
    [float(), float(), float()].prop_map(Vec3::from_array)
}

fn ray() -> impl Strategy<Value = Ray> {
    (vector(), float(), vector(), float()).prop_map(|(origin, t_min, direction, t_max)| Ray {
        origin,
        t_min,
        direction,
        t_max,
    })
}

struct World {
    mesh: TriangleMesh,
    bvh: Bvh,
    scenes: Vec<(String, Box<dyn Queries>)>,
    wide: WideScene,
    masked: MaskedScene<BinaryScene>,
}

fn world(mesh: TriangleMesh) -> World {
    let bvh = median_tree(&mesh, 2);
    let binary = BinaryScene::new(&bvh, &mesh).unwrap();
    World {
        scenes: scenes(&mesh, 2),
        wide: WideScene::new(&bvh, &mesh).unwrap(),
        masked: MaskedScene::new(binary, vec![1, 2, 3]),
        bvh,
        mesh,
    }
}

/// A moderate, a huge and a tiny world, and an empty one.
static WORLDS: LazyLock<Vec<World>> = LazyLock::new(|| {
    let scaled = |factor: f32| {
        let (positions, indices) = soup_mesh(60, 0.8, 4).into_parts();
        TriangleMesh::new(positions.iter().map(|p| *p * factor).collect(), indices).unwrap()
    };
    [scaled(1.0), scaled(1e37), scaled(1e-42), TriangleMesh::default()].map(world).into()
});

fn sound(hit: &Hit, ray: &Ray, mesh: &TriangleMesh) -> bool {
    if !hit.is_hit() {
        return *hit == Hit::MISS;
    }
    (hit.prim_id as usize) < mesh.len()
        && hit.t >= ray.t_min.max(0.0) * (1.0 - 1e-6)
        && hit.t <= ray.t_max
        && (0.0..=1.0).contains(&hit.u)
        && (0.0..=1.0).contains(&hit.v)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn any_ray(ray in ray(), most in 0..4_usize, mask in any::<u32>()) {
        for world in WORLDS.iter() {
            let all = brute_force_all(&world.mesh, &ray);
            prop_assert!(all.iter().all(|hit| sound(hit, &ray, &world.mesh)), "{:?}", all);
            for (name, scene) in &world.scenes {
                let hit = scene.closest(&ray);
                prop_assert!(sound(&hit, &ray, &world.mesh), "{} {:?}", name, hit);
                prop_assert_eq!(
                    common::bits(&scene.closest_filtered(&ray, &mut |_, _, _, _| true)),
                    common::bits(&hit)
                );
                prop_assert_eq!(
                    scene.any(&ray),
                    scene.any_filtered(&ray, &mut |_, _, _, _| true)
                );
                let list = scene.nearest(&ray, usize::MAX);
                prop_assert!(list.iter().all(|hit| sound(hit, &ray, &world.mesh)), "{:?}", list);
                // Far from the origin distances are so coarse that a box may seem to lie behind a hit
                // inside it; then the list, which no hit shortens, has one that is at least as near.
                prop_assert_eq!(list.is_empty(), !hit.is_hit());
                prop_assert!(!hit.is_hit() || list.contains(&hit), "{} {:?}", name, hit);
                prop_assert!(list.iter().take(1).all(|first| first.t <= hit.t), "{}", name);
                prop_assert_eq!(scene.nearest(&ray, most).len(), most.min(list.len()));
            }
            let (hit, _) = world.wide.closest_hit_counted(&ray);
            let (any, _) = world.wide.any_hit_counted(&ray);
            prop_assert!(any || !hit.is_hit());
            prop_assert!(world.wide.count_hits(&ray, most) <= most);
            let hit = world.masked.closest_hit(&ray, mask);
            prop_assert!(!hit.is_hit() || world.masked.is_visible(hit.prim_id, mask));
            prop_assert!(world.masked.any_hit(&ray, mask) || !hit.is_hit());
        }
    }

    #[test]
    fn any_answer_of_a_primitive(ray in ray(), t in float(), u in float()) {
        for world in WORLDS.iter() {
            let asked = |_: u32, _: &Ray| Some(Hit { t, u, v: u, prim_id: 9 });
            let scene = CustomScene::new(&world.bvh, asked).unwrap();
            let hit = scene.closest_hit(&ray);
            prop_assert!(!hit.is_hit() || (hit.prim_id as usize) < world.mesh.len());
            prop_assert_eq!(scene.any_hit(&ray), hit.is_hit());
            let mut hits = Vec::new();
            scene.all_hits(&ray, &mut hits);
            prop_assert_eq!(hits.is_empty(), !hit.is_hit());
        }
    }

    #[test]
    fn any_point_and_box(
        p in vector(), q in vector(), distance in any::<u64>().prop_map(f64::from_bits),
    ) {
        for world in WORLDS.iter() {
            let queries = MeshQueries::new(&world.bvh, &world.mesh).unwrap();
            let found = queries.nearest(p, f64::INFINITY);
            prop_assert_eq!(found.is_some(), p.is_finite() && !world.mesh.is_empty());
            let nearest = world.mesh.triangles().zip(0..)
                .map(|(t, id)| nearest_on_triangle(&t, p, id).distance)
                .fold(f64::INFINITY, f64::min);
            prop_assert!(found.is_none_or(|found| found.distance == nearest), "{:?}", found);
            let mut list = Vec::new();
            queries.within(p, distance, &mut list);
            prop_assert!(list.iter().all(|found| found.distance <= distance));
            for bounds in [Aabb::new(p, q), Aabb::new(p.min(q), p.max(q))] {
                let mut ids = Vec::new();
                queries.overlapping(&bounds, &mut ids);
                let expected: Vec<u32> = world.mesh.triangles().zip(0..)
                    .filter(|(t, _)| triangle_overlaps_box(t, &bounds))
                    .map(|(_, id)| id)
                    .collect();
                prop_assert_eq!(&ids, &expected);
                let mut candidates = Vec::new();
                queries.box_candidates(&bounds, &mut candidates);
                prop_assert!(ids.iter().all(|id| candidates.contains(id)));
            }
        }
    }
}
