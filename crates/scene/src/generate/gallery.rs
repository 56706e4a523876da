//! The atrium with a large mirror-like statue and a glass one, after the Sponza–Buddha–Bunny
//! scene of Ganestam and Doggett 2015, §4.

use super::{
    atrium, bunny, dragon,
    math::{circle, sin_cos_turns},
    piece::{Budget, EDGES, Patch, Plan, ROUND, Wrap, capped, capped_len, caps, cells},
};
use crate::{Camera, CameraKey, CameraPath, Hop, Material, Motion, Rigid};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::to_u32;

/// Where the statues stand, and how large they are.
const SERPENT: DVec3 = DVec3::new(2.2, 0.0, 0.3);
const SERPENT_SCALE: f64 = 1.85;
const BUNNY: DVec3 = DVec3::new(-5.6, 0.0, 1.3);
const BUNNY_SCALE: f64 = 1.5;

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let camera =
        Camera::look_at(Vec3::new(-10.2, 2.1, -1.7), Vec3::new(1.0, 2.6, 0.9), Vec3::Y, 1.0);
    let mut plan = atrium::begin(camera);
    let stone = to_u32(plan.materials.len());
    plan.materials.extend([
        Material::matte("pedestal", Vec3::new(0.5, 0.48, 0.45)),
        Material::metal("mirror bronze", Vec3::new(0.97, 0.90, 0.78), 0.0),
        Material {
            absorption: Vec3::new(0.35, 0.05, 0.12),
            ..Material::glass("statue glass", 1.5)
        },
        Material::metal("mirror ball", Vec3::splat(0.95), 0.0),
    ]);
    let (bronze, glass, mirror) = (stone + 1, stone + 2, stone + 3);
    plan.path = Some(path());
    plan.crease = Some(EDGES);
    let mut budget = Budget::new(triangles, 1.0);
    let share = budget.share(0.55);
    budget.spend(atrium::furnish(
        &mut plan,
        share,
        seed,
        &atrium::Furniture { vases: false, waving: true },
    ));
    plan.object("pedestals", Motion::default());
    plan.piece(stone, || {
        let mut patch = Patch::default();
        for (foot, half) in [(SERPENT, 1.0), (BUNNY, 0.85)] {
            let half = DVec3::new(half, 0.35, half);
            patch.cuboid(foot + DVec3::Y * half.y, half, DMat3::IDENTITY);
        }
        patch
    });
    budget.spend(24);
    plan.crease = Some(ROUND);
    let size = caps(budget.share(0.02), 2.0, [8, 5]);
    let middle = DVec3::new(-2.2, 0.9, -1.9);
    let hop = Hop { pivot: middle.as_vec3(), jump: Vec3::Y * 1.2, period: 1.6, ..Hop::default() };
    plan.object("mirror ball", Motion { rigid: Rigid::Hop(hop), ..Motion::default() });
    plan.piece(mirror, move || {
        capped(size, &|u, v| {
            let (sin, cos) = sin_cos_turns(0.5 * v);
            middle + (circle(-u) * sin.max(0.0) - DVec3::Y * cos) * 0.6
        })
    });
    budget.spend(capped_len(size));
    let size = caps(budget.share(0.13), 1.4, [10, 10]);
    plan.object("glass statue", Motion::default());
    plan.piece(glass, move || {
        capped(size, &|u, v| BUNNY + DVec3::Y * 0.7005 + bunny::surface(u, v) * BUNNY_SCALE)
    });
    budget.spend(capped_len(size));
    plan.object("mirror statue", Motion::default());
    let size = cells(budget.share(1.0), dragon::ASPECT, [8, 3]);
    plan.grid(bronze, size, Wrap::Both, move |u, v| {
        // The knot on its edge: what lay along Z stands upright.
        let p = dragon::surface(u, v, seed);
        let p = DVec3::new(p.x, p.z, -(p.y - 0.62));
        SERPENT + DVec3::Y * (0.7 + 1.53 * SERPENT_SCALE) + p * SERPENT_SCALE
    });
    plan
}

/// From the end of the court past the glass statue, round the mirror, and back along the other
/// side.
fn path() -> CameraPath {
    let key = |x: f32, y: f32, z: f32, tx: f32, ty: f32, tz: f32| CameraKey {
        position: Vec3::new(x, y, z),
        target: Vec3::new(tx, ty, tz),
        vertical_fov: 1.0,
    };
    CameraPath::new(
        vec![
            key(-10.2, 2.1, -1.7, 1.0, 2.6, 0.9),
            key(-9.0, 2.0, -1.7, -1.0, 2.4, 1.0),
            key(-7.6, 1.9, -1.8, -3.0, 2.1, 1.2),
            key(-6.0, 1.9, -2.2, -3.0, 2.0, 1.4),
            key(-4.0, 2.0, -3.0, 1.0, 2.4, 0.8),
            key(-1.5, 2.2, -3.6, 2.4, 3.2, 0.3),
            key(1.5, 2.3, -3.7, 2.2, 3.4, 0.3),
            key(4.6, 2.3, -3.4, 1.6, 3.2, 0.3),
            key(7.0, 2.3, -1.8, 0.5, 2.6, 0.3),
            key(8.2, 2.4, 0.4, -1.0, 2.6, 0.4),
            key(7.4, 2.5, 2.6, -1.0, 2.6, 0.2),
        ],
        false,
    )
}
