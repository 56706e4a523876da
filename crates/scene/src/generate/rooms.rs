//! A room in which nothing reflects, and the same with one small mirror: what a renderer plans for
//! these must shrink to what they call for.

use super::{
    bunny, dragon,
    math::{circle, noise, sin_cos_turns},
    piece::{Budget, EDGES, Patch, Plan, ROUND, Wrap, capped, capped_len, caps, cells},
};
use crate::{
    Camera, CameraKey, CameraPath, Environment, Hop, Light, LightKind, Material, Motion, Rigid,
    Wave,
};
use glam::{DMat3, DVec3, Vec3};

const WALL: u32 = 0;
const FLOOR: u32 = 1;
const PEDESTAL: u32 = 2;
const TERRACOTTA: u32 = 3;
const PLASTER: u32 = 4;
const CLOTH: u32 = 5;
const BALL: u32 = 6;
const LAMP: u32 = 7;
const FRAME: u32 = 8;
const MIRROR: u32 = 9;

/// Half the length (X) and half the width (Z) of the room, and its height, in metres.
const ROOM: [f64; 3] = [5.0, 4.0, 3.6];

fn materials() -> Vec<Material> {
    // Without the coat that a dielectric has: purely diffuse.
    let matte = |name, r, g, b| Material { ior: 1.0, ..Material::matte(name, Vec3::new(r, g, b)) };
    vec![
        matte("wall", 0.72, 0.68, 0.60),
        matte("floor", 0.38, 0.28, 0.20),
        matte("pedestal", 0.55, 0.55, 0.55),
        matte("terracotta", 0.62, 0.28, 0.16),
        matte("plaster", 0.80, 0.80, 0.78),
        matte("blue cloth", 0.10, 0.20, 0.45),
        matte("green ball", 0.15, 0.45, 0.20),
        Material { ior: 1.0, ..Material::emitter("lamp", Vec3::new(16.0, 14.0, 11.0)) },
    ]
}

/// `mirror` hangs a mirror of 40 by 55 centimetres on the wall.
pub(super) fn plan(triangles: usize, seed: u64, mirror: bool) -> Plan {
    let camera =
        Camera::look_at(Vec3::new(-4.2, 1.7, 2.6), Vec3::new(0.8, 1.1, -0.9), Vec3::Y, 0.95);
    let mut plan = Plan::new(materials(), camera, Environment::DAYLIGHT);
    plan.path = Some(path());
    plan.lights.push(Light {
        kind: LightKind::Point,
        position: Vec3::new(0.0, 2.7, 0.6),
        direction: Vec3::NEG_Y,
        intensity: Vec3::new(5.0, 4.5, 3.8),
    });
    plan.crease = Some(EDGES);
    plan.object("room", Motion::default());
    plan.piece(WALL, walls);
    plan.piece(FLOOR, || {
        let mut patch = Patch::default();
        let [x, z, _] = ROOM;
        patch.quad([[-x, z], [x, z], [x, -z], [-x, -z]].map(|[x, z]| DVec3::new(x, 0.0, z)));
        patch
    });
    let mut spent = 12 * 8 + 2 + 24;
    let (left, right) = (DVec3::new(-0.9, 0.0, -1.4), DVec3::new(2.0, 0.0, -0.6));
    plan.object("pedestals", Motion::default());
    plan.piece(PEDESTAL, move || {
        let mut patch = Patch::default();
        for foot in [left, right] {
            patch.cuboid(foot + DVec3::Y * 0.4, DVec3::new(0.55, 0.4, 0.55), DMat3::IDENTITY);
        }
        patch
    });
    if mirror {
        plan.materials.extend([
            Material { ior: 1.0, ..Material::matte("frame", Vec3::new(0.25, 0.14, 0.07)) },
            Material::metal("mirror", Vec3::splat(0.95), 0.0),
        ]);
        spent += looking_glass(&mut plan);
    }
    let mut budget = Budget::new(triangles.saturating_sub(spent), 1.0);
    plan.crease = Some(ROUND);
    let size = caps(budget.share(0.02), 2.0, [8, 5]);
    let globe = |center: DVec3, radius: f64| {
        move || {
            capped(size, &|u, v| {
                let (sin, cos) = sin_cos_turns(0.5 * v);
                center + (circle(-u) * sin.max(0.0) - DVec3::Y * cos) * radius
            })
        }
    };
    plan.object("lamp", Motion::default());
    plan.piece(LAMP, globe(DVec3::new(0.0, 3.1, 0.6), 0.14));
    budget.spend(capped_len(size));
    let middle = DVec3::new(0.7, 0.3, 0.9);
    let hop = Hop { pivot: middle.as_vec3(), jump: Vec3::Y * 0.8, period: 1.2, ..Hop::default() };
    plan.object("ball", Motion { rigid: Rigid::Hop(hop), ..Motion::default() });
    plan.piece(BALL, globe(middle, 0.3));
    budget.spend(capped_len(size));
    let size = caps(budget.share(0.26), 1.4, [10, 10]);
    plan.object("animal", Motion::default());
    plan.piece(TERRACOTTA, move || {
        capped(size, &|u, v| {
            // Facing into the room.
            let p = bunny::surface(u, v);
            left + DVec3::Y * 0.8005 + DVec3::new(-p.z, p.y, p.x) * 0.9
        })
    });
    budget.spend(capped_len(size));
    plan.crease = Some(EDGES);
    let size = cells(budget.share(0.16), 1.2, [4, 3]);
    let wave = Wave {
        displacement: Vec3::new(0.10, 0.0, 0.0),
        wave: Vec3::new(0.0, -0.35, 0.3),
        frequency: 0.5,
        phase: 0.0,
        hold: Vec3::new(0.0, -1.0 / 2.4, 0.0),
        hold_offset: 3.1 / 2.4,
    };
    plan.object("curtain", Motion { wave: Some(wave), ..Motion::default() });
    budget.spend(plan.grid(CLOTH, size, Wrap::No, move |u, v| {
        let (fold, _) = sin_cos_turns(6.0 * u + 0.2 * v);
        let sway = noise(DVec3::new(3.0 * u, 2.5 * v, 0.7), seed);
        DVec3::new(4.55 + fold * (0.04 + 0.06 * v) + 0.06 * sway * v, 3.1 - 2.4 * v, 1.9 * u - 1.6)
    }));
    plan.crease = Some(ROUND);
    plan.object("serpent", Motion::default());
    let size = cells(budget.share(1.0), dragon::ASPECT, [8, 3]);
    plan.grid(PLASTER, size, Wrap::Both, move |u, v| {
        right + DVec3::Y * 0.78 + dragon::surface(u, v, seed) * 0.42
    });
    plan
}

