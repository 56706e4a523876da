//! Powers of two that keep products of coordinates in the range of `f32`.

use crate::setup::MODERATE;
use niwaki_core::{Aabb, AreaScale, Triangle, glam::Vec3};

/// The power of two that a scene's coordinates are multiplied by before anything else, chosen
/// from its extent, which becomes 2³⁰ at most; 1 for scenes of 2⁻²⁰ to 2³⁰ units.
///
/// The triangle test multiplies three lengths, so coordinates of 1e30 would overflow and those of
/// 1e-30 vanish. Multiplication by a power of two is exact, except where a part of the scene is
/// more than 2¹²⁶ times smaller than the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SceneScale {
    pub(crate) factor: f32,
    /// Of the scaled scene; a point for an empty one.
    pub(crate) bounds: Aabb,
    /// The largest coordinate of the scaled scene, by magnitude.
    pub(crate) magnitude: f32,
    /// Nothing is scaled, and no coordinate is over [`MODERATE`].
    pub(crate) is_moderate: bool,
}

impl SceneScale {
    pub(crate) fn of(bounds: &Aabb) -> Self {
        // An extent that is no f32 is at most 2¹²⁹. It must not stay: a plane of a quantised node is
        // the sum of two terms, each of which has to be finite.
        let is_endless = bounds.extent().max_element() == f32::INFINITY;
        let factor = if is_endless { 2.0_f32.powi(-99) } else { AreaScale::of(bounds).get() };
        let bounds = if bounds.is_empty() {
            Aabb::new(Vec3::ZERO, Vec3::ZERO)
        } else {
            Aabb { min: bounds.min * factor, max: bounds.max * factor }
        };
        let magnitude = bounds.min.abs().max(bounds.max.abs()).max_element();
        Self { factor, bounds, magnitude, is_moderate: factor == 1.0 && magnitude <= MODERATE }
    }

    #[inline]
    pub(crate) fn aabb(self, bounds: Aabb) -> Aabb {
        Aabb { min: bounds.min * self.factor, max: bounds.max * self.factor }
    }

    #[inline]
    pub(crate) fn triangle(self, t: Triangle) -> Triangle {
        Triangle { v0: t.v0 * self.factor, v1: t.v1 * self.factor, v2: t.v2 * self.factor }
    }
}
