//! A large outdoor court with trees, an arcade and laid tables: glassware with walls, wine and
//! water, after the San Miguel scene of Ganestam and Doggett 2015, §4.

use super::{
    atrium, foliage,
    glassware::{FEWEST, Vessel},
    math::{circle, sin_cos_turns, turbulence},
    piece::{Budget, EDGES, Patch, Plan, Wrap, cells},
    random::Random,
};
use crate::{Camera, CameraKey, CameraPath, Environment, Light, LightKind, Material, Motion, Wave};
use foliage::YARD;
use glam::{DMat3, DVec3, Vec3};

const GROUND: u32 = 0;
// Bark and two kinds of leaves are 1 to 3, as trees expect.
const WALL: u32 = 4;
const STONE: u32 = 5;
const WOOD: u32 = 6;
const LINEN: u32 = 7;
const CHINA: u32 = 8;
const CLEAR: u32 = 9;
const GREEN: u32 = 10;
const BLUE: u32 = 11;
const WINE: u32 = 12;
const WATER: u32 = 13;
const BANNER: u32 = 14;
const STEEL: u32 = 15;

/// Height of a table's top.
const TABLE: f64 = 0.76;
/// Half the length and half the width of a table.
const HALF: [f64; 2] = [1.1, 0.5];

fn materials() -> Vec<Material> {
    let matte = |name, r, g, b| Material::matte(name, Vec3::new(r, g, b));
    let glass = |name, ior, r, g, b| Material {
        absorption: Vec3::new(r, g, b),
        ..Material::glass(name, ior)
    };
    vec![
        matte("paving", 0.46, 0.40, 0.33),
        matte("bark", 0.25, 0.17, 0.1),
        matte("leaves", 0.12, 0.32, 0.06),
        matte("young leaves", 0.3, 0.45, 0.08),
        matte("ochre wall", 0.75, 0.6, 0.3),
        matte("arcade stone", 0.62, 0.56, 0.47),
        matte("table wood", 0.32, 0.19, 0.10),
        matte("linen", 0.80, 0.78, 0.73),
        Material { roughness: 0.0, ..matte("glazed china", 0.82, 0.82, 0.80) },
        Material::glass("clear glass", 1.5),
        // Absorption a metre; walls are two to three millimetres.
        glass("green glass", 1.52, 160.0, 40.0, 190.0),
        glass("blue glass", 1.5, 60.0, 20.0, 6.0),
        glass("red wine", 1.34, 4.0, 90.0, 75.0),
        glass("water", 1.33, 0.5, 0.1, 0.05),
        matte("banner", 0.55, 0.06, 0.05),
        Material::metal("polished steel", Vec3::new(0.62, 0.61, 0.60), 0.0),
    ]
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let camera =
        Camera::look_at(Vec3::new(-1.75, 1.35, 1.55), Vec3::new(0.25, 0.80, -0.2), Vec3::Y, 0.75);
    let mut plan = Plan::new(materials(), camera, Environment::DAYLIGHT);
    plan.path = Some(path());
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.45, -0.72, -0.45).normalize(),
        intensity: Vec3::new(3.0, 2.8, 2.5),
    });
    plan.crease = Some(EDGES);
    plan.object("walls", Motion::default());
    plan.piece(WALL, foliage::walls);
    plan.end_object();
    let mut budget = Budget::new(triangles.saturating_sub(48), 1.0);
    let ground = cells(budget.share(0.06), 1.0, [2, 2]);
    budget.spend(plan.grid(GROUND, ground, Wrap::No, move |u, v| {
        let p = DVec3::new(u - 0.5, 0.0, 0.5 - v) * (2.0 * YARD);
        p + DVec3::Y * (0.02 * turbulence(p * 0.6, seed) - 0.02)
    }));
    let share = budget.share(0.14);
    budget.spend(arcade(&mut plan, share));
    let share = budget.share(0.05);
    budget.spend(banners(&mut plan, share, seed));
    // Tables with all that stands on them; one at least.
    let share = budget.share(0.33);
    budget.spend(tables(&mut plan, share, seed));
    plan.crease = Some(EDGES);
    let left = budget.share(1.0);
    let trees = (left / 25_000).clamp(1, 24);
    let mut each = Budget::new(left, trees as f64);
    for k in 0..trees {
        let mut random = Random::new(seed, 300 + k as u64);
        let place = loop {
            let p =
                DVec3::new(random.range(-1.0, 1.0), 0.0, random.range(-1.0, 1.0)) * (YARD - 4.0);
            // Around the tables and the way to them.
            if p.length() > 6.5 && (p.x > 0.0 || p.z < 3.0) {
                break p;
            }
        };
        plan.object("tree", Motion::default());
        let share = each.share(1.0);
        each.spend(foliage::tree(&mut plan, share, place, &mut random));
    }
    plan
}

