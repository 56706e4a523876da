//! The scenes, lights and camera paths of the case studies (§3.1, §3.2): one description for all
//! six algorithms.

use crate::SpotLight;
use glam::Vec3;
use niwaki_core::{Aabb, TriangleMesh, to_u32};
use niwaki_scene::{CameraPath, Light, LightKind, Object, Scene, generate};
use std::{f32::consts::TAU, sync::Arc};

/// Spotlights of primary rendering (§3.1).
pub const PRIMARY_LIGHTS: usize = 32;
/// Triangles of the paper's atrium with five dragons.
pub const ATRIUM_TRIANGLES: usize = 724_337;
/// Triangles of the paper's tessellated geometry.
pub const TESSELLATED_TRIANGLES: usize = 396_000;

/// A scene with the lights and the camera path that all algorithms draw it with.
#[derive(Clone, Debug)]
pub struct Study {
    /// The triangles.
    pub scene: Arc<Scene>,
    /// The camera of each frame.
    pub path: CameraPath,
    /// Lights without shadows, for FR, ZR and DR.
    pub lights: Vec<SpotLight>,
    /// Up to 8 lights for SV, SM and VSM.
    casting: Vec<SpotLight>,
}

impl Study {
    /// A scene with lights. Those of the generated scenes `serpents` and `tessellated` are the
    /// studies' own; for a scene of one's own they hang above its middle as its bounds allow.
    #[must_use]
    pub fn of(scene: Scene) -> Self {
        match scene.name.as_str() {
            "serpents" => return hall(scene),
            "tessellated" => return shapes(scene),
            _ => {}
        }
        let path = scene.camera_path();
        let (lights, casting) = (ring(scene.mesh.bounds()), above(scene.mesh.bounds()));
        Self { scene: Arc::new(strip(scene)), path, lights, casting }
    }

    /// The first lights of those that cast shadows, at most 8: the paper has 2, 4, 6 and 8.
    #[must_use]
    pub fn shadow_lights(&self, count: usize) -> Vec<SpotLight> {
        self.casting.iter().take(count).copied().collect()
    }
}

/// The atrium with five dragons in about this many triangles, [`ATRIUM_TRIANGLES`] in the paper,
/// of which the procedural serpents stand in for the Stanford dragon.
#[must_use]
pub fn atrium(triangles: usize, seed: u64) -> Study {
    hall(generate::generate("serpents", triangles, seed).unwrap_or_default())
}

/// The same with the triangles of `dragon` in place of each serpent, scaled to its height and put
/// on its place.
#[must_use]
pub fn atrium_with(dragon: &Scene, triangles: usize, seed: u64) -> Study {
    let scene = generate::generate("serpents", triangles, seed).unwrap_or_default();
    hall(replace_objects(&scene, "dragon", dragon))
}

/// Tessellated shapes in about this many triangles, [`TESSELLATED_TRIANGLES`] in the paper.
#[must_use]
pub fn tessellated(triangles: usize, seed: u64) -> Study {
    shapes(generate::generate("tessellated", triangles, seed).unwrap_or_default())
}

/// Lights around the tessellated shapes.
fn shapes(scene: Scene) -> Study {
    let path = scene.camera_path();
    let lights = (0..to_u32(PRIMARY_LIGHTS)).map(|i| {
        let (sin, cos) = (TAU * i as f32 / 11.0).sin_cos();
        let radius = 2.0 + 7.0 * i as f32 / PRIMARY_LIGHTS as f32;
        let at = Vec3::new(radius * cos, 5.5, radius * sin);
        let target = Vec3::new(0.8 * radius * cos, 0.0, 0.8 * radius * sin);
        SpotLight::aimed(at, target, 0.5, 9.0, tint(i) * 25.0)
    });
    let casting = (0..8_u32).map(|i| {
        let (sin, cos) = (TAU * (3 * i % 8) as f32 / 8.0).sin_cos();
        let at = Vec3::new(6.5 * cos, 6.0 + 0.2 * i as f32, 6.5 * sin);
        SpotLight::aimed(at, Vec3::new(-0.5 * cos, 0.5, -0.5 * sin), 0.75, 18.0, tint(i) * 70.0)
    });
    Study {
        path,
        lights: lights.collect(),
        casting: casting.collect(),
        scene: Arc::new(strip(scene)),
    }
}

