//! Long thin industrial geometry, like the Power Plant: pipe runs with bends, racks of beams and
//! a few vessels.

use super::{
    curve::tube,
    math::{circle, sin_cos_turns},
    piece::{Budget, Patch, Plan, Wrap, cells},
    random::Random,
};
use crate::{Camera, Environment, Light, LightKind, Material};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::to_u32;

const STEEL: u32 = 0;
const BEAM: u32 = 3;
const GLASS: u32 = 4;
const LAMP: u32 = 5;
const FLOOR: u32 = 6;

/// The hall: half extents in X and Z, and its height, in metres.
const HALL: DVec3 = DVec3::new(40.0, 24.0, 25.0);
/// Straight legs of a run, each one ring of long quads, and rings of the bends between them.
const LEGS: usize = 4;
const BEND_STEPS: usize = 5;

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    let materials = vec![
        Material::metal("steel", Vec3::splat(0.65), 0.25),
        Material { roughness: 0.5, ..matte("red paint", 0.5, 0.08, 0.05) },
        Material { roughness: 0.5, ..matte("blue paint", 0.1, 0.2, 0.5) },
        matte("beam", 0.45, 0.4, 0.1),
        Material::glass("gauge glass", 1.5),
        Material::emitter("lamp", Vec3::splat(40.0)),
        matte("concrete", 0.4, 0.4, 0.4),
    ];
    let camera =
        Camera::look_at(Vec3::new(-38.0, 9.0, -22.0), Vec3::new(5.0, 9.0, 4.0), Vec3::Y, 1.0);
    let mut plan = Plan::new(materials, camera, Environment::DAYLIGHT);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.5, -0.8, 0.3).normalize(),
        intensity: Vec3::splat(2.0),
    });
    plan.piece(FLOOR, || {
        let mut patch = Patch::default();
        let (x, z) = (HALL.x + 2.0, HALL.z + 2.0);
        patch.quad([[-x, z], [x, z], [x, -z], [-x, -z]].map(|[x, z]| DVec3::new(x, 0.0, z)));
        patch
    });
    let mut budget = Budget::new(triangles - 2, 1.0);
    let mut random = Random::new(seed, 1);
    let vessels = (triangles / 20_000).clamp(1, 12);
    for k in 0..vessels {
        let share = budget.share(0.06 / vessels as f64);
        let material = [STEEL, GLASS, LAMP][k % 3];
        let size = if material == LAMP { 0.6 } else { random.range(1.2, 2.5) };
        let center = DVec3::new(
            random.range(-0.8, 0.8) * HALL.x,
            if material == LAMP { HALL.y - 1.0 } else { size * 1.6 },
            random.range(-0.8, 0.8) * HALL.z,
        );
        budget.spend(plan.grid(material, cells(share, 1.0, [6, 4]), Wrap::U, move |u, v| {
            let (sin, cos) = sin_cos_turns(0.5 * v);
            center + circle(-u) * (size * sin.max(0.0)) - DVec3::Y * (1.6 * size * cos)
        }));
    }
    // Runs come in bundles of parallel pipes.
    let around = if triangles < 20_000 { 4 } else { 12 };
    let each = 2 * around * (LEGS + (LEGS - 1) * BEND_STEPS);
    let runs = (budget.share(0.82) / each).max(1);
    budget.spend(runs * each);
    let scale = (300.0 / runs as f64).sqrt().clamp(0.03, 1.0);
    let mut made = 0;
    let mut bundle = 0;
    while made < runs {
        let mut random = Random::new(seed, 10_000 + bundle);
        let pipes = (2 + random.below(7)).min(runs - made);
        let radius = random.range(0.08, 0.3) * scale;
        let path = path(&mut random);
        let material = STEEL + to_u32(random.below(3));
        for pipe in 0..pipes {
            let offset = pipe as f64 * 2.6 * radius;
            plan.piece(material, move || run(&path, around, radius, offset));
        }
        made += pipes;
        bundle += 1;
    }
    // Beams are the smallest parts, so they make up what the others left.
    let beams = budget.share(1.0) / 12;
    plan.piece(BEAM, move || racks(beams, seed));
    plan
}

/// The corners of a run: mostly along the axes, some askew.
fn path(random: &mut Random) -> [DVec3; LEGS + 1] {
    let mut corners = [DVec3::ZERO; LEGS + 1];
    let low = DVec3::new(-HALL.x, 0.5, -HALL.z);
    let high = DVec3::new(HALL.x, HALL.y, HALL.z);
    let mut at = DVec3::new(
        random.range(low.x, high.x),
        random.range(low.y, high.y),
        random.range(low.z, high.z),
    );
    let skew = if random.below(4) == 0 { 0.35 } else { 0.0 };
    let mut axis = random.below(3);
    for corner in &mut corners {
        *corner = at;
        let mut next = at;
        next[axis] = random.range(low[axis], high[axis]);
        // A leg is never so short that its bends overlap.
        if (next[axis] - at[axis]).abs() < 4.0 {
            let inward = if at[axis] > 0.5 * (low[axis] + high[axis]) { -6.0 } else { 6.0 };
            next[axis] = at[axis] + inward;
        }
        let side = (axis + 1) % 3;
        next[side] += skew * random.range(-1.0, 1.0) * (next[axis] - at[axis]).abs();
        at = next.clamp(low, high);
        axis = (axis + 1 + random.below(2)) % 3;
    }
    corners
}

/// A tube along a path whose corners are rounded, moved sideways by `offset`.
fn run(path: &[DVec3; LEGS + 1], around: usize, radius: f64, offset: f64) -> Patch {
    let reference = DVec3::new(0.31, 0.87, 0.38);
    let shift = DVec3::new(1.0, 0.6, -1.0).normalize() * offset;
    let bend = (6.0 * radius).min(1.2);
    // Ring centers with their directions.
    let mut rings = vec![(path[0], (path[1] - path[0]).normalize())];
    for k in 1..LEGS {
        let before = (path[k] - path[k - 1]).normalize();
        let after = (path[k + 1] - path[k]).normalize();
        let (from, to) = (path[k] - before * bend, path[k] + after * bend);
        for step in 0..=BEND_STEPS {
            // A quadratic Bézier curve with the corner as its middle point.
            let t = step as f64 / BEND_STEPS as f64;
            let (a, b) = (from.lerp(path[k], t), path[k].lerp(to, t));
            rings.push((a.lerp(b, t), before.lerp(after, t).try_normalize().unwrap_or(after)));
        }
    }
    rings.push((path[LEGS], (path[LEGS] - path[LEGS - 1]).normalize()));
    super::piece::rings(&rings, around, |center, direction, around| {
        tube(center + shift, direction, reference, around, radius)
    })
}

/// Posts and girders in regular frames, as boxes.
fn racks(count: usize, seed: u64) -> Patch {
    let mut patch = Patch::default();
    let mut random = Random::new(seed, 2);
    for k in 0..count {
        let along = k % 3;
        let mut center = DVec3::new(
            (random.below(17) as f64 / 8.0 - 1.0) * HALL.x,
            (0.5 + random.below(6) as f64) / 6.0 * HALL.y,
            (random.below(11) as f64 / 5.0 - 1.0) * HALL.z,
        );
        // Levels of gratings lie close together where there are many.
        center.y += random.range(-0.5, 0.5);
        let mut half = DVec3::splat(random.range(0.02, 0.12));
        half[along] = [HALL.x / 8.0, HALL.y / 12.0, HALL.z / 5.0][along];
        patch.cuboid(center, half, DMat3::IDENTITY);
    }
    patch
}
