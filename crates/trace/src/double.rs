//! Rays and triangles in double precision.

use crate::{
    binary::check_tree,
    flat::{closing_double, is_flat_double},
};
use niwaki_core::{
    Aabb, BuildError, Builder, Bvh, PrimRef,
    float::{round_down, round_up},
    glam::{DVec3, Vec3},
    to_u32,
};
use niwaki_wide::CollapseError;

/// A ray in double precision: [`niwaki_core::Ray`] has the rules, which are the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleRay {
    /// Start point (at t = 0).
    pub origin: DVec3,
    /// Direction, of any length but 0; `t` counts in its length.
    pub direction: DVec3,
    /// Smallest accepted distance; a negative one counts as 0.
    pub t_min: f64,
    /// Largest accepted distance; may be infinite.
    pub t_max: f64,
}

impl DoubleRay {
    /// An unbounded ray: `t` from 0 to ∞.
    #[must_use]
    pub const fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f64::INFINITY }
    }
}

/// What a ray hit, in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleHit {
    /// Distance in lengths of the ray's direction.
    pub t: f64,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f64,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f64,
    /// The triangle.
    pub prim_id: u32,
}

/// Why a scene in double precision was not made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DoubleSceneError {
    /// A triangle names a vertex that does not exist or has a coordinate beyond ±10³⁰⁰, if it has
    /// one. Remedy: drop or repair it.
    #[error("triangle {triangle} has a vertex that does not exist, is not finite or is too far")]
    BadTriangle {
        /// The first such.
        triangle: usize,
    },
    /// The builder failed. Remedy: as the cause says.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The builder's tree is not one. Remedy: mend the builder.
    #[error(transparent)]
    Tree(#[from] CollapseError),
}

/// Triangles in double precision with a binary tree, traced by scalar code, watertight: for scenes
/// whose detail is lost in `f32`, such as a screw on a planet.
///
/// The test is that of [`crate::Mode::Watertight`] with 53 bits instead of 24; weights below 2⁻⁹⁰⁰,
/// whose sign underflow could have changed, count as zero. Owns a copy of all that it needs.
///
/// ```
/// use niwaki_core::{BuildError, Builder, Bvh, BvhNode, PrimRef, glam::DVec3};
/// use niwaki_trace::{DoubleRay, DoubleScene};
/// # struct OneLeaf;
/// # impl Builder for OneLeaf {
/// #     fn name(&self) -> &str { "one_leaf" }
/// #     fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
/// #         Ok(Bvh { nodes: vec![BvhNode::leaf(prims[0].aabb(), 0, 1)], prim_ids: vec![0] })
/// #     }
/// #     fn memory_bound(&self, _: usize) -> usize { 64 }
/// # }
///
/// // A millimetre, seen at the distance of the sun.
/// let far = DVec3::new(1.5e11, 0.0, 0.0);
/// let corners = [far, far + DVec3::Y * 1e-3, far + DVec3::Z * 1e-3];
/// # let builder = OneLeaf;
/// let scene = DoubleScene::new(&builder, &corners, &[[0, 1, 2]])?; // any builder
/// let origin = far - DVec3::X + (DVec3::Y + DVec3::Z) * 2.5e-4;
/// let hit = scene.closest_hit(&DoubleRay::new(origin, DVec3::X)).expect("a hit");
/// assert_eq!(hit.t, 1.0);
/// assert!((hit.u - 0.25).abs() < 1e-12 && (hit.v - 0.25).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DoubleScene {
    nodes: Vec<Node>,
    prim_ids: Vec<u32>,
    /// One a reference, in leaf order.
    triangles: Vec<[DVec3; 3]>,
    /// The power of two by which all coordinates are multiplied, so that the longest edge of the
    /// scene is near 1 and products of three neither overflow nor vanish.
    exponent: i64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    min: DVec3,
    max: DVec3,
    /// The first child or reference.
    first: u32,
    /// References of a leaf; 0 for an inner node.
    count: u32,
}

