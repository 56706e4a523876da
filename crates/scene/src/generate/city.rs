//! Rotated blocks of houses with domes, like the Arabic and the Italian City: little lies along
//! the axes.

use super::{
    math::{circle, sin_cos_turns, turbulence, whole},
    piece::{Budget, Patch, Plan, Wrap, cells},
    random::Random,
};
use crate::{Camera, Environment, Light, LightKind, Material};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::to_u32;

const GROUND: u32 = 0;
const HOUSES: u32 = 1;
const GLASS: u32 = 4;
const GOLD: u32 = 5;
const LAMP: u32 = 6;

/// A house with its place and its boxes.
struct House {
    center: DVec3,
    half: DVec3,
    axes: DMat3,
    /// Windows along the two fronts and storeys.
    windows: [usize; 3],
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    let materials = vec![
        matte("street", 0.35, 0.32, 0.28),
        matte("sandstone", 0.65, 0.52, 0.36),
        matte("lime wash", 0.75, 0.7, 0.62),
        matte("brick", 0.5, 0.28, 0.2),
        Material::glass("windows", 1.5),
        Material::metal("gilded dome", Vec3::new(1.0, 0.78, 0.34), 0.15),
        Material::emitter("lantern", Vec3::new(30.0, 22.0, 12.0)),
    ];
    // A house takes about 60 boxes; the grid of lots grows with the request.
    let lots = whole((triangles as f64 / 1200.0).sqrt() + 0.5).clamp(2, 200);
    let pitch = 16.0;
    let size = lots as f64 * pitch;
    let eye = DVec3::new(-0.42 * size, 14.0 + 0.16 * size, 0.5 * size).as_vec3();
    let camera = Camera::look_at(eye, Vec3::new(0.0, 6.0, 0.0), Vec3::Y, 0.9);
    let mut plan = Plan::new(materials, camera, Environment::DAYLIGHT);
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.6, -0.65, -0.35).normalize(),
        intensity: Vec3::new(3.0, 2.7, 2.3),
    });
    let mut budget = Budget::new(triangles, 1.0);
    let ground = cells(budget.share(0.1), 1.0, [2, 2]);
    budget.spend(plan.grid(GROUND, ground, Wrap::No, move |u, v| {
        let p = DVec3::new(u - 0.5, 0.0, 0.5 - v) * (1.2 * size);
        p + DVec3::Y * (0.25 * turbulence(p * 0.05, seed) - 0.2)
    }));
    let mut random = Random::new(seed, 1);
    // Every district of 4 by 4 lots has a direction of its own.
    let houses_budget = budget.share(0.78);
    let mut houses = Budget::new(houses_budget, (lots * lots) as f64);
    for lot in 0..lots * lots {
        let (i, j) = (lot % lots, lot / lots);
        let mut district = Random::new(seed, 1000 + (j / 4 * lots + i / 4) as u64);
        let (sin, cos) = sin_cos_turns(district.range(0.02, 0.23) + 0.004 * random.unit());
        let axes =
            DMat3::from_cols(DVec3::new(cos, 0.0, sin), DVec3::Y, DVec3::new(-sin, 0.0, cos));
        let share = houses.share(1.0);
        let half = DVec3::new(
            random.range(3.5, 5.5),
            random.range(3.0, 8.0) + if random.below(12) == 0 { 9.0 } else { 0.0 },
            random.range(3.5, 5.5),
        );
        let jitter = DVec3::new(random.range(-1.0, 1.0), 0.0, random.range(-1.0, 1.0));
        let place = DVec3::new(i as f64 + 0.5, 0.0, j as f64 + 0.5) * pitch + jitter;
        let center = place - DVec3::new(0.5 * size, 0.0, 0.5 * size) + DVec3::Y * half.y;
        houses.spend(house(
            &mut plan,
            share,
            House { center, half, axes, windows: [0; 3] },
            &mut random,
        ));
    }
    budget.spend(houses_budget - houses.left());
    // Domes of mosques and churches, the finest geometry of the city.
    let domes = (lots * lots / 24).max(1);
    let mut domes_left = Budget::new(budget.share(1.0), domes as f64);
    for k in 0..domes {
        let share = domes_left.share(1.0);
        let place = DVec3::new(random.range(-0.45, 0.45), 0.0, random.range(-0.45, 0.45)) * size;
        let radius = random.range(3.0, 6.0);
        let material = if k % 3 == 0 { GOLD } else { HOUSES + 1 };
        let taken = plan.grid(material, cells(share, 1.5, [6, 4]), Wrap::U, move |u, v| {
            let (sin, cos) = sin_cos_turns(0.25 * v);
            let (_, rib) = sin_cos_turns(24.0 * u);
            let bulge = 1.0 + 0.25 * v * (1.0 - v) + 0.015 * rib * (1.0 - v);
            place + circle(-u) * (radius * cos * bulge) + DVec3::Y * (12.0 + 1.2 * radius * sin)
        });
        domes_left.spend(taken);
    }
    plan
}

