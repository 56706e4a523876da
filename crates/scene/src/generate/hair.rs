//! Many thin curved tubes around a sphere, like the Hairball scene.

use super::{
    curve::{tangent, tube},
    piece::{Budget, Plan, Wrap, cells},
    random::Random,
};
use crate::{Camera, Environment, Light, LightKind, Material};
use glam::{DVec3, Vec3};

/// Triangles of a strand where there are enough: three sides, 24 segments.
const STRAND: usize = 3 * 24 * 2;

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let materials = vec![
        Material::matte("scalp", Vec3::new(0.25, 0.15, 0.1)),
        Material { roughness: 0.4, ..Material::matte("hair", Vec3::new(0.45, 0.25, 0.1)) },
    ];
    let camera = Camera::look_at(Vec3::new(1.6, 1.0, 4.2), Vec3::ZERO, Vec3::Y, 0.8);
    let mut plan = Plan::new(materials, camera, Environment::DAYLIGHT);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(-0.4, -0.7, -0.6).normalize(),
        intensity: Vec3::splat(2.5),
    });
    let mut budget = Budget::new(triangles, 1.0);
    let scalp = cells(budget.share(0.01), 2.0, [8, 4]);
    let taken = plan.grid(0, scalp, Wrap::U, |u, v| {
        let (sin, cos) = super::math::sin_cos_turns(v * 0.5);
        super::math::circle(-u) * (sin * 0.5) + DVec3::Y * (cos * -0.5)
    });
    budget.spend(taken);
    let strands = (triangles / STRAND).max(16);
    // Thinner with more of them, so that the ball stays see-through near its border.
    let thickness = (0.6 / (strands as f64).sqrt()).clamp(0.000_5, 0.02);
    let mut left = Budget::new(triangles - taken, strands as f64);
    for strand in 0..strands {
        let segments = (left.share(1.0) / 6).max(2);
        let mut random = Random::new(seed, strand as u64);
        let root = random.direction();
        let bend = random.direction() * random.range(0.2, 0.7);
        let curl = random.range(0.02, 0.09);
        let waves = random.range(1.0, 3.0);
        let phase = random.unit();
        let length = random.range(0.9, 1.5);
        let reference = root.any_orthonormal_vector();
        let side = root.cross(reference);
        let curve = move |t: f64| {
            let (sin, cos) = super::math::sin_cos_turns(waves * t + phase);
            root * (0.48 + length * t)
                + bend * (t * t)
                + (reference * cos + side * sin) * (curl * t)
        };
        let taken = plan.grid(1, [3, segments], Wrap::U, move |u, v| {
            let radius = thickness * (1.0 - 0.8 * v);
            tube(curve(v), tangent(curve, v), reference, u, radius)
        });
        left.spend(taken);
    }
    plan
}
