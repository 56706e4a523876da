//! The bound on memory, measured with a counting allocator.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_binned::Binned;

#[global_allocator]
static ALLOCATOR: support::counting::Counting = support::counting::Counting;

#[test]
fn peak_memory_stays_within_the_bound() {
    support::check_memory_bound(&Binned::default());
    support::check_memory_bound(&Binned { bins: 64, max_leaf_size: 1, ..Binned::default() });
}
