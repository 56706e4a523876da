//! What is special about quantised nodes; the tests of all kernels have them too.

mod common;

use common::{bits, random_rays, split_tree};
use niwaki_core::{Bvh, BvhNode, Hit, Intersector, Ray, TriangleMesh, glam::Vec3, to_u32};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{
    Batches, Counts, HitQueries, Kernel, Mode, QuantisedScene, SceneError, WideScene,
    brute_force_in,
};
use niwaki_wide::{Bvh4, Bvh16, CollapseSettings, WideBvh};

/// Calls `f` with every kernel of every width over a tree, by name.
fn each_kernel(
    mode: Mode,
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, &dyn Intersector, &dyn Fn(&Ray) -> Vec<u32>),
) {
    macro_rules! width {
        ($width:literal) => {
            let wide = WideBvh::<$width>::collapse(bvh, &CollapseSettings::default()).unwrap();
            let scene = QuantisedScene::build_in(mode, wide, mesh).unwrap();
            for kernel in QuantisedScene::<$width>::kernels() {
                let scene = scene.clone().with_kernel(kernel).unwrap();
                assert_eq!((scene.kernel(), scene.mode()), (kernel, mode));
                let shown = |ray: &Ray| {
                    let mut ids = Vec::new();
                    let hit = scene.closest_hit_filtered(ray, |id, _, _, _| {
                        ids.push(id);
                        false
                    });
                    assert_eq!(hit, Hit::MISS);
                    ids
                };
                f(&format!("{kernel}, {} wide, {mode}", $width), &scene, &shown);
            }
        };
    }
    width!(4);
    width!(8);
    width!(16);
}

#[test]
fn both_modes_give_the_bits_of_brute_force() {
    for mode in Mode::ALL {
        for (count, size) in [(1, 1.0), (2, 1.0), (70, 0.4), (2_000, 0.1)] {
            let mesh = soup_mesh(count, size, count as u64);
            for bvh in [median_tree(&mesh, 1), split_tree(&mesh)] {
                let expected: Vec<(Ray, Hit)> = random_rays(500, 7)
                    .into_iter()
                    .map(|ray| (ray, brute_force_in(mode, &mesh, &ray)))
                    .collect();
                let mut hits = 0;
                each_kernel(mode, &bvh, &mesh, |name, scene, _| {
                    for (ray, expected) in &expected {
                        assert_eq!(bits(&scene.closest_hit(ray)), bits(expected), "{name} {ray:?}");
                        assert_eq!(scene.any_hit(ray), expected.is_hit(), "{name} {ray:?}");
                        hits += usize::from(expected.is_hit());
                    }
                });
                assert!(hits > 10, "the rays must meet the triangles");
            }
        }
    }
}

/// Triangles of this size at a place, a few in each node.
fn far_away(count: usize, size: f32, place: Vec3) -> TriangleMesh {
    let (positions, indices) = soup_mesh(count, 0.5, 3).into_parts();
    TriangleMesh::new(positions.iter().map(|p| *p * size + place).collect(), indices).unwrap()
}

#[test]
fn unused_slots_are_never_followed() {
    // The boxes are smaller than the errors of rays that come from afar, so that arithmetic alone
    // cannot tell an inverted box. The word of an unused slot leads to the first triangle: it would
    // be shown to the filter twice.
    for (size, place) in [(1e-3, Vec3::splat(1e4)), (1.0, Vec3::splat(3e6)), (1.0, Vec3::ZERO)] {
        for count in [2, 3, 5, 9, 33] {
            let mesh = far_away(count, size, place);
            let bvh = median_tree(&mesh, 1);
            let mut most = 0;
            // The watertight kernels may start a ray again, which shows triangles twice, too.
            each_kernel(Mode::Fast, &bvh, &mesh, |name, _, shown| {
                for id in 0..count {
                    let target = mesh.triangle(id).bounds().center();
                    for origin in [Vec3::ZERO, place * 2.0, place + Vec3::X * size * 9.0] {
                        let mut ids = shown(&Ray::new(origin, target - origin));
                        let all = ids.len();
                        ids.sort_unstable();
                        ids.dedup();
                        assert_eq!(ids.len(), all, "{name}, {count} triangles of {size}");
                        most = most.max(all);
                    }
                }
            });
            assert!(most > 0, "some must be shown");
        }
    }
}