/// A house of boxes that takes about `share` triangles: a body, a cornice, windows with frames.
fn house(plan: &mut Plan, share: usize, mut house: House, random: &mut Random) -> usize {
    let boxes = (share / 12).max(1);
    let extra = boxes.saturating_sub(2);
    // As many windows as there are boxes for, spread over storeys and fronts as they fit.
    let storeys = whole(house.half.y * 2.0 / 3.0).clamp(1, extra.max(1));
    let around = extra.div_ceil(storeys).max(1);
    house.windows = [around.div_ceil(4).max(1), storeys, extra];
    let material = HOUSES + to_u32(random.below(3));
    let lit = random.below(40) == 0;
    let taken = 12 * boxes;
    let cornice = boxes > 1;
    let glass = extra / 3;
    let body = House { ..house };
    plan.piece(material, move || {
        let mut patch = Patch::default();
        patch.cuboid(body.center, body.half, body.axes);
        if cornice {
            let half = DVec3::new(body.half.x + 0.35, 0.3, body.half.z + 0.35);
            patch.cuboid(body.center + DVec3::Y * body.half.y, half, body.axes);
        }
        windows(&mut patch, &body, glass..extra, DVec3::new(0.55, 0.85, 0.12));
        patch
    });
    if glass > 0 {
        let material = if lit { LAMP } else { GLASS };
        plan.piece(material, move || {
            let mut patch = Patch::default();
            windows(&mut patch, &house, 0..glass, DVec3::new(0.45, 0.7, 0.2));
            patch
        });
    }
    taken
}

/// Boxes on the fronts of a house, one for each number.
fn windows(patch: &mut Patch, house: &House, numbers: std::ops::Range<usize>, half: DVec3) {
    let [columns, storeys, _] = house.windows;
    for n in numbers {
        let front = n % 4;
        let column = n / 4 % columns;
        let storey = n / (4 * columns) % storeys.max(1);
        let layer = n / (4 * columns * storeys.max(1));
        let (sideways, outward) = if front % 2 == 0 { (0, 2) } else { (2, 0) };
        let sign = if front < 2 { 1.0 } else { -1.0 };
        let spread = (column as f64 + 0.5) / columns as f64 * 2.0 - 1.0;
        let mut local = DVec3::ZERO;
        local[sideways] = spread * (house.half[sideways] - 0.3);
        local[outward] = sign * (house.half[outward] + 0.05 * layer as f64);
        local.y =
            ((storey as f64 + 0.5) / storeys.max(1) as f64 * 2.0 - 1.0) * (house.half.y - 0.4);
        let narrow = (0.8 * house.half[sideways] / columns as f64).min(half.x);
        let mut size = DVec3::new(0.0, half.y.min(0.8 * house.half.y / storeys as f64), 0.0);
        size[sideways] = narrow;
        size[outward] = half.z;
        patch.cuboid(house.center + house.axes * local, size, house.axes);
    }
}
