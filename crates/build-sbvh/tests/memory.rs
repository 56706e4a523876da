//! The bound on memory, measured with a counting allocator.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_sbvh::{ObjectSplit, Sbvh};
use niwaki_core::Builder;
use support::{Rng, counting};

#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

/// Where everything wants to split and where nothing does, on one thread and on several.
#[test]
fn peak_memory_stays_within_the_bound() {
    let soups = [0, 1, 100, 10_000, 80_000].map(|n| support::soup(n, 2));
    let mut rng = Rng(3);
    let diagonals = support::mesh((0..20_000).map(|_| {
        let (from, to) = (rng.cube(), rng.cube());
        [from, to, to + rng.cube() * 0.01]
    }));
    let eager = Sbvh { alpha: 0.0, max_leaf_size: 1, max_references: 1.3, ..Sbvh::default() };
    let object_split = ObjectSplit::Sweep { up_to: 5000 };
    let swept = Sbvh { object_split, ..Sbvh::sweep() };
    let pools = [1, 4].map(|threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool")
    });
    for (pool, builder) in
        pools.iter().flat_map(|pool| [Sbvh::default(), eager, swept].map(|builder| (pool, builder)))
    {
        for mesh in soups.iter().chain([&diagonals]) {
            // Once for what the pool allocates on first use.
            if mesh.len() <= 100 {
                pool.install(|| builder.build_mesh(mesh)).expect("finite");
            }
            let (result, peak) = counting::peak(|| pool.install(|| builder.build_mesh(mesh)));
            let bvh = result.expect("finite");
            let bound = pool.install(|| builder.memory_bound(mesh.len()));
            let references = builder.reference_bound(mesh.len());
            assert!(bvh.prim_ids.len() <= references);
            assert!(peak <= bound, "{builder:?}, {}: {peak} of {bound} bytes", mesh.len());
            // A bound far above the use would be true and useless.
            if mesh.len() >= 20_000 {
                assert!(bvh.bytes() <= peak, "the counter counts");
                assert!(bound < 3 * peak, "{builder:?}: {peak} of {bound} bytes");
            }
        }
    }
}
