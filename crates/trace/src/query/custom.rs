//! Trees over primitives that are not triangles.

use super::{
    hits::{HitQueries, Traverse},
    visitor::{Closest, First, Visitor},
};
use crate::{
    SceneError,
    binary::{Leaves, check_tree, trace},
    scale::SceneScale,
    setup::RaySetup,
};
use niwaki_core::{Bvh, BvhNode, Hit, Intersector, Ray};
use rayon::prelude::*;

/// Primitives of the caller's, named by the ids in the leaves of a tree. Any
/// `Fn(u32, &Ray) -> Option<Hit>` is such a thing.
pub trait Primitives: Sync {
    /// The closest hit of one primitive with `ray.t_min ≤ t ≤ ray.t_max`.
    ///
    /// `ray` is the ray that was asked about with its `t_max` drawn in to what is still of
    /// interest. Hits outside its range and of NaN are ignored; `prim_id` is replaced by the
    /// primitive's; `u` and `v` come back as they are and may mean anything.
    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<Hit>;
}

impl<F: Fn(u32, &Ray) -> Option<Hit> + Sync> Primitives for F {
    #[inline]
    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<Hit> {
        self(prim_id, ray)
    }
}

/// A binary tree over the caller's own primitives: spheres, curves, instances of other scenes.
///
/// The tree comes from any builder, by boxes ([`niwaki_core::Builder::build`]). A primitive is
/// asked about where a ray meets the box of its leaf, so boxes must enclose all that
/// [`Primitives::intersect`] can report. It reports one hit: where [`HitQueries`] filters that
/// one away, what the ray hits of the same primitive farther on is not found, and lists hold one
/// hit for each primitive.
///
/// ```
/// use niwaki_core::{Aabb, Bvh, BvhNode, Hit, Intersector, Ray, glam::Vec3};
/// use niwaki_trace::CustomScene;
///
/// // One sphere of radius 1 around the origin; `examples/spheres.rs` has many.
/// let bvh = Bvh {
///     nodes: vec![BvhNode::leaf(Aabb::new(-Vec3::ONE, Vec3::ONE), 0, 1)],
///     prim_ids: vec![0],
/// };
/// let scene = CustomScene::new(&bvh, |_id: u32, ray: &Ray| {
///     let (a, b) = (ray.direction.length_squared(), ray.origin.dot(ray.direction));
///     let root = (b * b - a * (ray.origin.length_squared() - 1.0)).sqrt();
///     let t = (-b - root) / a;
///     (t >= ray.t_min && t <= ray.t_max).then_some(Hit { t, ..Hit::MISS })
/// })?;
/// let hit = scene.closest_hit(&Ray::new(Vec3::new(0.0, 0.0, -3.0), Vec3::Z));
/// assert_eq!((hit.prim_id, hit.t), (0, 2.0));
/// # Ok::<(), niwaki_trace::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CustomScene<P> {
    nodes: Vec<BvhNode>,
    prim_ids: Vec<u32>,
    scale: SceneScale,
    primitives: P,
}

impl<P: Primitives> CustomScene<P> {
    /// Keeps a copy of the tree.
    ///
    /// # Errors
    /// [`SceneError::Collapse`] if it is not a tree.
    pub fn new(bvh: &Bvh, primitives: P) -> Result<Self, SceneError> {
        check_tree(bvh)?;
        let scale = SceneScale::of(&bvh.bounds());
        let nodes = bvh.nodes.par_iter().with_min_len(4096).map(|node| {
            let bounds = scale.aabb(node.aabb());
            BvhNode { min: bounds.min, max: bounds.max, ..*node }
        });
        Ok(Self { nodes: nodes.collect(), prim_ids: bvh.prim_ids.clone(), scale, primitives })
    }

    /// The primitives.
    #[must_use]
    pub const fn primitives(&self) -> &P {
        &self.primitives
    }

    fn trace<const ANY: bool, V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<(RaySetup, V::Answer)> {
        let setup = RaySetup::new(ray, self.scale)?;
        let leaves = Asked { scene: self, ray };
        let answer = trace::<ANY, _, _, _>(&self.nodes, &leaves, &setup, visitor(setup), &mut ());
        Some((setup, answer))
    }
}

/// The primitives as one ray meets them.
struct Asked<'a, P> {
    scene: &'a CustomScene<P>,
    ray: &'a Ray,
}

impl<P: Primitives> Leaves for Asked<'_, P> {
    #[inline]
    fn intersect(&self, reference: usize, setup: &RaySetup, limit: f32) -> Hit {
        let prim_id = self.scene.prim_ids[reference];
        let t_max = setup.unscaled(limit).min(self.ray.t_max);
        let ray = self.ray.with_range(self.ray.t_min.max(0.0), t_max);
        match self.scene.primitives.intersect(prim_id, &ray) {
            Some(hit) if hit.t >= ray.t_min && hit.t <= ray.t_max => {
                // Rounding of tiny distances must not lead past the limit.
                Hit { t: setup.scaled(hit.t).min(limit), prim_id, ..hit }
            }
            _ => Hit::MISS,
        }
    }
}

impl<P: Primitives> Intersector for CustomScene<P> {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        self.trace::<false, _>(ray, |setup| Closest::new(setup.t_max))
            .map_or(Hit::MISS, |(setup, closest)| setup.finish(closest))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.trace::<true, _>(ray, |_| First::default()).is_some_and(|(_, is_hit)| is_hit)
    }
}

impl<P: Primitives> Traverse for CustomScene<P> {
    fn visit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer> {
        self.trace::<false, V>(ray, visitor).map(|(_, answer)| answer)
    }

    fn visit_until_limit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer> {
        self.trace::<true, V>(ray, visitor).map(|(_, answer)| answer)
    }
}

impl<P: Primitives> HitQueries for CustomScene<P> {}
