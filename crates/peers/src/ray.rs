//! Rays that peers cannot be asked about.

use niwaki_core::{Ray, glam::Vec3};

/// False for rays that hit nothing by definition ([`Ray`]): with a NaN, without a direction, or
/// with an empty range. Infinite origins and directions are among them, since both peers leave
/// them undefined.
#[inline]
pub(crate) fn is_traceable(ray: &Ray) -> bool {
    ray.t_min <= ray.t_max
        && ray.origin.is_finite()
        && ray.direction.is_finite()
        && ray.direction != Vec3::ZERO
}
