//! Judges bounding volume hierarchies: SAH, EPO, LCV, tree statistics and structural validation.
//!
//! ```
//! use niwaki_core::{Aabb, Bvh, BvhNode, SahConstants, TriangleMesh, glam::Vec3};
//! use niwaki_metrics::{TreeStats, epo, sah, validate};
//!
//! // One leaf over two triangles that make a unit square.
//! let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
//! let mesh = TriangleMesh::new(corners, vec![[0, 1, 2], [2, 1, 3]])?;
//! let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 2)], prim_ids: vec![0, 1] };
//!
//! assert_eq!(validate(&bvh, &mesh), Ok(()));
//! assert_eq!(sah(&bvh, &SahConstants::THESIS_IV), 2.0); // C_T times two triangles
//! assert_eq!(epo(&bvh, &mesh, &SahConstants::THESIS_IV), 0.0); // no foreign surface inside
//! assert_eq!(TreeStats::of(&bvh).leaf_nodes, 1);
//! # Ok::<(), niwaki_core::MeshError>(())
//! ```
//!
//! | function | says | cost |
//! |---|---|---|
//! | [`sah`] | expected work of a long random ray (thesis section 3.4, equation 3) | one pass |
//! | [`epo`], [`epo_sampled`] | extra work of rays that start or end on surfaces (Aila et al. 2013) | seconds a million triangles; sampled, milliseconds |
//! | [`lcv`], [`leaf_counts`] | how unequal the work of neighbouring rays is (Aila et al. 2013) | traces the given rays |
//! | [`TreeStats`] | counts, depths, leaf sizes, duplication, bytes | one pass |
//! | [`validate`] | whether the tree is sound and covers the mesh | a few passes |
//!
//! The first four accept every tree without panic or endless loop, broken ones included: they
//! judge what can be reached from the root and ignore links that lead nowhere or to a node that
//! was seen before. None of them recurses, so depth is no limit, and none depends on the number
//! of threads. There are no feature flags.

mod clip;
mod epo;
mod lcv;
mod preorder;
mod sah;
mod stats;
mod validate;

pub use epo::{EpoEstimate, epo, epo_sampled};
pub use lcv::{LeafCounts, lcv, leaf_counts};
pub use sah::sah;
pub use stats::TreeStats;
pub use validate::{ValidateOptions, Violation, validate, validate_with};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
