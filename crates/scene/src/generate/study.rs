//! The scenes of the raster case studies (Johnsson, Ganestam, Doggett and Akenine-Möller 2012, §3):
//! an atrium with five dragons, and tessellated shapes without textures.

use super::{
    atrium, dragon,
    math::{circle, noise, sin_cos_turns},
    piece::{Budget, EDGES, Patch, Plan, ROUND, Wrap, capped, capped_len, caps, cells},
};
use crate::{CameraKey, CameraPath, Environment, Material};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::to_u32;

/// The paper's counts: Sponza's atrium, and five dragons of 100,000.
const ATRIUM_SHARE: f64 = 224_337.0 / 724_337.0;
/// Where the dragons stand, how large they are, and how far they are turned (in turns).
const DRAGONS: [(DVec3, f64, f64); 5] = [
    (DVec3::new(-8.6, 0.0, 1.1), 0.85, 0.05),
    (DVec3::new(-4.4, 0.0, -1.5), 0.95, 0.32),
    (DVec3::new(0.2, 0.0, 0.8), 1.15, 0.55),
    (DVec3::new(4.8, 0.0, -1.2), 0.95, 0.71),
    (DVec3::new(9.0, 0.0, 0.9), 0.85, 0.88),
];

const fn key(eye: [f32; 3], target: [f32; 3]) -> CameraKey {
    CameraKey {
        position: Vec3::from_array(eye),
        target: Vec3::from_array(target),
        vertical_fov: 1.0,
    }
}

/// The atrium with five dragons along its court.
pub(super) fn serpents(triangles: usize, seed: u64) -> Plan {
    let keys = vec![
        key([-12.4, 2.4, -1.0], [-4.0, 1.4, 0.4]),
        key([-9.5, 2.0, -2.6], [-2.0, 1.2, 0.2]),
        key([-6.0, 1.8, 1.6], [0.0, 1.0, 0.0]),
        key([-2.0, 2.2, 3.0], [2.4, 1.2, -0.6]),
        key([2.2, 2.6, 2.6], [6.0, 1.2, -0.8]),
        key([5.4, 3.4, -3.2], [2.0, 1.0, 1.0]),
        key([9.0, 4.6, -2.6], [-1.0, 1.2, 0.4]),
        key([12.2, 3.2, 0.6], [-2.0, 1.2, 0.2]),
    ];
    let path = CameraPath::new(keys, false);
    let mut plan = atrium::begin(path.frame(0));
    let bronze = to_u32(plan.materials.len());
    plan.materials.push(Material {
        roughness: 0.4,
        metallic: 0.6,
        ..Material::matte("bronze scales", Vec3::new(0.55, 0.36, 0.17))
    });
    plan.path = Some(path);
    plan.crease = Some(EDGES);
    let share = Budget::new(triangles, 1.0).share(ATRIUM_SHARE);
    let furniture = atrium::Furniture { vases: false, waving: false };
    // A small atrium has more than its share; dragons get what is left.
    let left = triangles.saturating_sub(atrium::furnish(&mut plan, share, seed, &furniture));
    let mut budget = Budget::new(left, 1.0);
    plan.crease = Some(ROUND);
    for (i, (foot, scale, turn)) in DRAGONS.into_iter().enumerate() {
        plan.object("dragon", crate::Motion::default());
        let share = budget.share(1.0 / DRAGONS.len() as f64);
        let size = cells(share, dragon::ASPECT, [8, 3]);
        let (sin, cos) = sin_cos_turns(turn);
        let seed = seed.wrapping_add(i as u64);
        budget.spend(plan.grid(bronze, size, Wrap::Both, move |u, v| {
            let p = dragon::surface(u, v, seed) * scale;
            foot + DVec3::new(cos * p.x + sin * p.z, p.y, cos * p.z - sin * p.x)
        }));
        plan.end_object();
    }
    plan
}

