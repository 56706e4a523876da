//! Hard geometry, determinism, refusals, and what the heuristic promises.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_binned::Binned;
use niwaki_build_lbvh::Lbvh;
use niwaki_build_median::ObjectMedian;
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, SahConstants};
use niwaki_metrics::{sah, validate};
use support::*;

#[test]
fn hard_cases_are_survived() {
    check_hard_cases(&Binned::default(), Binned::default().max_leaf_size);
    let small = Binned { bins: 2, max_leaf_size: 1, sah: SahConstants::KARRAS_AILA };
    check_hard_cases(&small, 1);
    check_references(&Binned::default());
}

#[test]
fn large_nodes_do_not_show_threads() {
    // Large enough for several levels of parallel binning and partitioning.
    let mesh = soup(300_000, 6);
    let builder = Binned::default();
    let trees = [1, 2, 3, 8].map(|n| on_threads(n, || builder.build_mesh(&mesh).unwrap()));
    validate(&trees[0], &mesh).unwrap();
    assert!(trees[1..].iter().all(|tree| same_bytes(tree, &trees[0])));
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = Binned::default();
    for bins in [0, 1, 65, usize::MAX] {
        assert_eq!(refused(&Binned { bins, ..good }), "bins");
    }
    assert_eq!(refused(&Binned { max_leaf_size: 0, ..good }), "max_leaf_size");
    for triangle in [f32::NAN, f32::INFINITY, -1.0] {
        let sah = SahConstants { triangle, ..SahConstants::THESIS_IV };
        assert_eq!(refused(&Binned { sah, ..good }), "sah");
    }
}

#[test]
fn the_heuristic_beats_those_without() {
    let mesh = soup(30_000, 8);
    let cost =
        |builder: &dyn Builder| sah(&builder.build_mesh(&mesh).unwrap(), &SahConstants::THESIS_IV);
    let binned = cost(&Binned::default());
    assert!(binned < cost(&ObjectMedian::default()));
    assert!(binned < cost(&Lbvh::default()));
    // More bins look at more splits; a greedy choice does not have to gain, but not lose much.
    assert!(cost(&Binned { bins: 64, ..Binned::default() }) < 1.05 * binned);
}

#[test]
fn two_clusters_are_told_apart() {
    // One split between clusters is far cheaper than all others: any builder by SAH finds it.
    let mesh = mesh((0..2000).map(|i| {
        let mut rng = Rng(i);
        let center = Vec3::Z * if i % 3 == 0 { 100.0 } else { 0.0 };
        [(); 3].map(|()| center + rng.cube())
    }));
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    let [a, b] = bvh.nodes[0].children().map(|i| bvh.nodes[i].aabb());
    assert!(a.intersection(b).is_empty());
    assert!(a.extent().max_element() <= 2.0 && b.extent().max_element() <= 2.0);
}

/// Ending early where the best split costs more. The decision looks one split ahead, as in Wald
/// 2007, so a single tree may lose a few percent to splits further down that would have paid; over
/// many trees it gains.
#[test]
fn leaves_are_made_where_they_pay() {
    for constants in [SahConstants::THESIS_IV, SahConstants::THESIS_V] {
        let merged = Binned { sah: constants, ..Binned::default() };
        let single = Binned { max_leaf_size: 1, ..merged };
        let mut costs = [0.0; 2];
        for count in 0..200_usize {
            let mesh = soup(1 + (count * 7) % 500, count as u64);
            for (cost, builder) in costs.iter_mut().zip([&merged, &single]) {
                let bvh = builder.build_mesh(&mesh).unwrap();
                validate(&bvh, &mesh).unwrap();
                *cost += sah(&bvh, &constants);
            }
        }
        assert!(costs[0] < costs[1], "{costs:?}");
    }
}