/// Lights for the atrium: under its galleries and over its court.
fn hall(scene: Scene) -> Study {
    let path = scene.camera_path();
    let lights = (0..to_u32(PRIMARY_LIGHTS)).map(|i| {
        let (column, row) = (i % 8, i / 8);
        let x = -12.25 + 3.5 * column as f32;
        let z = [-6.3, -1.6, 1.6, 6.3][row as usize % 4];
        let y = if row % 3 == 0 { 4.4 } else { 7.5 };
        let aim = Vec3::new(x + 0.5, 0.0, 0.85 * z);
        SpotLight::aimed(Vec3::new(x, y, z), aim, 0.55, y + 4.0, tint(i) * (y * 7.0))
    });
    let casting = (0..8_u32).map(|i| {
        // Spread over the court from the first two on.
        let x = [-6.0, 6.0, 0.0, -11.0, 11.0, -3.0, 3.0, 8.5][i as usize % 8];
        let z = if i % 2 == 0 { -2.6 } else { 2.6 };
        let aim = Vec3::new(0.75 * x, 0.0, -0.4 * z);
        SpotLight::aimed(Vec3::new(x, 8.4, z), aim, 0.8, 16.0, tint(i) * 160.0)
    });
    Study {
        path,
        lights: lights.collect(),
        casting: casting.collect(),
        scene: Arc::new(strip(scene)),
    }
}

/// 32 lights in a ring within the upper part of a box.
fn ring(bounds: Aabb) -> Vec<SpotLight> {
    let Some((middle, half)) = measures(bounds) else { return Vec::new() };
    let reach = half.length();
    let light = |i: u32| {
        let (sin, cos) = (TAU * i as f32 / PRIMARY_LIGHTS as f32).sin_cos();
        let out = Vec3::new(half.x * cos, 0.0, half.z * sin);
        let at = middle + out * 0.6 + Vec3::Y * (0.8 * half.y);
        let aim = middle + out * 0.5 - Vec3::Y * half.y;
        SpotLight::aimed(at, aim, 0.6, 1.5 * reach, tint(i) * (0.3 * reach * reach))
    };
    (0..to_u32(PRIMARY_LIGHTS)).map(light).collect()
}

/// Eight lights above the middle of a box.
fn above(bounds: Aabb) -> Vec<SpotLight> {
    let Some((middle, half)) = measures(bounds) else { return Vec::new() };
    let reach = half.length();
    let light = |i: u32| {
        let (sin, cos) = (TAU * (3 * i % 8) as f32 / 8.0).sin_cos();
        let at = middle + Vec3::new(0.4 * half.x * cos, 0.85 * half.y, 0.4 * half.z * sin);
        let aim = middle - Vec3::new(0.3 * half.x * cos, half.y, 0.3 * half.z * sin);
        SpotLight::aimed(at, aim, 0.8, 2.5 * reach, tint(i) * (0.6 * reach * reach))
    };
    (0..8).map(light).collect()
}

/// The middle and half the size of a box, at least a bit in each direction.
fn measures(bounds: Aabb) -> Option<(Vec3, Vec3)> {
    if bounds.is_empty() || !bounds.is_finite() {
        return None;
    }
    let half = (bounds.max * 0.5 - bounds.min * 0.5).max(Vec3::splat(1e-6));
    Some((bounds.max * 0.5 + bounds.min * 0.5, half))
}

/// Warm, neutral and cold lights in turn, so that pictures show which is which.
fn tint(i: u32) -> Vec3 {
    [Vec3::new(1.0, 0.82, 0.6), Vec3::new(0.95, 0.95, 0.92), Vec3::new(0.65, 0.8, 1.0)]
        [i as usize % 3]
}

/// Without what the case studies do not draw: lights of other kinds, and transmission.
fn strip(mut scene: Scene) -> Scene {
    scene.lights.retain(|l: &Light| matches!(l.kind, LightKind::Spot { .. }));
    scene.materials.iter_mut().for_each(|m| m.transmission = 0.0);
    scene
}

