//! Architecture with an interior, like Sponza and the Conference room: large walls and floor,
//! finely tessellated columns, arches, drapery and vases.

use super::{
    math::{circle, noise, sin_cos_turns, smoothstep},
    piece::{Budget, Patch, Plan, Wrap, cells},
    random::Random,
};
use crate::{Camera, Environment, Light, LightKind, Material, Motion, Wave};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::to_u32;
use std::f64::consts::FRAC_PI_2;

const FLOOR: u32 = 0;
const WALL: u32 = 1;
const COLUMN: u32 = 2;
const ARCH: u32 = 3;
const BRASS: u32 = 6;
const GLASS: u32 = 7;
const LAMP: u32 = 8;

/// Half the length (X) and half the width (Z) of the open court, and of the building, in metres.
const COURT: [f64; 2] = [14.0, 4.5];
const HOUSE: [f64; 2] = [18.0, 8.5];
const STOREY: f64 = 5.0;
const RADIUS: f64 = 0.35;

fn materials() -> Vec<Material> {
    let cloth = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    vec![
        Material { roughness: 0.3, ..cloth("polished floor", 0.45, 0.4, 0.35) },
        cloth("plaster", 0.7, 0.62, 0.5),
        cloth("column stone", 0.65, 0.6, 0.52),
        cloth("arch stone", 0.6, 0.52, 0.42),
        cloth("red drapery", 0.5, 0.06, 0.05),
        cloth("green drapery", 0.08, 0.3, 0.1),
        Material::metal("brass", Vec3::new(0.9, 0.7, 0.35), 0.1),
        Material::glass("glass", 1.5),
        Material::emitter("lamp", Vec3::new(18.0, 14.0, 9.0)),
    ]
}

/// What of the furniture a scene wants.
pub(super) struct Furniture {
    /// Vases of brass and glass along the court.
    pub(super) vases: bool,
    /// Draperies that move in the wind, each an object.
    pub(super) waving: bool,
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let camera =
        Camera::look_at(Vec3::new(-12.5, 2.2, -1.2), Vec3::new(6.0, 3.2, 1.0), Vec3::Y, 1.1);
    let mut plan = begin(camera);
    furnish(&mut plan, triangles, seed, &Furniture { vases: true, waving: false });
    plan
}

/// Materials and light without any triangle.
pub(super) fn begin(camera: Camera) -> Plan {
    let mut plan = Plan::new(materials(), camera, Environment::DAYLIGHT);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.25, -0.9, 0.2).normalize(),
        intensity: Vec3::splat(3.0),
    });
    plan
}

/// Adds the building of about `triangles` triangles, of materials in the order of [`begin`];
/// returns how many it has.
pub(super) fn furnish(
    plan: &mut Plan,
    triangles: usize,
    seed: u64,
    furniture: &Furniture,
) -> usize {
    plan.piece(WALL, shell);
    plan.piece(FLOOR, || {
        let mut patch = Patch::default();
        let [x, z] = HOUSE;
        patch.quad([[-x, z], [x, z], [x, -z], [-x, -z]].map(|[x, z]| DVec3::new(x, 0.0, z)));
        patch
    });
    let total = triangles.saturating_sub(SHELL_TRIANGLES + 2);
    let mut budget = Budget::new(total, 1.0);
    // Few, coarser pieces for small requests.
    let spans = (triangles / 4000).clamp(1, 8);
    let posts = posts(spans);
    let details = posts.len() as f64;
    let mut random = Random::new(seed, 0);
    for storey in 0..2 {
        for &[x, z] in &posts {
            let foot = DVec3::new(x, f64::from(storey) * STOREY, z);
            let share = budget.share(0.40 / (2.0 * details));
            budget.spend(column(plan, COLUMN, share, foot));
        }
        let arches = arches(spans);
        for &(from, to) in &arches {
            let base = f64::from(storey) * STOREY + 3.4;
            let share = budget.share(0.22 / (2.0 * arches.len() as f64));
            budget.spend(arch(plan, ARCH, share, from, to, base));
        }
    }
    for i in 0..spans {
        let share = budget.share(0.26 / spans as f64);
        let x = COURT[0] * (2.0 * (i as f64 + 0.5) / spans as f64 - 1.0);
        let z = if i % 2 == 0 { COURT[1] } else { -COURT[1] };
        let top = DVec3::new(x, 9.2, z);
        if furniture.waving {
            plan.object("drapery", Motion { wave: Some(wind(top, i)), ..Motion::default() });
        }
        budget.spend(drapery(plan, share, top, 4 + to_u32(i % 2), &mut random));
        plan.end_object();
    }
    let vases = if furniture.vases { spans.min(5) } else { 0 };
    for i in 0..vases {
        let share = budget.share(0.08 / vases as f64);
        let x = COURT[0] * (1.6 * (i as f64 + 0.5) / vases as f64 - 0.8);
        let material = [BRASS, GLASS][i % 2];
        budget.spend(vase(plan, share, DVec3::new(x, 0.0, random.range(-1.5, 1.5)), material));
    }
    // Without vases their triangles go to the lamp, which has enough: they are left.
    let left = if furniture.vases { budget.share(1.0) } else { budget.share(0.25) };
    let size = cells(left, 2.0, [3, 2]);
    budget.spend(plan.grid(LAMP, size, Wrap::U, |u, v| {
        let (sin, cos) = sin_cos_turns(0.5 * v);
        DVec3::new(0.0, 8.2, 0.0) + (circle(-u) * sin - DVec3::Y * cos) * 0.35
    }));
    total - budget.left() + SHELL_TRIANGLES + 2
}

