//! Checks that `cargo xtask verify`, `stability`, the tests and the fuzz targets share.
//!
//! ```
//! // What a fuzzer feeds with bytes, and what a test feeds with seeds.
//! for target in &niwaki_checks::fuzz::ALL {
//!     for seed in target.seeds() {
//!         target.check(&seed);
//!     }
//! }
//! assert!(niwaki_checks::builders().iter().any(|builder| builder.name() == "sweep"));
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`builders()`](builders::builders) | every builder of ours, in the order of tables |
//! | [`exact_answers`] | rays with their exact closest hits |
//! | [`same_bytes`], [`same_wide`] | equality of trees to the last bit |
//! | [`fuzz`] | one function a fuzz target: what has to hold whatever the bytes |
//!
//! There are no feature flags.

mod answers;
mod builders;
pub mod fuzz;
mod trees;

pub use answers::exact_answers;
pub use builders::builders;
pub use trees::{same_bytes, same_wide};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
