//! The twin against the CPU builder, and every stage of the kernels against the twin.

use super::{GpuLbvh, LbvhConfig, twin};
use crate::{Buffer, Device, DeviceOptions, GpuError};
use niwaki_build_lbvh::Lbvh;
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, Builder, PrimRef, SahConstants};
use proptest::prelude::*;

fn device() -> Option<Device> {
    match Device::open(&DeviceOptions::checked()) {
        Ok(device) => Some(device),
        Err(error @ (GpuError::NoLoader(_) | GpuError::NoDevice(_))) => {
            let is_required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!is_required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Boxes on a grid that is as fine as asked, so that codes and coordinates coincide or not.
fn boxes(count: usize, cells: f32, seed: u64) -> Vec<PrimRef> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut point = || Vec3::from([(); 3].map(|()| (random.f32() * cells).floor() / cells));
    let mut boxes = Vec::with_capacity(count);
    for id in 0..niwaki_core::to_u32(count) {
        let (a, b) = (point(), point());
        boxes.push(PrimRef::new(Aabb::new(a.min(b), a.max(b)), 2 * id + 1));
    }
    boxes
}

fn config(code_bits: u32, max_leaf_size: usize) -> LbvhConfig {
    LbvhConfig { code_bits, max_leaf_size, sah: SahConstants { leaf: 0.5, ..Default::default() } }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn the_twin_finds_the_tree_of_the_cpu(
        count in 1_usize..5000,
        cells in prop::sample::select(vec![1.0_f32, 4.0, 1e6]),
        seed: u64,
        code_bits in prop::sample::select(vec![30_u32, 63]),
        max_leaf_size in prop::sample::select(vec![1_usize, 4, 9, usize::MAX]),
    ) {
        let config = config(code_bits, max_leaf_size);
        let prims = boxes(count, cells, seed);
        let cpu = Lbvh { code_bits, max_leaf_size, sah: config.sah, ..Lbvh::default() };
        let found = twin::build(&prims, &config).unwrap().bvh;
        prop_assert_eq!(found, cpu.build(&prims).unwrap());
    }
}

/// The first words of one of the arrays of `stride` words in a buffer.
fn part(words: &[u32], array: usize, stride: usize, count: usize) -> &[u32] {
    &words[array * stride..array * stride + count]
}

fn words(buffer: &Buffer) -> Vec<u32> {
    buffer.read().unwrap()
}

#[test]
fn every_stage_does_what_its_twin_does() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    for (count, cells, code_bits, max_leaf_size) in
        [(5000, 1e6, 63, 4), (5000, 8.0, 30, 4), (3000, 2.0, 63, usize::MAX), (2, 1.0, 30, 1)]
    {
        let config = config(code_bits, max_leaf_size);
        let prims = boxes(count, cells, 1);
        let twin = twin::build(&prims, &config).unwrap();
        let stride = count + 100;
        let workspace = builder.workspace(stride, &config).unwrap();
        workspace.upload(&prims).unwrap();
        workspace.build().unwrap();
        let name = format!("{count} {cells} {code_bits}");

        let record = words(workspace.record_words());
        assert_eq!(record[5..14], twin.record, "settle {name}");
        assert_eq!(record[3] as usize, twin.bvh.nodes.len(), "scan_tiles {name}");

        let items = words(&workspace.items[0]);
        let low: Vec<u32> = twin.sorted.iter().map(|item| (item.0 & 0xffff_ffff) as u32).collect();
        let order: Vec<u32> = twin.sorted.iter().map(|item| item.1).collect();
        assert_eq!(part(&items, 0, stride, count), low, "sort {name}");
        assert_eq!(part(&items, 2, stride, count), order, "sort {name}");
        if code_bits > 32 {
            let high: Vec<u32> = twin.sorted.iter().map(|item| (item.0 >> 32) as u32).collect();
            assert_eq!(part(&items, 1, stride, count), high, "sort {name}");
        }

        let tree = words(&workspace.tree);
        assert_eq!(part(&tree, 0, stride, count - 1), twin.tree.other, "hierarchy {name}");
        assert_eq!(part(&tree, 1, stride, count - 1), twin.tree.split, "collapse {name}");
        assert_eq!(part(&tree, 2, stride, count - 1), twin.tree.parent, "hierarchy {name}");
        assert_eq!(part(&tree, 3, stride, count), twin.tree.leaf_parent, "hierarchy {name}");

        let boxes = words(&workspace.boxes);
        for axis in 0..3 {
            let least: Vec<u32> = twin.boxes.iter().map(|b| b.min[axis].to_bits()).collect();
            let most: Vec<u32> = twin.boxes.iter().map(|b| b.max[axis].to_bits()).collect();
            assert_eq!(part(&boxes, axis, stride, count - 1), least, "bottom_up {name}");
            assert_eq!(part(&boxes, 3 + axis, stride, count - 1), most, "bottom_up {name}");
        }

        let ranks = words(&workspace.items[1]);
        assert_eq!(part(&ranks, 0, stride, count), twin.ranks.0, "rank {name}");
        assert_eq!(part(&ranks, 1, stride, count), twin.ranks.1, "rank {name}");
        assert_eq!(workspace.download().unwrap(), twin.bvh, "emit {name}");
    }
    assert_eq!(device.messages(), Vec::<String>::new());
}

/// Scenes of more workgroups than a device allows along an axis take several rows, the last of which
/// may be longer than needed.
#[test]
fn rows_of_workgroups_change_nothing() {
    let Some(device) = device() else { return };
    let config = config(63, 4);
    for (count, max_groups) in [(20_000, 7), (20_000, 1), (30, 1)] {
        let builder = GpuLbvh::with_max_groups(&device, max_groups).unwrap();
        let prims = boxes(count, 1e6, 2);
        let twin = twin::build(&prims, &config).unwrap();
        assert_eq!(builder.build(&prims, &config).unwrap(), twin.bvh, "{count} {max_groups}");
    }
    assert_eq!(device.messages(), Vec::<String>::new());
}
