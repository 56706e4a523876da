//! What a kernel needs of a ray, computed once.

use crate::scale::SceneScale;
use niwaki_core::{Hit, Ray, glam::Vec3};

/// A ray in the scaled coordinates of a scene, and its way back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RaySetup {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
    /// At least +0.0, so that the bits of distances sort like integers.
    pub(crate) t_min: f32,
    /// Finite.
    pub(crate) t_max: f32,
    /// What scaled distances are divided by.
    t_factor: f64,
}

impl RaySetup {
    /// `None` for a ray that hits nothing: a NaN or infinite component, a zero direction, an
    /// empty range of `t`.
    #[inline]
    pub(crate) fn new(ray: &Ray, scale: SceneScale) -> Option<Self> {
        let d = ray.direction.abs();
        let longest = d.max_element();
        let origin = ray.origin * scale.factor;
        // Each comparison is false for NaN; max_element may drop NaN, so sums are checked.
        let sum = d.x + d.y + d.z;
        // f32::MAX as the last distance: a hit beyond could not be told from a miss.
        let t_max = ray.t_max.min(f32::MAX);
        let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
        let usable = longest > 0.0
            && longest <= f32::MAX
            && !sum.is_nan()
            && origin.is_finite()
            && t_min <= t_max
            && !ray.t_min.is_nan()
            && !ray.t_max.is_nan();
        if !usable {
            return None;
        }
        // Unit directions, and all others of moderate length, stay as they are.
        if scale.factor == 1.0 && (1e-9..=1e9).contains(&longest) {
            let direction = ray.direction;
            return Some(Self { origin, direction, t_min, t_max, t_factor: 1.0 });
        }
        Self::rescaled(ray, scale, longest, t_min, t_max)
    }

    /// Brings the longest component of the direction into 1..2.
    #[cold]
    fn rescaled(
        ray: &Ray,
        scale: SceneScale,
        longest: f32,
        t_min: f32,
        t_max: f32,
    ) -> Option<Self> {
        // Denormals are normal in f64, whose range holds every product below.
        let exponent = (f64::from(longest).to_bits() >> 52).cast_signed() - 1023;
        let factor = power_of_two(-exponent);
        let direction = (ray.direction.as_dvec3() * factor).as_vec3();
        // origin·s + t'·(direction·k) = s·(origin + t·direction) with t' = t·s/k.
        let t_factor = f64::from(scale.factor) / factor;
        let t_min = to_f32(f64::from(t_min) * t_factor);
        let t_max = to_f32(f64::from(t_max) * t_factor).min(f32::MAX);
        if t_min > t_max {
            return None;
        }
        let origin = ray.origin * scale.factor;
        Some(Self { origin, direction, t_min, t_max, t_factor })
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
/// With u the unit roundoff, the error is at most `|r|·u·(2|b − o| + |o|)` to first order, where
/// `|b|` is at most the scene's largest coordinate, which is known beforehand: so the bound goes
/// into the constant term, once a ray, lowering every entry and raising every exit. A box thus
/// grows by a few units in the last place of the scene's coordinates, and none that the ray
/// meets is lost, whatever rounding does (Ize 2013 gives the bound for the two-step form).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    /// Finite and never zero.
    pub(crate) inverse: Vec3,
    /// Finite.
    pub(crate) near_offset: Vec3,
    /// Finite.
    pub(crate) far_offset: Vec3,
}

impl Slabs {
    #[inline]
    pub(crate) fn new(ray: &RaySetup, magnitude: f32) -> Self {
        // Twice the bound above, which also covers forming the offsets themselves.
        const PAD: f32 = 4.0 * f32::EPSILON;
        // A component 2⁻⁶⁰ of the longest moves the ray by less than the pad over the whole
        // scene; taking it for smaller ones keeps the reciprocal finite. The sign bit stays, so
        // that −0.0 enters at the upper plane.
        let least = ray.direction.abs().max_element() * f32::from_bits((127 - 60) << 23);
        let clamped = ray.direction.abs().max(Vec3::splat(least)).copysign(ray.direction);
        let inverse = 1.0 / clamped;
        let offset = -ray.origin * inverse;
        let pad = (ray.origin.abs() + magnitude) * inverse.abs() * PAD;
        // Finite limits keep ∞ − ∞ out of the test of empty slots.
        let limit = Vec3::splat(f32::MAX);
        Self {
            inverse,
            near_offset: (offset - pad).max(-limit).min(limit),
            far_offset: (offset + pad).max(-limit).min(limit),
        }
    }
}
