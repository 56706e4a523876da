//! Structures of `tracer/frame.wgsl`.

use crate::FrameSettings;
use bytemuck::{Pod, Zeroable};
use niwaki_core::{glam::Vec3, to_u32};
use niwaki_render::view::View;
use niwaki_scene::{Camera, Environment, Light, LightKind, Material, Scene};

/// `Frame`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameWords {
    pub(crate) position: Vec3,
    pub(crate) width: u32,
    pub(crate) corner: Vec3,
    pub(crate) height: u32,
    pub(crate) step_x: Vec3,
    pub(crate) ao_rays: u32,
    pub(crate) step_y: Vec3,
    pub(crate) ao_radius: f32,
    pub(crate) ambient: Vec3,
    pub(crate) lights: u32,
    pub(crate) ao_first: u32,
    pub(crate) ao_end: u32,
    pub(crate) seed: u32,
    pub(crate) shadows: u32,
}

impl FrameWords {
    /// A frame whose directions are all in one dispatch.
    pub(crate) fn new(
        camera: &Camera,
        settings: &FrameSettings,
        ambient: Vec3,
        lights: u32,
    ) -> Self {
        let view = View::new(camera, settings.width, settings.height);
        let ao_rays = settings.directions();
        Self {
            position: view.position,
            width: settings.width,
            corner: view.corner,
            height: settings.height,
            step_x: view.step_x,
            ao_rays,
            step_y: view.step_y,
            ao_radius: settings.reach(),
            ambient,
            lights,
            ao_first: 0,
            ao_end: ao_rays,
            seed: settings.seed,
            shadows: u32::from(settings.shadows),
        }
    }
}

/// `Material`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MaterialWords {
    pub(crate) diffuse: Vec3,
    pub(crate) exponent: f32,
    pub(crate) specular: Vec3,
    pub(crate) pad_0: u32,
    pub(crate) emission: Vec3,
    pub(crate) pad_1: u32,
}

/// Reflectance of dielectrics from straight above, for an index of refraction of 1.5.
const DIELECTRIC: f32 = 0.04;

/// Phong's largest exponent: beyond, highlights are smaller than a pixel.
const SHARPEST: f32 = 2048.0;

impl MaterialWords {
    /// Phong's model for a metallic-roughness material; `tint` is the mean colour of its texture.
    ///
    /// The exponent is 2/α² − 2 with α the square of the roughness, which gives Blinn's lobe the width of
    /// Beckmann's (Walter et al. 2007, section 5); a quarter of it gives Phong's lobe that of Blinn's
    /// (Akenine-Möller, Haines and Hoffman 2008, section 7.5.7).
    pub(crate) fn new(material: &Material, tint: Vec3) -> Self {
        let base = material.base_color * tint;
        let metal = material.metallic.clamp(0.0, 1.0);
        let alpha = (material.roughness * material.roughness).clamp(0.02, 1.0);
        let rough = 1.0 - material.roughness.clamp(0.0, 1.0);
        // A fully rough surface has no lobe to be seen.
        let specular = Vec3::splat(DIELECTRIC * rough).lerp(base, metal);
        Self {
            diffuse: base * (1.0 - metal),
            exponent: (0.25 * (2.0 / (alpha * alpha) - 2.0)).clamp(1.0, SHARPEST),
            specular,
            pad_0: 0,
            emission: material.emission,
            pad_1: 0,
        }
    }

    /// Of all materials of a scene.
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        // Phong's model here knows one colour a material.
        let tints: Vec<Vec3> = scene.textures.iter().map(|t| t.mean().truncate()).collect();
        let tint = |material: &Material| {
            let texture = material.base_color_texture.and_then(|i| tints.get(i));
            texture.copied().unwrap_or(Vec3::ONE)
        };
        scene.materials.iter().map(|material| Self::new(material, tint(material))).collect()
    }
}

/// `Light`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LightWords {
    pub(crate) place: Vec3,
    pub(crate) kind: u32,
    pub(crate) intensity: Vec3,
    pub(crate) outer: f32,
    pub(crate) direction: Vec3,
    pub(crate) falloff: f32,
}