impl DoubleScene {
    /// Builds a tree over boxes that are rounded outward to `f32`, relative to the middle of the
    /// scene, and refits it in double precision. `indices` has three vertices a triangle.
    ///
    /// # Errors
    /// [`DoubleSceneError`].
    pub fn new(
        builder: &dyn Builder,
        positions: &[DVec3],
        indices: &[[u32; 3]],
    ) -> Result<Self, DoubleSceneError> {
        let mut all = Vec::with_capacity(indices.len());
        for (triangle, corners) in indices.iter().enumerate() {
            let corners = corners.map(|i| positions.get(i as usize).copied().unwrap_or(DVec3::NAN));
            if !corners.iter().all(|v| v.abs().max_element() <= 1e300) {
                return Err(DoubleSceneError::BadTriangle { triangle });
            }
            all.push(corners);
        }
        let bounds = all
            .iter()
            .flatten()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |b, v| [b[0].min(*v), b[1].max(*v)]);
        let longest = (bounds[1] - bounds[0]).max_element();
        let exponent = if longest > 0.0 { -exponent_of(longest) } else { 0 };
        let factor = power_of_two(exponent);
        for v in all.iter_mut().flatten() {
            *v *= factor;
        }
        let center = (bounds[0] * factor + bounds[1] * factor) * 0.5;
        let prims: Vec<PrimRef> = (0..to_u32(all.len()))
            .zip(&all)
            .map(|(id, corners)| {
                let [a, b, c] = corners.map(|v| v - center);
                let (min, max) = (a.min(b).min(c), a.max(b).max(c));
                let min = Vec3::from(min.to_array().map(round_down));
                PrimRef::new(Aabb::new(min, Vec3::from(max.to_array().map(round_up))), id)
            })
            .collect();
        let bvh = builder.build(&prims)?;
        check_tree(&bvh)?;
        let triangles: Option<Vec<_>> =
            bvh.prim_ids.iter().map(|&id| all.get(id as usize).copied()).collect();
        let malformed = CollapseError::Malformed { node: 0, nodes: bvh.nodes.len() };
        let mut triangles = triangles.ok_or(malformed)?;
        let nodes = refit(&bvh, &triangles);
        let ids = 0..to_u32(all.len());
        let flat: Vec<u32> = ids.filter(|&id| is_flat_double(&all[id as usize])).collect();
        if !flat.is_empty() {
            let kept = closing_double(&flat, &all);
            for (corners, id) in triangles.iter_mut().zip(&bvh.prim_ids) {
                // The list of flat ones is in order as well.
                if flat.binary_search(id).is_ok() && kept.binary_search(id).is_err() {
                    *corners = [DVec3::NAN; 3];
                }
            }
        }
        Ok(Self { nodes, prim_ids: bvh.prim_ids, triangles, exponent })
    }

    /// The hit with the smallest `t` in the ray's range; at equal `t` that of the smallest id.
    #[must_use]
    pub fn closest_hit(&self, ray: &DoubleRay) -> Option<DoubleHit> {
        self.trace::<false>(ray)
    }

    /// True if anything lies in the ray's range.
    #[must_use]
    pub fn any_hit(&self, ray: &DoubleRay) -> bool {
        self.trace::<true>(ray).is_some()
    }

    fn trace<const ANY: bool>(&self, ray: &DoubleRay) -> Option<DoubleHit> {
        let root = self.nodes.first()?;
        let longest = ray.direction.abs().max_element();
        let origin = ray.origin * power_of_two(self.exponent);
        let usable = origin.abs().max_element() <= 1e150
            && ray.direction.is_finite()
            && longest > 0.0
            && ray.t_min <= ray.t_max
            && ray.t_max >= 0.0;
        if !usable {
            return None;
        }
        // The longest component between 1 and 2, or nearly so.
        let exponent = -exponent_of(longest);
        let direction = ray.direction * power_of_two(exponent);
        // origin·s + t'·(direction·k) = s·(origin + t·direction) with t' = t·s/k. Beyond the range
        // of the quotient, t would be beyond the range of f64.
        let factor = power_of_two(exponent - self.exponent);
        let (t_min, t_max) = (ray.t_min.max(0.0) / factor, (ray.t_max / factor).min(f64::MAX));
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the instructions, as just checked.
            let hit = unsafe { self.traverse_fma::<ANY>(root, origin, direction, t_min, t_max) };
            return hit.map(|hit| DoubleHit { t: hit.t * factor, ..hit });
        }
        let hit = self.traverse::<ANY>(root, origin, direction, t_min, t_max);
        hit.map(|hit| DoubleHit { t: hit.t * factor, ..hit })
    }

    /// The same code with hardware multiply-adds, whose results are the same by definition.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "fma")]
    fn traverse_fma<const ANY: bool>(
        &self,
        root: &Node,
        origin: DVec3,
        direction: DVec3,
        t_min: f64,
        t_max: f64,
    ) -> Option<DoubleHit> {
        self.traverse::<ANY>(root, origin, direction, t_min, t_max)
    }

    #[inline(always)]
    fn traverse<const ANY: bool>(
        &self,
        root: &Node,
        origin: DVec3,
        direction: DVec3,
        t_min: f64,
        t_max: f64,
    ) -> Option<DoubleHit> {
        let sheared = Sheared::new(origin, direction);
        let reach = (root.max - origin).abs().max((root.min - origin).abs()).max_element();
        // As in `watertight::pads`.
        let pads = [12.0, 6.0].map(|epsilons| epsilons * f64::EPSILON * reach);
        let inverse = direction.recip();
        let entry = |node: &Node, limit: f64| {
            let (mut near, mut far) = (t_min, limit);
            for axis in 0..3 {
                let negative = direction[axis].is_sign_negative();
                let (low, high) = (node.min[axis], node.max[axis]);
                let (first, last, sign) =
                    if negative { (high, low, -1.0) } else { (low, high, 1.0) };
                // 0·∞ is NaN, which min and max drop.
                near = near.max((first - origin[axis] - sign * pads[0]) * inverse[axis]);
                let leave = (last - origin[axis] + sign * pads[1]) * inverse[axis];
                far = far.min(leave * (1.0 + 8.0 * f64::EPSILON));
            }
            (near <= far).then_some(near)
        };
        let mut best: Option<DoubleHit> = None;
        let mut limit = t_max;
        let mut stack = Vec::with_capacity(64);
        stack.extend(entry(root, limit).map(|near| (0, near)));
        while let Some((index, near)) = stack.pop() {
            if near > limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                let range = node.first as usize..(node.first + node.count) as usize;
                for (corners, &prim_id) in
                    self.triangles[range.clone()].iter().zip(&self.prim_ids[range])
                {
                    let Some([t, u, v]) = sheared.intersect(corners) else { continue };
                    let id = best.map_or(u32::MAX, |hit| hit.prim_id);
                    if t >= t_min && (t < limit || (t == limit && prim_id < id)) {
                        limit = t;
                        best = Some(DoubleHit { t, u, v, prim_id });
                        if ANY {
                            return best;
                        }
                    }
                }
                continue;
            }
            let [a, b] = [node.first, node.first + 1]
                .map(|child| entry(&self.nodes[child as usize], limit).map(|near| (child, near)));
            match (a, b) {
                (Some(a), Some(b)) if a.1 <= b.1 => stack.extend([b, a]),
                (a, b) => stack.extend(a.into_iter().chain(b)),
            }
        }
        best
    }
}

