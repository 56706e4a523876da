//! Geometry and rays on which floating-point BVH builders and ray kernels go wrong.
//!
//! Builders, kernels and peers are all run against the same catalogue: by their own tests, by
//! `cargo xtask verify`, and by `cargo xtask stability`, which counts what each gets wrong.
//!
//! ```
//! for case in niwaki_hard_cases::meshes() {
//!     let rays = niwaki_hard_cases::rays(&case.mesh, 16, 1);
//!     println!("{}: {} triangles, {} rays", case.name, case.mesh.len(), rays.len());
//! }
//! ```
//!
//! [`closed`] has surfaces with rays from inside that must all hit:
//!
//! ```
//! let closed = niwaki_hard_cases::closed();
//! let rays = closed[0].rays_from_inside(100, 1); // aimed at corners and edges
//! assert_eq!(rays.len(), 100);
//! ```
//!
//! Beside the catalogue stand ordinary geometry ([`soup`], [`sheet`]) and a tree over it
//! ([`median_tree`]), so that benchmarks, examples and tests need not each make their own, and an
//! allocator that counts ([`counting`]), for tests of memory bounds, and small scene files ([`files`]).
//!
//! Sources: the issue trackers of tinybvh (#138, #156, #164, #168, #282, #283), Embree (#174,
//! #181, #387), svenstaro/bvh (#44) and parry (#444), Embree's and pbrt-v4's regression tests, and
//! the arithmetic of Ize 2013 and of Woop, Benthin and Wald 2013.

mod closed;
pub mod counting;
pub mod files;
mod meshes;
mod plain;
mod rays;

pub use closed::{Closed, border_point, closed, grid_box, seamed_octahedron};
pub use meshes::{Case, bad_prim_refs, closed_star, deep_chain, meshes, soup};
pub use plain::{median_tree, sheet, soup_mesh};
pub use rays::{aimed_at_borders, bad_rays, rays};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
