//! Small meshes, trees and rays, as bytes choose them.

use super::bytes::Bytes;
use niwaki_core::{Ray, TriangleMesh, glam::Vec3};

/// The most corners of a mesh.
const CORNERS: usize = 24;

/// The most triangles of a mesh.
const TRIANGLES: usize = 40;

/// The most rays of an input.
const RAYS: usize = 16;

/// Any bits.
pub(crate) fn vector(bytes: &mut Bytes<'_>) -> Vec3 {
    Vec3::new(bytes.float(), bytes.float(), bytes.float())
}

/// One of `of`; the zero vector if there is none.
fn one_of(of: &[Vec3], bytes: &mut Bytes<'_>) -> Vec3 {
    of.get(bytes.below(of.len())).copied().unwrap_or(Vec3::ZERO)
}

/// A point at or next to another one, or between two.
fn point(known: &[Vec3], bytes: &mut Bytes<'_>) -> Vec3 {
    match bytes.byte() & 3 {
        0 => vector(bytes),
        1 => one_of(known, bytes),
        2 => {
            let (a, b) = (one_of(known, bytes), one_of(known, bytes));
            a + (b - a) * (f32::from(bytes.byte()) / 128.0)
        }
        _ => {
            let mut p = one_of(known, bytes);
            let choice = bytes.byte();
            let axis = usize::from(choice % 3);
            let step = i32::from(choice >> 4) - 8;
            p[axis] = f32::from_bits(p[axis].to_bits().wrapping_add_signed(step));
            p
        }
    }
}

/// A mesh of up to 40 triangles over up to 24 corners, which they share. Triangles with a corner
/// that is not finite are left out, as loaders do.
pub(crate) fn mesh(bytes: &mut Bytes<'_>) -> TriangleMesh {
    let (corners, triangles) = (1 + bytes.below(CORNERS), bytes.below(TRIANGLES + 1));
    let mut positions = Vec::with_capacity(corners);
    while positions.len() < corners && !bytes.is_empty() {
        positions.push(point(&positions, bytes));
    }
    let mut indices = Vec::with_capacity(triangles);
    while indices.len() < triangles && !bytes.is_empty() {
        let index = |bytes: &mut Bytes<'_>| niwaki_core::to_u32(bytes.below(positions.len()));
        indices.push([index(bytes), index(bytes), index(bytes)]);
    }
    indices.retain(|t| t.iter().all(|&i| positions.get(i as usize).is_some_and(|p| p.is_finite())));
    TriangleMesh::new(positions, indices).expect("what it refuses was left out")
}

/// Up to 16 rays, many of them aimed at corners and edges of the mesh.
pub(crate) fn rays(mesh: &TriangleMesh, bytes: &mut Bytes<'_>) -> Vec<Ray> {
    let mut rays = Vec::new();
    while rays.len() < RAYS && !bytes.is_empty() {
        let choice = bytes.byte();
        let known = mesh.positions();
        let origin = point(known, bytes);
        let direction = match choice & 3 {
            0 => vector(bytes),
            1 => one_of(known, bytes) - origin,
            2 => point(known, bytes) - origin,
            _ => {
                let axis = bytes.below(6);
                let sign = if axis < 3 { 1.0 } else { -1.0 };
                let mut d = Vec3::ZERO;
                d[axis % 3] = sign;
                d
            }
        };
        let mut ray = Ray::new(origin, direction);
        if choice & 4 != 0 {
            ray.t_min = bytes.float();
        }
        if choice & 8 != 0 {
            ray.t_max = bytes.float();
        }
        rays.push(ray);
    }
    rays
}

/// True if the ray may hit something: finite, with a direction and a range.
pub(crate) fn is_legal(ray: &Ray) -> bool {
    ray.origin.is_finite()
        && ray.direction.is_finite()
        && ray.direction != Vec3::ZERO
        && ray.t_min.max(0.0) <= ray.t_max
        && !ray.t_min.is_nan()
}
