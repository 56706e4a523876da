//! obvhs: PLOC trees with reinsertion, and the compressed 8-wide layout.

use crate::{
    PeerBuild, PeerError,
    error::panic_message,
    flatten::{Read, flatten},
    ray::is_traceable,
};
use niwaki_core::{Aabb, Bvh, Hit, Intersector, Ray, TriangleMesh, glam::Vec3};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::RayHit,
    rt_triangle::RtTriangle,
    triangle::Triangle,
};
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
    /// time of `build_bvh2_from_tris`; triangles in obvhs's layout are made before it starts. With
    /// debug assertions it includes obvhs's own validation.
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

/// Which of obvhs's layouts and traversals answers rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ObvhsKernel {
    /// Binary tree.
    Bvh2,
    /// Compressed 8-wide tree, four boxes at a time with SSE: obvhs's fastest.
    #[default]
    CwBvh,
}

impl ObvhsKernel {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Bvh2, Self::CwBvh];

    /// The name in tables and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bvh2 => "bvh2",
            Self::CwBvh => "cwbvh",
        }
    }
}

enum Tree {
    Empty,
    Bvh2(Bvh2),
    CwBvh(CwBvh),
}

/// obvhs's own tree and kernel, with its precomputed triangles in the order of the tree's leaves:
/// the way that its examples trace fastest.
///
/// What differs from this workspace's kernels: obvhs replaces direction components below 1.2e-7 by
/// that in box tests, so unnormalised short directions are not supported by it; its triangle test
/// is not watertight; and its 8-wide traversal ignores levels past the 32nd. Rays that hit nothing
/// by definition are answered here, since obvhs asserts that rays are finite.
pub struct ObvhsScene {
    tree: Tree,
    triangles: Vec<RtTriangle>,
    ids: Vec<u32>,
    build_time: Duration,
}

impl std::fmt::Debug for ObvhsScene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ObvhsScene")
            .field("references", &self.ids.len())
            .field("build_time", &self.build_time)
            .finish_non_exhaustive()
    }
}

impl ObvhsScene {
    /// Builds on the current rayon pool.
    ///
    /// # Errors
    /// [`PeerError::Panicked`] if obvhs does not accept the mesh.
    pub fn new(
        mesh: &TriangleMesh,
        preset: ObvhsPreset,
        kernel: ObvhsKernel,
    ) -> Result<Self, PeerError> {
        if mesh.is_empty() {
            return Ok(Self {
                tree: Tree::Empty,
                triangles: Vec::new(),
                ids: Vec::new(),
                build_time: Duration::ZERO,
            });
        }
        let source = triangles(mesh);
        let params = preset.params();
        let mut unused = Duration::default();
        let start = Instant::now();
        let tree = guarded(|| match kernel {
            ObvhsKernel::Bvh2 => Tree::Bvh2(build_bvh2_from_tris(&source, params, &mut unused)),
            ObvhsKernel::CwBvh => Tree::CwBvh(build_cwbvh_from_tris(&source, params, &mut unused)),
        })?;
        let ids = match &tree {
            Tree::Bvh2(tree) => tree.primitive_indices.clone(),
            Tree::CwBvh(tree) => tree.primitive_indices.clone(),
            Tree::Empty => Vec::new(),
        };
        let triangles = ids.par_iter().map(|&id| RtTriangle::from(&source[id as usize])).collect();
        Ok(Self { tree, triangles, ids, build_time: start.elapsed() })
    }

    /// How long obvhs took from its triangles to a traversable tree, putting the triangles in leaf
    /// order included. With debug assertions it includes obvhs's own validation.
    #[must_use]
    pub const fn build_time(&self) -> Duration {
        self.build_time
    }

    /// Bytes of nodes, precomputed triangles and ids.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let nodes = match &self.tree {
            Tree::Empty => 0,
            Tree::Bvh2(tree) => size_of_val(tree.nodes.as_slice()),
            Tree::CwBvh(tree) => size_of_val(tree.nodes.as_slice()),
        };
        nodes + size_of_val(self.triangles.as_slice()) + size_of_val(self.ids.as_slice())
    }
}

impl Intersector for ObvhsScene {
    #[inline]
    fn closest_hit(&self, ray: &Ray) -> Hit {
        if !is_traceable(ray) {
            return Hit::MISS;
        }
        let query = obvhs_ray(ray);
        let mut hit = RayHit::none();
        let test = |ray: &obvhs::ray::Ray, i: usize| self.triangles[i].intersect(ray);
        let found = match &self.tree {
            Tree::Empty => false,
            Tree::Bvh2(tree) => tree.ray_traverse(query, &mut hit, test),
            Tree::CwBvh(tree) => tree.ray_traverse(query, &mut hit, test),
        };
        if !found {
            return Hit::MISS;
        }
        let i = hit.primitive_id as usize;
        let weights = self.triangles[i].compute_barycentric(&query);
        Hit { t: hit.t, u: weights.x, v: weights.y, prim_id: self.ids[i] }
    }

    #[inline]
    fn any_hit(&self, ray: &Ray) -> bool {
        if !is_traceable(ray) {
            return false;
        }
        let query = obvhs_ray(ray);
        let test = |ray: &obvhs::ray::Ray, i: usize| self.triangles[i].intersect(ray);
        match &self.tree {
            Tree::Empty => false,
            Tree::Bvh2(tree) => !tree.ray_traverse_miss(query, test),
            Tree::CwBvh(tree) => !tree.ray_traverse_miss(query, test),
        }
    }
}

/// obvhs accepts `t` strictly below the end of the range; the next number makes that "up to".
#[inline]
fn obvhs_ray(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(
        ray.origin.to_array().into(),
        ray.direction.to_array().into(),
        ray.t_min,
        ray.t_max.next_up(),
    )
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