/// Four walls, and a ceiling around an opening to the sky: boxes.
fn walls() -> Patch {
    let mut patch = Patch::default();
    let mut block = |x: [f64; 2], y: [f64; 2], z: [f64; 2]| {
        let (min, max) = (DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]));
        patch.cuboid((min + max) * 0.5, (max - min) * 0.5, DMat3::IDENTITY);
    };
    let [x, z, top] = ROOM;
    let t = 0.2;
    block([-x - t, -x], [0.0, top], [-z, z]);
    block([x, x + t], [0.0, top], [-z, z]);
    block([-x - t, x + t], [0.0, top], [-z - t, -z]);
    block([-x - t, x + t], [0.0, top], [z, z + t]);
    let (ox, oz) = (2.2, 1.4);
    block([-x - t, x + t], [top, top + t], [-z - t, -oz]);
    block([-x - t, x + t], [top, top + t], [oz, z + t]);
    block([-x - t, -ox], [top, top + t], [-oz, oz]);
    block([ox, x + t], [top, top + t], [-oz, oz]);
    patch
}

/// A mirror in a frame on the far wall; returns how many triangles these are.
fn looking_glass(plan: &mut Plan) -> usize {
    let center = DVec3::new(0.75, 1.65, -ROOM[1]);
    let (w, h) = (0.20, 0.275);
    plan.object("mirror", Motion::default());
    plan.piece(MIRROR, move || {
        let mut patch = Patch::default();
        let corners = [[-w, -h], [w, -h], [w, h], [-w, h]];
        patch.quad(corners.map(|[x, y]| center + DVec3::new(x, y, 0.012)));
        patch
    });
    plan.piece(FRAME, move || {
        let mut patch = Patch::default();
        let t = 0.025;
        for side in [-1.0, 1.0] {
            let upright = DVec3::new(side * (w + t), 0.0, 0.015);
            patch.cuboid(center + upright, DVec3::new(t, h + 2.0 * t, 0.015), DMat3::IDENTITY);
            let across = DVec3::new(0.0, side * (h + t), 0.015);
            patch.cuboid(center + across, DVec3::new(w, t, 0.015), DMat3::IDENTITY);
        }
        patch
    });
    2 + 48
}

/// Along the room at eye level, looking at what stands in it.
fn path() -> CameraPath {
    let key = |x: f32, y: f32, z: f32, tx: f32, ty: f32, tz: f32| CameraKey {
        position: Vec3::new(x, y, z),
        target: Vec3::new(tx, ty, tz),
        vertical_fov: 0.95,
    };
    CameraPath::new(
        vec![
            key(-4.2, 1.7, 2.6, 0.8, 1.1, -0.9),
            key(-3.2, 1.7, 2.4, 0.8, 1.2, -1.2),
            key(-2.0, 1.7, 2.3, 0.6, 1.3, -2.0),
            key(-0.8, 1.7, 2.4, 0.7, 1.3, -3.0),
            key(0.5, 1.7, 2.5, 0.9, 1.2, -2.0),
            key(1.8, 1.7, 2.6, 1.0, 1.1, -1.0),
            key(3.0, 1.8, 2.4, 0.6, 1.0, -0.8),
        ],
        false,
    )
}
