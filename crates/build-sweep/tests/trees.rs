//! Sweep trees: optimal splits, validity on hard input, the same bytes everywhere.

use niwaki_build_sweep::{Kernel, SplitRule, Sweep, SweepWorkspace, build_tree};
use niwaki_core::glam::Vec3;
use niwaki_core::{
    Aabb, BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, scene_bounds,
};
use niwaki_metrics::{sah, validate};
use proptest::prelude::*;

fn boxes(count: usize, size: f32, seed: u32) -> Vec<PrimRef> {
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    (0..count)
        .map(|i| {
            let min = Vec3::new(random(), random(), random());
            let extent = Vec3::new(random(), random(), random()) * size;
            PrimRef::new(Aabb::new(min, min + extent), u32::try_from(i).unwrap())
        })
        .collect()
}

/// The lowest `A(l)·w(l) + A(r)·w(r)` over all object splits, by trying every one.
fn brute_force(prims: &[PrimRef], constants: &SahConstants) -> f64 {
    let cost = |part: &[&PrimRef]| {
        let bounds = part.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
        let weight = f64::from(constants.leaf) + f64::from(constants.triangle) * part.len() as f64;
        bounds.area() * weight
    };
    let mut best = f64::INFINITY;
    for axis in 0..3 {
        let mut sorted: Vec<&PrimRef> = prims.iter().collect();
        sorted.sort_by(|a, b| a.centroid2()[axis].total_cmp(&b.centroid2()[axis]));
        for left in 1..prims.len() {
            best = best.min(cost(&sorted[..left]) + cost(&sorted[left..]));
        }
    }
    best
}

/// Checks every node of a tree against all splits and the rule for leaves.
fn check_greedy(prims: &[PrimRef], constants: SahConstants, max_leaf_size: u32, bvh: &Bvh) {
    let mut stack = vec![0];
    // What is below a node, from the leaves: small trees only.
    fn below(bvh: &Bvh, node: usize) -> Vec<u32> {
        let mut ids = Vec::new();
        let mut stack = vec![node];
        while let Some(i) = stack.pop() {
            let node = &bvh.nodes[i];
            ids.extend(bvh.leaf_prims(node));
            if !node.is_leaf() {
                stack.extend(node.children());
            }
        }
        ids
    }
    while let Some(i) = stack.pop() {
        let node = &bvh.nodes[i];
        let ids = below(bvh, i);
        let here: Vec<PrimRef> = ids.iter().map(|&id| prims[id as usize]).collect();
        let bounds = here.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()));
        assert_eq!(bounds, node.aabb(), "node {i} is tight");
        let area = bounds.area();
        let weight =
            |n: usize| f64::from(constants.leaf) + f64::from(constants.triangle) * n as f64;
        let leaf = area * weight(here.len());
        let best = brute_force(&here, &constants);
        let inner = f64::from(constants.inner) * area;
        if node.is_leaf() {
            assert!(here.len() <= max_leaf_size as usize);
            assert!(
                here.len() == 1 || inner + best >= leaf * (1.0 - 1e-5),
                "leaf {i} of {} costs {leaf}, splitting {}",
                here.len(),
                inner + best
            );
            continue;
        }
        if here.len() <= max_leaf_size as usize {
            assert!(inner + best <= leaf * (1.0 + 1e-5), "node {i} should be a leaf");
        }
        let taken: f64 = node
            .children()
            .iter()
            .map(|&c| bvh.nodes[c].aabb().area() * weight(below(bvh, c).len()))
            .sum();
        assert!(taken <= best * (1.0 + 1e-5), "node {i}: split costs {taken}, the best {best}");
        stack.extend(node.children());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn every_split_is_the_best_of_all(
        count in 1_usize..90,
        size in prop::sample::select(vec![0.01_f32, 0.1, 1.0]),
        seed: u32,
        constants in prop::sample::select(vec![
            SahConstants::THESIS_IV,
            SahConstants::THESIS_V,
            SahConstants { inner: 1.0, leaf: 0.5, triangle: 2.0 },
        ]),
        max_leaf_size in 1_u32..9,
    ) {
        let prims = boxes(count, size, seed);
        for kernel in Kernel::available() {
            let bvh = Sweep { constants, max_leaf_size, kernel }.build(&prims).unwrap();
            check_greedy(&prims, constants, max_leaf_size, &bvh);
        }
    }

    #[test]
    fn kernels_agree_to_the_last_bit(
        count in 1_usize..700,
        seed: u32,
        scale in prop::sample::select(vec![1e-38_f32, 1e-30, 1.0, 1e30]),
        snap in any::<bool>(),
    ) {
        let mut prims = boxes(count, 0.1, seed);
        for p in &mut prims {
            // Snapping makes many equal centroids, equal costs, and zeros of both signs.
            let snap = |v: Vec3| if snap { ((v - 0.5) * 8.0).round() / 8.0 } else { v };
            (p.min, p.max) = (snap(p.min) * scale, snap(p.max) * scale);
        }
        let bytes = |kernel| Sweep { kernel, ..Sweep::default() }.build(&prims).unwrap();
        let expected = bytes(Kernel::Scalar);
        for kernel in Kernel::available() {
            let bvh = bytes(kernel);
            prop_assert_eq!(bits(&bvh), bits(&expected));
        }
    }
}

