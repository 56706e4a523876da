//! A log cabin beside one large, detailed tree, after the cabin scene of Ganestam and Doggett 2012, which
//! has 422,635 triangles: the path ends right before the tree.

use super::{
    curve::tube,
    fairy::spiral,
    foliage::tree,
    math::{circle, noise, sin_cos_turns, turbulence},
    piece::{Budget, EDGES, Patch, Plan, Wrap, capped, capped_len, caps, cells},
    random::Random,
};
use crate::{Environment, Light, LightKind, Material};
use glam::{DMat3, DVec3, Vec3};

const MEADOW: u32 = 0;
// Bark and two kinds of leaves are 1 to 3, as trees expect.
const LOG: u32 = 4;
const SHINGLE: u32 = 5;
const PLANK: u32 = 6;
const STONE: u32 = 7;
const GRASS: u32 = 8;

/// Half the side of the meadow in metres.
const GROUND: f64 = 16.0;
/// Half the length (X) and half the width (Z) of the cabin.
const HALF: [f64; 2] = [3.0, 2.2];
/// Height of the walls, and how far the ridge is above.
const WALL: f64 = 2.4;
const RISE: f64 = 1.7;
/// The cabin's middle, and the tree's.
const CABIN: DVec3 = DVec3::new(-3.2, 0.0, -1.0);
const TREE: DVec3 = DVec3::new(2.6, 0.0, 1.2);
/// Radius of a log.
const LOG_RADIUS: f64 = 0.12;

fn materials() -> Vec<Material> {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    vec![
        matte("meadow", 0.25, 0.30, 0.12),
        matte("bark", 0.25, 0.17, 0.10),
        matte("leaves", 0.12, 0.32, 0.06),
        matte("young leaves", 0.30, 0.45, 0.08),
        matte("logs", 0.42, 0.28, 0.16),
        matte("shingles", 0.30, 0.20, 0.16),
        Material { roughness: 0.4, ..matte("planks", 0.48, 0.34, 0.20) },
        matte("stones", 0.45, 0.43, 0.40),
        matte("grass", 0.24, 0.40, 0.12),
    ]
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let path = spiral([-0.3, 0.3], [13.0, 3.0], [4.6, 2.4], TREE.as_vec3().with_y(2.4));
    let mut plan = Plan::new(materials(), path.frame(0), Environment::DAYLIGHT);
    plan.path = Some(path);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(-0.5, -0.75, -0.35).normalize(),
        intensity: Vec3::splat(3.0),
    });
    plan.crease = Some(EDGES);
    let mut budget = Budget::new(triangles, 1.0);
    let ground = cells(budget.share(0.07), 1.0, [3, 3]);
    budget.spend(plan.grid(MEADOW, ground, Wrap::No, move |u, v| {
        let (x, z) = (GROUND * (2.0 * u - 1.0), GROUND * (1.0 - 2.0 * v));
        DVec3::new(x, height(x, z, seed), z)
    }));
    let share = budget.share(0.16);
    budget.spend(logs(&mut plan, share, seed));
    let share = budget.share(0.10);
    budget.spend(roof(&mut plan, share, seed));
    plan.piece(PLANK, planks);
    budget.spend(12 * PLANKS.len());
    let share = budget.share(0.05);
    budget.spend(stones(&mut plan, share, seed));
    let share = budget.share(0.52);
    budget.spend(tree(&mut plan, share, TREE - DVec3::Y * 0.05, &mut Random::new(seed, 900)));
    let blades = budget.left() / 2;
    plan.piece(GRASS, move || grass(blades, seed));
    plan
}

fn height(x: f64, z: f64, seed: u64) -> f64 {
    0.25 * turbulence(DVec3::new(x, 0.0, z) * 0.3, seed) - 0.12
}

/// Walls of logs, laid crosswise at the corners, with a doorway.
fn logs(plan: &mut Plan, share: usize, seed: u64) -> usize {
    let courses = (share / 600).clamp(2, 11);
    let step = WALL / courses as f64;
    let mut spans: Vec<[DVec3; 2]> = Vec::new();
    for course in 0..courses {
        let y = step * (course as f64 + 0.5);
        let over = HALF[0] + 0.35;
        // Long walls; the front has a door from −0.6 to 0.6.
        spans.push([DVec3::new(-over, y, -HALF[1]), DVec3::new(over, y, -HALF[1])]);
        if y < 2.0 {
            spans.push([DVec3::new(-over, y, HALF[1]), DVec3::new(-0.6, y, HALF[1])]);
            spans.push([DVec3::new(0.6, y, HALF[1]), DVec3::new(over, y, HALF[1])]);
        } else {
            spans.push([DVec3::new(-over, y, HALF[1]), DVec3::new(over, y, HALF[1])]);
        }
        let over = HALF[1] + 0.35;
        for x in [-HALF[0], HALF[0]] {
            let y = y + 0.5 * step;
            spans.push([DVec3::new(x, y, -over), DVec3::new(x, y, over)]);
        }
    }
    let radius = (0.55 * step).max(LOG_RADIUS);
    let mut budget = Budget::new(share, spans.len() as f64);
    for (k, [from, to]) in spans.into_iter().enumerate() {
        let size = caps(budget.share(1.0), 0.4, [5, 3]);
        budget.spend(capped_len(size));
        let along = (to - from).normalize();
        plan.piece(LOG, move || {
            capped(size, &|u, v| {
                // The ends are flat: the first and last ring stand where the log ends.
                let t = (1.06 * v - 0.03).clamp(0.0, 1.0);
                let rough = noise(DVec3::new(6.0 * u, 14.0 * t, k as f64 * 3.7), seed);
                let end = (v / 0.03).min((1.0 - v) / 0.03).clamp(0.0, 1.0);
                let radius = radius * (1.0 + 0.10 * rough) * end.sqrt();
                CABIN + tube(from.lerp(to, t), along, DVec3::Y, -u, radius)
            })
        });
    }
    share - budget.left()
}

