//! Hard geometry, determinism, refusals, bounds on references, and what spatial splits promise.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_binned::Binned;
use niwaki_build_sbvh::{ObjectSplit, Sbvh};
use niwaki_build_sweep::Sweep;
use niwaki_core::glam::Vec3;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, SahConstants, TriangleMesh};
use niwaki_metrics::{TreeStats, sah, validate};
use proptest::prelude::*;
use support::*;

/// Sound, within the bound on references, no triangle twice in a leaf, equal on all threads.
fn check(name: &str, builder: &Sbvh, mesh: &TriangleMesh, pools: &[rayon::ThreadPool]) -> Bvh {
    let trees: Vec<Bvh> = pools
        .iter()
        .map(|pool| {
            let result = pool.install(|| builder.build_mesh(mesh));
            result.unwrap_or_else(|e| panic!("{builder:?} on {name}: {e}"))
        })
        .collect();
    if let Err(faults) = validate(&trees[0], mesh) {
        panic!("{builder:?} on {name}: {}", faults[0]);
    }
    for other in &trees[1..] {
        assert!(same_bytes(&trees[0], other), "{builder:?} on {name}: threads show");
    }
    check_leaves(name, builder, &trees[0], mesh.len());
    trees.into_iter().next().expect("a pool")
}

fn check_leaves(name: &str, builder: &Sbvh, bvh: &Bvh, count: usize) {
    let bound = builder.reference_bound(count);
    assert!(bvh.prim_ids.len() <= bound, "{name}: {} of {bound}", bvh.prim_ids.len());
    for leaf in bvh.nodes.iter().filter(|n| n.is_leaf()) {
        let mut ids = bvh.leaf_prims(leaf).to_vec();
        assert!(ids.len() <= builder.max_leaf_size, "{name}");
        ids.sort_unstable();
        assert!(ids.windows(2).all(|w| w[0] != w[1]), "{name}: twice in one leaf");
    }
}

fn pools(threads: &[usize]) -> Vec<rayon::ThreadPool> {
    let pool = |&n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool");
    threads.iter().map(pool).collect()
}

/// Presets, and settings at which everything is split that can be.
fn builders() -> [Sbvh; 4] {
    let eager = Sbvh { alpha: 0.0, max_leaf_size: 1, ..Sbvh::default() };
    [
        Sbvh::default(),
        Sbvh::sweep(),
        Sbvh { max_references: 4.0, sah: SahConstants::KARRAS_AILA, spatial_bins: 7, ..eager },
        Sbvh {
            object_split: ObjectSplit::Sweep { up_to: usize::MAX },
            max_references: 1.1,
            spatial_bins: 64,
            ..eager
        },
    ]
}

fn all_cases() -> impl Iterator<Item = (&'static str, TriangleMesh)> {
    let catalogue = niwaki_hard_cases::meshes().into_iter().map(|case| (case.name, case.mesh));
    hard_cases().into_iter().chain(catalogue)
}

#[test]
fn hard_cases_are_survived() {
    let few = pools(&[1, 3]);
    for (name, mesh) in all_cases() {
        check(name, &Sbvh::default(), &mesh, &few);
        // Unoptimised, the large ones take seconds with the others.
        if mesh.len() <= 5000 {
            for builder in &builders()[1..] {
                check(name, builder, &mesh, &few);
            }
        }
    }
}

#[test]
fn bare_boxes_are_split_too() {
    let pools = pools(&[1, 3]);
    for builder in builders() {
        for (name, mesh) in hard_cases().into_iter().filter(|(_, mesh)| mesh.len() <= 5000) {
            let prims = mesh.prim_refs();
            let [one, three] =
                [0, 1].map(|i| pools[i].install(|| builder.build(&prims)).expect("finite"));
            assert!(same_bytes(&one, &three), "{name}: threads show");
            check_leaves(name, &builder, &one, prims.len());
            if let Err(faults) = validate(&one, &mesh) {
                panic!("{name}: {}", faults[0]);
            }
        }
    }
}

#[test]
fn large_nodes_do_not_show_threads() {
    // Large enough for several levels of parallel binning, cutting and moving.
    let mesh = long_soup(100_000, 0.1, 6);
    let bvh = check("soup", &Sbvh::default(), &mesh, &pools(&[1, 2, 3, 8]));
    assert!(bvh.prim_ids.len() > mesh.len());
}

