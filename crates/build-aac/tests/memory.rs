//! The bound on memory, measured with a counting allocator.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_aac::{Aac, Agglomerative};

#[global_allocator]
static ALLOCATOR: support::counting::Counting = support::counting::Counting;

#[test]
fn peak_memory_stays_within_the_bound() {
    support::check_memory_bound(&Aac::hq());
    support::check_memory_bound(&Aac::lq());
    support::check_memory_bound(&Aac { delta: 128, max_leaf_size: 1, ..Aac::hq() });
    support::check_memory_bound(&Agglomerative::default());
}
