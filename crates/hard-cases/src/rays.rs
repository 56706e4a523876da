//! Hard rays.

use fastrand::Rng;
use glam::Vec3;
use niwaki_core::{Aabb, Ray, TriangleMesh};

fn unit(rng: &mut Rng) -> Vec3 {
    // Uniform on the sphere (Archimedes: z is uniform).
    let z = 2.0 * rng.f32() - 1.0;
    let (sin, cos) = (std::f32::consts::TAU * rng.f32()).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, z)
}

fn inside(rng: &mut Rng, b: &Aabb) -> Vec3 {
    let f = Vec3::new(rng.f32(), rng.f32(), rng.f32());
    b.min + b.extent() * f
}

/// About `11 · count` legal rays around a mesh: random ones, axis-parallel ones with zeros of
/// either sign, tiny, huge and denormal direction components, bounded ranges, origins on corners,
/// edges, faces and box faces, and aim at corners and edges. The same for the same seed.
#[must_use]
pub fn rays(mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::with_seed(seed);
    let bounds = if mesh.is_empty() { Aabb::new(Vec3::ZERO, Vec3::ONE) } else { mesh.bounds() };
    let reach = bounds.extent().max_element().max(f32::MIN_POSITIVE);
    let outer = Aabb::new(bounds.min - Vec3::splat(reach), bounds.max + Vec3::splat(reach));
    let mut out = Vec::new();
    for _ in 0..count {
        let origin = inside(&mut rng, &outer);
        let target = inside(&mut rng, &bounds);
        out.push(Ray::new(origin, target - origin));
        out.push(Ray::new(inside(&mut rng, &bounds), unit(&mut rng)));
        // Axis-parallel, with both zeros.
        let axis = rng.usize(0..3);
        let mut direction = Vec3::new(0.0, -0.0, 0.0);
        direction[axis] = if rng.bool() { 1.0 } else { -1.0 };
        direction[(axis + 1) % 3] = if rng.bool() { 0.0 } else { -0.0 };
        let mut origin = target;
        origin[axis] = outer.min[axis];
        out.push(Ray::new(origin, direction));
        out.push(Ray::new(target, direction));
        // On a face of the scene's box, sliding along it.
        let mut on_face = target;
        on_face[axis] = if rng.bool() { bounds.min[axis] } else { bounds.max[axis] };
        let mut along = unit(&mut rng);
        along[axis] = if rng.bool() { 0.0 } else { -0.0 };
        out.push(Ray::new(on_face, along));
        // Nearly axis-parallel: reciprocals overflow or come close.
        let mut nearly = direction;
        nearly[(axis + 1) % 3] = if rng.bool() { 1e-30 } else { -1e-40 };
        out.push(Ray::new(origin, nearly));
        // Unnormalised and bounded.
        let scale = 10.0_f32.powi(rng.i32(-20..=20));
        let direction = unit(&mut rng);
        out.push(Ray::new(inside(&mut rng, &outer), direction * scale));
        let (a, b) = (rng.f32() * reach, rng.f32() * reach);
        out.push(Ray::new(inside(&mut rng, &outer), direction).with_range(a.min(b), a.max(b)));
    }
    out.extend(aimed_at_borders(mesh, 3 * count, seed ^ 0x5eed));
    out
}

/// `count` rays aimed exactly at corners, at points on edges, and from corners, edges and face
/// points of random triangles. Nothing for an empty mesh.
#[must_use]
pub fn aimed_at_borders(mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<Ray> {
    if mesh.is_empty() {
        return Vec::new();
    }
    let mut rng = Rng::with_seed(seed);
    let bounds = mesh.bounds();
    (0..count)
        .map(|i| {
            let t = mesh.triangle(rng.usize(0..mesh.len()));
            let [a, b, c] = t.vertices();
            let f = rng.f32();
            let on = match i % 3 {
                0 => a,
                1 => a + (b - a) * f,
                _ => a + (b - a) * (f * 0.5) + (c - a) * (rng.f32() * 0.5),
            };
            if rng.u8(0..4) == 0 {
                Ray::new(on, unit(&mut rng))
            } else {
                let origin = inside(&mut rng, &bounds);
                Ray::new(origin, on - origin)
            }
        })
        .collect()
}

/// Rays that hit nothing by definition, around a mesh that they would hit otherwise: NaN in
/// each component, zero directions, empty and NaN ranges, infinite origins.
#[must_use]
pub fn bad_rays(mesh: &TriangleMesh) -> Vec<Ray> {
    let target = if mesh.is_empty() { Vec3::ZERO } else { mesh.triangle(0).bounds().center() };
    let base = Ray::new(target - Vec3::Z, Vec3::Z);
    let mut out = Vec::new();
    for axis in 0..3 {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut ray = base;
            ray.origin[axis] = bad;
            out.push(ray);
        }
        let mut ray = base;
        ray.direction[axis] = f32::NAN;
        out.push(ray);
    }
    out.push(Ray { direction: Vec3::ZERO, ..base });
    out.push(Ray { direction: Vec3::splat(-0.0), ..base });
    out.push(base.with_range(2.0, 1.0));
    out.push(base.with_range(f32::NAN, 1.0));
    out.push(base.with_range(0.0, f32::NAN));
    out.push(base.with_range(f32::INFINITY, f32::INFINITY));
    out.push(base.with_range(0.0, -1.0));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_finite_and_repeatable() {
        for case in crate::meshes() {
            let rays = rays(&case.mesh, 8, 3);
            assert!(
                rays.iter().all(|r| r.origin.is_finite() && r.direction.is_finite()),
                "{}",
                case.name
            );
            assert_eq!(rays, super::rays(&case.mesh, 8, 3));
        }
    }
}
