//! Rays, hits, and the interface between renderers and whatever answers rays.

use glam::Vec3;

/// A ray: the points `origin + t·direction` with `t_min ≤ t ≤ t_max`.
///
/// 32 bytes, laid out as four `f32`s twice. `direction` need not be normalised; `t` counts in its
/// length. A ray with a NaN component, with a zero direction or with `t_max < t_min` hits
/// nothing.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Start point (at t = 0).
    pub origin: Vec3,
    /// Smallest accepted distance; at least 0. Our kernels and the exact oracle take a negative
    /// one as 0, so that nothing behind the origin is hit.
    pub t_min: f32,
    /// Direction.
    pub direction: Vec3,
    /// Largest accepted distance; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// An unbounded ray: `t` from 0 to ∞.
    #[must_use]
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// The same ray with other limits on `t`.
    #[must_use]
    pub const fn with_range(self, t_min: f32, t_max: f32) -> Self {
        Self { t_min, t_max, ..self }
    }

    /// The point at distance `t`.
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// What a ray hit: 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Distance in lengths of the ray's direction; ∞ for a miss.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32,
    /// The primitive; [`Hit::NO_PRIM`] for a miss.
    pub prim_id: u32,
}

impl Hit {
    /// The `prim_id` of a miss.
    pub const NO_PRIM: u32 = u32::MAX;

    /// No hit.
    pub const MISS: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, prim_id: Self::NO_PRIM };

    /// True unless this is a miss.
    #[must_use]
    #[inline]
    pub const fn is_hit(&self) -> bool {
        self.prim_id != Self::NO_PRIM
    }
}

/// Anything that answers rays against a set of triangles: our kernels, a peer, brute force.
pub trait Intersector: Sync {
    /// The hit with the smallest `t` in the ray's range, or [`Hit::MISS`]. Among hits at equal
    /// `t` any may be returned.
    fn closest_hit(&self, ray: &Ray) -> Hit;

    /// True if anything lies in the ray's range.
    fn any_hit(&self, ray: &Ray) -> bool;

    /// [`Intersector::closest_hit`] for each ray.
    ///
    /// # Panics
    /// If `hits` is not as long as `rays`; `niwaki_trace::Batches` returns an error instead.
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit slot per ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest_hit(ray);
        }
    }

    /// [`Intersector::any_hit`] for each ray.
    ///
    /// # Panics
    /// If `occluded` is not as long as `rays`; `niwaki_trace::Batches` returns an error instead.
    fn any_hits(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one flag per ray");
        for (ray, flag) in rays.iter().zip(occluded) {
            *flag = self.any_hit(ray);
        }
    }
}

const _: () = assert!(size_of::<Ray>() == 32 && size_of::<Hit>() == 16);
