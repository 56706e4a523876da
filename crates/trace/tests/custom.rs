//! Spheres, whole scenes and nonsense as primitives.

mod common;

use common::random_rays;
use fastrand::Rng;
use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Aabb, Builder, Hit, Intersector, PrimRef, Ray, glam::Vec3, to_u32};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{CustomScene, HitQueries, Primitives, WideScene};

#[derive(Clone, Debug)]
struct Sphere {
    center: Vec3,
    radius: f32,
}

impl Sphere {
    fn bounds(&self) -> Aabb {
        // Hits are rounded, and must lie inside all the same.
        let r = Vec3::splat(self.radius * 1.0001);
        Aabb::new(self.center - r, self.center + r)
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        // In f64, from the point of the ray that is nearest to the centre.
        let (o, d) = (ray.origin.as_dvec3() - self.center.as_dvec3(), ray.direction.as_dvec3());
        let middle = -o.dot(d) / d.length_squared();
        let square = f64::from(self.radius).powi(2) - (o + d * middle).length_squared();
        let half = (square / d.length_squared()).sqrt();
        #[expect(clippy::cast_possible_truncation, reason = "a distance for f32 rays")]
        [middle - half, middle + half]
            .map(|t| t as f32)
            .into_iter()
            .find(|&t| t >= ray.t_min && t <= ray.t_max)
            .map(|t| Hit { t, u: half as f32, ..Hit::MISS })
    }
}

fn spheres(count: usize, scale: f32) -> Vec<Sphere> {
    let mut rng = Rng::with_seed(count as u64);
    let mut number = || rng.f32() - 0.5;
    (0..count)
        .map(|_| {
            let center = Vec3::new(number(), number(), number()) * 2.0 * scale;
            Sphere { center, radius: (number().abs() * 0.5 + 0.02) * scale }
        })
        .collect()
}

/// Any builder makes the tree, by boxes.
fn scene(spheres: &[Sphere]) -> CustomScene<impl Primitives> {
    let prims: Vec<PrimRef> =
        (0..).zip(spheres).map(|(id, sphere)| PrimRef::new(sphere.bounds(), id)).collect();
    let bvh = Sbvh::default().build(&prims).unwrap();
    CustomScene::new(&bvh, |id: u32, ray: &Ray| spheres[id as usize].intersect(ray)).unwrap()
}

fn brute(spheres: &[Sphere], ray: &Ray) -> Vec<Hit> {
    let mut hits: Vec<Hit> = (0..)
        .zip(spheres)
        .filter_map(|(id, sphere)| sphere.intersect(ray).map(|hit| Hit { prim_id: id, ..hit }))
        .collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t));
    hits
}

#[test]
fn spheres_of_any_size_equal_brute_force() {
    let mut hits = 0;
    for scale in [1.0, 1e-20, 1e20] {
        for count in [1, 30, 400] {
            let spheres = spheres(count, scale);
            let scene = scene(&spheres);
            for ray in random_rays(300, 7) {
                let ray = Ray::new(ray.origin * scale, ray.direction);
                let all = brute(&spheres, &ray);
                let first = all.first().copied().unwrap_or(Hit::MISS);
                hits += usize::from(first.is_hit());
                assert_eq!(scene.closest_hit(&ray), first, "{ray:?}");
                assert_eq!(scene.any_hit(&ray), first.is_hit(), "{ray:?}");
                let mut list = Vec::new();
                scene.all_hits(&ray, &mut list);
                assert_eq!(list, all, "{ray:?}");
                scene.nearest_hits(&ray, 2, &mut list);
                assert_eq!(list, all[..all.len().min(2)], "{ray:?}");
                let odd = scene.closest_hit_filtered(&ray, |id, _, _, _| id % 2 == 1);
                let expected = all.iter().find(|hit| hit.prim_id % 2 == 1);
                assert_eq!(odd, expected.copied().unwrap_or(Hit::MISS), "{ray:?}");
                // Short of the first hit there is none; at it there is.
                if first.is_hit() {
                    let until = ray.with_range(0.0, first.t);
                    assert_eq!(scene.closest_hit(&until), first);
                    assert!(!scene.any_hit(&ray.with_range(0.0, first.t.next_down())));
                }
            }
        }
    }
    assert!(hits > 500, "{hits} hits");
}

#[test]
fn scenes_are_primitives_of_other_scenes() {
    // Copies of one mesh along a row: each primitive is the same scene, moved.
    let mesh = soup_mesh(200, 0.4, 1);
    let one = WideScene::new(&median_tree(&mesh, 2), &mesh).unwrap();
    let offset = |id: u32| Vec3::X * (3.0 * id as f32);
    let copies = 5;
    let prims: Vec<PrimRef> = (0..copies)
        .map(|id| {
            let bounds = mesh.bounds();
            PrimRef::new(Aabb::new(bounds.min + offset(id), bounds.max + offset(id)), id)
        })
        .collect();
    let bvh = Sbvh::default().build(&prims).unwrap();
    let row = CustomScene::new(&bvh, |id: u32, ray: &Ray| {
        let hit = one.closest_hit(&Ray { origin: ray.origin - offset(id), ..*ray });
        hit.is_hit().then_some(hit)
    })
    .unwrap();
    let mut met = [0; 5];
    for ray in random_rays(500, 3) {
        let ray = Ray::new(ray.origin * 4.0 + Vec3::X * 6.0, ray.direction);
        let expected = (0..copies)
            .map(|id| Hit {
                prim_id: id,
                ..one.closest_hit(&Ray { origin: ray.origin - offset(id), ..ray })
            })
            .filter(|hit| hit.t < f32::INFINITY)
            .min_by(|a, b| a.t.total_cmp(&b.t));
        let hit = row.closest_hit(&ray);
        assert_eq!(hit.t, expected.map_or(f32::INFINITY, |hit| hit.t), "{ray:?}");
        if hit.is_hit() {
            met[hit.prim_id as usize] += 1;
        }
    }
    assert!(met.iter().all(|&count| count > 0), "{met:?}");
}

#[test]
fn nonsense_from_a_primitive_is_ignored() {
    let bounds = Aabb::new(-Vec3::ONE, Vec3::ONE);
    let answers = [f32::NAN, f32::INFINITY, -1.0, 0.5, 9.0, f32::NEG_INFINITY];
    let prims: Vec<PrimRef> =
        (0..to_u32(answers.len())).map(|id| PrimRef::new(bounds, id)).collect();
    let bvh = Sbvh::default().build(&prims).unwrap();
    let asked = |id: u32, _: &Ray| Some(Hit { t: answers[id as usize], ..Hit::MISS });
    let scene = CustomScene::new(&bvh, asked).unwrap();
    let ray = Ray::new(Vec3::ZERO, Vec3::X).with_range(0.0, 5.0);
    assert_eq!((scene.closest_hit(&ray).prim_id, scene.closest_hit(&ray).t), (3, 0.5));
    let mut hits = Vec::new();
    scene.all_hits(&ray, &mut hits);
    assert_eq!(hits.len(), 1);
    assert!(!scene.any_hit(&ray.with_range(1.0, 2.0)));
}

#[test]
fn broken_trees_are_refused() {
    let prims = [PrimRef::new(Aabb::new(Vec3::ZERO, Vec3::ONE), 0)];
    let mut bvh = Sbvh::default().build(&prims).unwrap();
    bvh.nodes[0].count = 2;
    assert!(CustomScene::new(&bvh, |_: u32, _: &Ray| None).is_err());
}
