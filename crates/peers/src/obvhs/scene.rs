//! obvhs's own trees and kernels.

use super::{ObvhsPreset, guarded, triangles};
use crate::{PeerError, ray::is_traceable};
use ::obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh},
    ray::RayHit,
    rt_triangle::RtTriangle,
};
use niwaki_core::{Hit, Intersector, Ray, TriangleMesh};
use rayon::prelude::*;
use std::time::{Duration, Instant};

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
/// that in box tests, so short directions have to be normalised for it; and its triangle test is
/// not watertight. Rays that hit nothing by definition are answered here, since obvhs asserts that
/// rays are finite.
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
    /// [`PeerError::TooDeep`] if the 8-wide tree has more levels than obvhs can traverse, as it has
    /// for some dozens of equal triangles; [`PeerError::Panicked`] if obvhs does not accept the
    /// mesh.
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
        let start = Instant::now();
        let tree = guarded(|| match kernel {
            ObvhsKernel::Bvh2 => {
                let mut tree = build_bvh2_from_tris(&source, params, &mut Duration::default());
                // obvhs sizes the traversal stack by the depth before reinsertion.
                tree.max_depth = tree.max_depth.max(depth_of_bvh2(&tree) + 1);
                Ok(Tree::Bvh2(tree))
            }
            ObvhsKernel::CwBvh => build_cwbvh(&source, params).map(Tree::CwBvh),
        })??;
        let ids = match &tree {
            Tree::Bvh2(tree) => tree.primitive_indices.clone(),
            Tree::CwBvh(tree) => tree.primitive_indices.clone(),
            Tree::Empty => Vec::new(),
        };
        let triangles = ids.par_iter().map(|&id| RtTriangle::from(&source[id as usize])).collect();
        Ok(Self { tree, triangles, ids, build_time: start.elapsed() })
    }

    /// How long obvhs took from its triangles to a traversable tree, putting the triangles in leaf
    /// order included.
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

/// Levels of an 8-wide tree that obvhs's traversal has a stack for (its `TRAVERSAL_STACK_SIZE`,
/// which its own validation asserts).
const MAX_CWBVH_DEPTH: usize = 32;

/// What `build_cwbvh_from_tris` does, in the two steps that it consists of: a binary tree without
/// the passes meant for binary trees only (collapsing leaves, reinsertion after that), then
/// conversion. Conversion recurses once a level, so the depth has to be looked at in between.
fn build_cwbvh(
    source: &[::obvhs::triangle::Triangle],
    params: BvhBuildParams,
) -> Result<CwBvh, PeerError> {
    let binary_params = BvhBuildParams {
        max_prims_per_leaf: 1,
        post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
        ..params
    };
    let binary = build_bvh2_from_tris(source, binary_params, &mut Duration::default());
    // An 8-wide node takes in at most 7 levels of a binary tree, and a leaf of 3 triangles 2.
    let least = depth_of_bvh2(&binary).saturating_sub(2) / 7;
    if least >= MAX_CWBVH_DEPTH {
        return Err(PeerError::TooDeep { depth: least, max: MAX_CWBVH_DEPTH - 1 });
    }
    let tree = bvh2_to_cwbvh(&binary, params.max_prims_per_leaf.clamp(1, 3), true, false);
    let depth = depth_of_cwbvh(&tree);
    if depth >= MAX_CWBVH_DEPTH {
        return Err(PeerError::TooDeep { depth, max: MAX_CWBVH_DEPTH - 1 });
    }
    Ok(tree)
}

/// Levels below the root.
fn depth_of_bvh2(tree: &Bvh2) -> usize {
    depth(|i, children| {
        if let Some(node) = tree.nodes.get(i as usize).filter(|node| !node.is_leaf()) {
            children.extend([node.first_index, node.first_index + 1]);
        }
    })
}

/// Levels of nodes below the root.
fn depth_of_cwbvh(tree: &CwBvh) -> usize {
    depth(|i, children| {
        if let Some(node) = tree.nodes.get(i as usize) {
            // The children that are nodes stand together.
            children.extend((0..node.imask.count_ones()).map(|k| node.child_base_idx + k));
        }
    })
}

/// The depth of a tree with root 0, with a stack of its own.
fn depth(children_of: impl Fn(u32, &mut Vec<u32>)) -> usize {
    let mut deepest = 0;
    let mut stack = vec![(0, 0)];
    let mut children = Vec::new();
    while let Some((node, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        children_of(node, &mut children);
        stack.extend(children.drain(..).map(|child| (child, depth + 1)));
    }
    deepest
}
