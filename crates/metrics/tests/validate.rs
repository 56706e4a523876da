//! Sound trees pass; every fault is named.

mod common;

use common::{Split, build, chain, soup};
use niwaki_core::{Aabb, Bvh, BvhNode, SahConstants, TriangleMesh, glam::Vec3};
use niwaki_metrics::{
    TreeStats, ValidateOptions, Violation, epo, epo_sampled, leaf_counts, sah, validate,
    validate_with,
};
use proptest::prelude::*;

#[test]
fn sound_trees_pass_on_every_hard_case() {
    for case in niwaki_hard_cases::meshes() {
        for split in [Split::Never, Split::Sometimes, Split::Always] {
            if split == Split::Always && case.mesh.len() > 5_000 {
                continue;
            }
            let bvh = build(&case.mesh, 4, split);
            let result = validate(&bvh, &case.mesh);
            assert!(result.is_ok(), "{}, {split:?}: {:?}", case.name, result.unwrap_err()[0]);
            let stats = TreeStats::of(&bvh);
            assert_eq!(stats.primitives, case.mesh.len(), "{}", case.name);
            assert_eq!(stats.nodes, bvh.nodes.len(), "{}", case.name);
            assert!(sah(&bvh, &SahConstants::THESIS_V).is_finite(), "{}", case.name);
        }
    }
}

/// The violations after a change to a sound tree.
fn after(change: impl FnOnce(&mut Bvh)) -> Vec<Violation> {
    let mesh = soup(20, 0.2, 1);
    let mut bvh = build(&mesh, 2, Split::Never);
    assert_eq!(validate(&bvh, &mesh), Ok(()));
    change(&mut bvh);
    validate(&bvh, &mesh).unwrap_err()
}

fn first_leaf(bvh: &Bvh) -> usize {
    bvh.nodes.iter().position(BvhNode::is_leaf).unwrap()
}

#[test]
fn every_fault_is_named() {
    use Violation as V;
    macro_rules! assert_found {
        ($found:expr, $pattern:pat) => {
            let found = $found;
            assert!(found.iter().any(|v| matches!(v, $pattern)), "{found:?}");
        };
    }
    assert_found!(after(|b| b.nodes.clear()), V::NoNodes { triangles: 20 });
    assert_found!(
        after(|b| b.nodes[0].first = 1000),
        V::ChildOutOfRange { node: 0, first_child: 1000, .. }
    );
    assert_found!(
        after(|b| b.nodes[0].first = u32::MAX),
        V::ChildOutOfRange { node: 0, first_child: u32::MAX, .. }
    );
    assert_found!(
        after(|b| b.nodes[1].first = 1),
        V::ChildNotAfterParent { node: 1, first_child: 1 }
    );
    assert_found!(after(|b| b.nodes[1].first = 0), V::ChildNotAfterParent { node: 1, .. });
    let shared = after(|b| b.nodes[1].first = b.nodes[2].first);
    assert_found!(&shared, V::SharedNode { parents: 2, .. });
    assert_found!(&shared, V::UnreachableNode { .. });
    assert_found!(
        after(|b| b.nodes.extend([BvhNode::leaf(Aabb::EMPTY, 0, 1); 2])),
        V::UnreachableNode { .. }
    );
    assert_found!(after(|b| b.nodes[2].min.x = f32::NAN), V::BadBox { node: 2, .. });
    assert_found!(after(|b| b.nodes[0].max.z = f32::INFINITY), V::BadBox { node: 0, .. });
    assert_found!(
        after(|b| b.nodes[0].min.x = b.nodes[0].min.x.next_up()),
        V::ChildOutsideParent { node: 0, .. }
    );
    assert_found!(
        after(|b| {
            let leaf = first_leaf(b);
            b.nodes[leaf].count = u32::MAX;
        }),
        V::LeafRangeOutOfRange { .. }
    );
    assert_found!(
        after(|b| {
            let leaf = first_leaf(b);
            b.nodes[leaf].first += 1;
        }),
        V::UnusedEntry { .. }
    );
    assert_found!(
        after(|b| {
            let leaf = first_leaf(b);
            b.nodes[leaf].count += 1;
        }),
        V::SharedEntry { leaves: 2, .. }
    );
    assert_found!(
        after(|b| b.prim_ids[7] = 20),
        V::PrimOutOfRange { entry: 7, prim_id: 20, triangles: 20 }
    );
    let lost = after(|b| b.prim_ids[7] = b.prim_ids[8]);
    assert_found!(&lost, V::LostPrim { .. });
    assert_found!(
        after(|b| {
            let leaf = first_leaf(b);
            b.nodes[leaf].max.y = b.nodes[leaf].max.y.next_down();
        }),
        V::PrimOutsideLeaf { .. }
    );
}

