//! Closed surfaces, and rays from inside that no kernel should let out.

use crate::closed_star;
use fastrand::Rng;
use glam::Vec3;
use niwaki_core::{Ray, Triangle, TriangleMesh};

/// A closed surface around a point.
#[derive(Debug, Clone)]
pub struct Closed {
    /// Short name for tables, in `snake_case`.
    pub name: &'static str,
    /// Why it is hard.
    pub why: &'static str,
    /// The surface; neighbours share the bits of their common corners.
    pub mesh: TriangleMesh,
    /// A point inside.
    pub center: Vec3,
    /// All points no farther than this from [`Closed::center`] are inside.
    pub inner: f32,
    /// The surface is parallel to the axes, so that axis-parallel rays can be aimed at its corners.
    is_box: bool,
}

impl Closed {
    /// `count` rays from inside, each aimed at a corner or at a point on an edge; where the surface
    /// is parallel to the axes, a third are parallel to an axis. The real ray of each hits the
    /// surface, so a miss is a leak. The same for the same seed.
    #[must_use]
    pub fn rays_from_inside(&self, count: usize, seed: u64) -> Vec<Ray> {
        let mut rng = Rng::with_seed(seed);
        (0..count).map(|i| self.ray_from_inside(i, &mut rng)).collect()
    }

    fn ray_from_inside(&self, i: usize, rng: &mut Rng) -> Ray {
        let corners = self.mesh.triangle(rng.usize(0..self.mesh.len())).vertices();
        let corner = corners[rng.usize(0..3)];
        if self.is_box && i.is_multiple_of(3) {
            // From the plane through the center that the corner is straight above.
            let side = (corner - self.center).abs();
            let axis = (0..3).max_by(|&a, &b| side[a].total_cmp(&side[b])).unwrap_or(0);
            let mut origin = corner;
            origin[axis] = self.center[axis];
            let mut direction = Vec3::new(0.0, -0.0, 0.0);
            direction[axis] = corner[axis] - self.center[axis];
            return Ray::new(origin, direction);
        }
        let next = corners[rng.usize(0..3)];
        let target =
            if i.is_multiple_of(2) { corner } else { corner + (next - corner) * rng.f32() };
        let mut point = || 2.0 * rng.f32() - 1.0;
        let from_center = Vec3::new(point(), point(), point()).clamp_length_max(1.0);
        let origin = self.center + from_center * self.inner;
        Ray::new(origin, target - origin)
    }
}

/// Surfaces of several sizes at several places, and a box of squares with integer corners. The
/// stars have 32,768 triangles each.
#[must_use]
pub fn closed() -> Vec<Closed> {
    let star = |name, why, size: f32, center: Vec3| Closed {
        name,
        why,
        mesh: closed_star(6, size, center, 7),
        center,
        // Corners are no nearer than 0.7 of the size.
        inner: 0.5 * size,
        is_box: false,
    };
    vec![
        star("closed_star", "of size 1 around the origin", 1.0, Vec3::ZERO),
        star(
            "closed_star_offset",
            "coordinates of 1,000 times the size",
            1.0,
            Vec3::new(1e3, 7e2, -1.3e3),
        ),
        star("closed_star_at_1e7", "corners rounded to whole numbers", 64.0, Vec3::splat(1e7)),
        star("closed_star_1e-6", "of size 1e-6", 1e-6, Vec3::ZERO),
        star("closed_star_1e6", "of size 1e6", 1e6, Vec3::ZERO),
        star("closed_star_1e-30", "areas vanish in f32", 1e-30, Vec3::ZERO),
        star("closed_star_1e30", "areas overflow f32", 1e30, Vec3::ZERO),
        integer_box(),
    ]
}

/// The cube from −16 to 16 with faces of unit squares, each two triangles.
fn integer_box() -> Closed {
    const HALF: i16 = 16;
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [-HALF, HALF] {
            let at = |x: i16, y: i16| {
                let mut p = Vec3::ZERO;
                p[axis] = f32::from(side);
                p[(axis + 1) % 3] = f32::from(x);
                p[(axis + 2) % 3] = f32::from(y);
                p
            };
            for (x, y) in (-HALF..HALF).flat_map(|x| (-HALF..HALF).map(move |y| (x, y))) {
                triangles.push(Triangle::new(at(x, y), at(x + 1, y), at(x, y + 1)));
                triangles.push(Triangle::new(at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)));
            }
        }
    }
    Closed {
        name: "closed_box",
        why: "axis-parallel rays at corners with integer coordinates",
        mesh: TriangleMesh::from_triangles(&triangles).expect("small integers"),
        center: Vec3::ZERO,
        inner: f32::from(HALF - 1),
        is_box: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn surfaces_are_closed() {
        for case in closed() {
            let mut uses = HashMap::new();
            for triangle in case.mesh.triangles() {
                let v = triangle.vertices().map(|v| v.to_array().map(f32::to_bits));
                for k in 0..3 {
                    let (a, b) = (v[k], v[(k + 1) % 3]);
                    *uses.entry((a.min(b), a.max(b))).or_insert(0) += 1;
                }
            }
            assert!(uses.values().all(|n| n % 2 == 0), "{}", case.name);
        }
    }

    #[test]
    fn rays_start_inside_and_are_repeatable() {
        for case in closed() {
            let rays = case.rays_from_inside(300, 5);
            assert_eq!(rays, case.rays_from_inside(300, 5));
            let reach = case.mesh.bounds().extent().max_element();
            for ray in rays {
                assert!(ray.origin.is_finite() && ray.direction.is_finite(), "{}", case.name);
                let from_center = (ray.origin - case.center).abs().max_element();
                assert!(from_center <= 0.51 * reach, "{}: {ray:?}", case.name);
                assert!(ray.direction != Vec3::ZERO);
            }
        }
    }
}
