//! Rays for comparisons, and what differences are excused.

use niwaki_core::{Hit, Ray, TriangleMesh, glam::Vec3};
use niwaki_exact::{Verdict, settle};

/// From around, from inside, and from surfaces: a third each.
pub(crate) fn rays(mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut triangles = rng.fork();
    let bounds = mesh.bounds();
    let (middle, size) = (bounds.center(), bounds.extent());
    let mut vector = || Vec3::from_array([(); 3].map(|()| rng.f32() * 2.0 - 1.0));
    let mut rays = Vec::with_capacity(count);
    while rays.len() < count {
        let target = middle + 0.5 * size * vector();
        let from = match rays.len() % 3 {
            0 => middle + size.length() * vector().normalize_or(Vec3::X),
            1 => middle + 0.5 * size * vector(),
            _ => {
                let [a, b, c] = mesh.triangle(triangles.usize(..mesh.len())).vertices();
                a * 0.3 + b * 0.4 + c * 0.3
            }
        };
        let direction = target - from;
        let ray = Ray::new(from, direction * (0.1 + vector().x.abs()));
        rays.push(match rays.len() % 5 {
            0 => ray.with_range(1e-4, 0.8),
            1 => ray.with_range(1e-3, f32::INFINITY),
            _ => ray,
        });
    }
    rays
}

/// Differences of the answers: settled ones that rounding excuses. Panics if one side is wrong.
pub(crate) fn compare(
    what: &str,
    mesh: &TriangleMesh,
    rays: &[Ray],
    ours: &[Hit],
    theirs: &[Hit],
) -> (usize, usize) {
    let (mut bits, mut excused) = (0, 0);
    for (i, (our, their)) in ours.iter().zip(theirs).enumerate() {
        let key = |hit: &Hit| (hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim_id);
        if key(our) == key(their) {
            continue;
        }
        bits += 1;
        if our.prim_id == their.prim_id && our.t == their.t {
            let error = (our.u - their.u).abs().max((our.v - their.v).abs());
            assert!(error <= 1e-5, "{what}: {:?} gives {our:?}, not {their:?}", rays[i]);
            continue;
        }
        let verdict = settle(&rays[i], mesh, our, their);
        let is_right = matches!(verdict, Verdict::Agree | Verdict::Tie | Verdict::Rounding);
        assert!(is_right, "{what}: ray {i}, {:?}: {our:?}, not {their:?}: {verdict}", rays[i]);
        excused += usize::from(verdict != Verdict::Agree);
    }
    (bits, excused)
}
