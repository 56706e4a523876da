//! Splitters: coverage, bounds on duplication, determinism, hard input.

use niwaki_build_binned::Binned;
use niwaki_build_sweep::Sweep;
use niwaki_core::glam::Vec3;
use niwaki_core::{
    Aabb, BoxClip, BuildError, Builder, Bvh, BvhNode, Clip, PrimRef, Triangle, TriangleMesh, to_u32,
};
use niwaki_metrics::validate;
use niwaki_split::{
    EarlySplit, EdgeVolume, GroupSize, KarrasAila, PreSplit, PreSplitter, SlackSplit,
    SplitPartition,
};
use proptest::prelude::*;

/// Small groups bring every step into play for small meshes.
fn partition() -> SplitPartition {
    SplitPartition { group_size: GroupSize::Fixed(8), ..SplitPartition::default() }
}

/// Splits whatever has two parts that are not larger than the whole.
fn any_slack() -> SlackSplit {
    SlackSplit { max_ratio: 1.0, max_ratio_largest: 1.0, ..SlackSplit::default() }
}

fn splitters() -> Vec<Box<dyn PreSplitter>> {
    vec![
        Box::new(SplitPartition::default()),
        Box::new(partition()),
        Box::new(SplitPartition { reference_cost: 1.5, max_extra: 0.2, ..partition() }),
        Box::new(EarlySplit::default()),
        Box::new(EarlySplit { max_area: 1e-6, max_extra: 3.0 }),
        Box::new(EdgeVolume::default()),
        Box::new(EdgeVolume { max_volume: 1e-10, max_extra: 3.0 }),
        Box::new(KarrasAila::default()),
        Box::new(KarrasAila { max_extra: 4.0 }),
        Box::new(SlackSplit::default()),
        Box::new(SlackSplit { min_area: 0.01, planes: 1, max_extra: 3.0, ..any_slack() }),
    ]
}

/// Every reference as a leaf, so that `validate` judges what they cover.
fn leaves(prims: &[PrimRef]) -> Bvh {
    let boxes: Vec<Aabb> = prims.iter().map(PrimRef::aabb).collect();
    let mut below = Aabb::EMPTY;
    let mut bounds: Vec<Aabb> = boxes
        .iter()
        .rev()
        .map(|b| {
            below = below.union(*b);
            below
        })
        .collect();
    bounds.reverse();
    // A chain: each inner node has one leaf and the rest.
    let mut nodes = Vec::new();
    for (i, b) in boxes.iter().enumerate() {
        let is_last = i + 1 == boxes.len();
        let place = if i == 0 { 0 } else { 2 * i };
        nodes.resize(place + 1, BvhNode::leaf(Aabb::EMPTY, 0, 0));
        if is_last {
            nodes[place] = BvhNode::leaf(*b, to_u32(i), 1);
        } else {
            let first = to_u32(2 * i + 1);
            nodes[place] = BvhNode::inner(bounds[i], first);
            nodes.push(BvhNode::leaf(*b, to_u32(i), 1));
        }
    }
    Bvh { nodes, prim_ids: prims.iter().map(|p| p.prim_id).collect() }
}

