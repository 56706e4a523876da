//! Hard geometry, determinism, refusals, and what the builders are defined by.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_aac::{Aac, Agglomerative};
use niwaki_core::{Aabb, AreaScale, BuildError, Builder, SahConstants, TriangleMesh};
use niwaki_metrics::{sah, validate};
use proptest::prelude::*;
use support::*;

#[test]
fn hard_cases_are_survived() {
    for builder in [Aac::hq(), Aac::lq()] {
        check_hard_cases(&builder, builder.max_leaf_size);
        check_references(&builder);
    }
    check_hard_cases(&Aac { delta: 2, epsilon: 0.5, max_leaf_size: 1, ..Aac::hq() }, 1);
}

/// Only the sort before it runs on several threads, so two numbers of them are enough.
#[test]
fn hard_cases_are_survived_by_the_reference() {
    let builder = Agglomerative::default();
    check_references(&builder);
    for (name, mesh) in hard_cases() {
        let [one, three] =
            [1, 3].map(|threads| on_threads(threads, || builder.build_mesh(&mesh).unwrap()));
        validate(&one, &mesh).unwrap_or_else(|faults| panic!("{name}: {}", faults[0]));
        assert!(largest_leaf(&one) <= builder.max_leaf_size, "{name}");
        assert!(same_bytes(&one, &three), "{name}: threads show");
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    for delta in [0, 1, 129, usize::MAX] {
        assert_eq!(refused(&Aac { delta, ..Aac::hq() }), "delta");
    }
    for epsilon in [0.0, -0.1, 0.6, f32::NAN] {
        assert_eq!(refused(&Aac { epsilon, ..Aac::hq() }), "epsilon");
    }
    assert_eq!(refused(&Aac { max_leaf_size: 0, ..Aac::hq() }), "max_leaf_size");
    let sah = SahConstants { inner: f32::NAN, ..SahConstants::THESIS_IV };
    assert_eq!(refused(&Aac { sah, ..Aac::lq() }), "sah");
    assert_eq!(refused(&Agglomerative { sah, ..Agglomerative::default() }), "sah");
    let max_leaf_size = 0;
    let builder = Agglomerative { max_leaf_size, ..Agglomerative::default() };
    assert_eq!(refused(&builder), "max_leaf_size");
}

#[test]
fn more_primitives_than_allowed_are_refused() {
    let builder = Agglomerative { max_prims: 99, ..Agglomerative::default() };
    assert!(builder.build_mesh(&soup(99, 1)).is_ok());
    assert_eq!(
        builder.build_mesh(&soup(100, 1)),
        Err(BuildError::TooManyPrimitives { count: 100, max: 99 })
    );
}

#[test]
fn names_tell_presets() {
    assert_eq!(Aac::hq().name(), "aac_hq");
    assert_eq!(Aac::lq().name(), "aac_lq");
    assert_eq!(Aac { max_leaf_size: 1, ..Aac::lq() }.name(), "aac_lq");
    assert_eq!(Aac { delta: 10, ..Aac::hq() }.name(), "aac");
}

/// The boxes of joining the nearest pair of all, again and again, slowly.
fn nearest_pair_first(mesh: &TriangleMesh) -> Vec<[f32; 6]> {
    let mut boxes: Vec<_> = mesh.triangles().map(|t| t.bounds()).collect();
    let mut all = boxes.clone();
    let scale = AreaScale::of(&mesh.bounds());
    while boxes.len() > 1 {
        let mut best = (f32::INFINITY, 0, 0);
        for i in 0..boxes.len() {
            for j in 0..i {
                let d = boxes[i].union(boxes[j]).half_area(scale);
                if d < best.0 {
                    best = (d, i, j);
                }
            }
        }
        let other = boxes.swap_remove(best.1);
        boxes[best.2] = boxes[best.2].union(other);
        all.push(boxes[best.2]);
    }
    sorted(all)
}

fn sorted(boxes: Vec<Aabb>) -> Vec<[f32; 6]> {
    let key = |b: &Aabb| [b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z];
    let mut keys: Vec<_> = boxes.iter().map(key).collect();
    keys.sort_by(|a, b| a.partial_cmp(b).expect("no NaN"));
    keys
}

proptest! {
    /// The search with bounds finds what trying all pairs finds.
    #[test]
    fn agglomerative_joins_the_nearest_pair_first(count in 1_usize..150, seed: u64) {
        let mesh = soup(count, seed);
        let builder = Agglomerative { max_leaf_size: 1, ..Agglomerative::default() };
        let bvh = builder.build_mesh(&mesh).unwrap();
        validate(&bvh, &mesh).unwrap();
        let boxes = bvh.nodes.iter().map(|n| n.aabb()).collect();
        prop_assert_eq!(sorted(boxes), nearest_pair_first(&mesh));
    }

    /// With all primitives in one node, AAC is not approximate any more.
    #[test]
    fn aac_over_one_node_joins_the_nearest_pair_first(count in 1_usize..60, seed: u64) {
        let mesh = soup(count, seed);
        let builder = Aac { delta: 128, max_leaf_size: 1, ..Aac::hq() };
        let bvh = builder.build_mesh(&mesh).unwrap();
        let boxes = bvh.nodes.iter().map(|n| n.aabb()).collect();
        prop_assert_eq!(sorted(boxes), nearest_pair_first(&mesh));
    }

    /// Leaves are merged where that lowers the cost.
    #[test]
    fn merged_leaves_never_cost_more(
        count in 1_usize..2000,
        seed: u64,
        max_leaf_size in 2_usize..20,
    ) {
        let mesh = soup(count, seed);
        for constants in [SahConstants::THESIS_IV, SahConstants::THESIS_V] {
            let single = Aac { max_leaf_size: 1, sah: constants, ..Aac::lq() };
            let merged = Aac { max_leaf_size, ..single };
            let single = sah(&single.build_mesh(&mesh).unwrap(), &constants);
            let merged = sah(&merged.build_mesh(&mesh).unwrap(), &constants);
            prop_assert!(merged <= single * (1.0 + 1e-6), "{} {}", merged, single);
        }
    }
}
