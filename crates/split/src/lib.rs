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
//! let config = SplitPartition { group_size: GroupSize::Fixed(16), ..SplitPartition::default() };
//! let partition = config.partition_mesh(&mesh)?;
//! assert!(partition.references() > mesh.len(), "some triangles are in several groups");
//! assert!(partition.groups().all(|group| group.len() <= 16));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! There are no feature flags.

mod divide;
mod partition;
mod pre_split;
mod sets;
mod shared;

pub use partition::{GroupSize, Partition, SplitPartition};
pub use pre_split::{PreSplit, PreSplitter};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
