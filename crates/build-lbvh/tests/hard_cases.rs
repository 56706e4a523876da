//! Hard geometry, determinism, refusals, and that the three algorithms find one tree.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_lbvh::{Algorithm, Hlbvh, Lbvh};
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, Bvh, SahConstants, TriangleMesh};
use niwaki_metrics::{sah, validate};
use proptest::prelude::*;
use support::*;

const ALGORITHMS: [Algorithm; 3] = [Algorithm::Lauterbach, Algorithm::Karras, Algorithm::Apetrei];

#[test]
fn hard_cases_are_survived() {
    for algorithm in ALGORITHMS {
        check_hard_cases(&Lbvh { algorithm, ..Lbvh::default() }, Lbvh::default().max_leaf_size);
        check_references(&Lbvh { algorithm, ..Lbvh::default() });
        let small = Lbvh { algorithm, code_bits: 30, max_leaf_size: 1, ..Lbvh::default() };
        check_hard_cases(&small, 1);
    }
    check_hard_cases(&Hlbvh::default(), Hlbvh::default().max_leaf_size);
    check_references(&Hlbvh::default());
    for treelet_bits in [1, 30] {
        let single = Hlbvh { treelet_bits, bins: 2, max_leaf_size: 1, ..Hlbvh::default() };
        check_hard_cases(&single, 1);
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = Lbvh::default();
    for code_bits in [0, 29, 31, 60, 64, u32::MAX] {
        assert_eq!(refused(&Lbvh { code_bits, ..good }), "code_bits");
    }
    assert_eq!(refused(&Lbvh { max_leaf_size: 0, ..good }), "max_leaf_size");
    for treelet_bits in [0, 31, u32::MAX] {
        let builder = Hlbvh { treelet_bits, ..Hlbvh::default() };
        assert_eq!(refused(&builder), "treelet_bits");
    }
    for bins in [0, 1, 257] {
        assert_eq!(refused(&Hlbvh { bins, ..Hlbvh::default() }), "bins");
    }
    for inner in [f32::NAN, f32::INFINITY, -1.0] {
        let sah = SahConstants { inner, ..SahConstants::THESIS_IV };
        assert_eq!(refused(&Lbvh { sah, ..good }), "sah");
        assert_eq!(refused(&Hlbvh { sah, ..Hlbvh::default() }), "sah");
    }
}

/// One tree, whatever the algorithm.
fn check_agreement(mesh: &TriangleMesh, name: &str) {
    for code_bits in [30, 63] {
        for max_leaf_size in [1, 3, 8, 100_000] {
            let trees = ALGORITHMS.map(|algorithm| {
                let builder = Lbvh { code_bits, algorithm, max_leaf_size, ..Lbvh::default() };
                builder.build_mesh(mesh).unwrap()
            });
            for (tree, algorithm) in trees.iter().zip(ALGORITHMS) {
                assert!(
                    same_bytes(tree, &trees[0]),
                    "{name}, {code_bits} bits, leaves to {max_leaf_size}: {algorithm:?}"
                );
            }
        }
    }
}

#[test]
fn all_algorithms_find_one_tree_in_hard_cases() {
    for (name, mesh) in hard_cases() {
        check_agreement(&mesh, name);
    }
}

/// The tree by definition, slowly: at each node the first bit in which codes differ, with codes
/// computed bit by bit, divides it.
fn by_definition(mesh: &TriangleMesh, bits_per_axis: u32) -> Vec<(Vec<u32>, usize)> {
    let prims = mesh.prim_refs();
    let low = prims.iter().map(|p| p.centroid2()).reduce(Vec3::min).unwrap();
    let high = prims.iter().map(|p| p.centroid2()).reduce(Vec3::max).unwrap();
    let cells = 2.0_f32.powi(bits_per_axis as i32);
    let mut keys: Vec<(Vec<bool>, u32)> = prims
        .iter()
        .map(|p| {
            let cell = ((p.centroid2() - low) * (Vec3::splat(cells) / (high - low)))
                .clamp(Vec3::ZERO, Vec3::splat(cells - 1.0))
                .as_uvec3();
            let code = (0..bits_per_axis)
                .rev()
                .flat_map(|bit| cell.to_array().map(|c| c >> bit & 1 == 1))
                .collect();
            (code, p.prim_id)
        })
        .collect();
    keys.sort();
    // Equal codes go on with the bits of the place.
    for (place, (code, _)) in keys.iter_mut().enumerate() {
        code.extend((0..32).rev().map(|bit| place >> bit & 1 == 1));
    }
    let mut splits = Vec::new();
    let mut stack = vec![(0, keys.len())];
    while let Some((first, end)) = stack.pop() {
        if end - first < 2 {
            continue;
        }
        let bit = (0..).find(|&b| keys[first].0[b] != keys[end - 1].0[b]).unwrap();
        let middle = (first..end).find(|&i| keys[i].0[bit]).unwrap();
        let ids = keys[first..end].iter().map(|k| k.1).collect();
        splits.push((ids, middle - first));
        stack.push((middle, end));
        stack.push((first, middle));
    }
    splits
}

/// For each inner node in depth-first order: its primitives, and how many of them are on the left.
fn splits(bvh: &Bvh) -> Vec<(Vec<u32>, usize)> {
    let ids = |node: usize| {
        let (mut ids, mut stack) = (Vec::new(), vec![node]);
        while let Some(node) = stack.pop().map(|i| &bvh.nodes[i]) {
            ids.extend(bvh.leaf_prims(node));
            if !node.is_leaf() {
                let [left, right] = node.children();
                stack.extend([right, left]);
            }
        }
        ids
    };
    let mut splits = Vec::new();
    let mut stack = vec![0];
    while let Some(i) = stack.pop() {
        if !bvh.nodes[i].is_leaf() {
            let [left, right] = bvh.nodes[i].children();
            splits.push((ids(i), ids(left).len()));
            stack.extend([right, left]);
        }
    }
    splits
}

proptest! {
    #[test]
    fn all_algorithms_find_the_tree_of_the_definition(
        count in 1_usize..300,
        seed: u64,
        // Coarse grids make equal codes.
        grid in prop::sample::select(vec![2.0_f32, 16.0, 1e6]),
    ) {
        let mesh = mesh(soup(count, seed).triangles().map(|t| {
            let offset = (t.v0 * grid).floor() / grid - t.v0;
            [t.v0, t.v1, t.v2].map(|v| v + offset)
        }));
        check_agreement(&mesh, "soup");
        for code_bits in [30, 63] {
            let builder = Lbvh { code_bits, max_leaf_size: 1, ..Lbvh::default() };
            let bvh = builder.build_mesh(&mesh).unwrap();
            validate(&bvh, &mesh).unwrap();
            prop_assert_eq!(splits(&bvh), by_definition(&mesh, code_bits / 3));
        }
    }

    /// Leaves are merged where that lowers the cost: the result is no dearer than without, and
    /// with a free inner node and a dear triangle nothing is merged that is not in one place.
    #[test]
    fn merged_leaves_never_cost_more(count in 1_usize..2000, seed: u64, max_leaf_size in 2_usize..20) {
        let mesh = soup(count, seed);
        for constants in [SahConstants::THESIS_IV, SahConstants::THESIS_V] {
            let single = Lbvh { max_leaf_size: 1, sah: constants, ..Lbvh::default() };
            let merged = Lbvh { max_leaf_size, ..single };
            let single = sah(&single.build_mesh(&mesh).unwrap(), &constants);
            let merged = sah(&merged.build_mesh(&mesh).unwrap(), &constants);
            prop_assert!(merged <= single * (1.0 + 1e-6), "{merged} {single}");
        }
    }
}
