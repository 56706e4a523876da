//! Rays whose exact answer is known.

use niwaki_core::{Hit, Ray, TriangleMesh, float::round_down};
use niwaki_exact::closest_in_mesh;

/// The rays whose exact answer an `f32` can hold, with that answer; `u` and `v` are left 0.
#[must_use]
pub fn exact_answers(mesh: &TriangleMesh, rays: &[Ray]) -> (Vec<Ray>, Vec<Hit>) {
    // A distance past the normal range of f32 has no f32 to full precision, so no kernel that
    // returns one can be held to it.
    let normal =
        |t: f64| t == 0.0 || (f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX)).contains(&t);
    rays.iter()
        .filter_map(|ray| match closest_in_mesh(ray, mesh) {
            None => Some((*ray, Hit::MISS)),
            Some(closest) if normal(closest.t) => {
                let t = round_down(closest.t);
                let prim_id = closest.ties.first().map_or(Hit::NO_PRIM, |tie| tie.0);
                Some((*ray, Hit { t, u: 0.0, v: 0.0, prim_id }))
            }
            Some(_) => None,
        })
        .unzip()
}