#[test]
fn references_keep_their_ids() {
    let mut prims = soup(9000, 5).prim_refs();
    for p in &mut prims {
        p.prim_id = p.prim_id * 7 + 3;
    }
    let mut ids = Sbvh::default().build(&prims).expect("finite").prim_ids;
    ids.sort_unstable();
    ids.dedup();
    assert!(ids.iter().copied().eq(prims.iter().map(|p| p.prim_id)));

    // Equal references that a caller gives meet in a leaf, which names them once.
    let twice: Vec<PrimRef> = prims[..1000].iter().flat_map(|&p| [p, p]).collect();
    let bvh = Sbvh::default().build(&twice).expect("finite");
    check_leaves("twice", &Sbvh::default(), &bvh, twice.len());

    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut prims = prims.clone();
        prims[5000].max.z = bad;
        let error = Sbvh::default().build(&prims).expect_err("not finite");
        assert!(
            matches!(error, BuildError::NonFiniteBounds { index: 5000, prim_id: 35_003, .. }),
            "{error}"
        );
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = Sbvh::default();
    for bins in [0, 1, 65, usize::MAX] {
        let object_split = ObjectSplit::Bins(bins);
        assert_eq!(refused(&Sbvh { object_split, ..good }), "object_split");
    }
    for spatial_bins in [0, 1, 257] {
        assert_eq!(refused(&Sbvh { spatial_bins, ..good }), "spatial_bins");
    }
    for alpha in [-1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(refused(&Sbvh { alpha, ..good }), "alpha");
    }
    for max_references in [0.9, 17.0, f32::NAN] {
        assert_eq!(refused(&Sbvh { max_references, ..good }), "max_references");
    }
    for count_exponent in [0.2, 1.1, f32::NAN] {
        assert_eq!(refused(&Sbvh { count_exponent, ..good }), "count_exponent");
    }
    assert_eq!(refused(&Sbvh { max_leaf_size: 0, ..good }), "max_leaf_size");
    let sah = SahConstants { triangle: -1.0, ..SahConstants::THESIS_IV };
    assert_eq!(refused(&Sbvh { sah, ..good }), "sah");
}

/// Long thin triangles in all directions.
fn long_soup(count: usize, length: f32, seed: u64) -> TriangleMesh {
    let mut rng = Rng(seed);
    mesh((0..count).map(|_| {
        let (center, along) = (rng.cube(), rng.cube() * length);
        [center - along, center + along, center + along + rng.cube() * 0.001]
    }))
}

/// Thin triangles side by side, diagonal to all axes: boxes that overlap far more than they hold.
fn beams(count: usize) -> TriangleMesh {
    mesh((0..count).map(|i| {
        let from = Vec3::X * (i as f32 * 0.05);
        [from, from + Vec3::ONE, from + Vec3::ONE * 0.5 + Vec3::X * 0.002]
    }))
}

#[test]
fn spatial_splits_pay_where_triangles_are_long() {
    let mesh = beams(500);
    let cost = |builder: &dyn Builder| {
        let bvh = builder.build_mesh(&mesh).expect("finite");
        sah(&bvh, &SahConstants::THESIS_IV)
    };
    let costs = [1.0, 2.0, 4.0, 8.0]
        .map(|max_references| cost(&Sbvh { max_references, ..Sbvh::default() }));
    assert!(costs.windows(2).all(|pair| pair[1] < pair[0]), "{costs:?}");
    assert!(costs[3] < 0.7 * costs[0], "{costs:?}");
    assert!(costs[3] < 0.7 * cost(&Binned::default()), "{costs:?}");
}

#[test]
fn without_room_it_is_the_object_split_builder() {
    let mesh = soup(5000, 3);
    let sbvh = Sbvh {
        max_references: 1.0,
        count_exponent: 1.0,
        object_split: ObjectSplit::Sweep { up_to: usize::MAX },
        ..Sbvh::sweep()
    }
    .build_mesh(&mesh)
    .expect("finite");
    let sweep = Sweep::default().build_mesh(&mesh).expect("finite");
    assert_eq!(sbvh.prim_ids.len(), mesh.len());
    let [a, b] = [&sbvh, &sweep].map(|bvh| sah(bvh, &SahConstants::THESIS_IV));
    assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
}

#[test]
fn a_closed_mesh_of_even_triangles_is_hardly_split() {
    let mesh = niwaki_hard_cases::closed_star(5, 1.0, Vec3::ZERO, 1);
    let bvh = Sbvh::default().build_mesh(&mesh).expect("finite");
    let duplication = TreeStats::of(&bvh).duplication;
    assert!(duplication < 1.3, "{duplication}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Everything overlaps everything: covered, within the bound, equal on all threads.
    #[test]
    fn splitting_keeps_cover_and_bounds(
        count in 1_usize..400,
        seed: u64,
        length in prop::sample::select(vec![0.01_f32, 0.3, 3.0]),
        max_references in prop::sample::select(vec![1.0_f32, 1.3, 3.0, 16.0]),
        spatial_bins in prop::sample::select(vec![2_usize, 3, 16, 100, 256]),
        alpha in prop::sample::select(vec![0.0_f32, 1e-5, 1e-2]),
        max_leaf_size in 1_usize..9,
        swept: bool,
    ) {
        let object_split =
            if swept { ObjectSplit::Sweep { up_to: 100 } } else { ObjectSplit::Bins(16) };
        let builder = Sbvh {
            object_split, spatial_bins, alpha, max_references, max_leaf_size, ..Sbvh::default()
        };
        check("soup", &builder, &long_soup(count, length, seed), &pools(&[1, 3]));
    }
}
