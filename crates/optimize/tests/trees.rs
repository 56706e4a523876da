//! Every pass on hard input: cost never grows, trees stay valid, bytes never depend on threads.

#[allow(dead_code, reason = "each test file uses some of these")]
mod common;

use common::{passes, same_bytes, single, split_tree};
use niwaki_build_sweep::Sweep;
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, BuildError, Builder, Bvh, BvhNode, SahConstants, TriangleMesh, to_u32};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_metrics::{sah, validate};
use niwaki_optimize::{
    Annealing, Budget, Chain, Cheapest, CollapseLeaves, Insertion, OnSingleLeaves, OptimizeError,
    Optimized, Optimizer, Prune, Reinsertion, Rotations, Treelets, split_leaves,
};
use proptest::prelude::*;
use std::time::Duration;

fn cost(bvh: &Bvh) -> f64 {
    sah(bvh, &SahConstants::default())
}

/// Runs a pass and checks what all promise.
fn check(pass: &dyn Optimizer, tree: &Bvh, mesh: &TriangleMesh, what: &str) -> Bvh {
    let mut better = tree.clone();
    let report = pass.optimize(&mut better).unwrap();
    let what = format!("{} on {what}", pass.name());
    assert_eq!(validate(&better, mesh), Ok(()), "{what}");
    assert_eq!((report.before, report.after), (cost(tree), cost(&better)), "{what}");
    assert!(report.after <= report.before, "{what}");
    assert_eq!(report.changes == 0, same_bytes(tree, &better), "{what}: {report:?}");
    assert_depth_first(&better, &what, report.changes > 0);
    better
}

/// Children of a node stand where the walk reaches them, ids in the order of the leaves.
fn assert_depth_first(bvh: &Bvh, what: &str, changed: bool) {
    if !changed {
        return;
    }
    let (mut next_node, mut next_id) = (1, 0);
    let mut stack = vec![0];
    while let Some(i) = stack.pop() {
        let node = &bvh.nodes[i];
        if node.is_leaf() {
            assert_eq!(node.first, next_id, "{what}");
            next_id += node.count;
        } else {
            let [a, b] = node.children();
            assert_eq!(a, next_node, "{what}");
            next_node += 2;
            stack.extend([b, a]);
        }
    }
    assert_eq!(next_node, bvh.nodes.len(), "{what}");
}

#[test]
fn hard_meshes_stay_valid_and_never_get_worse() {
    for case in niwaki_hard_cases::meshes() {
        let split = OnSingleLeaves::new(&case.mesh, Treelets::default(), CollapseLeaves::default());
        let mut trees = vec![median_tree(&case.mesh, 5)];
        // The two meshes of 100,000 triangles are costly and no harder in a second tree.
        if case.mesh.len() < 50_000 {
            trees.push(single().build_mesh(&case.mesh).unwrap());
        }
        for tree in trees {
            for pass in passes() {
                check(&*pass, &tree, &case.mesh, case.name);
            }
            check(&split, &tree, &case.mesh, case.name);
        }
    }
}

#[test]
fn split_triangles_stay_covered() {
    for case in niwaki_hard_cases::meshes() {
        if case.mesh.len() > 20_000 {
            continue;
        }
        for builder in [single(), Sweep::default()] {
            let tree = split_tree(&case.mesh, &builder);
            assert_eq!(validate(&tree, &case.mesh), Ok(()), "{}", case.name);
            for pass in passes() {
                check(&*pass, &tree, &case.mesh, case.name);
            }
            let split =
                OnSingleLeaves::new(&case.mesh, Rotations::default(), CollapseLeaves::default());
            check(&split, &tree, &case.mesh, case.name);
        }
    }
}

/// Small triangles and a few that are 50 times as large.
fn mixed_soup(count: usize) -> TriangleMesh {
    let small = niwaki_hard_cases::soup(count, 0.01, 1);
    let large = niwaki_hard_cases::soup(count / 20, 0.5, 2);
    TriangleMesh::from_triangles(&[small, large].concat()).unwrap()
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let mesh = mixed_soup(20_000);
    let tree = median_tree(&mesh, 1);
    for pass in passes() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut bvh = tree.clone();
            pool.install(|| pass.optimize(&mut bvh)).unwrap();
            bvh
        };
        let expected = run(1);
        assert!(!same_bytes(&expected, &tree), "{} changed nothing", pass.name());
        for threads in [2, 3, 8] {
            assert!(same_bytes(&run(threads), &expected), "{} {threads}", pass.name());
        }
    }
}

