//! CPU ray traversal kernels over binary and wide BVHs.
//!
//! ```
//! use niwaki_core::{Bvh, BvhNode, Intersector, Ray, TriangleMesh, glam::Vec3};
//! use niwaki_trace::AutoScene;
//!
//! let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
//! // Any builder makes the tree; for one triangle a leaf will do.
//! let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
//! let scene = AutoScene::new(&bvh, &mesh)?;
//! let hit = scene.closest_hit(&Ray::new(Vec3::new(0.25, 0.5, -2.0), Vec3::Z));
//! assert_eq!((hit.prim_id, hit.t, hit.u, hit.v), (0, 2.0, 0.25, 0.5));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`AutoScene`] | a tree with its triangles, as wide as suits the processor, traced by the fastest [`Kernel`] it has: start here |
//! | [`WideScene`] | the same with a width that you choose: 8 unless said otherwise; 4 or 16 |
//! | [`QuantisedScene`] | the same with nodes of half the size |
//! | [`Mode`] | watertight, the default: no ray slips between two triangles; or fast |
//! | [`BinaryScene`] | the scalar reference kernel over the binary tree |
//! | [`DoubleScene`] | rays and triangles in `f64`, for scenes whose detail is lost in `f32` |
//! | [`CustomScene`] | the same traversal over primitives of the caller's |
//! | [`HitQueries`] | filters for alpha masks, all hits in order, the nearest k |
//! | [`MaskedScene`] | a mask for each primitive and one for the ray |
//! | [`MeshQueries`] | what is nearest to a point, what meets a box |
//! | [`Batches`] | slices of rays, on one thread or all |
//! | [`BruteForce`] | every triangle tested: what the kernels are compared with |
//! | [`Counts`], [`Walk`] | boxes, triangles, nodes and leaves that a ray visited, and where it ended |
//!
//! In each mode, all of them use one sequence of triangle arithmetic, fused multiply-adds
//! included, so a hit has the same `t`, `u` and `v` to the last bit whichever kernel found it, and
//! among hits at equal `t` the smallest `prim_id` wins everywhere.
//!
//! Coordinates of any finite magnitude work: scenes and rays are scaled by powers of two, which
//! changes no significand, so that products neither overflow nor vanish.
//!
//! There are no feature flags.

mod auto;
mod binary;
mod brute;
mod counts;
mod double;
mod error;
mod flat;
mod kernel;
mod kernels;
mod mode;
mod prepare;
mod quantised;
mod query;
mod scale;
mod setup;
mod triangle;
mod watertight;
mod wide;

pub use auto::AutoScene;
pub use binary::BinaryScene;
pub use brute::{BruteForce, brute_force, brute_force_all, brute_force_any, brute_force_in};
pub use counts::{Counts, Walk};
pub use double::{DoubleHit, DoubleRay, DoubleScene, DoubleSceneError};
pub use error::SceneError;
pub use kernel::Kernel;
pub use mode::Mode;
pub use prepare::{Prepared, check_binary};
pub use quantised::QuantisedScene;
pub use query::{
    Batches, CustomScene, HitQueries, LengthMismatch, MaskedScene, MeshQueries, NearestPoint,
    Primitives, nearest_on_triangle, triangle_overlaps_box,
};
pub use wide::WideScene;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
