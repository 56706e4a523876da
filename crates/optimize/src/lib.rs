//! Passes that improve finished bounding volume hierarchies (thesis section 3.8; paper IV, section
//! 5.4).
//!
//! ```
//! use niwaki_build_sweep::Sweep;
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//! use niwaki_optimize::{Chain, CollapseLeaves, Optimized, Optimizer, Reinsertion};
//!
//! let positions: Vec<Vec3> = (0..3000_u32)
//!     .map(|i| Vec3::new((i * 7 % 61) as f32, (i * 5 % 53) as f32, (i % 47) as f32))
//!     .collect();
//! let indices = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
//! let mesh = TriangleMesh::new(positions, indices)?;
//!
//! // A pass over a tree.
//! let sweep = Sweep { max_leaf_size: 1, ..Sweep::default() };
//! let mut bvh = sweep.build_mesh(&mesh)?;
//! let report = Reinsertion::default().optimize(&mut bvh)?;
//! assert!(report.after < report.before);
//!
//! // A builder whose trees are optimized, single primitives first, leaves merged in the end.
//! let passes =
//!     Chain::new(vec![Box::new(Reinsertion::default()), Box::new(CollapseLeaves::default())]);
//! let builder = Optimized::new(sweep, passes);
//! assert_eq!(builder.name(), "sweep+reinsert+collapse");
//! let bvh = builder.build_mesh(&mesh)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | pass | source | threads |
//! |---|---|---|
//! | [`Reinsertion`] | Meister and Bittner 2018 | searches in parallel |
//! | [`Insertion`] | Bittner, Hapala and Havran 2013 | searches in parallel |
//! | [`Rotations`], [`Annealing`] | Kensler 2008 | subtrees in parallel |
//! | [`Treelets`] | Karras and Aila 2013 | subtrees in parallel |
//! | [`Prune`] | thesis paper IV, section 5.4 | those of the builder of the new top |
//! | [`CollapseLeaves`] | least cost over all choices of leaves | serial, linear |
//! | [`OnSingleLeaves`], [`split_leaves`] | leaves split before a pass, merged after it | those of the pass |
//! | [`refit`], [`RefitRotations`] | new positions; Kopta et al. 2012 | leaves and subtrees in parallel |
//!
//! [`Optimizer`] is what passes have in common: budget in, [`Report`] out, never a worse tree.
//! [`Chain`] runs several in turn; [`Optimized`] puts a builder in front; [`Cheapest`] keeps the
//! best tree of several builders. Passes work on the boxes
//! of leaves, not of primitives, so trees with split primitives stay valid and tight; only
//! [`refit`] cannot keep such boxes. They move whole leaves: build with one primitive a leaf and
//! merge leaves last for the best trees.
//!
//! None of them recurses, so depth is no limit: chains of 1,000,000 nodes work. Search and moves
//! then stop short of very distant places ([`Reinsertion::max_visits`]). There are no feature
//! flags.

mod annealing;
mod bottom_up;
mod budget;
mod cheapest;
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
pub use cheapest::Cheapest;
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

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
