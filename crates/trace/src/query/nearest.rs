//! The nearest point of a triangle.

use niwaki_core::{
    Triangle,
    glam::{DVec3, Vec3},
};

/// A primitive's point that is nearest to a given one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// The primitive.
    pub prim_id: u32,
    /// From the given point; computed in `f64`, so that ties are rare outside shared edges and
    /// corners, where they are exact.
    pub distance: f64,
    /// The point, rounded.
    pub point: Vec3,
    /// Barycentric weight of the triangle's second vertex there.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex there.
    pub v: f32,
}

/// The square of the sine of a triangle's angle below which the direction of its normal may be
/// nothing but rounding.
const SLIVER: f64 = 1e-20;

/// The point of a triangle that is nearest to `from`, in `f64`; `prim_id` is only handed on.
///
/// The triangle is looked at from `from` as the origin: the foot of the perpendicular is inside if
/// the origin is on the inner side of the three planes through the edges and along the normal
/// (Ericson 2005, section 5.1.5, asks the same of dot products); otherwise the nearest point is on
/// an edge. The point always is a convex combination of the vertices, so that its distance is never
/// too small by more than the rounding of coordinates. It is too large only for slivers, by their
/// width at most. Segments and points are triangles too.
#[must_use]
pub fn nearest_on_triangle(triangle: &Triangle, from: Vec3, prim_id: u32) -> NearestPoint {
    let origin = from.as_dvec3();
    let [a, b, c] = triangle.vertices().map(|vertex| vertex.as_dvec3() - origin);
    let (to_b, to_c) = (b - a, c - a);
    let normal = to_b.cross(to_c);
    // By edges, not by the corners themselves, whose products a far point would make large.
    let whole = normal.length_squared();
    let weight_b = normal.dot(to_c.cross(a));
    let weight_c = normal.dot(a.cross(to_b));
    let mut best = (f64::INFINITY, DVec3::ZERO, 0.0, 0.0);
    let mut edges = true;
    if whole > 0.0 && weight_b >= 0.0 && weight_c >= 0.0 && weight_b + weight_c <= whole {
        let (u, v) = (weight_b / whole, weight_c / whole);
        let at = a + to_b * u + to_c * v;
        best = (at.length_squared(), at, u, v);
        edges = whole <= SLIVER * to_b.length_squared() * to_c.length_squared();
    }
    if edges {
        for (p, q, weights) in [
            (a, b, [[0.0, 0.0], [1.0, 0.0]]),
            (b, c, [[1.0, 0.0], [0.0, 1.0]]),
            (c, a, [[0.0, 1.0], [0.0, 0.0]]),
        ] {
            let (at, s) = nearest_on_segment(p, q);
            let square = at.length_squared();
            if square < best.0 {
                let weight = |i: usize| weights[0][i] * (1.0 - s) + weights[1][i] * s;
                best = (square, at, weight(0), weight(1));
            }
        }
    }
    let (square, at, u, v) = best;
    #[expect(clippy::cast_possible_truncation, reason = "weights of 0 to 1")]
    let (u, v) = (u as f32, v as f32);
    NearestPoint { prim_id, distance: square.sqrt(), point: (origin + at).as_vec3(), u, v }
}

/// The point of the segment `pq` nearest to the origin, and how far along it is: 0 at `p`, 1 at
/// `q`.
fn nearest_on_segment(p: DVec3, q: DVec3) -> (DVec3, f64) {
    // From the same end whichever triangle asks, so that neighbours agree to the last bit.
    let swapped = (q.x, q.y, q.z) < (p.x, p.y, p.z);
    let (from, to) = if swapped { (q, p) } else { (p, q) };
    let along = to - from;
    let square = along.length_squared();
    let s = if square > 0.0 { (-from.dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    // The very corner, so that all triangles around it are as far.
    let at = if s == 1.0 { to } else { from + along * s };
    (at, if swapped { 1.0 - s } else { s })
}
