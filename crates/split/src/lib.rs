//! Splits triangles ahead of BVH builders: SAH-guided split partitioning (Ganestam and Doggett
//! 2016; thesis paper V) and the pre-splitters it is compared with.
//!
//! ```
//! use niwaki_core::{TriangleMesh, glam::Vec3};
//! use niwaki_split::{GroupSize, SplitPartition};
//!
//! // Long thin triangles along the diagonal of a square.
//! let triangles = (0..64_u32).flat_map(|i| {
//!     let x = i as f32;
//!     [Vec3::new(x, 0.0, 0.0), Vec3::new(x + 64.0, 64.0, 0.0), Vec3::new(x + 1.0, 0.0, 0.0)]
//! });
//! let indices = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
//! let mesh = TriangleMesh::new(triangles.collect(), indices)?;
//!
//! let config = SplitPartition {
//!     group_size: GroupSize::Fixed(16),
//!     max_extra: 1.0,
//!     ..SplitPartition::default()
//! };
//! let partition = config.partition_mesh(&mesh)?;
//! assert!(partition.references() > mesh.len(), "some triangles are in several groups");
//! assert!(partition.groups().all(|group| group.len() <= 16));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | item | source |
//! |---|---|
//! | [`SplitPartition`] | thesis paper V: split where C_S < C_O while partitioning into groups |
//! | [`EarlySplit`] | Ernst and Greiner 2007: boxes over a surface area |
//! | [`EdgeVolume`] | Dammertz and Keller 2008: edges over a volume |
//! | [`KarrasAila`] | Karras and Aila 2013: priorities within a budget |
//! | [`SlackSplit`] | obvhs: large boxes whose parts have far smaller boxes |
//! | [`PreSplit`] | any builder behind any [`PreSplitter`]: `sweep_pre`, `binned_ka`, … |
//!
//! All of them have a bound on the references that they add, and give the same bytes on any number
//! of threads. There are no feature flags.

mod blocks;
mod divide;
mod early;
mod edge_volume;
mod karras_aila;
mod partition;
mod pieces;
mod pre_split;
mod room;
mod sets;
mod slack;
mod step;
mod unite;

pub use early::EarlySplit;
pub use edge_volume::EdgeVolume;
pub use karras_aila::KarrasAila;
pub use partition::{Group, GroupSize, Partition, SplitPartition};
pub use pre_split::{PreSplit, PreSplitter};
pub use slack::SlackSplit;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
