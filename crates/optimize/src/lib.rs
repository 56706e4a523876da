//! Passes that improve finished bounding volume hierarchies.

mod annealing;
mod bottom_up;
mod budget;
mod collapse;
mod error;
mod moves;
mod optimized;
mod pass;
mod reinsertion;
mod rotation;
mod search;
mod tree;
mod treelet;

pub use annealing::Annealing;
pub use budget::{Budget, Report};
pub use collapse::CollapseLeaves;
pub use error::OptimizeError;
pub use optimized::Optimized;
pub use pass::{Chain, Optimizer};
pub use reinsertion::Reinsertion;
pub use rotation::Rotations;
pub use treelet::Treelets;
