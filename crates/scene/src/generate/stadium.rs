//! A tiny, finely tessellated teapot in the middle of a huge stadium: the case that defeats
//! uniform grids and splits in the middle of space.

use super::{
    curve::{tangent, tube},
    math::{circle, noise, sin_cos_turns, smoothstep},
    piece::{Budget, Plan, Wrap, cells},
    random::Random,
};
use crate::{Camera, Environment, Light, LightKind, Material};
use glam::{DVec3, Vec3};

const GRASS: u32 = 0;
const CONCRETE: u32 = 1;
const SEATS: u32 = 2;
const POT: u32 = 4;
const LID: u32 = 5;
const FLOODLIGHT: u32 = 6;

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    let materials = vec![
        matte("grass", 0.1, 0.3, 0.07),
        matte("concrete", 0.5, 0.5, 0.48),
        matte("blue seats", 0.08, 0.15, 0.5),
        matte("white seats", 0.75, 0.75, 0.75),
        Material::metal("teapot", Vec3::splat(0.9), 0.05),
        Material::glass("lid", 1.5),
        Material::emitter("floodlight", Vec3::splat(200.0)),
    ];
    // A quarter metre from the teapot, with a hundred metres of stadium behind it.
    let camera =
        Camera::look_at(Vec3::new(0.22, 0.2, 0.5), Vec3::new(0.0, 0.09, 0.0), Vec3::Y, 0.9);
    let mut plan = Plan::new(materials, camera, Environment::DAYLIGHT);
    plan.cameras.push(Camera::look_at(
        Vec3::new(-60.0, 28.0, -50.0),
        Vec3::new(20.0, 0.0, 10.0),
        Vec3::Y,
        1.0,
    ));
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(-0.4, -0.75, -0.5).normalize(),
        intensity: Vec3::splat(2.5),
    });
    let mut budget = Budget::new(triangles, 1.0);
    let grass = cells(budget.share(0.05), 1.5, [2, 2]);
    budget.spend(plan.grid(GRASS, grass, Wrap::No, move |u, v| {
        let p = DVec3::new((u - 0.5) * 150.0, 0.0, (0.5 - v) * 110.0);
        // Flat under the teapot.
        let bumps = 0.05 * noise(p * 0.8, seed) * smoothstep(0.3, 4.0, p.length());
        p + DVec3::Y * (bumps - 0.05 * smoothstep(0.3, 4.0, p.length()))
    }));
    // The bowl: steps swept around an oval.
    let bowl = cells(budget.share(0.06), 2.5, [12, 4]);
    let steps = bowl[1].div_ceil(2) as f64;
    budget.spend(plan.grid(CONCRETE, bowl, Wrap::U, move |u, v| {
        let step = v * steps;
        let (out, up) = (step.floor() + (step - step.floor()).min(0.5) * 2.0, step.ceil());
        let radius = 1.0 + 0.7 * out / steps;
        let c = circle(-u);
        DVec3::new(70.0 * radius * c.x, 30.0 * up / steps, 50.0 * radius * c.z)
    }));
    let lamps = 4;
    for k in 0..lamps {
        let share = budget.share(0.01);
        let (sin, cos) = sin_cos_turns((k as f64 + 0.5) / lamps as f64);
        let center = DVec3::new(105.0 * cos, 42.0, 78.0 * sin);
        budget.spend(plan.grid(FLOODLIGHT, cells(share, 2.0, [6, 3]), Wrap::U, move |u, v| {
            let (sin, cos) = sin_cos_turns(0.5 * v);
            center + circle(-u) * (2.0 * sin.max(0.0)) - DVec3::Y * (2.0 * cos)
        }));
    }
    let seats = budget.share(0.25) / 12;
    let mut random = Random::new(seed, 1);
    for block in 0..2_u32 {
        let count = if block == 0 { seats / 2 } else { seats - seats / 2 };
        let stream = random.next_u64();
        plan.piece(SEATS + block, move || seat_block(count, stream));
    }
    budget.spend(12 * seats);
    teapot(&mut plan, &mut budget);
    plan
}

/// Seats as boxes that look at the field.
fn seat_block(count: usize, stream: u64) -> super::piece::Patch {
    let mut patch = super::piece::Patch::default();
    let mut random = Random::new(stream, 0);
    for _ in 0..count {
        let row = random.unit();
        let (sin, cos) = sin_cos_turns(random.unit());
        let radius = 1.03 + 0.66 * row;
        let center = DVec3::new(70.0 * radius * cos, 30.0 * row + 1.0, 50.0 * radius * sin);
        let forward = DVec3::new(-cos, 0.0, -sin);
        let axes = glam::DMat3::from_cols(forward.cross(DVec3::Y), DVec3::Y, -forward);
        patch.cuboid(center, DVec3::new(0.22, 0.4, 0.2), axes);
    }
    patch
}

/// Body, lid, spout and handle, 15 cm tall together, of whatever triangles are left.
fn teapot(plan: &mut Plan, budget: &mut Budget) {
    let total = budget.share(1.0);
    let mut parts = Budget::new(total, 1.0);
    let share = parts.share(0.15);
    parts.spend(plan.grid(LID, cells(share, 1.6, [6, 3]), Wrap::U, |u, v| {
        // A flat dome with a knob, from the rim to the axis.
        let (sin, cos) = sin_cos_turns(0.25 * v);
        let knob = 0.018 * smoothstep(0.75, 0.9, v);
        let radius = 0.055 * cos * (1.0 - 0.6 * smoothstep(0.6, 0.8, v)) + 0.3 * knob * (1.0 - v);
        circle(-u) * radius + DVec3::Y * (0.115 + 0.018 * sin + knob)
    }));
    let spout = |t: f64| DVec3::new(0.07 + 0.09 * t, 0.045 + 0.08 * t * t, 0.0);
    let share = parts.share(0.15);
    parts.spend(plan.grid(POT, cells(share, 0.8, [6, 3]), Wrap::U, move |u, v| {
        tube(spout(v), tangent(spout, v), DVec3::Z, u, 0.024 - 0.013 * v)
    }));
    let handle = |t: f64| {
        let (sin, cos) = sin_cos_turns(0.5 * t);
        DVec3::new(-0.07 - 0.06 * sin, 0.07 + 0.035 * cos, 0.0)
    };
    let share = parts.share(0.12);
    parts.spend(plan.grid(POT, cells(share, 0.5, [6, 3]), Wrap::U, move |u, v| {
        tube(handle(v), tangent(handle, v), DVec3::Z, u, 0.008)
    }));
    plan.grid(POT, cells(parts.share(1.0), 1.8, [6, 3]), Wrap::U, |u, v| {
        // From the middle of the bottom to the rim.
        let (sin, _) = sin_cos_turns(0.08 + 0.36 * v);
        let radius =
            (0.03 + 0.065 * sin) * smoothstep(0.0, 0.05, v) - 0.02 * smoothstep(0.7, 1.0, v);
        circle(-u) * radius.max(0.0)
            + DVec3::Y * (0.115 * smoothstep(0.0, 1.0, v.sqrt() * v.sqrt()))
    });
}