/// Wind in a drapery of 4.4 metres that hangs from `top`.
fn wind(top: DVec3, number: usize) -> Wave {
    let out = if top.z > 0.0 { -0.22 } else { 0.22 };
    Wave {
        displacement: Vec3::new(0.0, 0.02, out),
        wave: Vec3::new(0.15, -0.28, 0.0),
        frequency: 0.6,
        phase: [0.0, 0.37, 0.71][number % 3],
        hold: Vec3::new(0.0, -1.0 / 4.4, 0.0),
        hold_offset: 9.2 / 4.4,
    }
}

const SHELL_TRIANGLES: usize = 12 * 8;

/// Outer walls, the floors and ceilings of the galleries and their fronts: boxes.
fn shell() -> Patch {
    let mut patch = Patch::default();
    let mut block = |x: [f64; 2], y: [f64; 2], z: [f64; 2]| {
        let min = DVec3::new(x[0], y[0], z[0]);
        let max = DVec3::new(x[1], y[1], z[1]);
        patch.cuboid((min + max) * 0.5, (max - min) * 0.5, DMat3::IDENTITY);
    };
    let ([cx, cz], [hx, hz]) = (COURT, HOUSE);
    let top = 2.0 * STOREY + 1.0;
    block([-hx - 0.4, -hx], [0.0, top], [-hz, hz]);
    block([hx, hx + 0.4], [0.0, top], [-hz, hz]);
    block([-hx, hx], [0.0, top], [-hz - 0.4, -hz]);
    block([-hx, hx], [0.0, top], [hz, hz + 0.4]);
    // The gallery's floor goes round the court.
    let y = [STOREY - 0.3, STOREY];
    block([-hx, hx], y, [-hz, -cz - RADIUS]);
    block([-hx, hx], y, [cz + RADIUS, hz]);
    block([-hx, -cx - RADIUS], y, [-cz - RADIUS, cz + RADIUS]);
    block([cx + RADIUS, hx], y, [-cz - RADIUS, cz + RADIUS]);
    patch
}

/// Where columns stand around the court.
fn posts(spans: usize) -> Vec<[f64; 2]> {
    let mut out = Vec::new();
    for i in 0..=spans {
        let x = COURT[0] * (2.0 * i as f64 / spans as f64 - 1.0);
        out.extend([[x, -COURT[1]], [x, COURT[1]]]);
    }
    out.extend([[-COURT[0], 0.0], [COURT[0], 0.0]]);
    out
}

