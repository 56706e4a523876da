//! Triangles against boxes.

use niwaki_core::{
    Aabb, Triangle,
    glam::{DVec3, Vec3},
};

/// Above the error of every projection below, relative to the sum of the magnitudes of its
/// products: six roundings in the longest chain.
const ERROR: f64 = 16.0 * f64::EPSILON;

/// True if a triangle and a box have a point in common; both with their borders.
///
/// Conservative: it never says no where they touch. It says yes without need only where they pass
/// each other by less than about 1e-15 of the distance from the triangle's first vertex to the
/// farthest corner of either. Where coordinates are multiples of one power of two and differ by at
/// most 2¹⁴ times it, nothing is rounded and the answer is exact. Segments and points are triangles too; in an
/// empty box or one with NaN there is nothing.
///
/// The separating axis test of Akenine-Möller (2001) over the 13 axes, in `f64`, with corners of
/// the box instead of its centre and extents, which would have been rounded.
#[must_use]
pub fn triangle_overlaps_box(triangle: &Triangle, bounds: &Aabb) -> bool {
    // The axes of the box, exactly.
    let own = triangle.bounds();
    if !(own.min.cmple(bounds.max).all() && own.max.cmpge(bounds.min).all()) || bounds.is_empty() {
        return false;
    }
    if bounds.contains(&own) {
        return true;
    }
    // Infinite faces would make products that are not numbers. No vertex is past the finite ones.
    let (least, most) = (Vec3::splat(f32::MIN), Vec3::splat(f32::MAX));
    let origin = triangle.v0.as_dvec3();
    let low = bounds.min.max(least).as_dvec3() - origin;
    let high = bounds.max.min(most).as_dvec3() - origin;
    let vertices = triangle.vertices().map(|vertex| vertex.as_dvec3() - origin);
    let [_, b, c] = vertices;
    let normal = [(b.y * c.z, b.z * c.y), (b.z * c.x, b.x * c.z), (b.x * c.y, b.y * c.x)];
    let axis = DVec3::from_array(normal.map(|(p, q)| p - q));
    let magnitude = DVec3::from_array(normal.map(|(p, q)| p.abs() + q.abs()));
    if separates(axis, magnitude, &vertices, low, high) {
        return false;
    }
    let edges = [b, c, triangle.v2.as_dvec3() - triangle.v1.as_dvec3()];
    for edge in edges {
        for axis in [
            DVec3::new(0.0, -edge.z, edge.y),
            DVec3::new(edge.z, 0.0, -edge.x),
            DVec3::new(-edge.y, edge.x, 0.0),
        ] {
            if separates(axis, axis.abs(), &vertices, low, high) {
                return false;
            }
        }
    }
    true
}

/// True if the projections on an axis surely have a gap between them. `magnitude` bounds the
/// terms that the components of the axis are made of.
fn separates(
    axis: DVec3,
    magnitude: DVec3,
    vertices: &[DVec3; 3],
    low: DVec3,
    high: DVec3,
) -> bool {
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut farthest = low.abs().max(high.abs());
    for vertex in vertices {
        let at = axis.dot(*vertex);
        first = first.min(at);
        last = last.max(at);
        farthest = farthest.max(vertex.abs());
    }
    let (to_low, to_high) = (axis * low, axis * high);
    let box_first = to_low.min(to_high).element_sum();
    let box_last = to_low.max(to_high).element_sum();
    let error = ERROR * magnitude.dot(farthest);
    first - box_last > error || box_first - last > error
}