#[test]
fn bad_trees_get_much_better() {
    // Halving at the median ignores areas; published gains of these passes on such trees are
    // some 10 to 30 percent.
    let mesh = mixed_soup(6000);
    let tree = median_tree(&mesh, 1);
    let ratio = |pass: &dyn Optimizer| cost(&check(pass, &tree, &mesh, "soup")) / cost(&tree);
    assert!(ratio(&Reinsertion::default()) < 0.8);
    assert!(ratio(&Insertion::default()) < 0.8);
    assert!(ratio(&Treelets::default()) < 0.85);
    assert!(ratio(&Rotations::default()) < 0.9);
    assert!(ratio(&Annealing::default()) < 0.97 * ratio(&Rotations::default()));
    assert!(ratio(&Prune::new(Sweep::default())) < 0.95);
    // A sweep tree is hard to better, but can be.
    let sweep = single().build_mesh(&mesh).unwrap();
    let reinserted = check(&Reinsertion::default(), &sweep, &mesh, "sweep");
    assert!(cost(&reinserted) < 0.97 * cost(&sweep));
}

/// A chain: each inner node has a leaf and the rest. Boxes shrink by less than `f32` can resolve
/// in the end, so many are equal.
fn chain(depth: u32) -> (Bvh, TriangleMesh) {
    let size = |i: u32| 1.0 / (1.0 + i as f32 * 1e-4);
    let corner = |i: u32| Vec3::new(size(i), (i % 7) as f32 * 0.1, 0.0);
    let mesh = TriangleMesh::new(
        (0..=depth).flat_map(|i| [Vec3::ZERO, corner(i), corner(i) * 0.5]).collect(),
        (0..=depth).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
    )
    .unwrap();
    let mut bounds: Vec<Aabb> = (0..=depth as usize).map(|i| mesh.triangle(i).bounds()).collect();
    let leaves = bounds.clone();
    for i in (0..depth as usize).rev() {
        bounds[i] = bounds[i].union(bounds[i + 1]);
    }
    let mut nodes = vec![BvhNode::leaf(bounds[0], 0, 1)];
    for i in 0..depth as usize {
        let place = nodes.len() - 1;
        nodes[place] = BvhNode::inner(bounds[i], to_u32(nodes.len()));
        nodes.push(BvhNode::leaf(leaves[i], to_u32(i), 1));
        nodes.push(BvhNode::leaf(bounds[i + 1], to_u32(i + 1), 1));
    }
    (Bvh { nodes, prim_ids: (0..=depth).collect() }, mesh)
}

#[test]
fn chains_a_million_deep_do_not_overflow_the_stack() {
    let (tree, mesh) = chain(1_000_000);
    let once = Budget::iterations(1);
    let passes: [Box<dyn Optimizer>; 7] = [
        Box::new(Reinsertion { budget: once, batch_fraction: 0.002, ..Reinsertion::default() }),
        Box::new(Insertion { budget: once, batch_fraction: 0.001, ..Insertion::default() }),
        Box::new(Rotations { budget: once, ..Rotations::default() }),
        Box::new(Annealing { budget: once, ..Annealing::default() }),
        Box::new(Treelets { budget: once, leaves: 4, ..Treelets::default() }),
        Box::new(Prune::new(Sweep::default())),
        Box::new(CollapseLeaves::default()),
    ];
    for pass in passes {
        let mut better = tree.clone();
        let report = pass.optimize(&mut better).unwrap();
        assert_eq!(validate(&better, &mesh), Ok(()), "{}", pass.name());
        assert!(report.after <= report.before);
    }
    let split = split_leaves(&tree, &mesh).unwrap();
    assert_eq!(cost(&split), cost(&tree));
}

#[test]
fn chains_are_shortened() {
    let (tree, mesh) = chain(10_000);
    for pass in passes() {
        check(&*pass, &tree, &mesh, "chain");
    }
}

