//! Hard geometry, determinism and refusals.

mod support;

use niwaki_build_median::{ObjectMedian, SPATIAL_LEVELS, SpatialMedian};
use niwaki_core::Builder;
use niwaki_metrics::{TreeStats, validate};
use proptest::prelude::*;
use support::*;

#[test]
fn object_median_survives_hard_cases() {
    check_hard_cases(&ObjectMedian::default(), 4);
    check_hard_cases(&ObjectMedian { max_leaf_size: 1 }, 1);
    check_references(&ObjectMedian::default());
}

#[test]
fn spatial_median_survives_hard_cases() {
    check_hard_cases(&SpatialMedian::default(), 4);
    check_hard_cases(&SpatialMedian { max_leaf_size: 1 }, 1);
    check_references(&SpatialMedian::default());
}

#[test]
fn empty_leaves_are_refused() {
    assert_eq!(refused(&ObjectMedian { max_leaf_size: 0 }), "max_leaf_size");
    assert_eq!(refused(&SpatialMedian { max_leaf_size: 0 }), "max_leaf_size");
}

#[test]
fn object_medians_make_flat_trees() {
    for count in [1, 2, 3, 1000, 1024, 1025] {
        let bvh = ObjectMedian { max_leaf_size: 1 }.build_mesh(&soup(count, 4)).unwrap();
        let depth = TreeStats::of(&bvh).depth_max;
        assert_eq!(depth, count.next_power_of_two().ilog2() as usize, "{count}");
    }
}

#[test]
fn spatial_depth_is_bounded() {
    for (name, mesh) in hard_cases() {
        let bvh = SpatialMedian { max_leaf_size: 1 }.build_mesh(&mesh).unwrap();
        let bound = SPATIAL_LEVELS + mesh.len().max(1).next_power_of_two().ilog2();
        assert!(TreeStats::of(&bvh).depth_max <= bound as usize, "{name}");
    }
}

proptest! {
    /// Each inner node is cut as documented: every centroid on the left sorts before every one on
    /// the right, along one axis, and the halves differ by at most one.
    #[test]
    fn halves_are_ordered_and_equal(count in 2_usize..200, seed: u64) {
        let mesh = soup(count, seed);
        let prims = mesh.prim_refs();
        let bvh = ObjectMedian { max_leaf_size: 1 }.build_mesh(&mesh).unwrap();
        validate(&bvh, &mesh).unwrap();
        let [left, right] = sides(&bvh);
        prop_assert!(right.len() - left.len() <= 1);
        let ordered = (0..3).any(|axis| {
            let key = |&id: &u32| prims[id as usize].centroid2()[axis];
            left.iter().all(|l| right.iter().all(|r| key(l) <= key(r)))
        });
        prop_assert!(ordered);
    }

    /// The root's children lie on their sides of the middle of its box.
    #[test]
    fn the_middle_of_the_box_divides(count in 2_usize..200, seed: u64) {
        let mesh = soup(count, seed);
        let prims = mesh.prim_refs();
        let bvh = SpatialMedian { max_leaf_size: 1 }.build_mesh(&mesh).unwrap();
        validate(&bvh, &mesh).unwrap();
        let axis = bvh.bounds().longest_axis();
        let middle2 = bvh.bounds().min[axis] + bvh.bounds().max[axis];
        let below = |&id: &u32| prims[id as usize].centroid2()[axis] < middle2;
        let number_below = bvh.prim_ids.iter().filter(|id| below(id)).count();
        prop_assume!(number_below > 0 && number_below < count);
        let [left, right] = sides(&bvh);
        prop_assert!(left.iter().all(below) && !right.iter().any(below));
    }
}

/// The primitives of the root's children.
fn sides(bvh: &niwaki_core::Bvh) -> [Vec<u32>; 2] {
    bvh.nodes[0].children().map(|child| {
        let mut ids = Vec::new();
        let mut stack = vec![child];
        while let Some(node) = stack.pop() {
            ids.extend(bvh.leaf_prims(&bvh.nodes[node]));
            if !bvh.nodes[node].is_leaf() {
                stack.extend(bvh.nodes[node].children());
            }
        }
        ids
    })
}
