//! Shading normals of patches.

use super::piece::Patch;
use glam::{DVec3, Vec3};
use niwaki_core::to_u32;
use rayon::prelude::*;

/// Gives a patch unit normals: at each corner of a triangle the mean of the triangles that meet
/// there and whose normals are within an angle of the triangle's own, of which `crease` is the
/// cosine (−1: all of them). Vertices that need several normals are doubled; vertices at exactly
/// one place count as one, so that seams do not show.
///
/// A corner's triangle counts by its sine over the lengths of its two edges, which is exact for
/// points on a sphere (Max 1999, "Weights for computing vertex normals from facet normals").
pub(super) fn shade(patch: &mut Patch, crease: f64) {
    let positions = &patch.positions;
    let count = positions.len();
    // Adding zero makes one number of the two zeros.
    let place = |i: u32| positions[i as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..to_u32(count)).collect();
    order.par_sort_unstable_by_key(|&i| (place(i), i));
    let mut weld = vec![0_u32; count];
    for run in order.chunk_by(|&a, &b| place(a) == place(b)) {
        run.iter().for_each(|&i| weld[i as usize] = run[0]);
    }
    let corner = |t: &[u32; 3], k: usize| positions[t[k] as usize].as_dvec3();
    let faces: Vec<DVec3> = patch
        .indices
        .par_iter()
        .map(|t| {
            let a = corner(t, 0);
            (corner(t, 1) - a).cross(corner(t, 2) - a).normalize_or_zero()
        })
        .collect();
    let weight = |c: u32| {
        let (t, k) = (&patch.indices[c as usize / 3], c as usize % 3);
        let here = corner(t, k);
        let (a, b) = (corner(t, (k + 1) % 3) - here, corner(t, (k + 2) % 3) - here);
        let scale = a.length_squared() * b.length_squared();
        if scale > 0.0 { a.cross(b) / scale } else { DVec3::ZERO }
    };
    // The corners at each place, in order of their triangles.
    let mut first = vec![0_u32; count + 1];
    for &i in patch.indices.iter().flatten() {
        first[weld[i as usize] as usize + 1] += 1;
    }
    for i in 0..count {
        first[i + 1] += first[i];
    }
    let mut next = first.clone();
    let mut corners = vec![0_u32; 3 * patch.indices.len()];
    for (c, &i) in (0_u32..).zip(patch.indices.iter().flatten()) {
        let slot = &mut next[weld[i as usize] as usize];
        corners[*slot as usize] = c;
        *slot += 1;
    }
    let around =
        |place: u32| &corners[first[place as usize] as usize..first[place as usize + 1] as usize];
    let mean = |place: u32, own: Option<DVec3>| {
        let near = |c: &&u32| own.is_none_or(|own| own.dot(faces[**c as usize / 3]) >= crease);
        let sum: DVec3 = around(place).iter().filter(near).map(|&c| weight(c)).sum();
        sum.try_normalize().map_or(Vec3::Y, |n| n.as_vec3())
    };
    if crease <= -1.0 {
        let normals: Vec<Vec3> = (0..count).into_par_iter().map(|i| mean(weld[i], None)).collect();
        patch.normals = normals;
        return;
    }
    let wanted: Vec<Vec3> = (0..to_u32(corners.len()))
        .into_par_iter()
        .map(|c| {
            let (t, k) = (c as usize / 3, c as usize % 3);
            // A triangle without area has no side that it could be on.
            let own = (faces[t] != DVec3::ZERO).then_some(faces[t]);
            mean(weld[patch.indices[t][k] as usize], own)
        })
        .collect();
    // The first normal that a vertex needs is its own; others get a copy of the vertex.
    let mut normals = vec![Vec3::ZERO; count];
    let mut copies: Vec<Vec<u32>> = vec![Vec::new(); count];
    let mut positions = positions.clone();
    for (i, &normal) in patch.indices.iter_mut().flatten().zip(&wanted) {
        let original = *i as usize;
        if normals[original] == Vec3::ZERO {
            normals[original] = normal;
        } else if normals[original] != normal {
            let known = copies[original].iter().find(|&&c| normals[c as usize] == normal);
            *i = known.copied().unwrap_or_else(|| {
                let copy = to_u32(normals.len());
                normals.push(normal);
                positions.push(positions[original]);
                copies[original].push(copy);
                copy
            });
        }
    }
    normals.iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
    (patch.positions, patch.normals) = (positions, normals);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    #[test]
    fn boxes_get_the_normals_of_their_sides() {
        let mut patch = Patch::default();
        patch.cuboid(DVec3::ONE, DVec3::new(1.0, 2.0, 3.0), DMat3::IDENTITY);
        shade(&mut patch, 0.7);
        assert_eq!((patch.positions.len(), patch.normals.len()), (24, 24));
        for t in &patch.indices {
            let [a, b, c] = t.map(|i| patch.positions[i as usize]);
            let normal = (b - a).cross(c - a).normalize();
            assert!(t.iter().all(|&i| patch.normals[i as usize].distance(normal) < 1e-6));
        }
    }

    #[test]
    fn normals_of_a_sphere_are_exact() {
        let mut patch = super::super::piece::capped([24, 16], &|u, v| {
            let (sin, cos) = super::super::math::sin_cos_turns(0.5 * v);
            super::super::math::circle(-u) * sin.max(0.0) - DVec3::Y * cos
        });
        shade(&mut patch, -1.0);
        let worst = patch.positions.iter().zip(&patch.normals).map(|(p, n)| p.distance(*n));
        assert!(worst.fold(0.0, f32::max) < 1e-4);
    }
}