#[test]
fn a_ray_that_misses_visits_at_least_what_it_visits_in_full_precision() {
    let mesh = soup_mesh(3_000, 0.05, 4);
    let bvh = median_tree(&mesh, 1);
    let (full, quantised) =
        (WideScene::new(&bvh, &mesh).unwrap(), QuantisedScene::new(&bvh, &mesh).unwrap());
    let (mut sum_full, mut sum_quantised) = (Counts::default(), Counts::default());
    for ray in random_rays(4_000, 5) {
        let (hit, count) = full.any_hit_counted(&ray);
        let (quantised_hit, quantised_count) = quantised.any_hit_counted(&ray);
        assert_eq!(hit, quantised_hit);
        assert_eq!(full.closest_hit_counted(&ray).0, quantised.closest_hit_counted(&ray).0);
        if !hit {
            assert!(quantised_count.nodes >= count.nodes && quantised_count.leaves >= count.leaves);
            sum_full += count;
            sum_quantised += quantised_count;
        }
    }
    // A node's boxes grow by less than two of 255 steps each, which is not much.
    assert!(sum_quantised.nodes > sum_full.nodes && sum_quantised.leaves > sum_full.leaves);
    assert!(sum_quantised.boxes * 10 < sum_full.boxes * 12, "{sum_quantised:?} {sum_full:?}");
}

#[test]
fn nodes_take_half_the_room_or_less() {
    let mesh = soup_mesh(2_000, 0.1, 4);
    let bvh = median_tree(&mesh, 1);
    let wide = WideBvh::<8>::collapse(&bvh, &CollapseSettings::default()).unwrap();
    let nodes = wide.nodes().len();
    let full = WideScene::build_from(wide.clone(), &mesh).unwrap();
    let quantised = QuantisedScene::build_from(wide, &mesh).unwrap();
    assert_eq!(full.bytes() - quantised.bytes(), 128 * nodes);
    let optimal = CollapseSettings::default();
    let wide = Bvh4::collapse(&bvh, &optimal).unwrap();
    let saved = 64 * wide.nodes().len();
    let full = WideScene::build_from(wide.clone(), &mesh).unwrap();
    assert_eq!(full.bytes() - QuantisedScene::build_from(wide, &mesh).unwrap().bytes(), saved);
    let wide = Bvh16::collapse(&bvh, &optimal).unwrap();
    let saved = 320 * wide.nodes().len();
    let full = WideScene::build_from(wide.clone(), &mesh).unwrap();
    assert_eq!(full.bytes() - QuantisedScene::build_from(wide, &mesh).unwrap().bytes(), saved);
}

#[test]
fn batches_and_threads_change_nothing() {
    let mesh = soup_mesh(900, 0.2, 6);
    let bvh = median_tree(&mesh, 2);
    let rays = random_rays(3_000, 8);
    let mut answers = Vec::new();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut hits = vec![Hit::MISS; rays.len()];
        pool.install(|| {
            let scene = QuantisedScene::new(&bvh, &mesh).unwrap();
            scene.par_closest_hits(&rays, &mut hits).unwrap();
        });
        answers.push(hits);
    }
    assert_eq!(answers[0], answers[1]);
    let scene = QuantisedScene::new(&bvh, &mesh).unwrap();
    assert!(rays.iter().zip(&answers[0]).all(|(ray, hit)| scene.closest_hit(ray) == *hit));
}