/// True if one of 5,000 points of a triangle is in no leaf that holds it.
fn sees_gap(bvh: &Bvh, mesh: &TriangleMesh, id: u32) -> bool {
    let leaves: Vec<&BvhNode> =
        bvh.nodes.iter().filter(|n| n.is_leaf() && bvh.leaf_prims(n).contains(&id)).collect();
    let [a, b, c] = mesh.triangle(id as usize).vertices().map(|v| v.as_dvec3());
    (0..100).flat_map(|i| (0..100 - i).map(move |j| (i, j))).any(|(i, j)| {
        let (u, v) = (f64::from(i) / 100.0 + 0.003, f64::from(j) / 100.0 + 0.003);
        let point = a + (b - a) * u + (c - a) * v;
        !leaves
            .iter()
            .any(|n| (n.min.as_dvec3().cmple(point) & n.max.as_dvec3().cmpge(point)).all())
    })
}

#[test]
fn parts_of_split_triangles_that_no_box_covers_are_found() {
    let mesh = soup(60, 0.8, 2);
    let bvh = build(&mesh, 2, Split::Sometimes);
    assert_eq!(validate(&bvh, &mesh), Ok(()));
    let mut found = 0;
    let mut tried = 0;
    for (leaf, node) in bvh.nodes.iter().enumerate().filter(|(_, n)| n.is_leaf()) {
        // Shave a hundredth off one side: some triangle of the leaf loses a part.
        let mut broken = bvh.clone();
        let axis = node.aabb().longest_axis();
        broken.nodes[leaf].max[axis] -= node.aabb().extent()[axis] * 0.01;
        tried += 1;
        let Err(violations) = validate(&broken, &mesh) else {
            // A corner alone may lose too little area to count: no sample may see the loss.
            let uncovered = broken.leaf_prims(node).iter().any(|&id| sees_gap(&broken, &mesh, id));
            assert!(!uncovered, "the gap in leaf {leaf} was not found");
            continue;
        };
        found += 1;
        for violation in violations {
            match violation {
                Violation::PrimNotCovered { prim_id, leaves, uncovered } => {
                    assert!(broken.leaf_prims(node).contains(&prim_id));
                    assert!(leaves > 1 && uncovered > 1e-6 && uncovered < 0.5);
                }
                Violation::PrimOutsideLeaf { prim_id, node: outside } => {
                    assert!(broken.leaf_prims(node).contains(&prim_id));
                    assert_eq!(outside as usize, leaf);
                }
                other => panic!("{other}"),
            }
        }
    }
    assert!(found * 10 > tried * 8, "{found} of {tried}");
}

#[test]
fn half_a_triangle_without_its_box_is_half_uncovered() {
    let mesh =
        TriangleMesh::new(vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0], vec![[0, 1, 2]]).unwrap();
    let tree = |split: f32| {
        let (left, right) = (
            Aabb::new(Vec3::ZERO, Vec3::new(2.0, 4.0, 0.0)),
            Aabb::new(Vec3::X * split, Vec3::new(4.0, 2.0, 0.0)),
        );
        Bvh {
            nodes: vec![
                BvhNode::inner(mesh.bounds(), 1),
                BvhNode::leaf(left, 0, 1),
                BvhNode::leaf(right, 1, 1),
            ],
            prim_ids: vec![0, 0],
        }
    };
    assert_eq!(validate(&tree(2.0), &mesh), Ok(()));
    // From 2 to 3 lies a strip of area 1.5 out of 8.
    let violations = validate(&tree(3.0), &mesh).unwrap_err();
    assert_eq!(
        violations,
        [Violation::PrimNotCovered { prim_id: 0, leaves: 2, uncovered: 1.5 / 8.0 }]
    );
    // A gap of two ulp of the largest coordinate: nothing for 4 ulp of tolerance.
    let gap = tree(2.0 + 2.0 * (4.0_f32.next_up() - 4.0));
    let exact = ValidateOptions { uncovered_area: 1e-9, ..ValidateOptions::default() };
    assert!(validate_with(&gap, &mesh, &exact).is_err());
    assert!(validate_with(&gap, &mesh, &ValidateOptions { widen_ulps: 4.0, ..exact }).is_ok());
}

#[test]
fn the_number_of_violations_is_capped() {
    let mesh = soup(2_000, 0.1, 3);
    let mut bvh = build(&mesh, 2, Split::Never);
    for node in &mut bvh.nodes {
        node.max = node.min;
    }
    assert_eq!(validate(&bvh, &mesh).unwrap_err().len(), 100);
    let one = ValidateOptions { max_violations: 1, ..ValidateOptions::default() };
    assert_eq!(validate_with(&bvh, &mesh, &one).unwrap_err().len(), 1);
    // Without nodes, all of the mesh is lost.
    let nothing = validate(&Bvh::default(), &mesh).unwrap_err();
    assert_eq!((nothing.len(), &nothing[0]), (100, &Violation::NoNodes { triangles: 2_000 }));
    assert_eq!(validate(&Bvh::default(), &TriangleMesh::default()), Ok(()));
}