fn diagonals(count: u32) -> TriangleMesh {
    let triangles: Vec<Triangle> = (0..count)
        .map(|i| {
            let a = i as f32;
            Triangle::new(
                Vec3::new(a, 0.0, -a),
                Vec3::new(1000.0 - a, 1000.0, 1000.0),
                Vec3::new(a + 3.0, 1.0, a),
            )
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

fn check(splitter: &dyn PreSplitter, mesh: &TriangleMesh, name: &str) -> Vec<PrimRef> {
    let prims = splitter.split_mesh(mesh).unwrap();
    let what = format!("{} on {name}", splitter.suffix());
    assert!(prims.len() <= splitter.max_references(mesh.len()), "{what}");
    for p in &prims {
        let whole = mesh.triangle(p.prim_id as usize).bounds();
        assert!(whole.contains(&p.aabb()) && !p.aabb().is_empty(), "{what}: {p:?}");
    }
    if let Err(faults) = validate(&leaves(&prims), mesh) {
        panic!("{what}: {}", faults[0]);
    }
    prims
}

#[test]
fn hard_meshes_stay_covered() {
    for case in niwaki_hard_cases::meshes() {
        for splitter in splitters() {
            check(splitter.as_ref(), &case.mesh, case.name);
            let boxes = splitter.split_boxes(&case.mesh.prim_refs()).unwrap();
            assert!(boxes.len() <= splitter.max_references(case.mesh.len()));
        }
    }
}

#[test]
fn trees_over_split_references_are_valid() {
    for case in niwaki_hard_cases::meshes().into_iter().filter(|case| case.mesh.len() < 20_000) {
        let builders: [Box<dyn Builder>; 5] = [
            Box::new(PreSplit::new(Sweep::default(), partition())),
            Box::new(PreSplit::new(Binned::default(), partition())),
            Box::new(PreSplit::new(Sweep::default(), EarlySplit::default())),
            Box::new(PreSplit::new(Sweep::default(), EdgeVolume::default())),
            Box::new(PreSplit::new(Binned::default(), KarrasAila::default())),
        ];
        let names = builders.each_ref().map(|b| b.name().to_owned());
        assert_eq!(names, ["sweep_pre", "binned_pre", "sweep_esc", "sweep_evh", "binned_ka"]);
        for builder in builders {
            let bvh = builder.build_mesh(&case.mesh).unwrap();
            assert_eq!(validate(&bvh, &case.mesh), Ok(()), "{} {}", builder.name(), case.name);
            for leaf in bvh.nodes.iter().filter(|node| node.is_leaf()) {
                let mut ids = bvh.leaf_prims(leaf).to_vec();
                ids.sort_unstable();
                assert!(ids.windows(2).all(|w| w[0] != w[1]), "no id twice in a leaf");
            }
            let bvh = builder.build(&case.mesh.prim_refs()).unwrap();
            assert_eq!(validate(&bvh, &case.mesh), Ok(()), "{} {}", builder.name(), case.name);
        }
    }
}

/// Diagonals all overlap every plane: whatever may be split is, up to the bound and not beyond.
#[test]
fn where_everything_wants_to_split_the_bound_holds() {
    let mesh = diagonals(20_000);
    let mut last = mesh.len();
    for max_extra in [0.0, 0.1, 0.5, 1.0, 4.0] {
        let prims = check(&SplitPartition { max_extra, ..partition() }, &mesh, "diagonals");
        let bound = mesh.len() as f64 * f64::from(1.0 + max_extra);
        // A set whose room does not suffice for all that overlaps is not split, so that little
        // room may go unused.
        assert!(prims.len() >= last && prims.len() as f64 <= bound, "{max_extra}");
        if max_extra >= 1.0 {
            assert!(prims.len() as f64 > 0.75 * bound, "{} of {bound}", prims.len());
        }
        last = prims.len();
        for splitter in [
            &EarlySplit { max_area: 1e-7, max_extra } as &dyn PreSplitter,
            &EdgeVolume { max_volume: 1e-9, max_extra },
            &KarrasAila { max_extra },
            &SlackSplit { min_area: 1e-3, planes: 1, max_extra, ..any_slack() },
        ] {
            let prims = check(splitter, &mesh, "diagonals");
            let used = prims.len() as f64 / bound;
            assert!(max_extra == 0.0 || used > 0.6, "{} uses {used}", splitter.suffix());
        }
    }
}

#[test]
fn karras_and_aila_spend_their_budget() {
    let mesh = niwaki_hard_cases::soup_mesh(20_000, 0.1, 9);
    for max_extra in [0.1, 0.3, 2.0] {
        let prims = check(&KarrasAila { max_extra }, &mesh, "soup");
        let spent = (prims.len() - mesh.len()) as f32 / (mesh.len() as f32 * max_extra);
        assert!(spent > 0.8, "{spent} of {max_extra}");
    }
}

#[test]
fn slack_is_split_off_and_nothing_else() {
    // Small triangles set the mean; then one across the scene, and a wall as large.
    let mut triangles = niwaki_hard_cases::soup(1000, 0.01, 5);
    let (low, high) = (Vec3::ZERO, Vec3::splat(10.0));
    triangles.push(Triangle::new(low, high, high - Vec3::new(0.1, 0.0, 0.0)));
    triangles.push(Triangle::new(low, Vec3::new(10.0, 0.0, 0.0), Vec3::new(0.0, 10.0, 0.0)));
    let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
    let splitter = SlackSplit::default();
    let prims = check(&splitter, &mesh, "two large triangles");
    let of = |id: u32| prims.iter().filter(move |p| p.prim_id == id);
    assert!(of(1000).count() > 8);
    let area = |id: u32| of(id).map(|p| p.aabb().area()).sum::<f64>();
    assert!(area(1000) < 0.1 * mesh.triangle(1000).bounds().area());
    assert!((0..1000).chain([1001]).all(|id| of(id).count() == 1));
    // The parts of full boxes have no less area.
    let boxes = mesh.prim_refs();
    assert_eq!(splitter.split_boxes(&boxes), Ok(boxes));
    // Nothing stands out of an even tessellation, however slack its boxes are.
    let even = niwaki_hard_cases::sheet(50, |x, y| Vec3::new(x as f32, y as f32, (x + y) as f32));
    assert_eq!(splitter.split_mesh(&even), Ok(even.prim_refs()));
}

#[test]
fn bytes_do_not_depend_on_threads() {
    fn same(splitter: &dyn PreSplitter, mesh: &TriangleMesh) {
        let results = [1, 2, 3, 8].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| splitter.split_mesh(mesh).unwrap())
        });
        let bytes = results.each_ref().map(|r| bytemuck::cast_slice::<PrimRef, u8>(r));
        assert!(bytes[1..].iter().all(|b| *b == bytes[0]), "{}", splitter.suffix());
    }
    // Large enough for a division by all threads, with splits and without.
    same(&SplitPartition::default(), &niwaki_hard_cases::soup_mesh(150_000, 0.05, 3));
    same(&SplitPartition::default(), &diagonals(135_000));
    let mesh = niwaki_hard_cases::soup_mesh(20_000, 0.1, 3);
    same(&partition(), &mesh);
    same(&EarlySplit::default(), &mesh);
    same(&EdgeVolume::default(), &mesh);
    same(&KarrasAila::default(), &mesh);
    same(&SlackSplit { min_area: 0.5, ..SlackSplit::default() }, &mesh);
}