/// Columns and arches along the walls of −X and −Z.
fn arcade(plan: &mut Plan, share: usize) -> usize {
    let spans = (share / 1500).clamp(1, 6);
    let mut budget = Budget::new(share, 1.0);
    let x = |i: usize| (YARD - 2.0) * (2.0 * i as f64 / spans as f64 - 1.0);
    let inward = -(YARD - 2.5);
    let count = 2.0 * (2.0 * spans as f64 + 1.0);
    plan.end_object();
    for side in 0..2 {
        let at = |i: usize| if side == 0 { [x(i), inward] } else { [inward, x(i)] };
        for i in 0..=spans {
            let [x, z] = at(i);
            let share = budget.share(1.0 / count);
            budget.spend(atrium::column(plan, STONE, share, DVec3::new(x, 0.0, z)));
            if i < spans {
                let share = budget.share(1.0 / count);
                budget.spend(atrium::arch(plan, STONE, share, at(i), at(i + 1), 3.4));
            }
        }
    }
    share - budget.left()
}

/// Cloths that wave in the wind on poles of steel behind the tables.
fn banners(plan: &mut Plan, share: usize, seed: u64) -> usize {
    let mut budget = Budget::new(share, 2.0);
    for (k, x) in [-3.2_f32, 4.4].into_iter().enumerate() {
        let foot = DVec3::new(x.into(), 0.0, -4.2);
        let pole = cells(budget.share(0.3), 1.0, [5, 2]);
        plan.end_object();
        budget.spend(plan.grid(STEEL, pole, Wrap::U, move |u, v| {
            foot + circle(-u) * (0.035 - 0.034 * (v - 0.97).max(0.0) / 0.03) + DVec3::Y * (4.2 * v)
        }));
        let wave = Wave {
            displacement: Vec3::new(0.0, 0.03, 0.28),
            wave: Vec3::new(0.62, 0.10, 0.0),
            frequency: 1.1,
            phase: 0.43 * k as f32,
            hold: Vec3::new(1.0 / 1.9, 0.0, 0.0),
            hold_offset: -(x + 0.04) / 1.9,
        };
        plan.object("banner", Motion { wave: Some(wave), ..Motion::default() });
        let cloth = cells(budget.share(0.7), 1.6, [3, 2]);
        budget.spend(plan.grid(BANNER, cloth, Wrap::No, move |u, v| {
            let ripple = 0.03 * turbulence(DVec3::new(4.0 * u, 3.0 * v, k as f64), seed) * u;
            foot + DVec3::new(0.04 + 1.9 * u, 4.1 - 1.1 * v - 0.12 * u, ripple)
        }));
    }
    plan.end_object();
    share - budget.left()
}

/// What stands on a table: vessel, material, and where, from its middle.
fn setting(random: &mut Random) -> Vec<(Vessel, u32, [f64; 2])> {
    let mut out = vec![
        (Vessel::Carafe, BLUE, [0.05, 0.0]),
        (Vessel::Water, WATER, [0.05, 0.0]),
        (Vessel::Bottle, GREEN, [-0.28, 0.06]),
        (Vessel::Bottle, CLEAR, [0.36, -0.05]),
    ];
    for x in [-0.72, 0.0, 0.72] {
        for side in [-1.0, 1.0] {
            let place = [x + random.range(-0.02, 0.02), side * (HALF[1] - 0.17)];
            out.push((Vessel::Plate, CHINA, place));
            let glass = [place[0] + 0.18 * side, place[1] - side * 0.10];
            out.push((Vessel::WineGlass, CLEAR, glass));
            if random.unit() < 0.6 {
                out.push((Vessel::Wine, WINE, glass));
            }
            let tumbler = [place[0] + 0.26 * side, place[1] - side * 0.02];
            out.push((Vessel::Tumbler, CLEAR, tumbler));
        }
    }
    out
}

