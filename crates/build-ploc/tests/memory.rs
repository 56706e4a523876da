//! The bound on memory, measured with a counting allocator.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_ploc::{MAX_RADIUS, Ploc};

#[global_allocator]
static ALLOCATOR: support::counting::Counting = support::counting::Counting;

#[test]
fn peak_memory_stays_within_the_bound() {
    support::check_memory_bound(&Ploc::default());
    support::check_memory_bound(&Ploc { radius: 1, max_leaf_size: 1, ..Ploc::default() });
    support::check_memory_bound(&Ploc { radius: MAX_RADIUS, ..Ploc::default() });
}
