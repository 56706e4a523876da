//! Hard geometry, determinism and refusals.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_ploc::{MAX_RADIUS, Ploc};
use support::*;

#[test]
fn hard_cases_are_survived() {
    check_hard_cases(&Ploc::default(), Ploc::default().max_leaf_size);
    check_references(&Ploc::default());
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = Ploc::default();
    for radius in [0, MAX_RADIUS + 1, usize::MAX] {
        assert_eq!(refused(&Ploc { radius, ..good }), "radius");
    }
    assert_eq!(refused(&Ploc { max_leaf_size: 0, ..good }), "max_leaf_size");
}
