//! Other BVH libraries behind Niwaki's traits: Embree, found at run time, and obvhs.
//!
//! ```
//! use niwaki_core::{Intersector, Ray, TriangleMesh, glam::Vec3};
//! use niwaki_peers::{ObvhsKernel, ObvhsPreset, ObvhsScene};
//!
//! let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
//! let scene = ObvhsScene::new(&mesh, ObvhsPreset::Medium, ObvhsKernel::CwBvh)?;
//! let hit = scene.closest_hit(&Ray::new(Vec3::new(0.2, 0.3, -2.0), Vec3::Z));
//! assert_eq!((hit.prim_id, hit.t), (0, 2.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Each peer takes part in two ways. Its *trees*, converted to [`Bvh`], go through our kernels, so
//! that only tree quality is compared: [`Embree::build_bvh`] and [`ObvhsPreset::build`] return a
//! [`PeerBuild`]. Its *own* trees and kernels answer rays as a user of it would get them:
//! [`EmbreeScene`] and [`ObvhsScene`] are [`Intersector`]s.
//!
//! Embree is not linked: [`Embree::load`] opens the library that `EMBREE_LIBRARY` names, or the
//! system's, version 4 or 3. Without one everything else works.
//!
//! There are no feature flags.
//!
//! [`Bvh`]: niwaki_core::Bvh
//! [`Intersector`]: niwaki_core::Intersector

pub mod embree;
mod error;
mod flatten;
pub mod obvhs;
mod ray;

pub use self::obvhs::{ObvhsKernel, ObvhsPreset, ObvhsScene};
pub use embree::{
    Embree, EmbreeBvhSettings, EmbreeScene, EmbreeSettings, EmbreeVersion, LIBRARY_NAMES, Quality,
};
pub use error::PeerError;

use niwaki_core::Bvh;
use std::time::{Duration, Instant};

/// The examples of the README run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// A peer's tree in our layout.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerBuild {
    /// The tree, as the peer built it: same boxes, same leaves.
    pub bvh: Bvh,
    /// What the peer needed, from a mesh (or the peer's own triangles, see the function that
    /// built) to its own tree.
    pub build: Duration,
    /// What conversion to [`PeerBuild::bvh`] took on top.
    pub conversion: Duration,
}

impl PeerBuild {
    /// A build that ends now, and a conversion that still has to run.
    fn timed(start: Instant, convert: impl FnOnce() -> Bvh) -> Self {
        let build = start.elapsed();
        let start = Instant::now();
        let bvh = convert();
        Self { bvh, build, conversion: start.elapsed() }
    }
}
