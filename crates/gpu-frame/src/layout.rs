//! What buffers hold: the Rust twins of the structures in `frame/surfaces.wgsl` and
//! `frame/gbuffer.wgsl`.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use niwaki_render::shading::mean_fresnel;
use niwaki_scene::{AlphaMode, Material, MaterialFacts};

/// A vertex: 32 bytes, for the vertex stage and for kernels.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// In world space.
    pub position: Vec3,
    /// Texture coordinate.
    pub u: f32,
    /// Shading normal; zero where there is none.
    pub normal: Vec3,
    /// Texture coordinate.
    pub v: f32,
}

/// A material with all that kernels need of it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GpuMaterial {
    base_color: Vec3,
    metallic: f32,
    emission: Vec3,
    roughness: f32,
    absorption: Vec3,
    transmission: f32,
    ior: f32,
    alpha: f32,
    alpha_mode: u32,
    cutoff: f32,
    base_texture: i32,
    surface_texture: i32,
    emission_texture: i32,
    thickness: f32,
    flags: u32,
    mean_fresnel: f32,
    body: f32,
    pad: u32,
}

const REFLECTS: u32 = 1;
const REFRACTS: u32 = 2;
const POLISHED: u32 = 4;
const SEE_THROUGH: u32 = 8;
const CUT_OUT: u32 = 16;
const THIN_WALLED: u32 = 32;

/// Longer than any map is deep, but finite: shaders may assume that there is no infinity.
const ENDLESS: f32 = 1e30;

impl GpuMaterial {
    /// `thickness` is how far behind its front a surface counts, as a share of `diagonal`, that of
    /// the scene's bounds, without end from 1 on; `textures` how many there are; `look_through` whether rays look through glass, blended
    /// surfaces and holes in a cube map.
    pub fn new(
        m: &Material,
        facts: &MaterialFacts,
        thickness: f32,
        diagonal: f32,
        textures: usize,
        look_through: bool,
    ) -> Self {
        let texture = |t: Option<usize>| match t {
            Some(i) if i < textures => i32::try_from(i).unwrap_or(-1),
            _ => -1,
        };
        let (alpha_mode, cutoff) = match m.alpha_mode {
            AlphaMode::Opaque => (0, 0.0),
            AlphaMode::Mask(cutoff) => (1, cutoff),
            AlphaMode::Blend => (2, 0.0),
        };
        let thickness = unit(thickness);
        let clear = look_through && (facts.transmissive || facts.blended);
        let thin = facts.transmissive || clear;
        let ior = m.index_of_refraction();
        Self {
            base_color: numbers(m.base_color),
            metallic: unit(m.metallic),
            emission: numbers(m.emission),
            roughness: unit(m.roughness),
            absorption: numbers(m.absorption),
            transmission: unit(m.transmission),
            ior,
            alpha: unit(m.alpha),
            alpha_mode,
            cutoff: if cutoff.is_nan() { 2.0 } else { cutoff },
            base_texture: texture(m.base_color_texture),
            surface_texture: texture(m.metallic_roughness_texture),
            emission_texture: texture(m.emission_texture),
            thickness: if thin {
                0.0
            } else if thickness >= 1.0 {
                ENDLESS
            } else {
                thickness * diagonal
            },
            flags: u32::from(facts.reflective) * REFLECTS
                + u32::from(facts.transmissive) * REFRACTS
                + u32::from(facts.polished) * POLISHED
                + u32::from(clear) * SEE_THROUGH
                + u32::from(look_through && facts.has_alpha() && !clear) * CUT_OUT
                + u32::from(m.thin_walled) * THIN_WALLED,
            mean_fresnel: mean_fresnel(ior),
            // Without end is what nobody derived: then nothing is known of it.
            body: if facts.transmissive && m.thickness < 1.0 {
                unit(m.thickness) * diagonal
            } else {
                0.0
            },
            pad: 0,
        }
    }
}

/// NaN becomes 0.
const fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

/// Negative values and NaN become 0, infinite ones the largest number.
fn numbers(v: Vec3) -> Vec3 {
    v.max(Vec3::ZERO).min(Vec3::splat(f32::MAX))
}

/// Where a texture stands in the atlas, and how it is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TextureInfo {
    pub x: u32,
    pub y: u32,
    pub layer: u32,
    pub width: u32,
    pub height: u32,
    pub flags: u32,
    pub pad: [u32; 2],
}

/// A view that is rasterised: clip space relative to a point, so that scenes far from the origin
/// lose no digits.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ViewMatrix {
    /// From a position relative to the eye to clip space.
    pub matrix: Mat4,
    /// Where the view is from.
    pub eye: Vec3,
    /// Of no meaning.
    pub pad: f32,
}

const _: () = assert!(
    size_of::<Vertex>() == 32
        && size_of::<GpuMaterial>() == 96
        && size_of::<TextureInfo>() == 32
        && size_of::<ViewMatrix>() == 80
);