/// Which columns arches join.
fn arches(spans: usize) -> Vec<([f64; 2], [f64; 2])> {
    let mut out = Vec::new();
    for z in [-COURT[1], COURT[1]] {
        let x = |i: usize| COURT[0] * (2.0 * i as f64 / spans as f64 - 1.0);
        out.extend((0..spans).map(|i| ([x(i), z], [x(i + 1), z])));
    }
    for x in [-COURT[0], COURT[0]] {
        out.push(([x, -COURT[1]], [x, 0.0]));
        out.push(([x, 0.0], [x, COURT[1]]));
    }
    out
}

/// A fluted column with base and capital.
pub(super) fn column(plan: &mut Plan, material: u32, share: usize, foot: DVec3) -> usize {
    plan.grid(material, cells(share, 1.2, [5, 2]), Wrap::U, move |u, v| {
        let ends = smoothstep(0.12, 0.04, v) + smoothstep(0.86, 0.97, v);
        let (_, flute) = sin_cos_turns(16.0 * u);
        let (_, ring) = sin_cos_turns(6.0 * v.min(0.1) / 0.1);
        let swell = 1.0 - 0.12 * v;
        let shaft = RADIUS * swell * (1.0 - 0.06 * (1.0 - ends) * (1.0 + flute));
        let radius = shaft * (1.0 + 0.45 * ends + 0.05 * ends * ring);
        foot + circle(-u) * radius + DVec3::Y * (3.4 * v)
    })
}

/// A round arch of square section with moulded edges, over the gap between two columns.
pub(super) fn arch(
    plan: &mut Plan,
    material: u32,
    share: usize,
    from: [f64; 2],
    to: [f64; 2],
    base: f64,
) -> usize {
    let a = DVec3::new(from[0], base, from[1]);
    let b = DVec3::new(to[0], base, to[1]);
    let along = (b - a).normalize();
    let across = along.cross(DVec3::Y);
    let half = (b - a).length() * 0.5;
    let middle = (a + b) * 0.5;
    let rise = 1.1;
    plan.grid(material, cells(share, 0.7, [4, 2]), Wrap::U, move |u, v| {
        let (sin, cos) = sin_cos_turns(0.5 * v);
        // The section is a superellipse-like square, swept along half an ellipse.
        let c = circle(-u);
        let square = 1.0 / c.x.abs().max(c.z.abs());
        let (_, mould) = sin_cos_turns(12.0 * u);
        let size = 0.3 * square * (1.0 + 0.04 * mould);
        let out = along * -cos + DVec3::Y * sin;
        middle - along * (half * cos)
            + DVec3::Y * (rise * sin)
            + out * (c.x * size)
            + across * (c.z * size)
    })
}

/// A cloth that hangs from a rod, in folds that widen downward.
pub(super) fn drapery(
    plan: &mut Plan,
    share: usize,
    top: DVec3,
    material: u32,
    random: &mut Random,
) -> usize {
    let seed = random.next_u64();
    let phase = random.unit();
    let width = random.range(1.2, 1.7);
    plan.grid(material, cells(share, 0.8, [3, 3]), Wrap::No, move |u, v| {
        let (fold, _) = sin_cos_turns(7.0 * u + phase + 0.2 * v);
        let sway = noise(DVec3::new(3.0 * u, 2.5 * v, phase * 9.0), seed);
        let x = (u - 0.5) * 2.0 * width * (1.0 - 0.15 * v);
        let z = fold * (0.05 + 0.13 * v) + sway * 0.25 * v;
        top + DVec3::new(x, -4.4 * v, z)
    })
}

/// A vase turned on a lathe.
fn vase(plan: &mut Plan, share: usize, foot: DVec3, material: u32) -> usize {
    plan.grid(material, cells(share, 1.0, [5, 3]), Wrap::U, move |u, v| {
        let (sin, cos) = sin_cos_turns(0.75 * v);
        let radius = 0.12 + 0.32 * sin.max(0.0) + 0.05 * cos.abs() + 0.1 * smoothstep(0.85, 1.0, v);
        // Closed at the bottom.
        let radius = radius * smoothstep(0.0, 0.04 / FRAC_PI_2, v);
        foot + circle(-u) * radius + DVec3::Y * (1.3 * v)
    })
}
