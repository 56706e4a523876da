//! What a kernel needs of a ray, computed once.

use crate::scale::SceneScale;
use niwaki_core::{
    Hit, Ray,
    float::{round_down, round_up},
    glam::Vec3A,
};

/// A ray in the scaled coordinates of a scene, and its way back.
#[derive(Clone, Copy, Debug)]
pub struct RaySetup {
    /// Vectors of four words, as kernels read them: words that were just written one by one cannot
    /// be read as one vector without a wait.
    pub(crate) origin: Vec3A,
    pub(crate) direction: Vec3A,
    /// At least +0.0, so that the bits of distances sort like integers.
    pub(crate) t_min: f32,
    /// Finite, and at least +0.0 as well.
    pub(crate) t_max: f32,
    /// What scaled distances are divided by.
    t_factor: f64,
    /// Products of its coordinates with the reciprocal direction may overflow.
    is_extreme: bool,
}

/// Coordinates up to this, times the reciprocal of the smallest component that a moderate ray can
/// have, 2⁶⁰·10⁹, stay in the range of `f32`.
pub(crate) const MODERATE: f32 = 1e10;

impl RaySetup {
    /// `None` for a ray that hits nothing: a NaN or infinite component, a zero direction, an
    /// empty range of `t`.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, scale: SceneScale) -> Option<Self> {
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        let (distance, length) = (origin.abs(), direction.abs());
        // f32::MAX as the last distance: a hit beyond could not be told from a miss.
        // Adding zero makes −0.0 +0.0.
        let t_max = if ray.t_max < f32::MAX { ray.t_max + 0.0 } else { f32::MAX };
        let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
        // Unit directions, and all others of moderate length, stay as they are. Sums keep NaN,
        // for which each comparison is false.
        let moderate = scale.is_moderate
            && distance.x + distance.y + distance.z <= MODERATE
            && length.x + length.y + length.z <= 1e9
            && length.max_element() >= 1e-9
            && ray.t_min <= ray.t_max
            && t_min <= t_max;
        // Taken apart, so that the fields can be in registers: the answer of a call is in memory.
        let (origin, direction, t_min, t_max, t_factor) = if moderate {
            (origin, direction, t_min, t_max, 1.0)
        } else {
            let s = Self::rescaled(ray, scale, t_min, t_max)?;
            (s.origin, s.direction, s.t_min, s.t_max, s.t_factor)
        };
        Some(Self { origin, direction, t_min, t_max, t_factor, is_extreme: !moderate })
    }

    /// Any other ray: brings the longest component of the direction into 1..2.
    #[cold]
    fn rescaled(ray: &Ray, scale: SceneScale, t_min: f32, t_max: f32) -> Option<Self> {
        let longest = ray.direction.abs().max_element();
        let origin = Vec3A::from(ray.origin) * scale.factor;
        let usable = origin.is_finite()
            && ray.direction.is_finite()
            && longest > 0.0
            && ray.t_min <= ray.t_max
            && t_min <= t_max;
        if !usable {
            return None;
        }
        // Denormals are normal in f64, whose range holds every product below.
        let exponent = (f64::from(longest).to_bits() >> 52).cast_signed() - 1023;
        let factor = power_of_two(-exponent);
        let direction = (ray.direction.as_dvec3() * factor).as_vec3a();
        // origin·s + t'·(direction·k) = s·(origin + t·direction) with t' = t·s/k.
        let t_factor = f64::from(scale.factor) / factor;
        // Inward: what is denormal rounds, and no hit may come out of the ray's own range.
        let t_min = round_up(f64::from(t_min) * t_factor);
        let t_max = round_down(f64::from(t_max) * t_factor).min(f32::MAX);
        (t_min <= t_max).then_some(Self {
            origin,
            direction,
            t_min,
            t_max,
            t_factor,
            is_extreme: true,
        })
    }

    /// A scaled distance in the ray's own.
    pub(crate) fn unscaled(&self, t: f32) -> f32 {
        if self.t_factor == 1.0 { t } else { to_f32(f64::from(t) / self.t_factor) }
    }

    /// A distance of the ray's own, scaled.
    pub(crate) fn scaled(&self, t: f32) -> f32 {
        if self.t_factor == 1.0 { t } else { to_f32(f64::from(t) * self.t_factor) }
    }

    /// A hit in the ray's own distance.
    #[inline]
    pub(crate) fn finish(&self, mut hit: Hit) -> Hit {
        if self.t_factor != 1.0 && hit.is_hit() {
            hit.t = to_f32(f64::from(hit.t) / self.t_factor);
        }
        hit
    }
}

