//! Seeded procedural scenes, scalable from a thousand to ten million triangles.
//!
//! The same name, size and seed give the same bytes on every platform and at any number of
//! threads: random numbers, sines and noise are computed here, from IEEE additions,
//! multiplications, divisions and square roots alone.

mod atrium;
mod city;
mod curve;
mod dragon;
mod foliage;
mod hair;
pub(crate) mod math;
mod piece;
mod pipes;
mod random;
mod stadium;

use crate::Scene;

/// The scenes that [`generate`] makes.
pub const NAMES: &[&str] = &["dragon", "hair", "atrium", "city", "pipes", "foliage", "stadium"];

/// Makes a scene of about `triangles` triangles (within 5 % from 1,000 on), or `None` for an
/// unknown name.
#[must_use]
pub fn generate(name: &str, triangles: usize, seed: u64) -> Option<Scene> {
    // Fewer could not show the shape; more could not be numbered.
    let triangles = triangles.clamp(256, 1 << 30);
    let plan = match name {
        "dragon" => dragon::plan(triangles, seed),
        "hair" => hair::plan(triangles, seed),
        "atrium" => atrium::plan(triangles, seed),
        "city" => city::plan(triangles, seed),
        "pipes" => pipes::plan(triangles, seed),
        "foliage" => foliage::plan(triangles, seed),
        "stadium" => stadium::plan(triangles, seed),
        _ => return None,
    };
    Some(plan.into_scene(name))
}
