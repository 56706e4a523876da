//! Bonsai trees: validity on hard input, pruning, the same bytes everywhere.

use niwaki_build_bonsai::{Bonsai, Pruning};
use niwaki_build_sweep::{Kernel, Sweep};
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, BuildError, Builder, Bvh, PrimRef, SahConstants, Triangle, TriangleMesh};
use niwaki_metrics::{TreeStats, sah, validate};
use niwaki_split::{GroupSize, SplitPartition};
use proptest::prelude::*;

fn random(state: &mut u32) -> f32 {
    *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*state >> 8) as f32 / 16_777_216.0
}

/// Small triangles in clusters, and a few that span the scene.
fn soup(count: usize, seed: u32) -> TriangleMesh {
    let mut s = seed;
    let mut point = |size: f32| Vec3::new(random(&mut s), random(&mut s), random(&mut s)) * size;
    let triangles: Vec<Triangle> = (0..count)
        .map(|i| {
            let (place, size) = if i % 97 == 0 { (0.3, 1.0) } else { (1.0, 0.02) };
            let at = point(place);
            Triangle { v0: at + point(size), v1: at + point(size), v2: at + point(size) }
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

fn presets() -> [Bonsai; 5] {
    let by_deviation = Bonsai { pruning: Pruning::Deviation(1.0), ..Bonsai::bonsai() };
    let s = Bonsai::bonsai_s();
    [Bonsai::bonsai(), Bonsai::bonsai_p(), Bonsai::bonsai_p_star(), by_deviation, s]
}

/// The preset with another size of mini trees.
fn sized(preset: Bonsai, size: u32) -> Bonsai {
    let split =
        preset.split.map(|split| SplitPartition { group_size: GroupSize::Fixed(size), ..split });
    Bonsai { mini_tree_size: size, split, ..preset }
}

#[test]
fn hard_meshes_give_valid_trees() {
    for case in niwaki_hard_cases::meshes() {
        for preset in presets() {
            // Small mini trees bring every step into play, even for small meshes.
            for mini_tree_size in [1, 7, preset.mini_tree_size] {
                let bonsai = sized(preset, mini_tree_size);
                let bvh = bonsai.build_mesh(&case.mesh).unwrap();
                assert_eq!(validate(&bvh, &case.mesh), Ok(()), "{} {bonsai:?}", case.name);
            }
        }
    }
}

#[test]
fn equal_primitives_beyond_the_mini_tree_size_end() {
    let point = Triangle { v0: Vec3::ONE, v1: Vec3::ONE, v2: Vec3::ONE };
    let meshes = [
        vec![point; 100_000],
        vec![Triangle { v0: Vec3::ZERO, v1: Vec3::X, v2: Vec3::Y }; 100_000],
        // One centroid, all bounds different.
        (1..100_001_u32)
            .map(|i| {
                let e = Vec3::new(1.0, 2.0, 3.0) * i as f32;
                Triangle { v0: -e, v1: e, v2: e }
            })
            .collect(),
    ];
    for triangles in meshes {
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        for preset in presets() {
            let bvh = preset.build_mesh(&mesh).unwrap();
            assert_eq!(validate(&bvh, &mesh), Ok(()));
        }
    }
}

#[test]
fn bytes_do_not_depend_on_threads_or_kernel() {
    let mesh = soup(150_000, 4);
    for preset in presets() {
        let build = |threads, kernel| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Bonsai { kernel, ..preset }.build_mesh(&mesh).unwrap())
        };
        let expected = build(1, Kernel::Scalar);
        assert_eq!(validate(&expected, &mesh), Ok(()));
        for threads in [1, 2, 3, 8] {
            let bvh = build(threads, Kernel::best());
            assert!(same_bytes(&bvh, &expected), "{} on {threads} threads", preset.name());
        }
    }
}

fn same_bytes(a: &Bvh, b: &Bvh) -> bool {
    bytemuck::cast_slice::<_, u8>(&a.nodes) == bytemuck::cast_slice::<_, u8>(&b.nodes)
        && a.prim_ids == b.prim_ids
}

#[test]
fn meshes_and_their_references_give_the_same_tree() {
    let mesh = soup(20_000, 8);
    // Of bare references only the boxes can be split.
    for preset in presets().into_iter().filter(|preset| preset.split.is_none()) {
        let from_mesh = preset.build_mesh(&mesh).unwrap();
        assert!(same_bytes(&from_mesh, &preset.build(&mesh.prim_refs()).unwrap()));
    }
}

#[test]
fn one_mini_tree_is_the_sweep_tree() {
    let mesh = soup(400, 2);
    let sweep = Sweep::default().build_mesh(&mesh).unwrap();
    let bonsai = Bonsai::bonsai().build_mesh(&mesh).unwrap();
    assert_eq!(TreeStats::of(&bonsai), TreeStats::of(&sweep));
    let cost = |bvh| sah(bvh, &SahConstants::default());
    assert_eq!(cost(&bonsai), cost(&sweep));
}

#[test]
fn thresholds_at_the_ends_of_their_range() {
    let mesh = soup(30_000, 6);
    let build = |pruning| {
        let bvh = Bonsai { pruning, ..Bonsai::bonsai() }.build_mesh(&mesh).unwrap();
        assert_eq!(validate(&bvh, &mesh), Ok(()));
        bvh
    };
    let unpruned = build(Pruning::Off);
    // Nothing is larger: nothing is cut.
    assert!(same_bytes(&build(Pruning::Mean(1e30)), &unpruned));
    assert!(same_bytes(&build(Pruning::Deviation(1e30)), &unpruned));
    // Everything is: the top tree is a sweep over the leaves of all mini trees.
    let leaves = |bvh: &Bvh| bvh.nodes.iter().filter(|n| n.is_leaf()).count();
    let cut = build(Pruning::Mean(0.0));
    assert_eq!(leaves(&cut), leaves(&unpruned));
    assert!(same_bytes(&build(Pruning::Deviation(-1e30)), &cut));
}

#[test]
fn pruning_repairs_what_large_triangles_spoil() {
    let mesh = soup(60_000, 7);
    let cost = |bvh: &Bvh| sah(bvh, &SahConstants::THESIS_IV);
    let sweep = cost(&Sweep::default().build_mesh(&mesh).unwrap());
    let [plain, p, p_star] = [Bonsai::bonsai(), Bonsai::bonsai_p(), Bonsai::bonsai_p_star()]
        .map(|bonsai| cost(&bonsai.build_mesh(&mesh).unwrap()) / sweep);
    assert!(p < plain && p_star < plain, "{plain} {p} {p_star}");
    // Paper IV, figure 7, has 1.01 and 0.99 on average; this mesh is a bad case by design.
    assert!(p < 1.05 && p_star < 1.05, "{plain} {p} {p_star}");
}

#[test]
fn splitting_pays_where_triangles_are_large_and_no_leaf_holds_one_twice() {
    let mesh = soup(60_000, 7);
    let cost = |bvh: &Bvh| sah(bvh, &SahConstants::THESIS_V);
    let [p, s] =
        [Bonsai::bonsai_p(), Bonsai::bonsai_s()].map(|bonsai| bonsai.build_mesh(&mesh).unwrap());
    assert!(cost(&s) < 0.9 * cost(&p), "{} {}", cost(&s), cost(&p));
    assert!(s.prim_ids.len() > mesh.len() && s.prim_ids.len() < 2 * mesh.len());
    for leaf in s.nodes.iter().filter(|node| node.is_leaf()) {
        let mut ids = s.leaf_prims(leaf).to_vec();
        ids.sort_unstable();
        assert!(ids.windows(2).all(|pair| pair[0] != pair[1]));
    }
    // Boxes alone can be split too, and stay covered.
    let bvh = Bonsai::bonsai_s().build(&mesh.prim_refs()).unwrap();
    assert_eq!(validate(&bvh, &mesh), Ok(()));
}

#[test]
fn names_tell_presets_apart() {
    let names = presets().map(|b| b.name().to_owned());
    assert_eq!(names, ["bonsai", "bonsai_p", "bonsai_p_star", "bonsai_custom", "bonsai_s"]);
    assert_eq!(Bonsai::default(), Bonsai::bonsai_p());
}

#[test]
fn timings_add_up_to_the_build() {
    let mesh = soup(5000, 3);
    let (bvh, timings) = Bonsai::bonsai_p().build_mesh_timed(&mesh).unwrap();
    assert!(same_bytes(&bvh, &Bonsai::bonsai_p().build_mesh(&mesh).unwrap()));
    assert_eq!(timings.total(), timings.steps().iter().map(|(_, t)| *t).sum());
    assert!(!timings.mini_trees.is_zero());
}

#[test]
fn bad_input_is_named() {
    for (prims, index) in niwaki_hard_cases::bad_prim_refs() {
        let error = Bonsai::bonsai_p().build(&prims).unwrap_err();
        assert!(
            matches!(error, BuildError::NonFiniteBounds { index: i, .. } if i == index),
            "{error}"
        );
    }
    let good = Bonsai::bonsai();
    for bad in [
        Bonsai { mini_tree_size: 0, ..good },
        Bonsai { mini_tree_size: Bonsai::MAX_MINI_TREE_SIZE + 1, ..good },
        Bonsai { pruning: Pruning::Mean(-1.0), ..good },
        Bonsai { pruning: Pruning::Mean(f32::NAN), ..good },
        Bonsai { pruning: Pruning::Deviation(f32::INFINITY), ..good },
        Bonsai { max_leaf_size: 0, ..good },
        Bonsai {
            split: Some(SplitPartition { max_extra: -1.0, ..SplitPartition::default() }),
            ..good
        },
        sized(Bonsai::bonsai_s(), Bonsai::MAX_MINI_TREE_SIZE + 1),
    ] {
        let error = bad.build_mesh(&TriangleMesh::default()).unwrap_err();
        assert!(matches!(error, BuildError::BadSetting { .. }), "{error}");
    }
    assert_eq!(good.build(&[]).unwrap(), Bvh::default());
}

#[test]
fn deep_chains_build() {
    let mesh = TriangleMesh::from_triangles(&niwaki_hard_cases::deep_chain(10_000)).unwrap();
    for preset in presets() {
        for mini_tree_size in [16, preset.mini_tree_size] {
            let bvh = Bonsai { max_leaf_size: 1, ..sized(preset, mini_tree_size) }
                .build_mesh(&mesh)
                .unwrap();
            assert_eq!(validate(&bvh, &mesh), Ok(()));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_boxes_and_settings_give_a_sound_tree(
        corners in prop::collection::vec(
            (prop::array::uniform3(-1e3_f32..1e3), prop::array::uniform3(0.0_f32..1.0)),
            1..600,
        ),
        scale in prop::sample::select(vec![1e-38_f32, 1e-30, 1.0, 1e30]),
        mini_tree_size in 1_u32..80,
        max_leaf_size in 1_u32..9,
        fraction in prop::sample::select(vec![0.0_f32, 0.01, 0.1, 1.0]),
    ) {
        let prims: Vec<PrimRef> = corners
            .iter()
            .zip(0..)
            .map(|(&(min, extent), id)| {
                let min = Vec3::from(min) * scale;
                PrimRef::new(Aabb::new(min, min + Vec3::from(extent) * scale), id)
            })
            .collect();
        let pruning = Pruning::Mean(fraction);
        let bonsai = Bonsai { mini_tree_size, max_leaf_size, pruning, ..Bonsai::bonsai() };
        let bvh = bonsai.build(&prims).unwrap();
        let mut ids = bvh.prim_ids.clone();
        ids.sort_unstable();
        prop_assert!(ids.iter().copied().eq(prims.iter().map(|p| p.prim_id)));
        // Every node is the union of what it holds, and every range of ids is used once, in order.
        let mut next = 0;
        let mut stack = vec![0];
        while let Some(i) = stack.pop() {
            let node = &bvh.nodes[i];
            let bounds = if node.is_leaf() {
                prop_assert_eq!(node.first, next);
                next += node.count;
                prop_assert!(node.count <= max_leaf_size);
                bvh.leaf_prims(node)
                    .iter()
                    .fold(Aabb::EMPTY, |b, &id| b.union(prims[id as usize].aabb()))
            } else {
                let [left, right] = node.children();
                prop_assert!(left > i);
                stack.extend([right, left]);
                bvh.nodes[left].aabb().union(bvh.nodes[right].aabb())
            };
            prop_assert_eq!(bounds, node.aabb());
        }
        prop_assert_eq!(next as usize, prims.len());
    }
}
