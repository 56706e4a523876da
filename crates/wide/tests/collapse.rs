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

/// The same tree in another order of nodes.
fn breadth_first(bvh: &Bvh) -> Bvh {
    let mut nodes = vec![bvh.nodes[0]];
    let mut next = 0;
    while next < nodes.len() {
        if !nodes[next].is_leaf() {
            let [a, b] = nodes[next].children();
            nodes[next].first = to_u32(nodes.len());
            nodes.extend([bvh.nodes[a], bvh.nodes[b]]);
        }
        next += 1;
    }
    Bvh { nodes, prim_ids: bvh.prim_ids.clone() }
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
    fn same<const W: usize>(bvh: &Bvh, settings: &CollapseSettings) {
        let collapse = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| WideBvh::<W>::collapse(bvh, settings).unwrap())
        };
        let one = collapse(1);
        check(bvh, &one, settings);
        let cost = one.cost(&settings.costs).to_bits();
        for threads in [2, 3, 8] {
            let other = collapse(threads);
            assert_eq!(other, one);
            assert_eq!(other.cost(&settings.costs).to_bits(), cost);
        }
    }
    // Depth first, and with siblings far from what is below them.
    for bvh in [random_tree(&leaf_sizes, 5), breadth_first(&random_tree(&leaf_sizes, 5))] {
        for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
            same::<4>(&bvh, &settings);
            same::<8>(&bvh, &settings);
            same::<16>(&bvh, &settings);
        }
    }
}

#[test]
fn large_leaves_are_divided() {
    let bvh = random_tree(&[100_000], 0);
    for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
        let wide = Bvh8::collapse(&bvh, &settings).unwrap();
        check(&bvh, &wide, &settings);
        assert!(wide.levels() <= 6);
    }
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
    for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
        let wide = Bvh8::collapse(&bvh, &settings).unwrap();
        check(&bvh, &wide, &settings);
        assert!(wide.levels() > 100_000);
        let wide = WideBvh::<16>::collapse(&bvh, &settings).unwrap();
        check(&bvh, &wide, &settings);
    }
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

#[test]
fn hard_cases_keep_every_reference() {
    for case in niwaki_hard_cases::meshes() {
        let bvh = niwaki_hard_cases::median_tree(&case.mesh, 2);
        if !bvh.nodes.is_empty() {
            all_widths(&bvh, &CollapseSettings::default());
        }
    }
}

#[test]
fn malformed_trees_are_refused() {
    let tree = random_tree(&[1; 200], 1);
    let faults: [fn(&mut Bvh); 4] = [
        |bvh| bvh.nodes[3].first = 1_000_000,
        |bvh| bvh.nodes[2].first = 1,
        |bvh| bvh.prim_ids.truncate(150),
        |bvh| bvh.nodes[1] = bvh.nodes[0],
    ];
    let mut refused = 0;
    for fault in faults {
        let mut bvh = tree.clone();
        fault(&mut bvh);
        for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
            for error in [
                Bvh8::collapse(&bvh, &settings).err(),
                WideBvh::<4>::collapse(&bvh, &settings).err(),
                WideBvh::<16>::collapse(&bvh, &settings).err(),
            ] {
                assert!(matches!(error, None | Some(CollapseError::Malformed { .. })), "{error:?}");
                refused += usize::from(error.is_some());
            }
        }
    }
    assert!(refused >= 18, "{refused}");
}

#[test]
fn boxes_that_are_no_boxes_lose_nothing() {
    // Not something a builder returns, but nothing that may break the collapse.
    let mut bvh = random_tree(&[2; 300], 3);
    for (i, node) in bvh.nodes.iter_mut().enumerate() {
        node.max.x = [f32::NAN, f32::INFINITY, -1.0, 1.0][i % 4];
    }
    for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
        let wide = Bvh8::collapse(&bvh, &settings).unwrap();
        let mut ids = wide.prim_ids().to_vec();
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..600));
    }
}
