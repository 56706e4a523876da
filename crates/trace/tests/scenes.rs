//! Making scenes: depth, faults, counts, threads.

use niwaki_core::{
    Aabb, Bvh, BvhNode, Hit, Intersector, Ray, Triangle, TriangleMesh, glam::Vec3, to_u32,
};
use niwaki_hard_cases::median_tree;
use niwaki_trace::{AutoScene, BinaryScene, Counts, Kernel, Mode, SceneError, WideScene};
use niwaki_wide::{Bvh4, Bvh16, CollapseError, CollapseSettings};

/// Unit right triangles in planes of constant z, one per unit.
fn stack_of(count: usize) -> TriangleMesh {
    let triangles: Vec<_> = (0..count)
        .map(|i| {
            let z = Vec3::new(0.0, 0.0, i as f32);
            Triangle::new(z, z + Vec3::X, z + Vec3::Y)
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

/// A tree that is one long chain: every inner node has one triangle on its first side, in order,
/// and the rest on the other.
fn chain_tree(mesh: &TriangleMesh) -> Bvh {
    let boxes: Vec<Aabb> = mesh.triangles().map(|t| t.bounds()).collect();
    let mut rest: Vec<Aabb> = boxes.clone();
    for i in (0..boxes.len().saturating_sub(1)).rev() {
        rest[i] = rest[i].union(rest[i + 1]);
    }
    let mut nodes = Vec::new();
    for i in 0..boxes.len() {
        if i + 1 == boxes.len() {
            nodes.push(BvhNode::leaf(boxes[i], to_u32(i), 1));
        } else if i == 0 {
            nodes.push(BvhNode::inner(rest[0], 1));
            nodes.push(BvhNode::leaf(boxes[0], 0, 1));
        } else {
            nodes.push(BvhNode::inner(rest[i], to_u32(nodes.len() + 1)));
            nodes.push(BvhNode::leaf(boxes[i], to_u32(i), 1));
        }
    }
    Bvh { nodes, prim_ids: (0..to_u32(boxes.len())).collect() }
}

#[test]
fn nothing_is_hit_in_an_empty_scene() {
    let (bvh, mesh) = (Bvh::default(), TriangleMesh::default());
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(BinaryScene::new(&bvh, &mesh).unwrap().closest_hit(&ray), Hit::MISS);
    let wide = WideScene::new(&bvh, &mesh).unwrap();
    assert_eq!(wide.bytes() - 32, 0, "nothing but the padding");
    for kernel in WideScene::<8>::kernels() {
        let scene = wide.clone().with_kernel(kernel).unwrap();
        assert_eq!(scene.closest_hit(&ray), Hit::MISS);
        assert!(!scene.any_hit(&ray));
    }
}

#[test]
fn chains_of_any_depth_are_traced() {
    for count in [300, 10_000, 1_000_000] {
        let mesh = stack_of(count);
        let bvh = chain_tree(&mesh);
        let binary = BinaryScene::new(&bvh, &mesh).unwrap();
        let wide = WideScene::new(&bvh, &mesh).unwrap();
        let last = count as f32 - 1.0;
        // Towards the deep end, towards the shallow end, and past everything.
        let up = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
        let down = Ray::new(Vec3::new(0.25, 0.25, last + 1.0), -Vec3::Z);
        let past = Ray::new(Vec3::new(0.75, 0.75, -1.0), Vec3::Z);
        let check = |scene: &dyn Intersector| {
            assert_eq!(scene.closest_hit(&up).prim_id, 0);
            let hit = scene.closest_hit(&down);
            assert_eq!((hit.prim_id as usize, hit.t), (count - 1, 1.0));
            assert_eq!(scene.closest_hit(&past), Hit::MISS);
            assert!(scene.any_hit(&up) && scene.any_hit(&down) && !scene.any_hit(&past));
            let rays = [up, down, past].repeat(7);
            let (mut hits, mut flags) = (vec![Hit::MISS; 21], vec![false; 21]);
            scene.closest_hits(&rays, &mut hits);
            scene.any_hits(&rays, &mut flags);
            let last = to_u32(count - 1);
            for (hits, flags) in hits.chunks(3).zip(flags.chunks(3)) {
                assert_eq!([hits[0].prim_id, hits[1].prim_id], [0, last]);
                assert_eq!((hits[2], flags), (Hit::MISS, [true, true, false].as_slice()));
            }
        };
        check(&binary);
        for kernel in WideScene::<8>::kernels() {
            check(&wide.clone().with_kernel(kernel).unwrap());
        }
        let optimal = CollapseSettings::optimal();
        let narrow = WideScene::build_from(Bvh4::collapse(&bvh, &optimal).unwrap(), &mesh).unwrap();
        for kernel in WideScene::<4>::kernels() {
            check(&narrow.clone().with_kernel(kernel).unwrap());
        }
        let wider = WideScene::build_from(Bvh16::collapse(&bvh, &optimal).unwrap(), &mesh).unwrap();
        for kernel in WideScene::<16>::kernels() {
            check(&wider.clone().with_kernel(kernel).unwrap());
        }
    }
}

#[test]
fn counts_of_a_tiny_tree_are_as_expected() {
    // Two triangles one behind the other, each in a leaf.
    let mesh = stack_of(2);
    let boxes: Vec<Aabb> = mesh.triangles().map(|t| t.bounds()).collect();
    let bvh = Bvh {
        nodes: vec![
            BvhNode::inner(boxes[0].union(boxes[1]), 1),
            BvhNode::leaf(boxes[0], 0, 1),
            BvhNode::leaf(boxes[1], 1, 1),
        ],
        prim_ids: vec![0, 1],
    };
    let binary = BinaryScene::new(&bvh, &mesh).unwrap();
    let wide = WideScene::new(&bvh, &mesh).unwrap();
    let counts = |nodes, boxes, leaves, triangles| Counts { nodes, boxes, leaves, triangles };
    // Hits the first: the second's box is entered behind the hit and never opened.
    let ray = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
    let (hit, count) = binary.closest_hit_counted(&ray);
    assert_eq!((hit.prim_id, count), (0, counts(1, 3, 1, 1)));
    let (hit, count) = wide.closest_hit_counted(&ray);
    assert_eq!((hit.prim_id, count), (0, counts(1, 2, 1, 1)));
    // Meets both boxes, no triangle.
    let ray = Ray::new(Vec3::new(0.75, 0.75, -1.0), Vec3::Z);
    assert_eq!(binary.closest_hit_counted(&ray), (Hit::MISS, counts(1, 3, 2, 2)));
    assert_eq!(wide.closest_hit_counted(&ray), (Hit::MISS, counts(1, 2, 2, 2)));
    assert_eq!(binary.any_hit_counted(&ray), (false, counts(1, 3, 2, 2)));
    assert_eq!(wide.any_hit_counted(&ray), (false, counts(1, 2, 2, 2)));
    // Misses the root.
    let ray = Ray::new(Vec3::new(5.0, 0.75, -1.0), Vec3::Z);
    assert_eq!(binary.closest_hit_counted(&ray), (Hit::MISS, counts(0, 1, 0, 0)));
    assert_eq!(wide.closest_hit_counted(&ray), (Hit::MISS, counts(1, 2, 0, 0)));
}

#[test]
fn trees_that_do_not_fit_are_refused() {
    let mesh = stack_of(40);
    let bvh = median_tree(&mesh, 1);
    let small = stack_of(30);
    let no_triangle = |e: SceneError| matches!(e, SceneError::NoSuchTriangle { triangles: 30, .. });
    assert!(no_triangle(WideScene::new(&bvh, &small).unwrap_err()));
    assert!(no_triangle(BinaryScene::new(&bvh, &small).unwrap_err()));
    // A cycle, a child past the end, and a leaf past the ids.
    let faults: [fn(&mut Bvh); 3] = [
        |bvh| bvh.nodes[5].first = 1,
        |bvh| bvh.nodes[2].first = 1_000_000,
        |bvh| {
            bvh.prim_ids.pop();
        },
    ];
    for fault in faults {
        let mut bad = bvh.clone();
        fault(&mut bad);
        let malformed =
            |e: SceneError| matches!(e, SceneError::Collapse(CollapseError::Malformed { .. }));
        assert!(malformed(BinaryScene::new(&bad, &mesh).unwrap_err()));
        assert!(malformed(WideScene::new(&bad, &mesh).unwrap_err()));
    }
}

#[test]
fn missing_instructions_are_an_error() {
    let scene = WideScene::new(&Bvh::default(), &TriangleMesh::default()).unwrap();
    assert_eq!(WideScene::<8>::kernels().last(), Some(&scene.kernel()));
    for kernel in Kernel::ALL {
        let chosen = scene.clone().with_kernel(kernel);
        assert_eq!(chosen.is_ok(), kernel.is_available() && kernel.traces(8), "{kernel}");
    }
    // No kernel is offered for a width that it does not trace.
    let bvh = Bvh16::collapse(&Bvh::default(), &CollapseSettings::default()).unwrap();
    let scene = WideScene::build_from(bvh, &TriangleMesh::default()).unwrap();
    assert_eq!(WideScene::<16>::kernels().last(), Some(&scene.kernel()));
    for (kernel, width) in [(Kernel::Sse42, 4), (Kernel::Avx2, 4), (Kernel::Avx512, 16)] {
        let kernels =
            if width == 4 { WideScene::<4>::kernels() } else { WideScene::<16>::kernels() };
        assert_eq!(kernels.contains(&kernel), kernel.is_available(), "{kernel}, {width} wide");
    }
    let refused = scene.with_kernel(Kernel::Avx2).unwrap_err();
    assert_eq!(refused, SceneError::KernelUnavailable(Kernel::Avx2));
}

#[test]
fn scenes_are_shared_between_threads() {
    fn check<T: Send + Sync>() {}
    check::<BinaryScene>();
    check::<WideScene>();
    check::<AutoScene>();
}

#[test]
fn the_width_is_what_suits_the_kernel() {
    let mesh = stack_of(40);
    let bvh = median_tree(&mesh, 1);
    let up = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
    for mode in Mode::ALL {
        let best = AutoScene::new_in(mode, &bvh, &mesh).unwrap();
        assert_eq!((best.kernel(), best.mode()), (Kernel::best(), mode));
        for kernel in Kernel::ALL {
            assert!(kernel.traces(kernel.best_width()), "{kernel}");
            let scene = match AutoScene::for_kernel(kernel, mode, &bvh, &mesh) {
                Ok(scene) => scene,
                Err(error) => {
                    assert_eq!(error, SceneError::KernelUnavailable(kernel));
                    assert!(!kernel.is_available());
                    continue;
                }
            };
            assert_eq!((scene.kernel(), scene.width()), (kernel, kernel.best_width()));
            assert_eq!(scene.closest_hit(&up).prim_id, 0);
            assert_eq!(scene.closest_hit(&up), best.closest_hit(&up));
            assert_eq!(scene.closest_hit_counted(&up).0, best.closest_hit(&up));
            assert!(scene.any_hit(&up) && scene.any_hit_counted(&up).0 && scene.bytes() > 1000);
            // Every width has the scalar kernel; the other way round it depends on the width.
            assert_eq!(scene.clone().with_kernel(Kernel::Scalar).unwrap().width(), scene.width());
            let traced = kernel.traces(best.width());
            assert_eq!(best.clone().with_kernel(kernel).is_ok(), traced, "{kernel}");
        }
    }
    assert!(AutoScene::new(&bvh, &stack_of(30)).is_err());
}