/// Nodes as bits, in which zeros of different sign differ.
fn bits(bvh: &Bvh) -> (Vec<[u32; 8]>, &[u32]) {
    let bits = |n: &BvhNode| {
        let (a, b) = (n.min.to_array().map(f32::to_bits), n.max.to_array().map(f32::to_bits));
        [a[0], a[1], a[2], n.first, b[0], b[1], b[2], n.count]
    };
    (bvh.nodes.iter().map(bits).collect(), &bvh.prim_ids)
}

#[test]
fn hard_meshes_give_valid_trees_on_every_kernel() {
    for case in niwaki_hard_cases::meshes() {
        let mut trees = Kernel::available().into_iter().map(|kernel| {
            let bvh = Sweep { kernel, ..Sweep::default() }.build_mesh(&case.mesh).unwrap();
            assert_eq!(validate(&bvh, &case.mesh), Ok(()), "{} {kernel:?}", case.name);
            let largest = bvh.nodes.iter().map(|n| n.count).max().unwrap_or(0);
            assert!(largest <= 8, "{}: a leaf of {largest}", case.name);
            bvh
        });
        let first = trees.next().unwrap();
        for other in trees {
            assert_eq!(bits(&first), bits(&other), "{}", case.name);
        }
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let prims = boxes(60_000, 0.01, 5);
    let build = |threads, kernel| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Sweep { kernel, ..Sweep::default() }.build(&prims).unwrap())
    };
    let expected = build(1, Kernel::Scalar);
    for threads in [1, 2, 3, 8] {
        for kernel in Kernel::available() {
            assert_eq!(bits(&build(threads, kernel)), bits(&expected), "{threads} {kernel:?}");
        }
    }
}

#[test]
fn the_parallel_engine_builds_the_tree_of_the_serial_one() {
    let prims = boxes(40_000, 0.02, 9);
    let rule = SplitRule::by_cost(SahConstants::default(), 8)
        .unwrap()
        .with_scale(scene_bounds(&prims).unwrap().area_scale);
    let parallel = build_tree(&prims, rule, Kernel::best());
    let mut workspace = SweepWorkspace::new(Kernel::best());
    workspace.prims.extend_from_slice(&prims);
    let mut ids = vec![0; prims.len()];
    let nodes = workspace.build(&rule, &mut ids, 0).to_vec();
    assert_eq!(nodes.len(), parallel.nodes.len());
    assert_eq!(ids, parallel.prim_ids);
    let serial = Bvh { nodes, prim_ids: ids };
    let cost = |bvh| sah(bvh, &SahConstants::default());
    assert_eq!(cost(&parallel), cost(&serial));
}

#[test]
fn equal_boxes_make_a_balanced_tree() {
    let prims: Vec<PrimRef> =
        (0..100_000).map(|i| PrimRef::new(Aabb::new(Vec3::ZERO, Vec3::ONE), i)).collect();
    let bvh = Sweep::default().build(&prims).unwrap();
    let mut deepest = 0;
    let mut stack = vec![(0, 1)];
    while let Some((i, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        if !bvh.nodes[i].is_leaf() {
            stack.extend(bvh.nodes[i].children().map(|c| (c, depth + 1)));
        }
    }
    assert!(deepest <= 16, "{deepest} levels for 100,000 in leaves of 8");
}

#[test]
fn trees_are_the_same_at_every_scale_of_the_scene() {
    let prims = boxes(5000, 0.05, 3);
    let cost = |scale: f32| {
        let scaled: Vec<PrimRef> = prims
            .iter()
            .map(|p| PrimRef { min: p.min * scale, max: p.max * scale, ..*p })
            .collect();
        let bvh = Sweep::default().build(&scaled).unwrap();
        sah(&bvh, &SahConstants::default())
    };
    let expected = cost(1.0);
    for exponent in [-100, -60, 60, 100] {
        let got = cost(2.0_f32.powi(exponent));
        assert!((got / expected - 1.0).abs() < 1e-3, "2^{exponent}: {got}, not {expected}");
    }
}

#[test]
fn deep_chains_build() {
    let chain = niwaki_hard_cases::deep_chain(10_000);
    let mesh = TriangleMesh::from_triangles(&chain).unwrap();
    for kernel in Kernel::available() {
        let bvh = Sweep { max_leaf_size: 1, kernel, ..Sweep::default() }.build_mesh(&mesh).unwrap();
        assert_eq!(validate(&bvh, &mesh), Ok(()));
    }
}

#[test]
fn bad_input_is_named() {
    for (prims, index) in niwaki_hard_cases::bad_prim_refs() {
        let error = Sweep::default().build(&prims).unwrap_err();
        assert!(
            matches!(error, BuildError::NonFiniteBounds { index: i, .. } if i == index),
            "{error}"
        );
    }
    let constants = SahConstants { inner: f32::NAN, ..SahConstants::default() };
    let bad =
        [Sweep { constants, ..Sweep::default() }, Sweep { max_leaf_size: 0, ..Sweep::default() }];
    for sweep in bad {
        assert!(matches!(sweep.build(&[]), Err(BuildError::BadSetting { .. })));
    }
    assert_eq!(Sweep::default().build(&[]).unwrap(), Bvh::default());
}
