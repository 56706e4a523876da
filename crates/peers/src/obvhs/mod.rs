//! obvhs: PLOC trees with reinsertion, and the compressed 8-wide layout.
//!
//! [`ObvhsScene`] answers rays with obvhs's own trees and kernels, and [`ObvhsPreset::build`]
//! brings its binary trees into [`Bvh`]s for any other kernel.

mod scene;

pub use scene::{ObvhsKernel, ObvhsScene};

use crate::{
    PeerBuild, PeerError,
    error::panic_message,
    flatten::{Read, flatten},
};
use ::obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    triangle::Triangle,
};
use niwaki_core::{Aabb, Bvh, TriangleMesh, glam::Vec3};
use rayon::prelude::*;
use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::{Duration, Instant},
};

/// The build presets of obvhs, by its own names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ObvhsPreset {
    /// `fastest_build`: PLOC alone, one triangle a leaf.
    Fastest,
    /// `very_fast_build`: PLOC and a little reinsertion.
    VeryFast,
    /// `fast_build`.
    Fast,
    /// `medium_build`: meant to take as long as Embree.
    #[default]
    Medium,
    /// `slow_build`: triangles are split before PLOC.
    Slow,
    /// `very_slow_build`: split triangles and reinsertion of every node.
    VerySlow,
}

impl ObvhsPreset {
    /// All, from fast to good.
    pub const ALL: [Self; 6] =
        [Self::Fastest, Self::VeryFast, Self::Fast, Self::Medium, Self::Slow, Self::VerySlow];
    /// Their names, in the order of [`ObvhsPreset::ALL`].
    pub const NAMES: &[&str] = &["fastest", "very_fast", "fast", "medium", "slow", "very_slow"];

    /// The name in tables and on the command line: obvhs's, without `_build`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fastest => "fastest",
            Self::VeryFast => "very_fast",
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::Slow => "slow",
            Self::VerySlow => "very_slow",
        }
    }

    /// True for presets that split triangles, so that trees may name one more than once.
    #[must_use]
    pub const fn splits(self) -> bool {
        self.params().pre_split
    }

    const fn params(self) -> BvhBuildParams {
        match self {
            Self::Fastest => BvhBuildParams::fastest_build(),
            Self::VeryFast => BvhBuildParams::very_fast_build(),
            Self::Fast => BvhBuildParams::fast_build(),
            Self::Medium => BvhBuildParams::medium_build(),
            Self::Slow => BvhBuildParams::slow_build(),
            Self::VerySlow => BvhBuildParams::very_slow_build(),
        }
    }

    /// obvhs's binary tree over a mesh, on the current rayon pool. [`PeerBuild::build`] is the
    /// time of `build_bvh2_from_tris`; triangles in obvhs's layout are made before it starts.
    ///
    /// Many equal boxes take obvhs quadratic time, as each pass of PLOC then joins few pairs:
    /// 100,000 equal triangles did not finish within a minute.
    ///
    /// # Errors
    /// [`PeerError::Panicked`] if obvhs does not accept the mesh.
    pub fn build(self, mesh: &TriangleMesh) -> Result<PeerBuild, PeerError> {
        if mesh.is_empty() {
            return Ok(PeerBuild::timed(Instant::now(), Bvh::default));
        }
        let triangles = triangles(mesh);
        let start = Instant::now();
        let tree =
            guarded(|| build_bvh2_from_tris(&triangles, self.params(), &mut Duration::default()))?;
        let build = start.elapsed();
        let start = Instant::now();
        let bvh = convert(&tree).ok_or_else(|| PeerError::Panicked {
            peer: "obvhs",
            message: "its tree has an index out of range".to_owned(),
        })?;
        Ok(PeerBuild { bvh, build, conversion: start.elapsed() })
    }
}

impl std::str::FromStr for ObvhsPreset {
    type Err = PeerError;

    fn from_str(name: &str) -> Result<Self, PeerError> {
        Self::ALL.into_iter().find(|preset| preset.name() == name).ok_or_else(|| {
            PeerError::UnknownName {
                what: "obvhs preset",
                name: name.to_owned(),
                known: Self::NAMES,
            }
        })
    }
}

/// The mesh in obvhs's layout. Through arrays: its version of glam may not be ours.
fn triangles(mesh: &TriangleMesh) -> Vec<Triangle> {
    (0..mesh.len())
        .into_par_iter()
        .map(|i| {
            let [v0, v1, v2] = mesh.triangle(i).vertices().map(|v| v.to_array());
            Triangle { v0: v0.into(), v1: v1.into(), v2: v2.into() }
        })
        .collect()
}

/// Turns a panic of obvhs into an error.
/// Turns a panic of obvhs into an error.
fn guarded<T>(build: impl FnOnce() -> T) -> Result<T, PeerError> {
    // What a panicking build leaves behind is dropped with it.
    catch_unwind(AssertUnwindSafe(build))
        .map_err(|panic| PeerError::Panicked { peer: "obvhs", message: panic_message(&*panic) })
}

/// Reinsertion may put children before their parents, so nodes are laid out anew.
fn convert(tree: &Bvh2) -> Option<Bvh> {
    let bounds = |i: u32| {
        let aabb = tree.nodes.get(i as usize)?.aabb();
        Some(Aabb::new(
            Vec3::from_array(aabb.min.to_array()),
            Vec3::from_array(aabb.max.to_array()),
        ))
    };
    flatten(0, bounds(0)?, |i: u32, ids| {
        let Some(node) = tree.nodes.get(i as usize) else { return Read::Missing };
        let first = node.first_index;
        if node.is_leaf() {
            let range = first as usize..first as usize + node.prim_count as usize;
            let Some(leaf) = tree.primitive_indices.get(range) else { return Read::Missing };
            ids.extend_from_slice(leaf);
            return Read::Leaf;
        }
        match (bounds(first), bounds(first.saturating_add(1))) {
            (Some(left), Some(right)) => Read::Inner([(first, left), (first + 1, right)]),
            _ => Read::Missing,
        }
    })
}