#[test]
fn a_chain_of_a_million_nodes_overflows_nothing() {
    let count = 1_000_000;
    let (bvh, mesh) = chain(count);
    assert_eq!(validate(&bvh, &mesh), Ok(()));
    let stats = TreeStats::of(&bvh);
    assert_eq!(stats.depth_max, count - 1);
    assert_eq!((stats.inner_nodes, stats.leaf_nodes), (count - 1, count));
    // Depths 1, 2, …, n − 1 and another n − 1.
    let n = count as f64;
    assert_eq!(stats.depth_mean, (n * (n - 1.0) / 2.0 + n - 1.0) / n);
    let ray = niwaki_core::Ray::new(Vec3::new(-1.0, 0.9, 0.9), Vec3::X);
    assert_eq!(leaf_counts(&bvh, &mesh, &[ray]).max as usize, count);
    // No leaf holds foreign surface, but every inner node on the way holds all that follows.
    let estimate = epo_sampled(&bvh, &mesh, &SahConstants::THESIS_IV, 3, 0);
    assert_eq!(estimate.value, 0.0);
    // Halving lengths: Σ (n − i)/(n − 1) of areas 2·(2(n − 1 − i) + 1) over the root's.
    let cost = sah(&bvh, &SahConstants::THESIS_IV);
    let area = |i: f64| 2.0 * (2.0 * (n - 1.0 - i) + 1.0);
    let inner: f64 = (0..count - 1).map(|i| 2.0 * area(i as f64)).sum();
    let expected = (inner + 2.0 * n) / area(0.0);
    assert!((cost / expected - 1.0).abs() < 1e-9, "{cost} {expected}");
}

fn any_node() -> impl Strategy<Value = BvhNode> {
    let coordinate = prop_oneof![Just(f32::NAN), Just(f32::INFINITY), -2.0_f32..2.0];
    let corner = [coordinate.clone(), coordinate.clone(), coordinate];
    let index = prop_oneof![0_u32..20, any::<u32>()];
    let count = prop_oneof![Just(0), 0_u32..5, any::<u32>()];
    (corner.clone(), corner, index, count).prop_map(|(min, max, first, count)| BvhNode {
        min: min.into(),
        first,
        max: max.into(),
        count,
    })
}

proptest! {
    /// Broken trees are judged without panic or endless loop, and never pass as sound.
    #[test]
    fn nonsense_is_survived(
        nodes in prop::collection::vec(any_node(), 0..20),
        prim_ids in prop::collection::vec(prop_oneof![0_u32..12, any::<u32>()], 0..20),
        seed in 0_u64..100,
    ) {
        let mesh = soup(10, 0.5, seed);
        let bvh = Bvh { nodes, prim_ids };
        let stats = TreeStats::of(&bvh);
        prop_assert!(stats.nodes <= bvh.nodes.len());
        let _ = sah(&bvh, &SahConstants::THESIS_IV);
        prop_assert!(epo(&bvh, &mesh, &SahConstants::THESIS_IV) >= 0.0);
        let rays = niwaki_hard_cases::rays(&mesh, 1, seed);
        prop_assert!(leaf_counts(&bvh, &mesh, &rays).max as usize <= bvh.nodes.len());
        let result = validate(&bvh, &mesh);
        if stats.primitives < mesh.len() {
            prop_assert!(result.is_err());
        }
    }

    #[test]
    fn counts_add_up(count in 0_usize..300, leaf_size in 1_usize..6, split in 0_usize..3, seed: u64) {
        let mesh = soup(count, 0.3, seed);
        let split = [Split::Never, Split::Sometimes, Split::Always][split];
        let bvh = build(&mesh, leaf_size, split);
        prop_assert_eq!(validate(&bvh, &mesh), Ok(()));
        let stats = TreeStats::of(&bvh);
        prop_assert_eq!(stats.nodes, stats.inner_nodes + stats.leaf_nodes);
        prop_assert_eq!(stats.leaf_nodes, if count == 0 { 0 } else { stats.inner_nodes + 1 });
        prop_assert_eq!(stats.leaf_depths.iter().sum::<usize>(), stats.leaf_nodes);
        prop_assert_eq!(stats.leaf_sizes.iter().sum::<usize>(), stats.leaf_nodes);
        let references: usize = stats.leaf_sizes.iter().enumerate().map(|(n, &k)| n * k).sum();
        prop_assert_eq!(references, stats.references);
        prop_assert_eq!(stats.references, bvh.prim_ids.len());
        prop_assert_eq!(stats.primitives, count);
        prop_assert_eq!(stats.bytes, bvh.bytes());
        // Kraft: the leaves of a full binary tree fill it.
        if count > 0 {
            let kraft: f64 = stats
                .leaf_depths
                .iter()
                .enumerate()
                .map(|(d, &k)| k as f64 * 0.5_f64.powf(d as f64))
                .sum();
            prop_assert_eq!(kraft, 1.0);
        }
    }
}

#[test]
fn boxes_may_reach_to_the_largest_f32() {
    let corners = vec![Vec3::MIN, Vec3::MAX, Vec3::new(f32::MAX, 0.0, f32::MIN)];
    let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).unwrap();
    let whole = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
    for options in [ValidateOptions::default(), ValidateOptions::rounded_clipping()] {
        assert_eq!(validate_with(&whole, &mesh, &options), Ok(()));
    }
    let mut short = whole;
    short.nodes[0].max.y = 1e38;
    assert!(validate(&short, &mesh).is_err());
}
