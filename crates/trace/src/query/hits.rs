//! Filters, and all hits of a ray.

use super::visitor::{ClosestAccepted, Collect, FirstAccepted, Visitor};
use crate::setup::RaySetup;
use niwaki_core::{Hit, Intersector, Ray};

/// Shows the hits of a ray to a visitor.
pub trait Traverse {
    /// All that the visitor's limits let through, nearest boxes first. `None` where nothing can be
    /// hit by definition, for then there is no visitor.
    fn visit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer>;

    /// Until the visitor sets a limit, in any order.
    fn visit_until_limit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer>;
}

/// What can be asked about a ray beyond [`Intersector`]: filters, and more than one hit.
///
/// Answered by [`crate::AutoScene`], [`crate::WideScene`] and [`crate::QuantisedScene`] of each width with all their
/// kernels, [`crate::BinaryScene`] and [`crate::CustomScene`], with the arithmetic of the plain
/// queries; these pay nothing for it. The trait cannot be implemented outside this crate.
///
/// ```
/// use niwaki_core::{Bvh, BvhNode, Ray, Triangle, TriangleMesh, glam::Vec3};
/// use niwaki_trace::{HitQueries, WideScene};
///
/// // Two triangles, the second two units behind the first.
/// let at = |z: f32| Triangle::new(Vec3::Z * z, Vec3::X + Vec3::Z * z, Vec3::Y + Vec3::Z * z);
/// let mesh = TriangleMesh::from_triangles(&[at(1.0), at(3.0)])?;
/// let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 2)], prim_ids: vec![0, 1] };
/// let scene = WideScene::new(&bvh, &mesh)?;
/// let ray = Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z);
///
/// // A filter makes holes: here all of the first triangle.
/// let hit = scene.closest_hit_filtered(&ray, |prim_id, _t, _u, _v| prim_id != 0);
/// assert_eq!((hit.prim_id, hit.t), (1, 3.0));
///
/// let mut hits = Vec::new();
/// scene.all_hits(&ray, &mut hits);
/// assert_eq!(hits.iter().map(|hit| hit.t).collect::<Vec<_>>(), [1.0, 3.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait HitQueries: Intersector + Traverse {
    /// The closest hit that `filter(prim_id, t, u, v)` accepts, or [`Hit::MISS`]; among accepted
    /// hits at equal `t` that of the smallest `prim_id`.
    ///
    /// The filter sees candidates in no particular order, not all that are farther than one that
    /// it accepted, and may see one more than once where a tree refers to a triangle more than
    /// once. `t`, `u` and `v` are as in [`Hit`].
    #[must_use]
    fn closest_hit_filtered(
        &self,
        ray: &Ray,
        filter: impl FnMut(u32, f32, f32, f32) -> bool,
    ) -> Hit {
        self.visit(ray, |setup| ClosestAccepted::new(setup, filter)).unwrap_or(Hit::MISS)
    }

    /// True if `filter(prim_id, t, u, v)` accepts any hit in the ray's range; it sees them in no
    /// particular order until it accepts one.
    #[must_use]
    fn any_hit_filtered(&self, ray: &Ray, filter: impl FnMut(u32, f32, f32, f32) -> bool) -> bool {
        self.visit_until_limit(ray, |setup| FirstAccepted::new(setup, filter)).unwrap_or(false)
    }

    /// Replaces `hits` by all hits in the ray's range, sorted by `t`, then by `prim_id`; a
    /// primitive comes once, however often the tree refers to it.
    ///
    /// Takes memory for every hit, and for those of split triangles once a reference meanwhile.
    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        self.nearest_hits(ray, usize::MAX, hits);
    }

    /// The first `most` of [`HitQueries::all_hits`], found without a look at what lies farther
    /// (multi-hit traversal; Gribble, Naveros and Kerzner 2014).
    ///
    /// Takes memory for about `most` hits and an eighth more.
    fn nearest_hits(&self, ray: &Ray, most: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        if most == 0 {
            return;
        }
        // Without an answer there is nothing to hit, and the list stays empty.
        let _ = self.visit(ray, |setup| Collect::new(setup, hits, most));
    }

    /// How many primitives the ray meets in its range, but at most `most`.
    #[must_use]
    fn count_hits(&self, ray: &Ray, most: usize) -> usize {
        let mut hits = Vec::new();
        self.nearest_hits(ray, most, &mut hits);
        hits.len()
    }
}
