//! Boxes in two four-lane registers.

use niwaki_core::glam::{Vec3, Vec4};
use niwaki_core::{Aabb, AreaScale, PrimRef};

/// A box whose fourth lanes have no meaning: those of references hold ids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Box4 {
    pub(crate) min: Vec4,
    pub(crate) max: Vec4,
}

impl Box4 {
    pub(crate) const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline]
    pub(crate) fn of(p: &PrimRef) -> Self {
        let [min, max]: [Vec4; 2] = bytemuck::cast(*p);
        Self { min, max }
    }

    /// With zeros in the fourth lanes: ids, read as numbers, are mostly denormal, and arithmetic on
    /// those is slow.
    #[inline]
    pub(crate) fn without_ids(p: &PrimRef) -> Self {
        let Self { min, max } = Self::of(p);
        Self { min: min.with_w(0.0), max: max.with_w(0.0) }
    }

    #[inline]
    pub(crate) fn from_aabb(b: &Aabb) -> Self {
        Self { min: b.min.extend(0.0), max: b.max.extend(0.0) }
    }

    #[inline]
    pub(crate) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline]
    pub(crate) fn aabb(&self) -> Aabb {
        Aabb { min: xyz(self.min), max: xyz(self.max) }
    }

    /// As [`Aabb::half_area`].
    #[inline]
    pub(crate) fn half_area(&self, scale: AreaScale) -> f32 {
        let e = (xyz(self.max) - xyz(self.min)) * scale.get();
        e.x * (e.y + e.z) + e.y * e.z
    }
}

#[inline]
fn xyz(v: Vec4) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}
