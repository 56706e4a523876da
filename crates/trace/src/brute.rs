//! Every triangle tested.

use crate::{
    scale::SceneScale,
    setup::RaySetup,
    triangle::{EdgeTriangle, intersect, no_hit, settle},
};
use niwaki_core::{Hit, Ray, TriangleMesh};

/// The closest hit by testing every triangle; among hits at equal `t` the smallest `prim_id`.
///
/// Takes time linear in the mesh, twice: the bounds decide the scale. Meant for tests and as the
/// reference of kernels, with which it agrees to the last bit of `t`, `u` and `v`.
#[must_use]
pub fn brute_force(mesh: &TriangleMesh, ray: &Ray) -> Hit {
    let scale = SceneScale::of(&mesh.bounds());
    let Some(setup) = RaySetup::new(ray, scale) else { return Hit::MISS };
    let mut hit = no_hit(setup.t_max);
    for (id, triangle) in (0..).zip(mesh.triangles()) {
        let triangle = EdgeTriangle::new(&scale.triangle(triangle));
        intersect(&triangle, id, setup.origin, setup.direction, setup.t_min, &mut hit);
    }
    setup.finish(settle(hit))
}

/// All hits by testing every triangle, sorted by `t`, then by `prim_id`; see [`brute_force`].
#[must_use]
pub fn brute_force_all(mesh: &TriangleMesh, ray: &Ray) -> Vec<Hit> {
    let scale = SceneScale::of(&mesh.bounds());
    let Some(setup) = RaySetup::new(ray, scale) else { return Vec::new() };
    let mut hits = Vec::new();
    for (id, triangle) in (0..).zip(mesh.triangles()) {
        let triangle = EdgeTriangle::new(&scale.triangle(triangle));
        let mut hit = no_hit(setup.t_max);
        intersect(&triangle, id, setup.origin, setup.direction, setup.t_min, &mut hit);
        if hit.is_hit() {
            hits.push(setup.finish(hit));
        }
    }
    hits.sort_by(|a, b| a.t.partial_cmp(&b.t).unwrap_or(std::cmp::Ordering::Equal));
    hits
}

/// True if [`brute_force`] hits.
#[must_use]
pub fn brute_force_any(mesh: &TriangleMesh, ray: &Ray) -> bool {
    brute_force(mesh, ray).is_hit()
}
