//! Kernels against each other and against exhaustive evaluation.

use crate::support::{hard_cases, same_bytes, soup};
use crate::top_down::{BINNED_LEVELS, build};
use crate::{Binned, parallel};
use niwaki_core::bins::{Bins, CHUNK, Kernel, Mapping, Split};
use niwaki_core::{Aabb, AreaScale, PrimRef, SahConstants};
use niwaki_metrics::TreeStats;
use proptest::prelude::*;

fn bounds(prims: &[PrimRef]) -> [Aabb; 2] {
    prims.iter().fold([Aabb::EMPTY; 2], |[b, c], p| [b.union(p.aabb()), c.grow(p.centroid2())])
}

/// The lanes with a meaning, and the numbers.
fn bits(bins: &Bins, number: usize) -> Vec<u32> {
    let lanes = [0, 1, 2, 4, 5, 6];
    let boxes = bins.bounds[..number].iter().flatten();
    let boxes = boxes.flat_map(|c| lanes.map(|lane| c.lanes()[lane].to_bits()));
    boxes.chain(bins.counts[..number].iter().flat_map(|c| c[..3].to_vec())).collect()
}

/// What every kernel has to do with one node.
fn check_node(prims: &[PrimRef], number: usize, sah: &SahConstants) {
    let [node, centroids] = bounds(prims);
    let scale = AreaScale::of(&node);
    let mapping = Mapping::new(&centroids, number);
    let run = |kernel: Kernel| {
        let mut bins = Bins::new();
        kernel.fill(&mut bins, prims, &mapping);
        let split = kernel.best(&bins, number, scale, sah);
        let mut moved = prims.to_vec();
        let parted = split.map(|split| kernel.partition(&mut moved, &mapping, &split));
        (bins, split, moved, parted)
    };
    let (bins, split, moved, parted) = run(Kernel::SCALAR);
    let (fast_bins, fast_split, fast_moved, fast_parted) = run(Kernel::fastest());
    assert_eq!(bits(&bins, number), bits(&fast_bins, number));
    assert_eq!(split, fast_split);
    assert_eq!(bytemuck::cast_slice::<_, u8>(&moved), bytemuck::cast_slice::<_, u8>(&fast_moved));
    if let (Some(parted), Some(fast)) = (parted, fast_parted) {
        assert_eq!(parted.left, fast.left);
        for (a, b) in parted.centroids.iter().zip(fast.centroids) {
            assert_eq!(a.aabb(), b.aabb());
        }
    }

    // Exhaustively: every border of every axis, with boxes from the primitives themselves.
    let cost_of = |split: &Split| {
        let mut all = prims.to_vec();
        let left = Kernel::SCALAR.partition(&mut all, &mapping, split).left;
        let (left, right) = all.split_at(left);
        let empty = left.is_empty() || right.is_empty();
        let cost = |side: &[PrimRef]| {
            let area = f64::from(bounds(side)[0].half_area(scale));
            area * (f64::from(sah.triangle) * side.len() as f64 + f64::from(sah.leaf))
        };
        (!empty).then(|| cost(left) + cost(right))
    };
    let least = (0..3)
        .flat_map(|axis| (1..number).map(move |bin| Split { axis, bin, cost: 0.0 }))
        .filter_map(|split| cost_of(&split))
        .min_by(f64::total_cmp);
    match (split, parted, least) {
        (Some(split), Some(parted), Some(least)) => {
            assert!((f64::from(split.cost) - least).abs() <= 1e-5 * least, "{split:?} {least}");
            assert!((cost_of(&split).unwrap() - least).abs() <= 1e-5 * least);
            // Boxes of the sides, by bins and by partition.
            let (left, right) = moved.split_at(parted.left);
            for (side, (from_bins, parted)) in [left, right]
                .into_iter()
                .zip(bins.sides(&split, number).into_iter().zip(parted.centroids))
            {
                assert_eq!(bounds(side), [from_bins, parted.aabb()]);
            }
        }
        (None, None, None) => {}
        other => panic!("{other:?}"),
    }
}

proptest! {
    #[test]
    fn kernels_agree_with_exhaustive_evaluation(
        count in 1_usize..120,
        seed: u64,
        number in prop::sample::select(vec![2_usize, 3, 5, 8, 16, 33, 64]),
        exponent in prop::sample::select(vec![-44_i32, -38, -30, -3, 0, 5, 18, 30]),
        leaf in prop::sample::select(vec![0.0_f32, 0.7]),
    ) {
        let scale = 10.0_f32.powi(exponent);
        let mut prims = soup(count, seed).prim_refs();
        for p in &mut prims {
            (p.min, p.max) = (p.min * scale, p.max * scale);
        }
        check_node(&prims, number, &SahConstants { leaf, ..SahConstants::THESIS_IV });
    }

    /// Exchanging what is on the wrong side keeps every primitive and divides where one thread
    /// would.
    #[test]
    fn parallel_kernels_agree_with_one_thread(
        count in CHUNK - 1..5 * CHUNK,
        bin in 1_usize..16,
        axis in 0_usize..3,
    ) {
        let mut prims = soup(count, 1).prim_refs();
        let mapping = Mapping::new(&bounds(&prims)[1], 16);
        let kernel = Kernel::fastest();
        let mut serial = Bins::new();
        kernel.fill(&mut serial, &prims, &mapping);
        prop_assert_eq!(bits(&serial, 16), bits(&kernel.fill_parallel(&prims, &mapping), 16));

        let split = Split { axis, bin, cost: 0.0 };
        let mut other = prims.clone();
        let expected = kernel.partition(&mut other, &mapping, &split);
        let parted = parallel::partition(kernel, &mut prims, &mapping, &split);
        prop_assert_eq!(parted.left, expected.left);
        for side in 0..2 {
            prop_assert_eq!(parted.centroids[side].aabb(), expected.centroids[side].aabb());
        }
        for range in [0..parted.left, parted.left..count] {
            let ids = |prims: &[PrimRef]| {
                let mut ids: Vec<u32> = prims[range.clone()].iter().map(|p| p.prim_id).collect();
                ids.sort_unstable();
                ids
            };
            prop_assert_eq!(ids(&prims), ids(&other));
        }
    }
}

#[test]
fn all_kernels_build_one_tree_in_hard_cases() {
    let configs = [
        Binned::default(),
        Binned { bins: 5, max_leaf_size: 1, sah: SahConstants::THESIS_V },
        Binned { bins: 64, max_leaf_size: 3, ..Binned::default() },
    ];
    for (name, mesh) in hard_cases() {
        for config in &configs {
            let reference = build(mesh.prim_refs(), config, Kernel::SCALAR).unwrap();
            let fast = build(mesh.prim_refs(), config, Kernel::fastest()).unwrap();
            assert!(same_bytes(&reference, &fast), "{name} {config:?}");
            let bound = BINNED_LEVELS + mesh.len().max(1).next_power_of_two().ilog2();
            assert!(TreeStats::of(&reference).depth_max <= bound as usize, "{name}");
        }
    }
}
