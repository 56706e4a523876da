//! Queries beyond the closest hit and any hit.

pub(crate) mod hits;
pub(crate) mod visitor;

pub use hits::HitQueries;
