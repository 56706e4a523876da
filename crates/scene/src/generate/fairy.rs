//! Figures with wings on a forest floor, after the fairy scene of Ganestam and Doggett 2012, which
//! has 174,117 triangles: small detail all over the image, and a path that turns around the middle while
//! it comes nearer.

use super::{
    foliage::tree,
    lathe::{Point, Profile, ball, turned},
    math::{circle, sin_cos_turns, smoothstep, turbulence},
    piece::{Budget, EDGES, Patch, Plan, ROUND, Wrap, capped, capped_len, caps, cells},
    random::Random,
};
use crate::{CameraKey, CameraPath, Environment, Light, LightKind, Material};
use glam::{DQuat, DVec3, Vec3};
use niwaki_core::to_u32;

const MOSS: u32 = 0;
// Bark and two kinds of leaves are 1 to 3, as trees expect.
const GRASS: u32 = 4;
const STEM: u32 = 5;
const CAP: u32 = 6;
const SKIN: u32 = 7;
const DRESS: u32 = 8;
const HAIR: u32 = 10;
const WING: u32 = 11;

/// Half the side of the ground in metres.
const GROUND: f64 = 6.0;

fn materials() -> Vec<Material> {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    let glossy = |name, r, g, b| Material { roughness: 0.3, ..matte(name, r, g, b) };
    vec![
        matte("moss", 0.20, 0.26, 0.08),
        matte("bark", 0.25, 0.17, 0.10),
        matte("leaves", 0.12, 0.32, 0.06),
        matte("young leaves", 0.30, 0.45, 0.08),
        matte("grass", 0.22, 0.42, 0.10),
        matte("stem", 0.75, 0.70, 0.60),
        glossy("cap", 0.60, 0.08, 0.05),
        matte("skin", 0.75, 0.52, 0.42),
        matte("blue dress", 0.18, 0.30, 0.65),
        matte("violet dress", 0.45, 0.20, 0.55),
        glossy("hair", 0.55, 0.33, 0.10),
        glossy("wings", 0.70, 0.80, 0.85),
    ]
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let path = spiral([0.0, 0.85], [4.6, 1.3], [1.9, 1.0], Vec3::Y * 0.7);
    let mut plan = Plan::new(materials(), path.frame(0), Environment::DAYLIGHT);
    plan.path = Some(path);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.35, -0.85, 0.3).normalize(),
        intensity: Vec3::splat(2.8),
    });
    plan.crease = Some(EDGES);
    let mut budget = Budget::new(triangles, 1.0);
    let ground = cells(budget.share(0.14), 1.0, [3, 3]);
    budget.spend(plan.grid(MOSS, ground, Wrap::No, move |u, v| {
        let (x, z) = (GROUND * (2.0 * u - 1.0), GROUND * (1.0 - 2.0 * v));
        DVec3::new(x, height(x, z, seed), z)
    }));
    plan.crease = Some(ROUND);
    let share = budget.share(0.30);
    budget.spend(figures(&mut plan, share, seed));
    let share = budget.share(0.14);
    budget.spend(mushrooms(&mut plan, share, seed));
    plan.crease = Some(EDGES);
    let share = budget.share(0.16);
    let trees = (share / 4_000).clamp(1, 7);
    let mut each = Budget::new(share, trees as f64);
    for k in 0..trees {
        // A ring around the clearing.
        let (sin, cos) = sin_cos_turns(k as f64 / trees as f64 + 0.07);
        let (x, z) = (5.3 * cos, 5.3 * sin);
        let mut random = Random::new(seed, 500 + k as u64);
        let share = each.share(1.0);
        let foot = DVec3::new(x, height(x, z, seed) - 0.05, z);
        each.spend(tree(&mut plan, share, foot, &mut random));
    }
    budget.spend(share - each.left());
    // The rest is grass, of four triangles a blade.
    let blades = budget.left() / 4;
    plan.piece(GRASS, move || grass(blades, seed));
    plan
}

/// A path of 100 frames around a target, from and to so many turns; distance and height go from `from`
/// to `to`.
pub(super) fn spiral(turns: [f64; 2], from: [f32; 2], to: [f32; 2], target: Vec3) -> CameraPath {
    const KEYS: u8 = 9;
    let key = |k: u8| {
        let share = f32::from(k) / f32::from(KEYS - 1);
        let [distance, height] = [0, 1].map(|i| from[i] + (to[i] - from[i]) * share);
        let around = circle(turns[0] + (turns[1] - turns[0]) * f64::from(share)).as_vec3();
        let position = target.with_y(height) + around * distance;
        CameraKey { position, target, vertical_fov: 0.75 }
    };
    CameraPath { frames: 100, ..CameraPath::new((0..KEYS).map(key).collect(), false) }
}