#[test]
fn groups_hold_what_they_may_and_no_primitive_twice() {
    let mesh = niwaki_hard_cases::soup_mesh(20_000, 0.05, 1);
    for size in [1, 16, 500] {
        let config =
            SplitPartition { group_size: GroupSize::Fixed(size), ..SplitPartition::default() };
        let partition = config.partition_mesh(&mesh).unwrap();
        assert_eq!(partition.bounds(), mesh.bounds());
        assert_eq!(partition.references(), mesh.len() + partition.added());
        assert!(partition.added() > 0, "large triangles overlap planes");
        let mut count = 0;
        for group in partition.groups() {
            assert!(!group.is_empty() && group.len() <= size as usize);
            let mut ids: Vec<u32> = group.iter().map(|p| p.prim_id).collect();
            ids.sort_unstable();
            assert!(ids.windows(2).all(|w| w[0] != w[1]));
            count += group.len();
        }
        assert_eq!(count, partition.references());
        let groups: Vec<PrimRef> =
            partition.groups().flat_map(|group| group.iter()).copied().collect();
        assert_eq!(partition.into_prims(), groups);
    }
}

/// Two large triangles across clusters of small ones: the decision of section 3.2 by hand.
#[test]
fn a_large_triangle_is_split_where_its_halves_are_cheaper() {
    let small = |x: f32| {
        let at = Vec3::new(x, 0.0, 0.0);
        Triangle::new(at, at + Vec3::X * 0.1, at + Vec3::Y * 0.1)
    };
    let mut triangles: Vec<Triangle> =
        (0..100).map(|i| small(if i % 2 == 0 { 0.0 } else { 10.0 })).collect();
    triangles.push(Triangle::new(Vec3::ZERO, Vec3::X * 10.0, Vec3::new(0.0, 1.0, 0.0)));
    let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
    let config = SplitPartition { group_size: GroupSize::Fixed(60), ..SplitPartition::default() };
    let partition = config.partition_mesh(&mesh).unwrap();
    // Unsplit, one group of 51 would be 10 wide; split, both are about half of that.
    assert_eq!(partition.added(), 1);
    assert!(partition.groups().all(|group| group.len() == 51));
    let none = SplitPartition { max_extra: 0.0, ..config }.partition_mesh(&mesh).unwrap();
    assert_eq!(none.added(), 0);
}

#[test]
fn thresholds_of_groups_are_those_of_the_paper() {
    let of = |count| GroupSize::Interpolated.of(count);
    assert_eq!([0, 99_999, 100_000].map(of), [512; 3]);
    assert_eq!([4_000_000, 12_759_246].map(of), [8192; 2]);
    assert_eq!(of(2_050_000), 4352);
    assert_eq!(GroupSize::Fixed(7).of(1 << 30), 7);
}

#[test]
fn even_tessellations_stay_nearly_whole_with_a_cost_of_references() {
    let mesh = niwaki_hard_cases::sheet(200, |x, y| {
        let (x, y) = (x as f32, y as f32);
        Vec3::new(x, y, (x * 0.1).sin() * (y * 0.07).cos() * 20.0)
    });
    let added = |reference_cost| {
        let config = SplitPartition { reference_cost, ..SplitPartition::default() };
        config.partition_mesh(&mesh).unwrap().added()
    };
    assert!(added(1.5) * 50 <= mesh.len(), "{}", added(1.5));
    assert!(added(1.5) <= added(0.0));
}

