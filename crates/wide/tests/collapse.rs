//! The collapsed tree against the binary one it came from.

use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3, to_u32};
use niwaki_wide::{
    Bvh8, Child, CollapseError, CollapseMethod, CollapseSettings, WideBvh, WideCosts,
};
use proptest::prelude::*;

/// A random binary tree over `leaves` unit boxes along x: `choice` decides where ranges split.
fn random_tree(leaf_sizes: &[u32], mut choice: u64) -> Bvh {
    let prims: u32 = leaf_sizes.iter().sum();
    let bounds = |range: std::ops::Range<usize>| {
        let (a, b) = (range.start as f32, range.end as f32);
        Aabb::new(Vec3::new(a, 0.0, 0.0), Vec3::new(b, 1.0, 1.0))
    };
    let firsts: Vec<u32> = leaf_sizes
        .iter()
        .scan(0, |sum, &n| {
            *sum += n;
            Some(*sum - n)
        })
        .collect();
    let all = 0..leaf_sizes.len();
    let mut nodes = vec![BvhNode::inner(bounds(all.clone()), 0)];
    let mut open = vec![(0, all)];
    while let Some((node, range)) = open.pop() {
        let i = range.start;
        if range.len() == 1 {
            nodes[node] = BvhNode::leaf(bounds(range), firsts[i], leaf_sizes[i]);
            continue;
        }
        choice = choice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        let middle = i + 1 + (choice >> 33) as usize % (range.len() - 1);
        let first = nodes.len();
        nodes[node] = BvhNode::inner(bounds(range.clone()), to_u32(first));
        nodes.extend([BvhNode::leaf(Aabb::EMPTY, 0, 1); 2]);
        open.push((first, i..middle));
        open.push((first + 1, middle..range.end));
    }
    // Ids that say which reference they were.
    Bvh { nodes, prim_ids: (0..prims).rev().collect() }
}

/// Checks everything that [`WideBvh`] promises.
fn check<const W: usize>(bvh: &Bvh, wide: &WideBvh<W>, settings: &CollapseSettings) {
    let mut leaf_box = vec![Aabb::EMPTY; bvh.prim_ids.len()];
    for node in bvh.nodes.iter().filter(|node| node.is_leaf()) {
        for &id in bvh.leaf_prims(node) {
            leaf_box[id as usize] = node.aabb();
        }
    }
    let mut ids = wide.prim_ids().to_vec();
    ids.sort_unstable();
    let mut expected = bvh.prim_ids.clone();
    expected.sort_unstable();
    assert_eq!(ids, expected, "every reference is kept");
    let mut parents = vec![0; wide.nodes().len()];
    let mut next_prim = 0;
    let mut inside = vec![wide.bounds(); wide.nodes().len()];
    for (i, node) in wide.nodes().iter().enumerate() {
        assert!(node.used >= 1 && node.used as usize <= W);
        assert_eq!(node.first_prim, next_prim);
        for slot in 0..W {
            let bounds = node.aabb(slot);
            let Some(child) = node.child(slot) else {
                assert_eq!(bounds, Aabb::EMPTY);
                continue;
            };
            assert!(inside[i].contains(&bounds));
            match child {
                Child::Node(c) => {
                    assert!(c as usize > i);
                    parents[c as usize] += 1;
                    inside[c as usize] = bounds;
                }
                Child::Leaf { first, count } => {
                    assert_eq!(first, next_prim, "leaves follow each other");
                    assert!(count >= 1 && count as usize <= settings.max_leaf.min(W));
                    next_prim += count;
                    for &id in wide.leaf_prims(first, count) {
                        assert!(bounds.contains(&leaf_box[id as usize]));
                    }
                }
            }
        }
    }
    assert_eq!(next_prim as usize, wide.prim_ids().len());
    assert!(parents.iter().skip(1).all(|&n| n == 1));
}

/// Collapses to every width by both methods, and checks that the optimal one costs least.
fn all_widths(bvh: &Bvh, settings: &CollapseSettings) {
    fn width<const W: usize>(bvh: &Bvh, settings: &CollapseSettings) {
        let cost = |method| {
            let settings = CollapseSettings { method, ..*settings };
            let wide = WideBvh::<W>::collapse(bvh, &settings).unwrap();
            check(bvh, &wide, &settings);
            wide.cost(&settings.costs)
        };
        let (greedy, optimal) = (cost(CollapseMethod::Greedy), cost(CollapseMethod::Optimal));
        assert!(optimal <= greedy * (1.0 + 1e-4), "{W}: {optimal} > {greedy}");
    }
    width::<4>(bvh, settings);
    width::<8>(bvh, settings);
    width::<16>(bvh, settings);
}

proptest! {
    #[test]
    fn collapse_keeps_the_tree(
        leaf_sizes in prop::collection::vec(
            prop_oneof![8 => 1_u32..4, 2 => 5_u32..20, 1 => 300_u32..700],
            1..200,
        ),
        choice: u64,
        max_leaf in 1_usize..=20,
        node in 0.0_f32..2.0,
        reference in 0.0_f32..2.0,
    ) {
        let bvh = random_tree(&leaf_sizes, choice);
        let costs = WideCosts { node, leaf: 1.0, reference };
        all_widths(&bvh, &CollapseSettings { max_leaf, costs, ..CollapseSettings::default() });
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let leaf_sizes: Vec<u32> =
        (0..60_000).map(|i| i % 3 + 1 + 20 * u32::from(i % 97 == 0)).collect();
    let bvh = random_tree(&leaf_sizes, 5);
    let settings = CollapseSettings::default();
    let collapse = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh8::collapse(&bvh, &settings).unwrap())
    };
    let one = collapse(1);
    check(&bvh, &one, &settings);
    for threads in [2, 3, 8] {
        assert_eq!(collapse(threads), one);
    }
}

#[test]
fn large_leaves_are_divided() {
    let bvh = random_tree(&[100_000], 0);
    let wide = Bvh8::collapse(&bvh, &CollapseSettings::default()).unwrap();
    check(&bvh, &wide, &CollapseSettings::default());
    assert!(wide.levels() <= 6);
}

#[test]
fn chains_do_not_overflow_the_stack() {
    let count = 1_000_000_u32;
    let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
    let mut nodes = vec![BvhNode::inner(unit, 1)];
    for i in 0..count - 1 {
        nodes.push(BvhNode::leaf(unit, i, 1));
        nodes.push(if i + 2 == count {
            BvhNode::leaf(unit, count - 1, 1)
        } else {
            BvhNode::inner(unit, 2 * i + 3)
        });
    }
    let bvh = Bvh { nodes, prim_ids: (0..count).collect() };
    let wide = Bvh8::collapse(&bvh, &CollapseSettings::default()).unwrap();
    check(&bvh, &wide, &CollapseSettings::default());
    assert!(wide.levels() > 100_000);
}

#[test]
fn settings_out_of_range_are_refused() {
    let bvh = random_tree(&[1, 1], 0);
    let costs = |costs| CollapseSettings { costs, ..CollapseSettings::default() };
    for settings in [
        CollapseSettings { max_leaf: 0, ..CollapseSettings::default() },
        costs(WideCosts { node: -1.0, ..WideCosts::default() }),
        costs(WideCosts { leaf: f32::INFINITY, ..WideCosts::default() }),
        costs(WideCosts { reference: f32::NAN, ..WideCosts::default() }),
    ] {
        let error = Bvh8::collapse(&bvh, &settings).unwrap_err();
        assert!(matches!(error, CollapseError::BadSetting { .. }), "{error}");
    }
}