/// The ground's height: even in the clearing, rising towards the trees.
fn height(x: f64, z: f64, seed: u64) -> f64 {
    let p = DVec3::new(x, 0.0, z);
    0.16 * turbulence(p * 0.9, seed) + 0.35 * smoothstep(3.0, 7.0, p.length()) - 0.08
}

/// Five figures in a ring, who look at its middle.
fn figures(plan: &mut Plan, share: usize, seed: u64) -> usize {
    let count = (share / 1_500).clamp(1, 5);
    let mut budget = Budget::new(share, count as f64);
    for k in 0..count {
        let mut random = Random::new(seed, 600 + k as u64);
        let turns = k as f64 / count as f64 + random.range(-0.03, 0.03);
        let around = circle(turns);
        let place = around * (if count == 1 { 0.0 } else { random.range(0.9, 1.2) });
        let foot = DVec3::new(place.x, height(place.x, place.z, seed) + 0.02, place.z);
        // Faces −X by itself, which is inward at no turns.
        let turn =
            DQuat::from_mat3(&glam::DMat3::from_cols(around, DVec3::Y, around.cross(DVec3::Y)));
        let size = random.range(0.9, 1.15);
        let arms = random.range(0.0, 0.5);
        let share = budget.share(1.0);
        let dress = DRESS + to_u32(k % 2);
        budget.spend(figure(plan, share, dress, arms, move |p| foot + turn * (p * size)));
    }
    share - budget.left()
}

/// A figure 1.2 metres tall that faces −X, of about `share` triangles.
fn figure(
    plan: &mut Plan,
    share: usize,
    dress: u32,
    arms: f64,
    place: impl Fn(DVec3) -> DVec3 + Copy + Send + Sync + 'static,
) -> usize {
    let mut budget = Budget::new(share, 1.0);
    // From the hem over waist and shoulders to the neck.
    let profile = Profile::new(&[
        (0.0, 0.34, 0.0),
        (0.27, 0.30, 0.02),
        (0.22, 0.45, 0.0),
        (0.075, 0.66, 0.0),
        (0.12, 0.80, 0.0),
        (0.09, 0.90, 0.0),
        (0.035, 0.94, 0.02),
        (0.0, 0.95, 0.0),
    ]);
    let size = caps(budget.share(0.30), 1.6, [6, 4]);
    budget.spend(capped_len(size));
    plan.piece(dress, move || {
        profile.lathe(size, &|p, u| {
            // Folds, deepest at the hem.
            let (_, fold) = sin_cos_turns(11.0 * u);
            let depth = 0.10 * smoothstep(0.6, 0.32, p.y);
            place(turned(glam::DVec2::new(p.x * (1.0 + depth * fold), p.y), u))
        })
    });
    let mut round = |weight: f64, material: u32, center: DVec3, half: DVec3| {
        let size = caps(budget.share(weight), 1.2, [5, 3]);
        budget.spend(capped_len(size));
        plan.piece(material, move || {
            capped(size, &|u, v| {
                let (sin, cos) = sin_cos_turns(0.5 * v);
                let p = circle(-u) * sin.max(0.0) - DVec3::Y * cos;
                place(center + p * half)
            })
        });
    };
    let head = DVec3::new(-0.01, 1.07, 0.0);
    round(0.12, SKIN, head, DVec3::new(0.095, 0.12, 0.085));
    round(0.10, HAIR, head + DVec3::new(0.03, 0.025, 0.0), DVec3::new(0.105, 0.125, 0.1));
    round(0.03, HAIR, head + DVec3::new(0.12, 0.09, 0.0), DVec3::splat(0.05));
    // Limbs: from joint to joint to end.
    let lift = 0.45 * arms;
    let limbs = [
        ([0.0, 0.86, 0.11], [-0.06, 0.70 + 0.4 * lift, 0.24], [-0.20, 0.66 + lift, 0.27]),
        ([0.0, 0.86, -0.11], [-0.05, 0.68, -0.22], [-0.18, 0.60, -0.25]),
        ([0.0, 0.42, 0.07], [-0.01, 0.22, 0.08], [0.0, 0.03, 0.08]),
        ([0.0, 0.42, -0.07], [-0.03, 0.22, -0.08], [0.02, 0.03, -0.08]),
    ];
    for joints in limbs {
        let [a, b, c] = [joints.0, joints.1, joints.2].map(DVec3::from);
        let size = cells(budget.share(0.05), 0.5, [4, 2]);
        let reference = if (c - a).normalize().y.abs() > 0.8 { DVec3::X } else { DVec3::Y };
        budget.spend(plan.grid(SKIN, size, Wrap::U, move |u, v| {
            let bend = |v: f64| a.lerp(b, v).lerp(b.lerp(c, v), v);
            let tangent = super::curve::tangent(bend, v);
            let radius = 0.034 - 0.012 * v;
            place(super::curve::tube(bend(v), tangent, reference, u, radius))
        }));
    }
    // Two pairs of wings behind the back.
    for (side, upper) in [(1.0, true), (-1.0, true), (1.0, false), (-1.0, false)] {
        let size = cells(budget.share(0.0625), 1.0, [3, 3]);
        budget.spend(plan.grid(WING, size, Wrap::No, move |u, v| {
            let length = if upper { 0.62 } else { 0.42 };
            let (sin, _) = sin_cos_turns(0.5 * u);
            let width = (0.02 + 0.18 * sin.max(0.0)) * (1.0 - 0.3 * u);
            let rise = if upper { 0.55 } else { -0.25 };
            let across = (v - 0.5) * 2.0 * width;
            let (ripple, _) = sin_cos_turns(3.0 * u + 2.0 * v);
            place(DVec3::new(
                0.09 + 0.20 * u + 0.008 * ripple,
                0.82 + rise * u * length + across,
                side * (0.03 + length * u),
            ))
        }));
    }
    share - budget.left()
}

