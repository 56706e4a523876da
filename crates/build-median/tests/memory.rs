//! The bound on memory, measured with a counting allocator.

mod support;

use niwaki_build_median::{ObjectMedian, SpatialMedian};

#[global_allocator]
static ALLOCATOR: support::counting::Counting = support::counting::Counting;

#[test]
fn peak_memory_stays_within_the_bound() {
    support::check_memory_bound(&ObjectMedian::default());
    support::check_memory_bound(&ObjectMedian { max_leaf_size: 1 });
    support::check_memory_bound(&SpatialMedian::default());
    support::check_memory_bound(&SpatialMedian { max_leaf_size: 1 });
}
