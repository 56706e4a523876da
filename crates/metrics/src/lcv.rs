//! Leaf count variability.

use crate::preorder::{Preorder, prim_range};
use glam::DVec3;
use niwaki_core::{Aabb, Bvh, Ray, Triangle, TriangleMesh};
use rayon::prelude::*;

/// How many leaves a set of rays opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct LeafCounts {
    /// Number of rays.
    pub rays: usize,
    /// E\[N\]: mean number of leaves a ray.
    pub mean: f64,
    /// √(E\[N²\] − E\[N\]²): the leaf count variability.
    pub standard_deviation: f64,
    /// The most that one ray opened.
    pub max: u32,
}

/// Leaf count variability (Aila, Karras and Laine 2013; thesis section 3.4): the
/// standard deviation, over `rays`, of the number of leaves that a ray intersects. It tells how
/// unequal the work of rays is that run side by side in SIMD lanes. 0 without rays.
///
/// See [`leaf_counts`] for what is counted.
#[must_use]
pub fn lcv(bvh: &Bvh, mesh: &TriangleMesh, rays: &[Ray]) -> f64 {
    leaf_counts(bvh, mesh, rays).standard_deviation
}

/// Traces `rays` for their closest hits and counts the leaves each one opens.
///
/// The metric is about leaf nodes that a ray intersects as it is traced, which leaves open how
/// far a traversal looks. Here that is every leaf whose closed box the ray meets between `t_min`
/// and the closest hit found so far, in a front-to-back traversal that visits the nearer child
/// first (by entry distance, the first child among equals) and skips a node that lies behind that
/// hit when its turn comes. All slab and triangle tests are in `f64`. Rays that hit nothing by
/// definition (NaN, zero direction,
/// `t_max < t_min`) open no leaf but count as rays.
///
/// Same result for every number of threads.
#[must_use]
pub fn leaf_counts(bvh: &Bvh, mesh: &TriangleMesh, rays: &[Ray]) -> LeafCounts {
    if rays.is_empty() {
        return LeafCounts::default();
    }
    let tracer = Tracer { bvh, mesh, order: Preorder::of(bvh) };
    let (sum, squares, max) = rays
        .par_iter()
        .map_init(Vec::new, |stack, ray| tracer.leaves_opened(ray, stack))
        .map(|n| (u64::from(n), u128::from(n) * u128::from(n), n))
        .reduce(|| (0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2.max(b.2)));
    let count = rays.len() as f64;
    let mean = sum as f64 / count;
    // Integer sums: n·Σx² − (Σx)² does not cancel.
    let spread = squares * rays.len() as u128 - u128::from(sum) * u128::from(sum);
    LeafCounts { rays: rays.len(), mean, standard_deviation: (spread as f64).sqrt() / count, max }
}

struct Tracer<'a> {
    bvh: &'a Bvh,
    mesh: &'a TriangleMesh,
    order: Preorder,
}

impl Tracer<'_> {
    fn leaves_opened(&self, ray: &Ray, stack: &mut Vec<(u32, f64)>) -> u32 {
        let origin = ray.origin.as_dvec3();
        let direction = ray.direction.as_dvec3();
        let t_min = f64::from(ray.t_min);
        let mut closest = f64::from(ray.t_max);
        let sound = origin.is_finite() && direction.is_finite() && direction != DVec3::ZERO;
        if !sound || t_min.is_nan() || closest.is_nan() || t_min > closest {
            return 0;
        }
        let entry = |position: u32, closest: f64| {
            let node = self.order.nodes.get(position as usize)?;
            slab_entry(&node.bounds, origin, direction, t_min, closest)
        };
        let mut opened = 0;
        stack.clear();
        stack.extend(entry(0, closest).map(|t| (0, t)));
        while let Some((position, near)) = stack.pop() {
            if near > closest {
                continue;
            }
            let node = &self.order.nodes[position as usize];
            if self.bvh.nodes[node.index as usize].is_leaf() {
                opened += 1;
                for &id in &self.bvh.prim_ids[prim_range(self.bvh, node.index)] {
                    if (id as usize) < self.mesh.len()
                        && let Some(t) =
                            plane_hit(&self.mesh.triangle(id as usize), origin, direction)
                        && t >= t_min
                        && t < closest
                    {
                        closest = t;
                    }
                }
                continue;
            }
            // Children: the next node, and the one after its subtree.
            let mut children = [None; 2];
            let mut child = position + 1;
            for slot in &mut children {
                if child < node.end {
                    *slot = entry(child, closest).map(|t| (child, t));
                    child = self.order.nodes[child as usize].end;
                }
            }
            match children {
                [Some(a), Some(b)] if b.1 < a.1 => stack.extend([a, b]),
                [a, b] => stack.extend(b.into_iter().chain(a)),
            }
        }
        opened
    }
}

/// Where a ray enters a closed box within `[t_min, t_max]`; conservative against rounding.
fn slab_entry(b: &Aabb, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> Option<f64> {
    let (low, high) = (b.min.as_dvec3(), b.max.as_dvec3());
    let (mut near, mut far) = (t_min, t_max);
    for axis in 0..3 {
        let (o, d) = (origin[axis], direction[axis]);
        if d == 0.0 {
            if !(low[axis] <= o && o <= high[axis]) {
                return None;
            }
            continue;
        }
        let (t0, t1) = ((low[axis] - o) / d, (high[axis] - o) / d);
        let margin = 4.0 * f64::EPSILON;
        near = near.max(t0.min(t1) - t0.min(t1).abs() * margin);
        far = far.min(t0.max(t1) + t0.max(t1).abs() * margin);
    }
    (near <= far).then_some(near)
}

/// Distance to a triangle (Möller and Trumbore 1997, in `f64`).
fn plane_hit(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
    let [a, b, c] = triangle.vertices().map(|v| v.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = direction.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q) / determinant)
}
