//! BVH builders by how much quality is wanted, and the choice by how many rays will be traced.
//!
//! ```
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//! use niwaki_presets::Preset;
//!
//! let corners = (0..300).map(|i| Vec3::new((i % 7) as f32, (i % 11) as f32, (i % 13) as f32));
//! let indices = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
//! let mesh = TriangleMesh::new(corners.collect(), indices)?;
//! // A million rays through a hundred triangles pay for a good tree.
//! let preset = Preset::for_rays(1_000_000, mesh.len());
//! let bvh = preset.build_mesh(&mesh)?;
//! assert!(preset > Preset::Fastest && !bvh.nodes.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A tree costs its build once and its traversal with each ray. Which builder is best therefore
//! depends on the number of rays: [`Preset::for_rays`] asks a [`CostModel`] that was fitted on
//! measurements, and which [`CostModel::fit`] fits again on those of another machine.
//!
//! There are no feature flags.

mod fit;
mod model;
mod preset;

pub use fit::{FitError, Sample};
pub use model::{BuildCost, CostModel, ModelError, RayCost};
pub use preset::Preset;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