#[test]
fn bad_input_is_named() {
    for (prims, index) in niwaki_hard_cases::bad_prim_refs() {
        for splitter in splitters() {
            let error = splitter.split_boxes(&prims).unwrap_err();
            assert!(matches!(error, BuildError::NonFiniteBounds { index: i, .. } if i == index));
        }
    }
    let bad: [(Box<dyn PreSplitter>, &str); 15] = [
        (Box::new(SplitPartition { max_extra: -1.0, ..partition() }), "max_extra"),
        (Box::new(SplitPartition { max_extra: f32::NAN, ..partition() }), "max_extra"),
        (Box::new(SplitPartition { reference_cost: -0.5, ..partition() }), "reference_cost"),
        (Box::new(SplitPartition { group_size: GroupSize::Fixed(0), ..partition() }), "group_size"),
        (Box::new(EarlySplit { max_area: 0.0, max_extra: 1.0 }), "max_area"),
        (Box::new(EarlySplit { max_area: 0.1, max_extra: f32::INFINITY }), "max_extra"),
        (Box::new(EdgeVolume { max_volume: f32::NAN, max_extra: 1.0 }), "max_volume"),
        (Box::new(EdgeVolume { max_volume: 1e-30, max_extra: 1.0 }), "max_volume"),
        (Box::new(KarrasAila { max_extra: -0.1 }), "max_extra"),
        (Box::new(SlackSplit { max_ratio: 0.0, ..SlackSplit::default() }), "max_ratio"),
        (Box::new(SlackSplit { max_ratio: 1.1, ..SlackSplit::default() }), "max_ratio"),
        (Box::new(SlackSplit { max_ratio_largest: f32::NAN, ..any_slack() }), "max_ratio_largest"),
        (Box::new(SlackSplit { min_area: f32::NAN, ..SlackSplit::default() }), "min_area"),
        (Box::new(SlackSplit { planes: 0, ..SlackSplit::default() }), "planes"),
        (Box::new(SlackSplit { max_extra: -0.1, ..SlackSplit::default() }), "max_extra"),
    ];
    for (splitter, name) in bad {
        let error = splitter.split_mesh(&TriangleMesh::default()).unwrap_err();
        assert!(
            matches!(error, BuildError::BadSetting { setting, .. } if setting == name),
            "{error}"
        );
    }
    for splitter in splitters() {
        assert_eq!(splitter.split_mesh(&TriangleMesh::default()), Ok(vec![]));
    }
}

/// A clipper that finds nothing of a primitive in its box must not make it vanish.
#[test]
fn nothing_is_lost_to_a_clipper_that_returns_nothing() {
    struct Nothing;
    impl Clip for Nothing {
        fn clip(&self, _: &PrimRef, _: usize, _: f32) -> [Aabb; 2] {
            [Aabb::EMPTY; 2]
        }
    }
    let mesh = diagonals(500);
    let partition = partition().partition(&mesh.prim_refs(), &Nothing).unwrap();
    let mut ids: Vec<u32> =
        partition.groups().flat_map(|group| group.iter()).map(|p| p.prim_id).collect();
    ids.sort_unstable();
    assert!(ids.into_iter().eq(0..500));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_triangles_stay_covered(
        corners in prop::collection::vec(
            (prop::array::uniform3(-1e3_f32..1e3), prop::array::uniform6(-300.0_f32..300.0)),
            1..120,
        ),
        scale in prop::sample::select(vec![1e-38_f32, 1e-30, 1.0, 1e30]),
        snap in prop::sample::select(vec![0.0_f32, 50.0]),
        max_extra in 0.0_f32..3.0,
        size in 1_u32..30,
    ) {
        let corner = |p: Vec3| {
            let p = if snap > 0.0 { (p / snap).round() * snap } else { p };
            p * scale
        };
        let triangles: Vec<Triangle> = corners
            .iter()
            .map(|&(at, [a, b, c, d, e, f])| {
                let at = Vec3::from(at);
                let [p, q] = [Vec3::new(a, b, c), Vec3::new(d, e, f)].map(|v| corner(at + v));
                Triangle::new(corner(at), p, q)
            })
            .collect();
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        let group_size = GroupSize::Fixed(size);
        let config = SplitPartition { group_size, max_extra, ..SplitPartition::default() };
        let prims = check(&config, &mesh, "any triangles");
        for splitter in [
            &EarlySplit { max_area: 1e-3, max_extra } as &dyn PreSplitter,
            &EdgeVolume { max_volume: 1e-5, max_extra },
            &KarrasAila { max_extra },
            &SlackSplit { min_area: 1e-3, planes: 1, max_extra, ..any_slack() },
        ] {
            check(splitter, &mesh, "any triangles");
        }
        // References that were split already can be split on: their boxes stay covered.
        let again = config.partition(&prims, &BoxClip).unwrap();
        let volume = |prims: &mut dyn Iterator<Item = &PrimRef>| -> f64 {
            prims.map(|p| p.aabb().extent().as_dvec3().element_product()).sum()
        };
        let [before, after] =
            [volume(&mut prims.iter()), volume(&mut again.groups().flat_map(|group| group.iter()))];
        prop_assert!((before - after).abs() <= before * 1e-4, "{before} {after}");
    }
}