#[test]
fn small_trees_are_left_alone() {
    let mut none = Bvh::default();
    let one = median_tree(&soup_mesh(3, 0.1, 1), 8);
    let two = median_tree(&soup_mesh(2, 0.1, 1), 1);
    for pass in passes() {
        let report = pass.optimize(&mut none).unwrap();
        assert_eq!((report.before, report.ratio()), (0.0, 1.0));
        assert_eq!(none, Bvh::default());
        check(&*pass, &one, &soup_mesh(3, 0.1, 1), "one leaf");
        check(&*pass, &two, &soup_mesh(2, 0.1, 1), "two leaves");
    }
}

#[test]
fn broken_trees_are_refused_and_left_alone() {
    let mesh = soup_mesh(200, 0.1, 4);
    let good = single().build_mesh(&mesh).unwrap();
    let leaf = good.nodes.iter().position(BvhNode::is_leaf).unwrap();
    let inner = good.nodes.iter().rposition(|node| !node.is_leaf()).unwrap();
    let change = |i: usize, f: &dyn Fn(&mut BvhNode)| {
        let mut bad = good.clone();
        f(&mut bad.nodes[i]);
        (bad, i)
    };
    let broken = [
        change(inner, &|n| n.first = 1_000_000),
        change(inner, &|n| n.first = u32::MAX),
        change(inner, &|n| n.first = 1),
        change(leaf, &|n| n.first = 1000),
        change(leaf, &|n| n.count = u32::MAX),
        change(leaf, &|n| n.max.y = f32::NAN),
        change(leaf, &|n| n.min.x = f32::INFINITY),
    ];
    for (bad, node) in broken {
        let bytes = |bvh: &Bvh| bytemuck::cast_slice::<_, u8>(&bvh.nodes).to_vec();
        for pass in passes() {
            let mut tree = bad.clone();
            let error = pass.optimize(&mut tree).unwrap_err();
            let named = matches!(error, OptimizeError::BrokenTree { node: n, .. } if n == node);
            assert!(named, "{}: {error}", pass.name());
            assert_eq!(bytes(&tree), bytes(&bad));
        }
        assert!(split_leaves(&bad, &mesh).is_err());
    }
    // Two parents of one pair, leaves over the same ids, a root that is too small.
    let mut shared = good.clone();
    shared.nodes[0].first = shared.nodes[1].first.max(shared.nodes[2].first);
    let mut cycle = good.clone();
    cycle.nodes[inner].first = to_u32(inner);
    let mut doubled = good.clone();
    for node in &mut doubled.nodes {
        if node.is_leaf() {
            (node.first, node.count) = (0, 200);
        }
    }
    let mut small = good.clone();
    small.nodes[0].max.x = 0.0;
    for bad in [cycle, doubled, small] {
        for pass in passes() {
            let mut tree = bad.clone();
            assert!(
                matches!(pass.optimize(&mut tree), Err(OptimizeError::BrokenTree { .. })),
                "{}",
                pass.name()
            );
            assert_eq!(tree, bad);
        }
    }
    // Nodes that nothing leads to are not noticed, as long as what remains is a tree.
    for pass in passes() {
        let _ = pass.optimize(&mut shared.clone());
    }
}