#[test]
fn chains_of_any_depth_are_traced() {
    // Boxes that shrink by half, so that grids get finer down to denormal steps.
    let count = 200_usize;
    let mut positions = Vec::new();
    for i in 0..count {
        let x = 2.0_f32.powi(60 - i32::try_from(i).unwrap());
        positions.extend([Vec3::new(x, 0.0, 0.0), Vec3::new(x, x, 0.0), Vec3::new(x, 0.0, x)]);
    }
    let indices = (0..to_u32(count)).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    let boxes: Vec<_> = mesh.triangles().map(|t| t.bounds()).collect();
    let mut rest = boxes.clone();
    for i in (0..count - 1).rev() {
        rest[i] = rest[i].union(rest[i + 1]);
    }
    let mut nodes = vec![BvhNode::inner(rest[0], 1)];
    for i in 0..count - 1 {
        nodes.push(BvhNode::leaf(boxes[i], to_u32(i), 1));
        if i + 2 == count {
            nodes.push(BvhNode::leaf(boxes[i + 1], to_u32(i + 1), 1));
        } else {
            nodes.push(BvhNode::inner(rest[i + 1], to_u32(nodes.len() + 1)));
        }
    }
    let bvh = Bvh { nodes, prim_ids: (0..to_u32(count)).collect() };
    for mode in Mode::ALL {
        each_kernel(mode, &bvh, &mesh, |name, scene, _| {
            for i in (0..count).step_by(7) {
                let corner = mesh.triangle(i).v0;
                let ray = Ray::new(Vec3::new(-1.0, 0.25, 0.25) * corner.x, Vec3::X);
                let expected = brute_force_in(mode, &mesh, &ray);
                assert_eq!(bits(&scene.closest_hit(&ray)), bits(&expected), "{name} {i}");
                assert!(expected.is_hit());
            }
        });
    }
}

#[test]
fn a_scene_whose_extent_is_no_number_is_traced() {
    let (mut positions, mut indices) = soup_mesh(30, 0.8, 4).into_parts();
    let first = to_u32(positions.len());
    for x in [-3.0e38, 3.0e38] {
        positions.extend([Vec3::X, Vec3::Y, Vec3::ONE].map(|p| p + Vec3::splat(x)));
    }
    indices.extend([[first, first + 1, 0], [first + 3, first + 4, 1]]);
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    assert_eq!(mesh.bounds().extent().x, f32::INFINITY);
    let bvh = median_tree(&mesh, 1);
    let rays = random_rays(300, 9);
    let full = WideScene::new(&bvh, &mesh).unwrap();
    let mut hits = 0;
    each_kernel(Mode::Watertight, &bvh, &mesh, |name, scene, _| {
        for ray in &rays {
            let expected = brute_force_in(Mode::Watertight, &mesh, ray);
            assert_eq!(bits(&scene.closest_hit(ray)), bits(&expected), "{name} {ray:?}");
            assert_eq!(bits(&full.closest_hit(ray)), bits(&expected), "{ray:?}");
            hits += usize::from(expected.is_hit());
        }
    });
    assert!(hits > 10, "the rays must meet the triangles");
}

#[test]
fn scenes_that_cannot_be_are_refused() {
    let empty = QuantisedScene::new(&Bvh::default(), &TriangleMesh::default()).unwrap();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    for kernel in QuantisedScene::<8>::kernels() {
        let scene = empty.clone().with_kernel(kernel).unwrap();
        assert_eq!(scene.closest_hit(&ray), Hit::MISS);
        assert!(!scene.any_hit(&ray));
    }
    let (mesh, small) = (soup_mesh(40, 0.2, 1), soup_mesh(30, 0.2, 1));
    let error = QuantisedScene::new(&median_tree(&mesh, 1), &small).unwrap_err();
    assert!(matches!(error, SceneError::NoSuchTriangle { triangles: 30, .. }));
    let wide = Bvh16::collapse(&Bvh::default(), &CollapseSettings::default()).unwrap();
    let scene = QuantisedScene::build_from(wide, &TriangleMesh::default()).unwrap();
    let refused = scene.with_kernel(Kernel::Avx2).unwrap_err();
    assert_eq!(refused, SceneError::KernelUnavailable(Kernel::Avx2));
}
