//! Hard geometry, determinism, refusals, and the cost of trees.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_ploc::{MAX_RADIUS, Ploc};
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, Builder, PrimRef, SahConstants};
use niwaki_metrics::{sah, validate};
use proptest::prelude::*;
use support::*;

#[test]
fn hard_cases_are_survived() {
    for builder in [Ploc::default(), Ploc { radius: 1, max_leaf_size: 1, ..Ploc::default() }] {
        check_hard_cases(&builder, builder.max_leaf_size);
        check_references(&builder);
    }
    check_hard_cases(&Ploc { radius: MAX_RADIUS, max_leaf_size: 8, ..Ploc::default() }, 8);
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = Ploc::default();
    for radius in [0, MAX_RADIUS + 1, usize::MAX] {
        assert_eq!(refused(&Ploc { radius, ..good }), "radius");
    }
    assert_eq!(refused(&Ploc { max_leaf_size: 0, ..good }), "max_leaf_size");
    for inner in [f32::NAN, f32::INFINITY, -1.0] {
        let sah = SahConstants { inner, ..SahConstants::THESIS_IV };
        assert_eq!(refused(&Ploc { sah, ..good }), "sah");
    }
}

/// Boxes around one point, each in the next: of all rounds only the smallest two choose each
/// other. Time in proportion to the square of the number would not end.
#[test]
fn a_million_nested_boxes_do_not_take_quadratic_time() {
    let prims: Vec<_> = (0..1_000_000)
        .map(|i| {
            PrimRef::new(Aabb::new(Vec3::splat(-1.0 - i as f32), Vec3::splat(1.0 + i as f32)), i)
        })
        .collect();
    let bvh = Ploc::default().build(&prims).unwrap();
    let mut ids = bvh.prim_ids.clone();
    ids.sort_unstable();
    assert!(ids.into_iter().eq(0..1_000_000));
}

/// All primitives see each other: what is joined first is what is nearest.
#[test]
fn neighbours_in_space_become_siblings() {
    let near = [0.0, 0.1, 5.0, 5.1, 100.0, 100.1];
    let prims: Vec<_> = near
        .iter()
        .zip(0..)
        .map(|(&x, i)| {
            let low = Vec3::new(x, 0.0, 0.0);
            PrimRef::new(Aabb::new(low, low + Vec3::splat(0.05)), i)
        })
        .collect();
    let bvh = Ploc { max_leaf_size: 1, ..Ploc::default() }.build(&prims).unwrap();
    let id = |leaf: usize| bvh.leaf_prims(&bvh.nodes[leaf])[0];
    let mut pairs: Vec<_> = bvh
        .nodes
        .iter()
        .filter(|n| !n.is_leaf() && n.children().iter().all(|&c| bvh.nodes[c].is_leaf()))
        .map(|n| n.children().map(id))
        .collect();
    pairs.sort_unstable();
    assert_eq!(pairs, [[0, 1], [2, 3], [4, 5]]);
}

proptest! {
    #[test]
    fn trees_are_sound_and_merged_leaves_never_cost_more(
        count in 1_usize..2000,
        seed: u64,
        radius in 1..=MAX_RADIUS,
        max_leaf_size in 2_usize..20,
    ) {
        let mesh = soup(count, seed);
        for constants in [SahConstants::THESIS_IV, SahConstants::THESIS_V] {
            let single = Ploc { radius, max_leaf_size: 1, sah: constants };
            let merged = Ploc { max_leaf_size, ..single };
            let [single, merged] = [single, merged].map(|builder| {
                let bvh = builder.build_mesh(&mesh).unwrap();
                validate(&bvh, &mesh).unwrap();
                sah(&bvh, &constants)
            });
            prop_assert!(merged <= single * (1.0 + 1e-6), "{} {}", merged, single);
        }
    }
}
