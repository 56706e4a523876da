//! The bound on memory, measured with a counting allocator.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_aac::{Aac, Agglomerative};
use niwaki_core::Builder;

#[global_allocator]
static ALLOCATOR: support::counting::Counting = support::counting::Counting;

/// One test, because the counter is global.
#[test]
fn peak_memory_stays_within_the_bound() {
    support::check_memory_bound(&Aac::hq());
    support::check_memory_bound(&Aac { delta: 128, max_leaf_size: 1, ..Aac::lq() });
    // The reference is slow, so with less to build.
    let builder = Agglomerative::default();
    let hard = support::hard_cases();
    let nested = hard.into_iter().filter(|(name, _)| ["nested boxes", "soup"].contains(name));
    for mesh in nested.map(|(_, mesh)| mesh).chain([support::soup(3000, 1), support::soup(1, 1)]) {
        let (result, peak) = support::counting::peak(|| builder.build_mesh(&mesh));
        let (kept, bound) = (result.unwrap().bytes(), builder.memory_bound(mesh.len()));
        assert!(kept <= peak && peak <= bound, "{} triangles: {peak} of {bound}", mesh.len());
        assert!(mesh.len() < 10_000 || bound < 3 * peak, "{peak} of {bound}");
    }
}