/// Toadstools among the figures.
fn mushrooms(plan: &mut Plan, share: usize, seed: u64) -> usize {
    let count = (share / 450).clamp(1, 55);
    let mut budget = Budget::new(share, count as f64);
    let mut random = Random::new(seed, 700);
    for _ in 0..count {
        let (place, size) = loop {
            let p = DVec3::new(random.range(-1.0, 1.0), 0.0, random.range(-1.0, 1.0)) * 3.6;
            if p.length() > 0.25 && p.length() < 3.6 {
                break (p, random.range(0.5, 1.3));
            }
        };
        let foot = DVec3::new(place.x, height(place.x, place.z, seed) - 0.02, place.z);
        let stem = cells(budget.share(0.35), 0.8, [4, 2]);
        budget.spend(plan.grid(STEM, stem, Wrap::U, move |u, v| {
            let radius = 0.03 + 0.02 * (1.0 - v) * (1.0 - v);
            foot + (circle(-u) * radius + DVec3::Y * (0.24 * v)) * size
        }));
        let mut points: Vec<Point> = vec![(0.0, 0.22, 0.0), (0.13, 0.19, 0.01)];
        points.extend(ball(0.2, 0.14, 0.27));
        let profile = Profile::new(&points);
        let cap = caps(budget.share(0.65), 1.3, [5, 3]);
        budget.spend(capped_len(cap));
        plan.piece(CAP, move || profile.lathe(cap, &|p, u| foot + turned(p, u) * size));
    }
    share - budget.left()
}

/// Blades of four triangles, bent by their own weight.
fn grass(blades: usize, seed: u64) -> Patch {
    let mut patch = Patch::default();
    let mut random = Random::new(seed, 800);
    for _ in 0..blades {
        let (x, z) = (random.range(-GROUND, GROUND), random.range(-GROUND, GROUND));
        let root = DVec3::new(x, height(x, z, seed) - 0.01, z);
        let lean = circle(random.unit());
        let side = DVec3::new(-lean.z, 0.0, lean.x) * random.range(0.004, 0.009);
        let tall = random.range(0.08, 0.26);
        let middle = root + DVec3::Y * (0.6 * tall) + lean * (0.12 * tall);
        let tip = root + DVec3::Y * tall + lean * (0.5 * tall);
        patch.quad([root - side, root + side, middle + side * 0.8, middle - side * 0.8]);
        patch.quad([middle - side * 0.8, middle + side * 0.8, tip + side * 0.2, tip - side * 0.2]);
    }
    patch
}
