//! Axis-aligned bounding boxes.

use glam::Vec3;

/// An axis-aligned box: all points `p` with `min ≤ p ≤ max` in each axis.
///
/// The empty box has `min = +∞`, `max = −∞`, so that growing it by anything gives that thing.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing; the neutral element of [`Aabb::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box between two corners; `min` must not exceed `max`, except for [`Aabb::EMPTY`].
    #[must_use]
    pub const fn new(min: Vec3, max: Vec3) -> Self {
        Self { min, max }
    }

    /// The smallest box around some points; [`Aabb::EMPTY`] without points.
    #[must_use]
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::grow)
    }

    /// True if no point lies inside.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// True if both corners are finite (so not for the empty box).
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }

    /// The smallest box around this one and a point.
    #[must_use]
    #[inline]
    pub fn grow(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both.
    #[must_use]
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The common part; empty ([`Aabb::is_empty`]) if the two do not touch.
    #[must_use]
    #[inline]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// True if `other` lies inside or on the border; the empty box lies in every box.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }

    /// True if the point lies inside or on the border.
    #[must_use]
    pub fn contains_point(&self, point: Vec3) -> bool {
        self.min.cmple(point).all() && self.max.cmpge(point).all()
    }

    /// Edge lengths; negative for the empty box.
    #[must_use]
    #[inline]
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// The middle, computed so that it cannot overflow for finite boxes.
    #[must_use]
    #[inline]
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// The axis (0, 1, 2) of the longest edge; the first among equals.
    #[must_use]
    pub fn longest_axis(&self) -> usize {
        let e = self.extent();
        if e.x >= e.y && e.x >= e.z {
            0
        } else if e.y >= e.z {
            1
        } else {
            2
        }
    }

    /// Surface area in `f64`, exact enough for every finite `f32` box; 0 for the empty box.
    #[must_use]
    pub fn area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let e = self.max.as_dvec3() - self.min.as_dvec3();
        2.0 * (e.x * e.y + e.y * e.z + e.z * e.x)
    }

    /// Half the surface area in `f32`, after multiplying every edge by `scale`
    /// ([`AreaScale::of`] gives one that keeps the products inside the range of `f32`). For the
    /// empty box the result has no meaning.
    #[must_use]
    #[inline]
    pub fn half_area(&self, scale: AreaScale) -> f32 {
        let e = self.extent() * scale.0;
        e.x * (e.y + e.z) + e.y * e.z
    }
}

/// A power of two by which edges are multiplied before areas are formed, so that the areas of
/// scenes with coordinates of 1e30 do not overflow `f32` and those of 1e-30 do not vanish. Ratios
/// of areas, which is all that the surface area heuristic uses, do not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaScale(f32);

impl AreaScale {
    /// No scaling: for scenes whose extent is known to be moderate.
    pub const ONE: Self = Self(1.0);

    /// The scale for everything inside `scene`: 1 for extents from 2⁻²⁰ to 2³⁰, otherwise the
    /// power of two that brings the longest edge near 1.
    #[must_use]
    pub fn of(scene: &Aabb) -> Self {
        let longest = scene.extent().max_element();
        // Infinite where corners on both sides of 0 are near the largest f32.
        let is_extent = longest > 0.0;
        if !is_extent || (2.0_f32.powi(-20)..=2.0_f32.powi(30)).contains(&longest) {
            return Self::ONE;
        }
        // The exponent from the bits: exact, and monotone for denormals and infinity as well.
        let exponent = (longest.to_bits() >> 23).cast_signed() - 127;
        Self(2.0_f32.powi((-exponent).clamp(-126, 126)))
    }

    /// The factor itself.
    #[must_use]
    pub const fn get(self) -> f32 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_is_neutral_and_has_no_area() {
        let b = Aabb::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 6.0, 8.0));
        assert_eq!(Aabb::EMPTY.union(b), b);
        assert!(Aabb::EMPTY.is_empty() && b.contains(&Aabb::EMPTY));
        assert_eq!(Aabb::EMPTY.area(), 0.0);
        assert_eq!(b.area(), 2.0 * (12.0 + 20.0 + 15.0));
        assert_eq!(b.half_area(AreaScale::ONE), 47.0);
        assert_eq!(b.longest_axis(), 2);
    }

    #[test]
    fn an_extent_past_the_range_is_scaled_too() {
        let all = Aabb::new(Vec3::MIN, Vec3::MAX);
        let scale = AreaScale::of(&all).get();
        assert!((all.max * scale - all.min * scale).max_element() < 16.0);
        assert_eq!(AreaScale::of(&Aabb::EMPTY), AreaScale::ONE);
        assert_eq!(AreaScale::of(&Aabb::new(Vec3::ONE, Vec3::ONE)), AreaScale::ONE);
    }

    #[test]
    fn scaled_areas_stay_finite_and_comparable_at_the_ends_of_the_range() {
        for size in [1e-38_f32, 1e-30, 1e-10, 1.0, 1e10, 1e30, 1e38] {
            let scene = Aabb::new(Vec3::ZERO, Vec3::splat(size));
            let scale = AreaScale::of(&scene);
            let whole = scene.half_area(scale);
            let part = Aabb::new(Vec3::ZERO, Vec3::splat(size * 0.5)).half_area(scale);
            assert!(whole.is_finite() && whole > 0.0, "{size}");
            assert!((part / whole - 0.25).abs() < 1e-3, "{size}: {part} / {whole}");
        }
    }
}