/// The nodes with boxes around what they hold, in double precision. The tree must have passed
/// [`check_tree`].
fn refit(bvh: &Bvh, triangles: &[[DVec3; 3]]) -> Vec<Node> {
    let mut nodes: Vec<Node> = bvh
        .nodes
        .iter()
        .map(|node| {
            let corners = triangles[if node.is_leaf() { node.prim_range() } else { 0..0 }].iter();
            let (min, max) = corners
                .flatten()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |b, &v| (b.0.min(v), b.1.max(v)));
            Node { min, max, first: node.first, count: node.count }
        })
        .collect();
    // Children come after their parents.
    for i in (0..nodes.len()).rev() {
        if nodes[i].count == 0 {
            let first = nodes[i].first as usize;
            let (a, b) = (nodes[first], nodes[first + 1]);
            nodes[i].min = a.min.min(b.min);
            nodes[i].max = a.max.max(b.max);
        }
    }
    nodes
}

/// [`crate::watertight::Sheared`] in double precision.
struct Sheared {
    axes: [usize; 3],
    origin: DVec3,
    shear: [f64; 2],
    along: f64,
}

impl Sheared {
    #[inline(always)]
    fn new(origin: DVec3, direction: DVec3) -> Self {
        let length = direction.abs();
        let z = (0..3).fold(0, |z, axis| if length[axis] > length[z] { axis } else { z });
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let along = direction[z];
        let shear = [direction[axes[0]] / along, direction[axes[1]] / along];
        Self { axes, origin, shear, along }
    }

    /// `t`, `u` and `v` of the point where the line passes the triangle.
    #[inline(always)]
    fn intersect(&self, corners: &[DVec3; 3]) -> Option<[f64; 3]> {
        /// Below this, underflow may have changed the sign.
        const CERTAIN: f64 = f64::from_bits((1023 - 900) << 52);
        let [a, b, c] = corners.map(|v| {
            let [x, y, z] = self.axes.map(|axis| v[axis] - self.origin[axis]);
            [(-self.shear[0]).mul_add(z, x), (-self.shear[1]).mul_add(z, y), z]
        });
        let edge = |p: [f64; 3], q: [f64; 3]| {
            let product = p[1] * q[0];
            let w = p[0].mul_add(q[1], -product) + (-p[1]).mul_add(q[0], product);
            if w.abs() < CERTAIN { 0.0 } else { w }
        };
        let w = [edge(b, c), edge(c, a), edge(a, b)];
        let inside = w.iter().all(|&w| w >= 0.0) || w.iter().all(|&w| w <= 0.0);
        let [wa, wb, wc] = w.map(f64::abs);
        let det = wa + (wb + wc);
        if !(inside && det > 0.0) {
            return None;
        }
        // The weights first, as products of three coordinates could overflow.
        let [wa, wb, wc] = [wa / det, wb / det, wc / det];
        let depth = wa.mul_add(a[2], wb.mul_add(b[2], wc * c[2]));
        Some([depth / self.along, wb, wc])
    }
}

/// Of a positive number: that of the largest power of two in it, or the least one if denormal.
fn exponent_of(x: f64) -> i64 {
    (x.to_bits() >> 52).cast_signed() - 1023
}

/// 2 to the `exponent`, or to the nearest to it within ±1000.
fn power_of_two(exponent: i64) -> f64 {
    f64::from_bits(((exponent.clamp(-1000, 1000) + 1023) << 52).cast_unsigned())
}