/// Hills with balls, rings and knots of many small triangles, without textures.
pub(super) fn tessellated(triangles: usize, seed: u64) -> Plan {
    let keys = (0..8_u8).map(|i| {
        let (sin, cos) = sin_cos_turns(f64::from(i) / 8.0);
        #[expect(clippy::cast_possible_truncation, reason = "moderate numbers")]
        let [x, z] = [cos, sin].map(|t| (9.5 * t) as f32);
        let height = if i % 2 == 0 { 4.2 } else { 2.8 };
        key([x, height, z], [-0.1 * x, 0.8, -0.1 * z])
    });
    let path = CameraPath::new(keys.collect(), true);
    let materials = vec![
        Material::matte("ground", Vec3::new(0.55, 0.56, 0.5)),
        Material { roughness: 0.3, ..Material::matte("red", Vec3::new(0.6, 0.12, 0.08)) },
        Material { roughness: 0.5, ..Material::matte("blue", Vec3::new(0.1, 0.2, 0.55)) },
        Material { roughness: 0.35, ..Material::metal("gold", Vec3::new(0.9, 0.65, 0.25), 0.35) },
        Material::matte("white", Vec3::new(0.75, 0.74, 0.7)),
    ];
    let mut plan = Plan::new(materials, path.frame(0), Environment::DAYLIGHT);
    plan.path = Some(path);
    plan.crease = Some(ROUND);
    let mut budget = Budget::new(triangles.saturating_sub(6 * 12), 1.0);
    let size = cells(budget.share(0.2), 1.0, [4, 4]);
    plan.object("ground", crate::Motion::default());
    budget.spend(plan.grid(0, size, Wrap::No, move |u, v| {
        let (x, z) = (24.0 * (u - 0.5), 24.0 * (0.5 - v));
        DVec3::new(x, 0.5 * noise(DVec3::new(0.3 * x, 0.3 * z, 0.0), seed), z)
    }));
    for i in 0..6_u8 {
        let (sin, cos) = sin_cos_turns((f64::from(i) + 0.5) / 6.0);
        let at = DVec3::new(5.0 * cos, 1.3 + 0.2 * f64::from(i % 3), 5.0 * sin);
        let share = budget.share(0.35 / 6.0);
        plan.object(if i % 2 == 0 { "ball" } else { "ring" }, crate::Motion::default());
        if i % 2 == 0 {
            let size = caps(share, 2.0, [6, 4]);
            plan.piece(1 + u32::from(i / 2), move || {
                capped(size, &|u, v| {
                    let (s, c) = sin_cos_turns(0.5 * v);
                    at + (circle(-u) * s.max(0.0) - DVec3::Y * c) * 0.9
                })
            });
            budget.spend(capped_len(size));
        } else {
            let size = cells(share, 2.5, [6, 3]);
            budget.spend(plan.grid(1 + u32::from(i / 2), size, Wrap::Both, move |u, v| {
                let (s, c) = sin_cos_turns(v);
                let ring = circle(u);
                let p = ring * (0.8 + 0.3 * c) + DVec3::Y * (0.3 * s);
                // On edge.
                at + DVec3::new(p.x, p.z, -p.y)
            }));
        }
        plan.end_object();
    }
    plan.crease = Some(EDGES);
    plan.object("posts", crate::Motion::default());
    plan.piece(4, || {
        let mut patch = Patch::default();
        for i in 0..6_u8 {
            let (sin, cos) = sin_cos_turns(f64::from(i) / 6.0);
            let at = DVec3::new(7.5 * cos, 1.2, 7.5 * sin);
            patch.cuboid(at, DVec3::new(0.2, 1.8, 0.2), DMat3::IDENTITY);
        }
        patch
    });
    plan.crease = Some(ROUND);
    plan.object("knot", crate::Motion::default());
    let size = cells(budget.share(1.0), dragon::ASPECT, [8, 3]);
    plan.grid(4, size, Wrap::Both, move |u, v| DVec3::Y * 0.9 + dragon::surface(u, v, seed) * 1.3);
    plan
}

#[cfg(test)]
mod tests {
    use crate::generate::generate;

    #[test]
    fn dragons_are_objects_of_their_share() {
        let scene = generate("serpents", 72_433, 1).unwrap();
        let dragons: Vec<usize> = scene
            .objects
            .iter()
            .filter(|o| o.name == "dragon")
            .map(|o| o.triangles.len())
            .collect();
        assert_eq!(dragons.len(), 5);
        assert!(dragons.iter().all(|n| (9_500..10_500).contains(n)), "{dragons:?}");
    }
}
