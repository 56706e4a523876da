//! Hard geometry, determinism and refusals.

#[path = "../../build-median/tests/support/mod.rs"]
mod support;

use niwaki_build_aac::Aac;
use support::*;

#[test]
fn hard_cases_are_survived() {
    for builder in [Aac::hq(), Aac::lq()] {
        check_hard_cases(&builder, builder.max_leaf_size);
        check_references(&builder);
    }
}