/// 2 to the `exponent`, which lies within ±1022.
fn power_of_two(exponent: i64) -> f64 {
    f64::from_bits(((exponent + 1023) << 52).cast_unsigned())
}

#[expect(clippy::cast_possible_truncation, reason = "rounding and saturating is the purpose")]
fn to_f32(x: f64) -> f32 {
    x as f32
}

/// The reciprocal direction and the offsets of a slab test by fused multiply-adds, which is
/// conservative without any work per box.
///
/// A plane at `b` is crossed at `t = (b − o)/d`, computed as `fma(b, r, −o·r)` with `r = 1/d`.
/// With u the unit roundoff, the error is at most `|r|·u·(2|b − o| + 2|o|)` to first order: a
/// rounding of `r`, one of the result, and two of the offset. `|b|` is at most the scene's largest
/// coordinate M, which is known beforehand: so the bound, `|r|·u·(2M + 4|o|)`, goes into the constant
/// term, once a ray, lowering every entry and raising every exit. A box thus grows by a few units
/// in the last place of the scene's coordinates, and none that the ray meets is lost, whatever
/// rounding does (Ize 2013 gives the bound for the two-step form).
///
/// A plane of a quantised node is `b = g + q·s` exactly, and is computed as
/// `fma(q, s·r, fma(g, r, −o·r))`. That has two roundings more, of `s·r` and of the inner sum, which
/// together come to `|r|·u·(q·s + |g − o|)` at most. With `|g| ≤ M`, `q·s ≤ 2.02M` (a grid ends at
/// most a step behind the node) and hence `|b| ≤ 1.02M`, the bound is `|r|·u·(5.1M + 5|o|)`. Both kinds
/// of nodes get the larger one, as the difference costs nothing that can be measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    /// Finite and never zero.
    pub(crate) inverse: Vec3A,
    /// Finite.
    pub(crate) near_offset: Vec3A,
    /// Finite.
    pub(crate) far_offset: Vec3A,
}

impl Slabs {
    #[inline(always)]
    pub(crate) fn new(ray: &RaySetup, magnitude: f32) -> Self {
        // Half more than the bound above, for the terms of second order.
        let pad = (ray.origin.abs() + magnitude) * (4.0 * f32::EPSILON);
        Self::padded(ray, pad, pad)
    }

    /// Slabs of boxes that are larger by `near` on the sides where the ray enters and by `far`
    /// where it leaves.
    #[inline(always)]
    pub(crate) fn padded(ray: &RaySetup, near: Vec3A, far: Vec3A) -> Self {
        // A component 2⁻⁶⁰ of the longest moves the ray by less than the pad over the whole
        // scene; taking it for smaller ones keeps the reciprocal finite. The sign bit stays, so
        // that −0.0 enters at the upper plane.
        let (origin, direction) = (ray.origin, ray.direction);
        let length = direction.abs();
        let least = length.max_element() * f32::from_bits((127 - 60) << 23);
        let inverse = length.max(Vec3A::splat(least)).recip().copysign(direction);
        let offset = origin * -inverse;
        let size = inverse.abs();
        let (mut near_offset, mut far_offset) = (offset - near * size, offset + far * size);
        if ray.is_extreme {
            // Finite limits keep ∞ − ∞ out of the test of empty slots.
            let limit = Vec3A::splat(f32::MAX);
            near_offset = near_offset.max(-limit).min(limit);
            far_offset = far_offset.max(-limit).min(limit);
        }
        Self { inverse, near_offset, far_offset }
    }

    /// For a quantised node's test whose multiply-adds round twice: that adds roundings of q·s·r and
    /// g·r, `|r|·u·(2.02M + M)` at most, to the bound above.
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "kernels of x86-64"))]
    pub(crate) fn unfused(self, ray: &RaySetup, magnitude: f32) -> Self {
        // A unit more of each for forming the new offsets.
        let more = (ray.origin.abs() + magnitude) * (2.0 * f32::EPSILON) * self.inverse.abs();
        let limit = Vec3A::splat(f32::MAX);
        Self {
            near_offset: (self.near_offset - more).max(-limit),
            far_offset: (self.far_offset + more).min(limit),
            ..self
        }
    }
}