#[test]
fn settings_are_checked() {
    let constants = SahConstants { inner: f32::NAN, ..SahConstants::default() };
    let sweep = Sweep::default;
    let bad: Vec<Box<dyn Optimizer>> = vec![
        Box::new(Reinsertion { batch_fraction: 0.0, ..Reinsertion::default() }),
        Box::new(Reinsertion { batch_fraction: f32::NAN, ..Reinsertion::default() }),
        Box::new(Reinsertion { batch_fraction: 1.1, ..Reinsertion::default() }),
        Box::new(Reinsertion { falloff: -1.0, ..Reinsertion::default() }),
        Box::new(Reinsertion { batch_size: 0, ..Reinsertion::default() }),
        Box::new(Reinsertion { max_visits: 0, ..Reinsertion::default() }),
        Box::new(Reinsertion { constants, ..Reinsertion::default() }),
        Box::new(Insertion { batch_fraction: -1.0, ..Insertion::default() }),
        Box::new(Insertion { group_size: 0, ..Insertion::default() }),
        Box::new(Insertion { max_visits: 0, ..Insertion::default() }),
        Box::new(Insertion { constants, ..Insertion::default() }),
        Box::new(Rotations { constants, ..Rotations::default() }),
        Box::new(Annealing { temperature: 0.0, ..Annealing::default() }),
        Box::new(Annealing { temperature: f32::INFINITY, ..Annealing::default() }),
        Box::new(Annealing { constants, ..Annealing::default() }),
        Box::new(Treelets { leaves: 2, ..Treelets::default() }),
        Box::new(Treelets { leaves: 9, ..Treelets::default() }),
        Box::new(Treelets { constants, ..Treelets::default() }),
        Box::new(Prune { mini_tree_size: 0, ..Prune::new(sweep()) }),
        Box::new(Prune { threshold: f32::NAN, ..Prune::new(sweep()) }),
        Box::new(Prune { constants, ..Prune::new(sweep()) }),
        Box::new(CollapseLeaves { max_leaf_size: 0, ..CollapseLeaves::default() }),
        Box::new(CollapseLeaves { constants, ..CollapseLeaves::default() }),
    ];
    for pass in bad {
        let error = pass.optimize(&mut Bvh::default()).unwrap_err();
        assert!(matches!(error, OptimizeError::BadSetting { .. }), "{}: {error}", pass.name());
    }
}

#[test]
fn budgets_end_the_work() {
    let mesh = soup_mesh(5000, 0.1, 9);
    let tree = median_tree(&mesh, 1);
    for budget in [Budget::iterations(0), Budget::time(Duration::ZERO)] {
        let none: [Box<dyn Optimizer>; 5] = [
            Box::new(Reinsertion { budget, ..Reinsertion::default() }),
            Box::new(Insertion { budget, ..Insertion::default() }),
            Box::new(Rotations { budget, ..Rotations::default() }),
            Box::new(Annealing { budget, ..Annealing::default() }),
            Box::new(Treelets { budget, ..Treelets::default() }),
        ];
        for pass in none {
            let mut same = tree.clone();
            let report = pass.optimize(&mut same).unwrap();
            assert_eq!((report.iterations, report.changes), (0, 0), "{}", pass.name());
            assert_eq!(same, tree);
        }
    }
    let until_done = Rotations { budget: Budget::time(Duration::MAX), ..Rotations::default() };
    let mut climbed = tree.clone();
    let report = until_done.optimize(&mut climbed).unwrap();
    // The last sweep found nothing, so another one finds nothing either.
    assert!(report.iterations > 1);
    assert_eq!(until_done.optimize(&mut climbed).unwrap().changes, 0);
}

#[test]
fn chains_of_passes_and_optimized_builders() {
    let mesh = soup_mesh(3000, 0.1, 5);
    let pass =
        || Chain::new(vec![Box::new(Reinsertion::default()), Box::new(CollapseLeaves::default())]);
    assert_eq!(pass().passes().len(), 2);
    let builder = Optimized::new(single(), pass());
    assert_eq!(builder.name(), "sweep+reinsert+collapse");
    let tree = single().build_mesh(&mesh).unwrap();
    let expected = check(&pass(), &tree, &mesh, "soup");
    assert!(same_bytes(&builder.build_mesh(&mesh).unwrap(), &expected));
    assert!(same_bytes(&builder.build(&mesh.prim_refs()).unwrap(), &expected));
    assert_eq!(Optimized::new(single(), Rotations::default()).named("x").name(), "x");
    assert_eq!(builder.build(&[]).unwrap(), Bvh::default());
    for (prims, _) in niwaki_hard_cases::bad_prim_refs() {
        assert!(matches!(
            builder.build(&prims),
            Err(niwaki_core::BuildError::NonFiniteBounds { .. })
        ));
    }
    let bad = Optimized::new(single(), Treelets { leaves: 1, ..Treelets::default() });
    assert!(matches!(
        bad.build_mesh(&mesh),
        Err(niwaki_core::BuildError::BadSetting { setting: "leaves", .. })
    ));
    // A pass that fails gives back what was there before the first.
    let failing = Chain::new(vec![
        Box::new(Reinsertion::default()),
        Box::new(Treelets { leaves: 1, ..Treelets::default() }),
    ]);
    let mut same = tree.clone();
    assert!(failing.optimize(&mut same).is_err());
    assert_eq!(same, tree);
    assert_eq!(Chain::new(Vec::new()).optimize(&mut same), Ok(niwaki_optimize::Report::default()));
}

