//! The triangle test that all kernels share.

use crate::{
    mode::Mode,
    scale::SceneScale,
    setup::{RaySetup, Slabs},
    watertight::{self, Sheared},
};
use niwaki_core::{
    Hit, Triangle,
    glam::{DVec3, Vec3},
};

/// A triangle test of the scalar kernels, prepared for a ray.
pub(crate) trait TriangleTest {
    fn new(ray: &RaySetup) -> Self;

    /// The slabs that go with the test.
    fn slabs(ray: &RaySetup, scale: &SceneScale) -> Slabs;

    /// How much larger boxes must be where the ray enters and where it leaves, in a slab test
    /// without an error of its own but relative ones of three roundings.
    fn pads(ray: &RaySetup, scale: &SceneScale) -> [f32; 2];

    /// Replaces `hit` if the triangle of these [`words`] is met from `t_min` on and before it, or
    /// at the same distance with a smaller id.
    fn intersect(&self, words: [Vec3; 3], prim_id: u32, t_min: f32, hit: &mut Hit);
}

/// What a mode keeps of a triangle.
#[inline]
pub(crate) fn words(mode: Mode, triangle: &Triangle) -> [Vec3; 3] {
    match mode {
        Mode::Fast => {
            let EdgeTriangle { v0, e1, e2 } = EdgeTriangle::new(triangle);
            [v0, e1, e2]
        }
        Mode::Watertight => triangle.vertices(),
    }
}

/// The test of [`Mode::Fast`].
pub(crate) struct Fast {
    origin: Vec3,
    direction: Vec3,
}

impl TriangleTest for Fast {
    #[inline(always)]
    fn new(ray: &RaySetup) -> Self {
        Self { origin: ray.origin.into(), direction: ray.direction.into() }
    }

    #[inline(always)]
    fn slabs(ray: &RaySetup, scale: &SceneScale) -> Slabs {
        Slabs::new(ray, scale.magnitude)
    }

    #[inline(always)]
    fn pads(_: &RaySetup, _: &SceneScale) -> [f32; 2] {
        [0.0; 2]
    }

    #[inline(always)]
    fn intersect(&self, [v0, e1, e2]: [Vec3; 3], prim_id: u32, t_min: f32, hit: &mut Hit) {
        let triangle = EdgeTriangle { v0, e1, e2 };
        intersect(&triangle, prim_id, self.origin, self.direction, t_min, hit);
    }
}

impl TriangleTest for Sheared {
    #[inline(always)]
    fn new(ray: &RaySetup) -> Self {
        Self::new(ray)
    }

    #[inline(always)]
    fn slabs(ray: &RaySetup, scale: &SceneScale) -> Slabs {
        watertight::slabs(ray, scale)
    }

    #[inline(always)]
    fn pads(ray: &RaySetup, scale: &SceneScale) -> [f32; 2] {
        watertight::pads(ray, scale)
    }

    #[inline(always)]
    fn intersect(&self, corners: [Vec3; 3], prim_id: u32, t_min: f32, hit: &mut Hit) {
        self.intersect(corners, prim_id, t_min, hit);
    }
}

/// A triangle as the test wants it: a corner and two edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeTriangle {
    pub(crate) v0: Vec3,
    pub(crate) e1: Vec3,
    pub(crate) e2: Vec3,
}

impl EdgeTriangle {
    #[inline]
    pub(crate) fn new(t: &Triangle) -> Self {
        // Parallel edges span nothing, but their fused cross product is its own rounding, not zero.
        // An edge of zero makes the determinant zero for every ray. In f64 the products are exact.
        let (e1, e2) = (t.v1 - t.v0, t.v2 - t.v0);
        let is_flat = e1.as_dvec3().cross(e2.as_dvec3()) == DVec3::ZERO;
        Self { v0: t.v0, e1, e2: if is_flat { Vec3::ZERO } else { e2 } }
    }
}

/// `a × b`, one rounding for a product and one for the fused rest.
#[inline(always)]
fn cross(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(
        a.y.mul_add(b.z, -(a.z * b.y)),
        a.z.mul_add(b.x, -(a.x * b.z)),
        a.x.mul_add(b.y, -(a.y * b.x)),
    )
}

/// `a · b`, fused from z to x.
#[inline(always)]
fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x.mul_add(b.x, a.y.mul_add(b.y, a.z * b.z))
}

/// Möller and Trumbore's test (1997) in the form with the normal: with C = v0 − o and
/// R = C × d, the determinant is N·d, and u, v and t are e2·R, −e1·R and N·C over it.
///
/// Replaces `hit` if the triangle is met from `t_min` on and before it, or at the same distance
/// with a smaller id. Only a zero determinant is rejected, not a small one, and every comparison
/// is written so that NaN misses. The SIMD kernels do the same operations in the same order.
#[inline(always)]
pub(crate) fn intersect(
    triangle: &EdgeTriangle,
    prim_id: u32,
    origin: Vec3,
    direction: Vec3,
    t_min: f32,
    hit: &mut Hit,
) {
    let c = triangle.v0 - origin;
    let r = cross(c, direction);
    let n = cross(triangle.e1, triangle.e2);
    let det = dot(n, direction);
    let abs_det = det.abs();
    let sign = det.to_bits() & (1 << 31);
    let flip = |x: f32, sign: u32| f32::from_bits(x.to_bits() ^ sign);
    let u = flip(dot(triangle.e2, r), sign);
    let v = flip(dot(triangle.e1, r), sign ^ (1 << 31));
    if !(u >= 0.0 && v >= 0.0 && u + v <= abs_det && abs_det > 0.0) {
        return;
    }
    let t = flip(dot(n, c), sign) / abs_det;
    if t >= t_min && (t < hit.t || (t == hit.t && prim_id < hit.prim_id)) {
        *hit = Hit { t, u: u / abs_det, v: v / abs_det, prim_id };
    }
}

/// The state before the first hit: found hits must lie at `t_max` or before.
#[inline(always)]
pub(crate) const fn no_hit(t_max: f32) -> Hit {
    Hit { t: t_max, ..Hit::MISS }
}

/// A miss, or the hit itself.
#[inline(always)]
pub(crate) fn settle(hit: Hit) -> Hit {
    if hit.is_hit() { hit } else { Hit::MISS }
}
