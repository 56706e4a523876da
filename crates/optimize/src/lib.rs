//! Passes that improve finished bounding volume hierarchies.

mod budget;
mod error;
mod moves;
mod optimized;
mod pass;
mod reinsertion;
mod search;
mod tree;

pub use budget::{Budget, Report};
pub use error::OptimizeError;
pub use optimized::Optimized;
pub use pass::{Chain, Optimizer};
pub use reinsertion::Reinsertion;
