//! Point and box queries.

use super::{
    nearest::{NearestPoint, nearest_on_triangle},
    overlap::triangle_overlaps_box,
};
use crate::{
    SceneError,
    binary::{check_ids, check_tree},
};
use niwaki_core::{
    Aabb, Bvh, BvhNode, TriangleMesh,
    glam::{DVec3, Vec3},
};
use std::cmp::Ordering;

/// Queries about points and boxes, over a binary tree and its mesh as they are, without copies.
///
/// All are deterministic, hold with trees of any depth and with split triangles (each is reported
/// once), and allocate their result and a stack. Points and boxes of NaN find nothing.
///
/// ```
/// use niwaki_core::{Aabb, Bvh, BvhNode, TriangleMesh, glam::Vec3};
/// use niwaki_trace::MeshQueries;
///
/// let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
/// let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
/// let queries = MeshQueries::new(&bvh, &mesh)?;
///
/// let nearest = queries.nearest(Vec3::new(0.25, 0.25, 2.0), f64::INFINITY).expect("a triangle");
/// assert_eq!((nearest.prim_id, nearest.distance), (0, 2.0));
/// assert_eq!(nearest.point, Vec3::new(0.25, 0.25, 0.0));
///
/// // The box meets the triangle's box, but not the triangle.
/// let corner = Aabb::new(Vec3::new(0.8, 0.8, -1.0), Vec3::ONE);
/// let (mut boxes, mut prims) = (Vec::new(), Vec::new());
/// queries.box_candidates(&corner, &mut boxes);
/// queries.overlapping(&corner, &mut prims);
/// assert_eq!((boxes.len(), prims.len()), (1, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct MeshQueries<'a> {
    bvh: &'a Bvh,
    mesh: &'a TriangleMesh,
}

impl<'a> MeshQueries<'a> {
    /// Checks the tree, in one pass.
    ///
    /// # Errors
    /// [`SceneError::NoSuchTriangle`] if the tree is not of this mesh, or
    /// [`SceneError::Collapse`] if it is not a tree.
    pub fn new(bvh: &'a Bvh, mesh: &'a TriangleMesh) -> Result<Self, SceneError> {
        check_tree(bvh)?;
        check_ids(&bvh.prim_ids, mesh)?;
        Ok(Self { bvh, mesh })
    }

    /// The point of the mesh that is nearest to `from` and at most `max_distance` away; among
    /// triangles that are equally near that of the smallest id. See [`nearest_on_triangle`] for
    /// the arithmetic.
    #[must_use]
    pub fn nearest(&self, from: Vec3, max_distance: f64) -> Option<NearestPoint> {
        let mut best: Option<NearestPoint> = None;
        self.approach(from, max_distance, |found| {
            if best.is_none_or(|best| in_order(&found, &best).is_lt()) {
                best = Some(found);
            }
            best.map_or(max_distance, |best| best.distance)
        });
        best
    }

    /// Replaces `nearest` by the nearest point of each of the `most` nearest triangles that are at
    /// most `max_distance` away, sorted by distance, then by id.
    pub fn nearest_prims(
        &self,
        from: Vec3,
        most: usize,
        max_distance: f64,
        nearest: &mut Vec<NearestPoint>,
    ) {
        nearest.clear();
        if most == 0 {
            return;
        }
        // As in `Collect`: in order again whenever an eighth more has come.
        let room = most.saturating_add(most / 8 + 1);
        let mut limit = max_distance;
        self.approach(from, max_distance, |found| {
            nearest.push(found);
            if nearest.len() >= room {
                put_in_order(nearest, most);
                if nearest.len() == most
                    && let Some(last) = nearest.last()
                {
                    limit = last.distance;
                }
            }
            limit
        });
        put_in_order(nearest, most);
    }

    /// Replaces `nearest` by the nearest point of each triangle that is at most `radius` away,
    /// sorted by distance, then by id.
    pub fn within(&self, from: Vec3, radius: f64, nearest: &mut Vec<NearestPoint>) {
        self.nearest_prims(from, usize::MAX, radius, nearest);
    }

