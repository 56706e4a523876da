//! Trees with leaves around a walled yard, like San Miguel: many tiny overlapping triangles over
//! few large ones.

use super::{
    curve::tube,
    math::{circle, sin_cos_turns, smoothstep, turbulence},
    piece::{Budget, Patch, Plan, Wrap, cells, rings},
    random::Random,
};
use crate::{Camera, Environment, Light, LightKind, Material};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::to_u32;

const GROUND: u32 = 0;
const BARK: u32 = 1;
const LEAF: u32 = 2;
const WALL: u32 = 4;
const WATER: u32 = 5;
const BRASS: u32 = 6;
const LAMP: u32 = 7;

/// Half the side of the yard in metres.
pub(super) const YARD: f64 = 14.0;

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    let materials = vec![
        matte("ground", 0.4, 0.33, 0.25),
        matte("bark", 0.25, 0.17, 0.1),
        matte("leaves", 0.12, 0.32, 0.06),
        matte("young leaves", 0.3, 0.45, 0.08),
        matte("yellow wall", 0.75, 0.6, 0.3),
        Material { ior: 1.33, ..Material::glass("water", 1.33) },
        Material::metal("brass", Vec3::new(0.9, 0.7, 0.35), 0.1),
        Material::emitter("lantern", Vec3::new(25.0, 18.0, 10.0)),
    ];
    let camera =
        Camera::look_at(Vec3::new(-10.5, 1.8, -10.0), Vec3::new(2.0, 3.0, 1.5), Vec3::Y, 1.0);
    let mut plan = Plan::new(materials, camera, Environment::DAYLIGHT);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.45, -0.8, 0.25).normalize(),
        intensity: Vec3::splat(3.0),
    });
    plan.piece(WALL, walls);
    let mut budget = Budget::new(triangles - 48, 1.0);
    let ground = cells(budget.share(0.08), 1.0, [2, 2]);
    budget.spend(plan.grid(GROUND, ground, Wrap::No, move |u, v| {
        let p = DVec3::new(u - 0.5, 0.0, 0.5 - v) * (2.0 * YARD);
        p + DVec3::Y * (0.12 * turbulence(p * 0.6, seed) - 0.06)
    }));
    let bowls = [(WATER, 1.15, 0.9), (BRASS, 1.3, 1.0), (LAMP, 0.18, 3.6)];
    for (material, radius, height) in bowls {
        let share = budget.share(0.01);
        budget.spend(plan.grid(material, cells(share, 2.0, [6, 3]), Wrap::U, move |u, v| {
            let (sin, cos) = sin_cos_turns(0.5 * v);
            circle(-u) * (radius * sin.max(0.0)) + DVec3::Y * (height - 0.3 * radius * cos)
        }));
    }
    let left = budget.share(1.0);
    let trees = (left / 20_000).clamp(2, 60);
    let mut each = Budget::new(left, trees as f64);
    for k in 0..trees {
        let mut random = Random::new(seed, 100 + k as u64);
        let place = loop {
            let p =
                DVec3::new(random.range(-1.0, 1.0), 0.0, random.range(-1.0, 1.0)) * (YARD - 1.5);
            // Not in the fountain, and not where the camera stands.
            if p.length() > 3.0 && p.distance(DVec3::new(-10.5, 0.0, -10.0)) > 3.5 {
                break p;
            }
        };
        let share = each.share(1.0);
        each.spend(tree(&mut plan, share, place, &mut random));
    }
    plan
}

/// Four walls of boxes around the yard.
pub(super) fn walls() -> Patch {
    let mut patch = Patch::default();
    for (x, z) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        let center = DVec3::new(x * (YARD + 0.2), 2.5, z * (YARD + 0.2));
        let thick = |on: f64| if on == 0.0 { YARD + 0.4 } else { 0.2 };
        patch.cuboid(center, DVec3::new(thick(x), 2.5, thick(z)), DMat3::IDENTITY);
    }
    patch
}

/// A branch: a bent line from a point.
#[derive(Clone, Copy)]
struct Branch {
    from: DVec3,
    direction: DVec3,
    bend: DVec3,
    length: f64,
    radius: f64,
}

impl Branch {
    fn at(&self, t: f64) -> DVec3 {
        self.from + self.direction * (self.length * t) + self.bend * (t * t)
    }

    fn tangent(&self, t: f64) -> DVec3 {
        (self.direction * self.length + self.bend * (2.0 * t)).normalize()
    }
}

/// A tree of about `share` triangles: a fifth wood, the rest leaves of two triangles.
pub(super) fn tree(plan: &mut Plan, share: usize, place: DVec3, random: &mut Random) -> usize {
    const AROUND: usize = 6;
    const STEPS: usize = 4;
    let wanted = (share / 5 / (2 * AROUND * STEPS)).max(1);
    let trunk = Branch {
        from: place,
        direction: DVec3::Y,
        bend: random.direction() * 0.5,
        length: random.range(2.2, 3.5),
        radius: random.range(0.14, 0.24),
    };
    // Breadth first, so that the budget ends with twigs missing evenly.
    let mut branches = vec![trunk];
    let mut parent = 0;
    while branches.len() < wanted {
        let p = branches[parent];
        for _ in 0..4.min(wanted - branches.len()) {
            let t = random.range(0.45, 1.0);
            let mut direction = p.tangent(t) + random.direction() * 0.9;
            direction.y = direction.y.max(-0.1);
            let length = p.length * random.range(0.45, 0.72);
            branches.push(Branch {
                from: p.at(t),
                direction: direction.try_normalize().unwrap_or(DVec3::Y),
                bend: DVec3::NEG_Y * (0.12 * length) + random.direction() * (0.2 * length),
                length,
                radius: p.radius * (1.0 - 0.5 * t) * 0.6,
            });
        }
        parent += 1;
    }
    let wood = branches.len() * 2 * AROUND * STEPS;
    let leaves = share.saturating_sub(wood) / 2;
    let seed = random.next_u64();
    // Leaves grow on the outer half of the branches; they get smaller where there are many.
    let twigs: Vec<Branch> = branches[branches.len() / 3..].to_vec();
    plan.piece(BARK, move || {
        let mut patch = Patch::default();
        for b in &branches {
            let line: Vec<(DVec3, DVec3)> = (0..=STEPS)
                .map(|i| i as f64 / STEPS as f64)
                .map(|t| (b.at(t), b.tangent(t)))
                .collect();
            let reference = b.direction.any_orthonormal_vector();
            patch.append(&rings(&line, AROUND, |center, tangent, around| {
                let t = (center - b.from).length() / b.length;
                let radius = b.radius * (1.0 - 0.5 * smoothstep(0.0, 1.0, t));
                tube(center, tangent, reference, around, radius)
            }));
        }
        patch
    });
    let size = (5.0 / (leaves.max(1) as f64).sqrt()).clamp(0.012, 0.2);
    let material = LEAF + to_u32(random.below(2));
    plan.piece(material, move || {
        let mut patch = Patch::default();
        let mut random = Random::new(seed, 0);
        for _ in 0..leaves {
            let twig = &twigs[random.below(twigs.len())];
            let root = twig.at(random.range(0.3, 1.0)) + random.direction() * (2.0 * size);
            let along = random.direction();
            let side = along.any_orthonormal_vector() * (0.4 * size);
            let fold = along.cross(side) * 0.4;
            let tip = root + along * (2.0 * size);
            let middle = root + along * size + fold;
            patch.quad([root, middle - side, tip, middle + side]);
        }
        patch
    });
    wood + 2 * leaves
}