#[test]
fn the_cheapest_of_several_trees_is_kept() {
    let mesh = mixed_soup(3000);
    let bad = || Sweep { max_leaf_size: 1, ..Sweep::default() };
    let good = || Sweep::default();
    let expected = good().build_mesh(&mesh).unwrap();
    assert!(cost(&expected) < cost(&bad().build_mesh(&mesh).unwrap()));
    let builders =
        [Cheapest::new(bad(), 1.0).or(good(), 1.0), Cheapest::new(good(), 1.0).or(bad(), 1.0)];
    for builder in builders {
        assert_eq!(builder.name(), "sweep|sweep");
        assert!(same_bytes(&builder.build_mesh(&mesh).unwrap(), &expected));
        assert!(same_bytes(&builder.build(&mesh.prim_refs()).unwrap(), &expected));
        // By constants of which inner nodes cost nothing, small leaves are the best.
        let triangles = SahConstants { inner: 0.0, leaf: 0.0, triangle: 1.0 };
        let other = builder.with_constants(triangles).build_mesh(&mesh).unwrap();
        assert!(same_bytes(&other, &bad().build_mesh(&mesh).unwrap()));
    }
    // The first of equals, and what fails, fails.
    let empty = Cheapest::new(bad(), 1.0).or(good(), 1.0).build(&[]).unwrap();
    assert!(empty.nodes.is_empty());
    for (prims, index) in niwaki_hard_cases::bad_prim_refs() {
        let error = Cheapest::new(bad(), 1.0).or(good(), 1.0).build(&prims).unwrap_err();
        let BuildError::NonFiniteBounds { index: found, .. } = error else { panic!("{error}") };
        assert_eq!(found, index);
    }
}

#[test]
fn tops_are_not_built_by_builders_that_split() {
    struct Splits;
    impl Builder for Splits {
        fn name(&self) -> &str {
            "splits"
        }
        fn build(&self, prims: &[niwaki_core::PrimRef]) -> Result<Bvh, niwaki_core::BuildError> {
            Sweep::default().build(&[prims, prims].concat())
        }
        fn memory_bound(&self, count: usize) -> usize {
            Sweep::default().memory_bound(2 * count)
        }
    }
    let mut tree = median_tree(&soup_mesh(5000, 0.1, 9), 1);
    let error = Prune::new(Splits).optimize(&mut tree).unwrap_err();
    assert!(matches!(error, OptimizeError::Build(_)), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_tree_stays_valid_and_never_gets_worse(
        count in 1_usize..400,
        size in 0.001_f32..1.0,
        seed in any::<u64>(),
        scale in prop::sample::select(vec![1e-30_f32, 1.0, 1e30]),
        leaf in 1_usize..6,
        splits in any::<bool>(),
        which in 0_usize..9,
    ) {
        let mesh = soup_mesh(count, size, seed);
        let (positions, indices) = mesh.into_parts();
        let mesh =
            TriangleMesh::new(positions.iter().map(|p| *p * scale).collect(), indices).unwrap();
        let tree = if splits {
            split_tree(&mesh, &Sweep { max_leaf_size: to_u32(leaf), ..Sweep::default() })
        } else {
            median_tree(&mesh, leaf)
        };
        let pass = &passes()[which];
        let mut better = tree.clone();
        let report = pass.optimize(&mut better).unwrap();
        prop_assert_eq!(validate(&better, &mesh), Ok(()));
        prop_assert!(report.after <= report.before);
        prop_assert_eq!(report.after, cost(&better));
        if pass.name() != "collapse" {
            let sorted = |bvh: &Bvh| {
                let mut ids = bvh.prim_ids.clone();
                ids.sort_unstable();
                ids
            };
            prop_assert_eq!(sorted(&better), sorted(&tree));
        }
        // Leaves are split and merged without loss.
        let single = split_leaves(&tree, &mesh).unwrap();
        prop_assert_eq!(validate(&single, &mesh), Ok(()));
        prop_assert_eq!(single.nodes.len(), 2 * tree.prim_ids.len() - 1);
    }
}
