//! Closed surfaces, and rays from inside that no kernel should let out.

use crate::{closed_star, sheet};
use fastrand::Rng;
use glam::Vec3;
use niwaki_core::{Ray, TriangleMesh, to_u32};

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
        if self.is_box && i.is_multiple_of(3) {
            // From the plane through the center that the corner is straight above.
            let corner = self.mesh.positions()[rng.usize(0..self.mesh.positions().len())];
            let side = (corner - self.center).abs();
            let axis = (0..3).max_by(|&a, &b| side[a].total_cmp(&side[b])).unwrap_or(0);
            let mut origin = corner;
            origin[axis] = self.center[axis];
            let mut direction = Vec3::new(0.0, -0.0, 0.0);
            direction[axis] = corner[axis] - self.center[axis];
            return Ray::new(origin, direction);
        }
        let target = border_point(&self.mesh, rng);
        let mut point = || 2.0 * rng.f32() - 1.0;
        let from_center = Vec3::new(point(), point(), point()).clamp_length_max(1.0);
        let origin = self.center + from_center * self.inner;
        Ray::new(origin, target - origin)
    }
}

/// A corner of a triangle of a mesh, or as likely a point on one of its edges, up to rounding.
///
/// # Panics
/// If there are no triangles.
#[must_use]
pub fn border_point(mesh: &TriangleMesh, rng: &mut Rng) -> Vec3 {
    let corners = mesh.triangle(rng.usize(0..mesh.len())).vertices();
    let first = rng.usize(0..3);
    let (corner, next) = (corners[first], corners[(first + 1) % 3]);
    if rng.bool() { corner } else { corner + (next - corner) * rng.f32() }
}

/// Stars of several sizes at several places, 32,768 triangles each, a box of squares with integer
/// corners, and one with seams.
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
        flat_star(),
        Closed {
            name: "closed_box",
            why: "axis-parallel rays at corners with integer coordinates",
            mesh: grid_box(32, Vec3::splat(-16.0)),
            center: Vec3::ZERO,
            inner: 15.0,
            is_box: true,
        },
        Closed {
            name: "closed_seams",
            why: "corners in the middle of edges, closed by triangles without area",
            mesh: seamed_octahedron(Vec3::new(1.0, -2.0, 64.0)),
            center: Vec3::new(1.0, -2.0, 64.0),
            inner: 1.0,
            is_box: false,
        },
    ]
}

fn flat_star() -> Closed {
    const THICKNESS: f32 = 1e-3;
    let star = closed_star(6, 1.0, Vec3::ZERO, 7);
    let squeezed = star.positions().iter().map(|p| *p * Vec3::new(1.0, 1.0, THICKNESS));
    Closed {
        name: "closed_star_flat",
        why: "thin as a coin: slivers, seen at grazing angles",
        mesh: TriangleMesh::new(squeezed.collect(), star.indices().to_vec()).expect("finite"),
        center: Vec3::ZERO,
        inner: 0.5 * THICKNESS,
        is_box: false,
    }
}

/// An octahedron around a point. Each of four edges has a corner in its middle that only one side
/// knows; triangles without area close the seams. The middles are exact if the coordinates of the
/// center are integers below a million.
#[must_use]
pub fn seamed_octahedron(center: Vec3) -> TriangleMesh {
    let mut positions: Vec<Vec3> =
        [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y, Vec3::Z, -Vec3::Z].map(|v| v * 3.0 + center).into();
    let mut indices = Vec::new();
    for i in 0..4 {
        let (a, b) = (i, (i + 1) % 4);
        let middle = to_u32(positions.len());
        positions.push((positions[a as usize] + positions[b as usize]) * 0.5);
        // The upper half knows the middle of the edge, the lower does not.
        indices.extend([[a, middle, 4], [middle, b, 4], [b, a, 5], [a, b, middle]]);
    }
    TriangleMesh::new(positions, indices).expect("finite and in range")
}

/// The surface of a box of `n` unit cubes each way, from `corner` on: squares of two triangles
/// each, with shared vertices within a side.
#[must_use]
pub fn grid_box(n: u32, corner: Vec3) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for axis in 0..3 {
        for side in [0, n] {
            let base = to_u32(positions.len());
            let face = sheet(n, |i, j| {
                let mut p = Vec3::ZERO;
                p[axis] = side as f32;
                p[(axis + 1) % 3] = i as f32;
                p[(axis + 2) % 3] = j as f32;
                p + corner
            });
            positions.extend(face.positions());
            indices.extend(face.indices().iter().map(|corners| corners.map(|i| base + i)));
        }
    }
    TriangleMesh::new(positions, indices).expect("finite and in range")
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
    fn seams_are_closed_by_triangles_without_area() {
        for center in [Vec3::ZERO, Vec3::new(1.0, -2.0, 64.0)] {
            let mesh = seamed_octahedron(center);
            assert_eq!(mesh.triangles().filter(|t| t.area() == 0.0).count(), 4);
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