/// A gabled roof of shingles, each a thin box.
fn roof(plan: &mut Plan, share: usize, seed: u64) -> usize {
    let shingles = (share / 24).max(4);
    // Twice as many along the ridge as down the slope.
    let rows = super::math::whole((shingles as f64 / 2.4).sqrt()).max(2);
    let columns = (shingles / rows).max(2);
    plan.piece(SHINGLE, move || {
        let mut patch = Patch::default();
        let mut random = Random::new(seed, 910);
        let (half_x, half_z) = (HALF[0] + 0.6, HALF[1] + 0.5);
        for side in [-1.0, 1.0] {
            let eave = DVec3::new(0.0, WALL - 0.35, side * half_z);
            let ridge = DVec3::new(0.0, WALL + RISE, 0.0);
            let down = (eave - ridge).normalize();
            let out = DVec3::X.cross(down) * side;
            let axes = DMat3::from_cols(DVec3::X, out, down);
            let (width, length) = (half_x / columns as f64, (eave - ridge).length() / rows as f64);
            for row in 0..rows {
                for column in 0..columns {
                    let t = (row as f64 + 0.5) / rows as f64;
                    let shift = if row % 2 == 0 { 0.25 } else { -0.25 };
                    let x = half_x * (2.0 * (column as f64 + 0.5 + shift) / columns as f64 - 1.0);
                    let lift = 0.03 + random.range(0.0, 0.02);
                    let center = CABIN + ridge.lerp(eave, t) + DVec3::X * x + out * lift;
                    let half = DVec3::new(0.92 * width, 0.012, 0.62 * length);
                    patch.cuboid(center, half, axes);
                }
            }
        }
        patch
    });
    24 * rows * columns
}

/// Middle and half extents of boxes: gables, door, porch, posts, bench, chimney.
const PLANKS: [[f64; 6]; 12] = [
    [0.0, 1.0, 2.14, 0.58, 1.0, 0.04],
    [0.0, 0.06, 3.1, 2.0, 0.06, 0.8],
    [-1.8, 1.1, 3.8, 0.07, 1.1, 0.07],
    [1.8, 1.1, 3.8, 0.07, 1.1, 0.07],
    [0.0, 2.24, 3.2, 2.1, 0.04, 0.8],
    [-1.9, 0.45, 2.6, 0.5, 0.03, 0.2],
    [-2.3, 0.22, 2.6, 0.04, 0.22, 0.16],
    [-1.5, 0.22, 2.6, 0.04, 0.22, 0.16],
    [0.0, 2.5, 0.0, 2.9, 0.06, 2.1],
    [0.0, 4.06, 0.0, 3.4, 0.05, 0.09],
    [2.1, 3.6, -0.9, 0.3, 1.2, 0.3],
    [0.0, 0.02, 0.0, 2.9, 0.05, 2.1],
];

fn planks() -> Patch {
    let mut patch = Patch::default();
    for [x, y, z, a, b, c] in PLANKS {
        let center = CABIN + DVec3::new(x, y, z);
        patch.cuboid(center, DVec3::new(a, b, c), DMat3::IDENTITY);
    }
    patch
}

/// Field stones around the house and along the way to its door.
fn stones(plan: &mut Plan, share: usize, seed: u64) -> usize {
    let count = (share / 160).clamp(1, 140);
    let mut budget = Budget::new(share, count as f64);
    let mut random = Random::new(seed, 920);
    for k in 0..count {
        let around = random.unit();
        let way = circle(around) * random.range(4.2, 9.0);
        let (x, z) = (CABIN.x + way.x, CABIN.z + way.z);
        let center = DVec3::new(x, height(x, z, seed) + 0.03, z);
        let half =
            DVec3::new(random.range(0.1, 0.3), random.range(0.08, 0.2), random.range(0.1, 0.3));
        let size = caps(budget.share(1.0), 1.2, [5, 3]);
        budget.spend(capped_len(size));
        plan.piece(STONE, move || {
            capped(size, &|u, v| {
                let (sin, cos) = sin_cos_turns(0.5 * v);
                let p = circle(-u) * sin.max(0.0) - DVec3::Y * cos;
                let bumps = 1.0 + 0.25 * turbulence(p * 1.3 + DVec3::splat(k as f64 * 9.1), seed);
                center + p * half * bumps
            })
        });
    }
    share - budget.left()
}

/// Blades of two triangles on the meadow, none in the house.
fn grass(blades: usize, seed: u64) -> Patch {
    let mut patch = Patch::default();
    let mut random = Random::new(seed, 930);
    for _ in 0..blades {
        let (x, z) = loop {
            let p = [random.range(-GROUND, GROUND), random.range(-GROUND, GROUND)];
            let [dx, dz] = [(p[0] - CABIN.x).abs(), (p[1] - CABIN.z).abs()];
            if dx > HALF[0] || dz > HALF[1] {
                break (p[0], p[1]);
            }
        };
        let root = DVec3::new(x, height(x, z, seed) - 0.01, z);
        let lean = circle(random.unit());
        let side = DVec3::new(-lean.z, 0.0, lean.x) * random.range(0.006, 0.014);
        let tip = root + DVec3::Y * random.range(0.1, 0.35) + lean * 0.12;
        patch.quad([root - side, root + side, tip + side * 0.2, tip - side * 0.2]);
    }
    patch
}
