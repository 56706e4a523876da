//! The bound on memory, measured with a counting allocator.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_lbvh::{Algorithm, Hlbvh, Lbvh};

#[global_allocator]
static ALLOCATOR: support::counting::Counting = support::counting::Counting;

#[test]
fn peak_memory_stays_within_the_bound() {
    for treelet_bits in [1, 15, 30] {
        support::check_memory_bound(&Hlbvh { treelet_bits, ..Hlbvh::default() });
    }
    for algorithm in [Algorithm::Lauterbach, Algorithm::Karras, Algorithm::Apetrei] {
        for code_bits in [30, 63] {
            let builder = Lbvh { algorithm, code_bits, ..Lbvh::default() };
            support::check_memory_bound(&builder);
            support::check_memory_bound(&Lbvh { max_leaf_size: 1, ..builder });
        }
    }
}
