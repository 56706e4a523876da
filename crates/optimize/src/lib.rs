//! Passes that improve finished bounding volume hierarchies.

mod annealing;
mod bottom_up;
mod budget;
mod collapse;
mod error;
mod insertion;
mod moves;
mod optimized;
mod pass;
mod prune;
mod refit;
mod reinsertion;
mod rotation;
mod search;
mod split_leaves;
mod tree;
mod treelet;

pub use annealing::Annealing;
pub use budget::{Budget, Report};
pub use collapse::CollapseLeaves;
pub use error::OptimizeError;
pub use insertion::Insertion;
pub use optimized::Optimized;
pub use pass::{Chain, Optimizer};
pub use prune::Prune;
pub use refit::{RefitRotations, refit};
pub use reinsertion::Reinsertion;
pub use rotation::Rotations;
pub use split_leaves::{OnSingleLeaves, split_leaves};
pub use treelet::Treelets;