/// A scene whose objects of this name have other triangles.
fn replace_objects(scene: &Scene, name: &str, by: &Scene) -> Scene {
    let source = by.mesh.bounds();
    let Some((middle, half)) = measures(source) else { return scene.clone() };
    let mut out = Scene { objects: Vec::new(), animation: None, ..scene.clone() };
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let (mut normals, mut uvs, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    let first_material = to_u32(out.materials.len());
    out.materials.extend(by.materials.iter().cloned().map(|mut m| {
        for slot in
            [&mut m.base_color_texture, &mut m.metallic_roughness_texture, &mut m.emission_texture]
        {
            *slot = slot.map(|t| t + scene.textures.len());
        }
        m
    }));
    out.textures.extend(by.textures.iter().cloned());
    let mut add = |from: &Scene, object: &Object, place: &dyn Fn(Vec3) -> Vec3, material: u32| {
        let (triangle, vertex) = (to_u32(indices.len()), to_u32(positions.len()));
        let base = vertex.wrapping_sub(object.vertices.start);
        for v in object.vertices.start as usize..object.vertices.end as usize {
            positions.push(place(from.mesh.positions()[v]));
            normals.push(from.normals.get(v).copied().unwrap_or(Vec3::ZERO));
            uvs.push(from.uvs.get(v).copied().unwrap_or_default());
        }
        for t in object.triangles.start as usize..object.triangles.end as usize {
            indices.push(from.mesh.indices()[t].map(|i| i.wrapping_add(base)));
            ids.push(from.material_ids.get(t).copied().unwrap_or(0) + material);
        }
        Object {
            triangles: triangle..to_u32(indices.len()),
            vertices: vertex..to_u32(positions.len()),
            dynamic: false,
            ..object.clone()
        }
    };
    let whole = Object::whole(name, &by.mesh);
    let mut objects = Vec::new();
    for object in scene.objects_or_whole().iter() {
        objects.push(if object.name == name {
            let b = object.bounds;
            let scale = (0.5 * (b.max.y - b.min.y) / half.y).min(1e20);
            let foot = Vec3::new(0.5 * (b.min.x + b.max.x), b.min.y, 0.5 * (b.min.z + b.max.z));
            let below = Vec3::new(middle.x, source.min.y, middle.z);
            add(by, &whole, &|p| foot + (p - below) * scale, first_material)
        } else {
            add(scene, object, &|p| p, 0)
        });
    }
    let Ok(mesh) = TriangleMesh::new(positions, indices) else { return scene.clone() };
    for object in &mut objects {
        let range = object.vertices.start as usize..object.vertices.end as usize;
        object.bounds = Aabb::from_points(mesh.positions()[range].iter().copied());
    }
    Scene { mesh, normals, uvs, material_ids: ids, objects, ..out }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dragons_of_a_file_stand_where_serpents_stood() {
        let dragon = generate::generate("dragon", 1_000, 3).unwrap_or_default();
        let (plain, with) = (atrium(20_000, 1), atrium_with(&dragon, 20_000, 1));
        let bounds = |s: &Study| -> Vec<Aabb> {
            s.scene.objects.iter().filter(|o| o.name == "dragon").map(|o| o.bounds).collect()
        };
        let (a, b) = (bounds(&plain), bounds(&with));
        assert_eq!((a.len(), b.len()), (5, 5));
        for (a, b) in a.iter().zip(&b) {
            assert!((a.min.y - b.min.y).abs() < 1e-4 && (a.max.y - b.max.y).abs() < 1e-4);
            assert!((a.center().x - b.center().x).abs() < 1e-3, "{a:?} {b:?}");
        }
        let dragons = with.scene.objects.iter().filter(|o| o.name == "dragon");
        assert!(dragons.clone().all(|o| o.triangles.len() == dragon.mesh.len()));
        assert_eq!(with.scene.normals.len(), with.scene.mesh.positions().len());
        // Every triangle belongs to an object, in order.
        assert_eq!(
            with.scene.objects.last().map(|o| o.triangles.end as usize),
            Some(with.scene.mesh.len())
        );
    }

    #[test]
    fn studies_have_their_lights() {
        for study in [atrium(5_000, 1), tessellated(5_000, 1), Study::of(Scene::default())] {
            let empty = study.scene.mesh.is_empty();
            assert_eq!(study.lights.len(), if empty { 0 } else { PRIMARY_LIGHTS });
            for n in [2, 4, 6, 8] {
                assert_eq!(study.shadow_lights(n).len(), if empty { 0 } else { n });
            }
            assert!(study.scene.materials.iter().all(|m| m.transmission == 0.0));
        }
    }
}