fn tables(plan: &mut Plan, share: usize, seed: u64) -> usize {
    // A fully laid table has about 25 pieces.
    let count = (share / (26 * 600)).clamp(1, 5);
    let mut budget = Budget::new(share, count as f64);
    const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [3.4, -1.2], [-1.4, -3.6], [3.0, 3.2], [-4.6, -1.0]];
    for (k, [x, z]) in PLACES.into_iter().take(count).enumerate() {
        let mut random = Random::new(seed, 200 + k as u64);
        let middle = DVec3::new(x, 0.0, z);
        let mut laid = setting(&mut random);
        // Half the triangles for the cloth where there are few.
        let share = budget.share(1.0);
        let cloth = cells(share / 8, 2.0, [4, 2]);
        laid.truncate((share.saturating_sub(60 + share / 8) / FEWEST).max(1));
        plan.crease = Some(EDGES);
        plan.object("table", Motion::default());
        plan.piece(WOOD, move || table(middle));
        plan.grid(LINEN, cloth, Wrap::No, move |u, v| {
            // Hangs over the edge on all sides.
            let drop = |t: f64, half: f64| {
                let over = (t * 2.0 - 1.0) * (half + 0.18);
                (over.clamp(-half - 0.012, half + 0.012), (over.abs() - half - 0.012).max(0.0))
            };
            let (x, dx) = drop(u, HALF[0]);
            let (z, dz) = drop(1.0 - v, HALF[1]);
            let (fold, _) = sin_cos_turns(3.0 * (u + v));
            let down = dx.max(dz);
            let out = down * (0.10 + 0.10 * fold);
            middle
                + DVec3::new(
                    x + if dx > 0.0 { out * x.signum() } else { 0.0 },
                    TABLE + 0.003 - down,
                    z + if dz > 0.0 { out * z.signum() } else { 0.0 },
                )
        });
        let fixed = 12 * 5 + 2 * cloth[0] * cloth[1];
        let weight: f64 = laid.iter().map(|(vessel, ..)| vessel.weight()).sum();
        let mut parts = Budget::new(share.saturating_sub(fixed), weight);
        for (vessel, material, [dx, dz]) in laid {
            let share = parts.share(vessel.weight());
            let lift = if vessel == Vessel::Plate { 0.0042 } else { 0.0045 };
            let foot = middle + DVec3::new(dx, TABLE + lift, dz);
            plan.object(&format!("{vessel:?}").to_lowercase(), Motion::default());
            parts.spend(vessel.build(plan, share, material, foot, 1.0));
        }
        budget.spend(share.saturating_sub(fixed) - parts.left() + fixed);
    }
    plan.end_object();
    share - budget.left()
}

/// A top on four legs: boxes.
fn table(middle: DVec3) -> Patch {
    let mut patch = Patch::default();
    // Within the bend of the cloth.
    let top = DVec3::new(HALF[0] - 0.04, 0.02, HALF[1] - 0.04);
    patch.cuboid(middle + DVec3::Y * (TABLE - 0.0201), top, DMat3::IDENTITY);
    for (x, z) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let foot = DVec3::new(x * (HALF[0] - 0.08), 0.36, z * (HALF[1] - 0.08));
        patch.cuboid(middle + foot, DVec3::new(0.035, 0.36, 0.035), DMat3::IDENTITY);
    }
    patch
}

/// From the table to the middle of the court and around.
fn path() -> CameraPath {
    let key = |x: f32, y: f32, z: f32, tx: f32, ty: f32, tz: f32| CameraKey {
        position: Vec3::new(x, y, z),
        target: Vec3::new(tx, ty, tz),
        vertical_fov: 0.75,
    };
    CameraPath::new(
        vec![
            key(-1.75, 1.35, 1.55, 0.25, 0.80, -0.2),
            key(-1.3, 1.28, 1.45, 0.25, 0.82, -0.2),
            key(-0.7, 1.2, 1.35, 0.25, 0.84, -0.2),
            key(0.0, 1.15, 1.3, 0.3, 0.85, -0.4),
            key(0.8, 1.2, 1.4, 0.2, 0.85, -0.6),
            key(1.5, 1.35, 1.7, 0.2, 0.85, -0.6),
            key(1.7, 1.5, 2.4, 0.3, 0.95, -1.0),
            key(1.0, 1.65, 3.4, 0.2, 1.1, -2.0),
            key(-0.5, 1.75, 4.2, 0.4, 1.3, -3.0),
        ],
        false,
    )
}
