//! Geometry, primitive references, rays and the binary bounding volume hierarchy (BVH) that all
//! Niwaki crates share.
//!
//! ```
//! use niwaki_core::{Aabb, TriangleMesh, glam::Vec3};
//!
//! let mesh = TriangleMesh::new(
//!     vec![Vec3::ZERO, Vec3::X, Vec3::Y],
//!     vec![[0, 1, 2]],
//! )?;
//! let prims = mesh.prim_refs();
//! assert_eq!(prims[0].aabb(), Aabb::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
//! # Ok::<(), niwaki_core::MeshError>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`aabb`] | axis-aligned boxes and the scale that keeps their areas inside `f32` |
//! | [`triangle`] | triangles and conservative split clipping |
//! | [`mesh`] | indexed triangle meshes |
//! | [`prim_ref`] | 32-byte primitive references, the input of every builder |
//! | [`ray`] | rays, hits, and the [`Intersector`] that renderers are generic over |
//! | [`bvh`] | the binary BVH: 32-byte nodes, siblings adjacent |
//! | [`builder`] | the [`Builder`] trait, its errors and shared checks |
//! | [`bins`] | bins of centroids and their kernels, scalar and AVX2 |
//! | [`bottom_up`] | trees that are joined from the primitives up, with leaves by SAH |
//! | [`clip`] | cuts references at axis planes, for builders that split primitives |
//! | [`layout`] | where top-down builders put nodes so that the result never depends on threads |
//! | [`midpoint`] | midpoints of boxes, and groups of them halved in space |
//! | [`morton`] | Morton codes, and the order and radix tree that they give |
//! | [`partition`] | partitioning one list with all threads, in place |
//! | [`radix`] | a stable parallel radix sort |
//! | [`sah`] | surface area heuristic constants |
//! | [`memory`] | large pages for large arrays |
//! | [`float`] | rounding-aware arithmetic |
//!
//! There are no feature flags.

pub mod aabb;
pub mod bins;
pub mod bottom_up;
pub mod builder;
pub mod bvh;
pub mod clip;
pub mod float;
pub mod layout;
pub mod memory;
pub mod mesh;
pub mod midpoint;
pub mod morton;
pub mod partition;
pub mod prim_ref;
pub mod radix;
pub mod ray;
pub mod sah;
pub mod triangle;

pub use aabb::{Aabb, AreaScale};
pub use builder::{BuildError, Builder, SceneBounds, scene_bounds};
pub use bvh::{Bvh, BvhNode};
pub use clip::{BoxClip, Clip};
pub use float::to_u32;
pub use glam;
pub use mesh::{MeshError, TriangleMesh};
pub use prim_ref::PrimRef;
pub use ray::{Hit, Intersector, Ray};
pub use sah::SahConstants;
pub use triangle::Triangle;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