    /// Replaces `prim_ids` by the triangles that have a point in common with a box, in ascending
    /// order; [`triangle_overlaps_box`] says how exact this is (it never leaves one out).
    pub fn overlapping(&self, bounds: &Aabb, prim_ids: &mut Vec<u32>) {
        self.collect(bounds, prim_ids, |id| {
            triangle_overlaps_box(&self.mesh.triangle(id as usize), bounds)
        });
    }

    /// Replaces `prim_ids` by the triangles whose own boxes have a point in common with a box, in
    /// ascending order: the candidates of a broad phase, at no arithmetic.
    ///
    /// Of a split triangle, only those parts of its box count that the boxes of its leaves cover.
    /// So [`MeshQueries::overlapping`] is always a part of this, and trees without split triangles
    /// give exactly the triangles whose boxes overlap.
    pub fn box_candidates(&self, bounds: &Aabb, prim_ids: &mut Vec<u32>) {
        self.collect(bounds, prim_ids, |id| {
            touch(&self.mesh.triangle(id as usize).bounds(), bounds)
        });
    }

    /// The ids in leaves whose boxes meet `bounds`, where `keep` says so.
    fn collect(&self, bounds: &Aabb, prim_ids: &mut Vec<u32>, keep: impl Fn(u32) -> bool) {
        prim_ids.clear();
        if self.bvh.nodes.is_empty() || bounds.is_empty() {
            return;
        }
        let mut stack = vec![0];
        while let Some(index) = stack.pop() {
            let node: &BvhNode = &self.bvh.nodes[index];
            if !touch(&node.aabb(), bounds) {
                continue;
            }
            if node.is_leaf() {
                prim_ids.extend(self.bvh.leaf_prims(node).iter().filter(|&&id| keep(id)));
            } else {
                let [a, b] = node.children();
                stack.extend([b, a]);
            }
        }
        prim_ids.sort_unstable();
        prim_ids.dedup();
    }

    /// Shows the nearest points of triangles, those in near boxes first. `visit` returns the
    /// largest distance that is still of interest.
    fn approach(&self, from: Vec3, max_distance: f64, mut visit: impl FnMut(NearestPoint) -> f64) {
        let Some(root) = self.bvh.nodes.first() else { return };
        if !from.is_finite() || max_distance.is_nan() {
            return;
        }
        // What rounding can make of a distance, computed from differences of coordinates of this
        // size: a box must not seem farther than a point in it.
        let reach = root.min.abs().max(root.max.abs()).max_element();
        let slack = 64.0 * f64::EPSILON * (f64::from(reach) + f64::from(from.abs().max_element()));
        let origin = from.as_dvec3();
        let mut limit = max_distance;
        let mut stack = vec![(0, distance_to_box(origin, root))];
        while let Some((index, distance)) = stack.pop() {
            if distance > limit + slack {
                continue;
            }
            let node = &self.bvh.nodes[index];
            if node.is_leaf() {
                for &id in self.bvh.leaf_prims(node) {
                    let found = nearest_on_triangle(&self.mesh.triangle(id as usize), from, id);
                    if found.distance <= limit {
                        limit = visit(found);
                    }
                }
                continue;
            }
            let [a, b] = node.children();
            let a = (a, distance_to_box(origin, &self.bvh.nodes[a]));
            let b = (b, distance_to_box(origin, &self.bvh.nodes[b]));
            let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
            stack.extend([far, near]);
        }
    }
}

/// Nearer first, then the smaller id.
fn in_order(a: &NearestPoint, b: &NearestPoint) -> Ordering {
    a.distance.total_cmp(&b.distance).then(a.prim_id.cmp(&b.prim_id))
}

/// Sorts, drops what came twice, and keeps the first `most`.
fn put_in_order(nearest: &mut Vec<NearestPoint>, most: usize) {
    nearest.sort_by(in_order);
    nearest.dedup_by_key(|found| found.prim_id);
    nearest.truncate(most);
}

/// True if two boxes have a point in common, borders included; false for NaN.
fn touch(a: &Aabb, b: &Aabb) -> bool {
    a.min.cmple(b.max).all() && a.max.cmpge(b.min).all()
}

/// From a point to the nearest of a box.
fn distance_to_box(point: DVec3, node: &BvhNode) -> f64 {
    let below = node.min.as_dvec3() - point;
    let above = point - node.max.as_dvec3();
    below.max(above).max(DVec3::ZERO).length()
}
