//! An evenly tessellated closed surface, like the scanned dragon: a scaly serpent coiled along a
//! torus knot.

use super::{
    curve::{tangent, tube},
    math::{circle, sin_cos_turns, turbulence},
    piece::{Plan, Wrap, cells},
};
use crate::{Camera, Environment, Light, LightKind, Material};
use glam::{DVec3, Vec3};

/// Length of the knot over the circumference of the body.
pub(super) const ASPECT: f64 = 11.0;

/// The (2, 3) torus knot, standing on the ground.
fn knot(t: f64) -> DVec3 {
    let (sin, cos) = sin_cos_turns(3.0 * t);
    circle(2.0 * t) * (1.0 + 0.42 * cos) + DVec3::Y * (0.62 + 0.42 * sin)
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let materials = vec![Material {
        roughness: 0.35,
        metallic: 0.6,
        ..Material::matte("bronze scales", Vec3::new(0.55, 0.36, 0.17))
    }];
    let eye = Vec3::new(1.3, 1.9, 3.1);
    let camera = Camera::look_at(eye, Vec3::new(0.0, 0.55, 0.0), Vec3::Y, 0.75);
    let mut plan = Plan::new(materials, camera, Environment::DAYLIGHT);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(-0.5, -0.8, -0.35).normalize(),
        intensity: Vec3::splat(2.5),
    });
    let size = cells(triangles, ASPECT, [8, 3]);
    plan.grid(0, size, Wrap::Both, move |u, v| surface(u, v, seed));
    plan
}

/// The serpent: along the knot, and around the body. It is 1.2 tall and 3.2 wide, and closed.
pub(super) fn surface(u: f64, v: f64, seed: u64) -> DVec3 {
    let center = knot(u);
    // The serpent is thick in the middle of its length and thin where tail meets head.
    let (_, swell) = sin_cos_turns(u);
    let body = 0.17 - 0.045 * swell;
    let plain = tube(center, tangent(knot, u), DVec3::Y, v, body);
    // Scales, then folds of the skin. Both are functions of the place, so the seam closes.
    let (along, _) = sin_cos_turns(90.0 * u);
    let (around, _) = sin_cos_turns(9.0 * v);
    let folds = turbulence(plain * 9.0, seed);
    let displaced = body * (1.0 + 0.05 * along * around + 0.12 * folds);
    center + (plain - center) * (displaced / body)
}
