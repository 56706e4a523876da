//! `memory_bound` holds and is not far off, measured by an allocator that counts.

#[allow(dead_code, reason = "each test file uses some of these")]
mod common;

use niwaki_build_sweep::Sweep;
use niwaki_core::Builder;
use niwaki_hard_cases::counting::{Counting, peak};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_optimize::{
    Chain, Cheapest, CollapseLeaves, OnSingleLeaves, Optimized, Optimizer, Reinsertion,
};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// One test, because the counters are global.
#[test]
fn bounds_hold_and_are_tight() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        for count in [500, 60_000] {
            let mesh = soup_mesh(count, 0.1, 2);
            for leaf in [1, 4] {
                let tree = median_tree(&mesh, leaf);
                let mut passes = common::passes();
                passes.push(Box::new(Chain::new(vec![
                    Box::new(Reinsertion::default()),
                    Box::new(CollapseLeaves::default()),
                ])));
                let single =
                    OnSingleLeaves::new(&mesh, Reinsertion::default(), CollapseLeaves::default());
                for pass in passes.iter().map(|pass| &**pass).chain([&single as &dyn Optimizer]) {
                    let mut better = tree.clone();
                    let (_, peak) = peak(|| pass.optimize(&mut better).unwrap());
                    let bound = pass.memory_bound(tree.nodes.len(), tree.prim_ids.len());
                    let name = pass.name();
                    assert!(peak <= bound, "{name} {count} {leaf}: {peak} over {bound}");
                    // Pruning may have to build a top over single leaves; here it does not.
                    if count > 10_000 && name != "prune" {
                        assert!(bound <= 4 * peak, "{name} {count} {leaf}: {bound} for {peak}");
                    }
                }
            }
            let builder = Optimized::new(Sweep::default(), Reinsertion::default());
            let (_, most) = peak(|| builder.build_mesh(&mesh).unwrap());
            assert!(most <= builder.memory_bound(count), "{most}");
            let single = Sweep { max_leaf_size: 1, ..Sweep::default() };
            for builder in [
                Cheapest::new(Sweep::default(), 1.0).or(single, 1.0),
                Cheapest::new(single, 1.0).or(Sweep::default(), 1.0),
            ] {
                let (_, most) = peak(|| builder.build_mesh(&mesh).unwrap());
                assert!(most <= builder.memory_bound(count), "{}: {most}", builder.name());
            }
        }
    });
}