pub(crate) const DIRECTIONAL: u32 = 0;
pub(crate) const SPOT: u32 = 2;

impl LightWords {
    pub(crate) fn new(light: &Light) -> Self {
        let (kind, place, outer, falloff) = match light.kind {
            LightKind::Directional => (DIRECTIONAL, -light.direction, 0.0, 0.0),
            LightKind::Point => (1, light.position, 0.0, 0.0),
            LightKind::Spot { inner, outer } => {
                let (inner, outer) = (inner.cos(), outer.cos());
                (SPOT, light.position, outer, (inner - outer).max(1e-4).recip())
            }
        };
        let Light { intensity, direction, .. } = *light;
        Self { place, kind, intensity, outer, direction, falloff }
    }

    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        scene.lights.iter().map(Self::new).collect()
    }
}

/// The mean radiance of the surroundings over the sphere, by the midpoint rule in height, which is
/// uniform on it.
pub(crate) fn mean_radiance(environment: &Environment) -> Vec3 {
    const STEPS: u8 = 64;
    let heights = (0..STEPS).map(|i| (f32::from(i) + 0.5) / f32::from(STEPS) * 2.0 - 1.0);
    let radiance =
        heights.map(|y| environment.radiance(Vec3::new((1.0 - y * y).max(0.0).sqrt(), y, 0.0)));
    radiance.sum::<Vec3>() / f32::from(STEPS)
}

/// A unit normal in a word, as `pack_normal` of `normals.wgsl`.
pub(crate) fn pack_normal(n: Vec3) -> u32 {
    let size = n.abs().element_sum();
    let p = if size > 0.0 { n.truncate() / size } else { niwaki_core::glam::Vec2::ZERO };
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let folded = [(1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y)];
    let [x, y] = if n.z < 0.0 { folded } else { [p.x, p.y] };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "−32767 to 32767, as its bits"
    )]
    let half = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 32767.0 + 0.5).floor() as i16 as u16);
    half(x) | half(y) << 16
}

/// The normal of a word, as `unpack_normal` of `normals.wgsl`.
pub(crate) fn unpack_normal(bits: u32) -> Vec3 {
    #[expect(clippy::cast_possible_truncation, reason = "half of a word")]
    #[expect(clippy::cast_possible_wrap, reason = "its bits are those of a signed number")]
    let half = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (half(bits & 0xffff), half(bits >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let (x, y) =
        if z < 0.0 { ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)) } else { (x, y) };
    Vec3::new(x, y, z).normalize_or(Vec3::Z)
}

/// Three rows a triangle: a corner each, and its packed normal.
pub(crate) fn shapes(scene: &Scene) -> Vec<[[u32; 4]; 3]> {
    use rayon::prelude::*;
    let mesh = &scene.mesh;
    mesh.indices()
        .par_iter()
        .map(|t| {
            let corners = t.map(|i| mesh.positions()[i as usize]);
            let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let flat = flat.normalize_or(Vec3::Z);
            std::array::from_fn(|k| {
                let [x, y, z] = corners[k].to_array().map(f32::to_bits);
                let normal = scene.normals.get(t[k] as usize).copied().unwrap_or(flat);
                [x, y, z, pack_normal(normal)]
            })
        })
        .collect()
}

/// How many lights a frame has.
pub(crate) fn light_count(scene: &Scene) -> u32 {
    to_u32(scene.lights.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_survive_packing() {
        for i in 0..2000_u16 {
            let t = f32::from(i) * 0.377;
            let y = f32::from(i) / 1000.0 - 0.9995;
            let r = (1.0 - y * y).max(0.0).sqrt();
            let n = Vec3::new(r * t.cos(), y, r * t.sin());
            assert!(unpack_normal(pack_normal(n)).distance(n) < 1e-4, "{n}");
        }
        assert!(unpack_normal(pack_normal(Vec3::ZERO)).is_finite());
    }

    #[test]
    fn a_constant_environment_is_its_mean() {
        let mean = mean_radiance(&Environment::Constant(Vec3::new(1.0, 2.0, 3.0)));
        assert!(mean.distance(Vec3::new(1.0, 2.0, 3.0)) < 1e-5);
    }
}
