//! Drawing points on lights.

use crate::{
    sampling::{luminance, uniform_triangle},
    surface::{emission, locate, material_id, opacity, uv_at},
};
use glam::{DVec3, Vec2, Vec3};
use niwaki_scene::Scene;

/// The emissive triangles, drawn with probability proportional to their power.
///
/// Emission counts on both sides of a triangle: files disagree on winding, and a light that faces
/// away would silently leave a scene black. Textured emitters are weighted by their constant
/// factor, which keeps the estimate unbiased.
#[derive(Clone, Debug, Default)]
pub(crate) struct AreaLights {
    prims: Vec<u32>,
    /// Running sums of luminance × area, one per triangle.
    cumulative: Vec<f64>,
}

/// A point on an emissive triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPoint {
    pub(crate) point: DVec3,
    /// Unit normal by winding.
    pub(crate) normal: DVec3,
    /// Radiance given off, 0 where the surface is cut out.
    pub(crate) radiance: Vec3,
    /// Density over area.
    pub(crate) pdf_area: f64,
    /// The triangle.
    pub(crate) prim: usize,
}

impl AreaLights {
    /// Collects the emissive triangles of a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut lights = Self::default();
        let mut total = 0.0;
        if !scene.materials.iter().any(niwaki_scene::Material::is_emissive) {
            return lights;
        }
        for prim in 0..scene.mesh.len() {
            let Some(material) = scene.materials.get(material_id(scene, prim)) else { continue };
            if !material.is_emissive() {
                continue;
            }
            let power = f64::from(luminance(material.emission)) * scene.mesh.triangle(prim).area();
            if power > 0.0 && power.is_finite() {
                total += power;
                lights.prims.push(niwaki_core::to_u32(prim));
                lights.cumulative.push(total);
            }
        }
        lights
    }

    fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Density over area with which points of a triangle of this constant emission are drawn.
    pub(crate) fn pdf_area(&self, constant_emission: Vec3) -> f64 {
        let total = self.total();
        if total > 0.0 { f64::from(luminance(constant_emission)) / total } else { 0.0 }
    }

    /// Draws a point; `None` without lights.
    pub(crate) fn sample(&self, scene: &Scene, choice: f32, u: Vec2) -> Option<LightPoint> {
        let target = f64::from(choice) * self.total();
        let index = self.cumulative.partition_point(|&sum| sum <= target);
        let prim = *self.prims.get(index)? as usize;
        let (u, v) = uniform_triangle(u);
        let (point, normal, _) = locate(scene, prim, u, v);
        let material = scene.materials.get(material_id(scene, prim))?;
        let uv = uv_at(scene, prim, u, v);
        Some(LightPoint {
            point,
            normal,
            radiance: emission(scene, material, uv) * opacity(scene, material, uv),
            pdf_area: self.pdf_area(material.emission),
            prim,
        })
    }
}

/// Picks one punctual light for a point, with probability proportional to the luminance that each
/// would cast on a surface facing it: its index, the unit direction to it, its distance, and its
/// irradiance divided by the probability. `None` if none reaches the point.
pub(crate) fn sample_punctual(
    scene: &Scene,
    point: Vec3,
    choice: f32,
) -> Option<(Vec3, f32, Vec3)> {
    let weight = |light: &niwaki_scene::Light| {
        light.illuminate(point).map_or(0.0, |(.., irradiance)| f64::from(luminance(irradiance)))
    };
    let total: f64 = scene.lights.iter().map(weight).sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let mut left = f64::from(choice) * total;
    let mut last = None;
    for light in &scene.lights {
        let w = weight(light);
        if w > 0.0 {
            last = Some((light, w));
            left -= w;
            if left < 0.0 {
                break;
            }
        }
    }
    let (light, w) = last?;
    let (direction, distance, irradiance) = light.illuminate(point)?;
    #[expect(clippy::cast_possible_truncation, reason = "a ratio in f32's range by construction")]
    let inverse = (total / w) as f32;
    Some((direction, distance, irradiance * inverse))
}
