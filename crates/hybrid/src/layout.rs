//! What buffers hold: the Rust twins of the structures in `hybrid/scene.wgsl` and
//! `hybrid/visibility.wgsl`.

use crate::{Face, March, Region, Settings, Side};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use niwaki_render::shading::{Ambient, mean_fresnel};
use niwaki_scene::{AlphaMode, Camera, Environment, Light, LightKind, Material, MaterialFacts};

/// A vertex: 32 bytes, for the vertex stage and for kernels.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Vertex {
    pub(crate) position: Vec3,
    pub(crate) u: f32,
    pub(crate) normal: Vec3,
    pub(crate) v: f32,
}

/// A material with all that kernels need of it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct GpuMaterial {
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
    pad: [u32; 2],
}

const REFLECTS: u32 = 1;
const REFRACTS: u32 = 2;
const POLISHED: u32 = 4;
const SEE_THROUGH: u32 = 8;
const CUT_OUT: u32 = 16;

/// Longer than any map is deep, but finite: shaders may assume that there is no infinity.
const ENDLESS: f32 = 1e30;

impl GpuMaterial {
    /// `diagonal` is that of the scene's bounds, in which thickness counts; `textures` how many
    /// there are.
    pub(crate) fn new(
        m: &Material,
        facts: &MaterialFacts,
        settings: &Settings,
        diagonal: f32,
        textures: usize,
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
        let thickness = unit(m.thickness * settings.thickness);
        let clear = settings.look_through && (facts.transmissive || facts.blended);
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
                + u32::from(settings.look_through && facts.has_alpha() && !clear) * CUT_OUT,
            mean_fresnel: mean_fresnel(ior),
            pad: [0; 2],
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
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) layer: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) flags: u32,
    pub(crate) pad: [u32; 2],
}

/// A light with the first of its shadow maps.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct GpuLight {
    position: Vec3,
    kind: u32,
    direction: Vec3,
    layer: u32,
    intensity: Vec3,
    cos_inner: f32,
    cos_outer: f32,
    pixel: f32,
    maps: u32,
    pad: u32,
}

impl GpuLight {
    /// `pixel` and `maps`: see `hybrid/visibility.wgsl`.
    pub(crate) fn new(light: &Light, layer: u32, maps: u32, pixel: f32) -> Self {
        let (kind, inner, outer) = match light.kind {
            LightKind::Point => (0, 0.0, 0.0),
            LightKind::Directional => (1, 0.0, 0.0),
            LightKind::Spot { inner, outer } => (2, inner, outer),
        };
        Self {
            position: light.position,
            kind,
            direction: light.direction,
            layer,
            intensity: light.intensity,
            cos_inner: inner.cos(),
            cos_outer: outer.cos(),
            pixel,
            maps,
            pad: 0,
        }
    }
}

/// A view that is rasterised: clip space relative to a point, so that scenes far from the origin
/// lose no digits.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ViewMatrix {
    pub(crate) matrix: Mat4,
    pub(crate) eye: Vec3,
    pub(crate) pad: f32,
}

/// What all kernels know of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameUniform {
    eye: Vec3,
    width: u32,
    corner: Vec3,
    height: u32,
    step_x: Vec3,
    max_depth: u32,
    step_y: Vec3,
    cutoff: f32,
    center: Vec3,
    half_size: f32,
    traced: f32,
    far: f32,
    n_min: f32,
    n_max: f32,
    zenith: Vec3,
    face_resolution: f32,
    horizon: Vec3,
    face_mask: u32,
    ground: Vec3,
    light_count: u32,
    ambient_up: Vec3,
    mirror_roughness: f32,
    ambient_down: Vec3,
    max_rays: u32,
    top_level: u32,
    occlusion_rays: u32,
    occlusion_radius: f32,
    pad: u32,
    faces: [Mat4; 6],
    hops: [Mat4; 24],
}

/// What a frame's uniform is made from.
pub(crate) struct FrameInput<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) size: [u32; 2],
    pub(crate) region: &'a Region,
    pub(crate) settings: &'a Settings,
    pub(crate) environment: &'a Environment,
    /// Light comes from outside and is evaluated.
    pub(crate) sky: bool,
    /// Bit i: face i holds something.
    pub(crate) face_mask: u32,
    pub(crate) light_count: u32,
    /// That of the scene's bounds at rest.
    pub(crate) diagonal: f32,
    /// The highest level of the depth pyramid; 0 if marches read none.
    pub(crate) top_level: u32,
}

impl FrameUniform {
    pub(crate) fn new(input: &FrameInput<'_>) -> Self {
        let FrameInput { camera, size, region, settings, .. } = *input;
        let [width, height] = size.map(|n| n.max(1));
        let half_height = (0.5 * camera.vertical_fov).tan();
        let half_width = half_height * width as f32 / height as f32;
        let sky = if input.sky { *input.environment } else { Environment::DARK };
        let [zenith, horizon, ground] = match sky {
            Environment::Constant(radiance) => [radiance; 3],
            Environment::Sky { zenith, horizon, ground } => [zenith, horizon, ground],
        };
        let ambient = Ambient::of(&sky, settings.ambient);
        let (n_min, n_max) = match settings.march {
            March::Linear { n_min, n_max, .. } => (n_min, n_max),
            March::Pixels | March::Hierarchical => (1, 1),
        };
        let local = Region { center: Vec3::ZERO, ..*region };
        let mut hops = [Mat4::IDENTITY; 24];
        for face in Face::ALL {
            for (k, side) in Side::ALL.into_iter().enumerate() {
                hops[4 * face.index() + k] = region.face_to_face(face, face.neighbour(side));
            }
        }
        Self {
            eye: camera.position,
            width: size[0],
            corner: camera.forward - camera.right() * half_width + camera.up * half_height,
            height: size[1],
            step_x: camera.right() * (2.0 * half_width / width as f32),
            max_depth: settings.max_depth,
            step_y: camera.up * (-2.0 * half_height / height as f32),
            cutoff: settings.throughput_cutoff,
            center: region.center,
            half_size: region.half_size,
            traced: region.traced,
            far: region.far,
            n_min: n_min as f32,
            n_max: n_max as f32,
            zenith,
            face_resolution: settings.face_resolution as f32,
            horizon,
            face_mask: input.face_mask,
            ground,
            light_count: input.light_count,
            ambient_up: ambient.up,
            mirror_roughness: settings.mirror_roughness,
            ambient_down: ambient.down,
            max_rays: settings.max_rays,
            top_level: input.top_level,
            occlusion_rays: settings.occlusion_rays,
            // Finite, as shaders may assume that there is no infinity.
            occlusion_radius: (settings.occlusion_radius * input.diagonal).min(ENDLESS),
            pad: 0,
            faces: Face::ALL.map(|face| local.view_projection(face)),
            hops,
        }
    }
}

/// A dynamic object as `hybrid/deform.wgsl` reads it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MovedObject {
    pub(crate) pose: niwaki_scene::ObjectPose,
    pub(crate) first: u32,
    pub(crate) count: u32,
    /// Where its influences begin, or [`MovedObject::NO_SKIN`].
    pub(crate) first_influence: u32,
    /// Where the joints of its skin begin.
    pub(crate) first_joint: u32,
}

impl MovedObject {
    /// No joints bend the object.
    pub(crate) const NO_SKIN: u32 = u32::MAX;
}

const _: () = assert!(
    size_of::<Vertex>() == 32
        && size_of::<GpuMaterial>() == 96
        && size_of::<TextureInfo>() == 32
        && size_of::<GpuLight>() == 64
        && size_of::<ViewMatrix>() == 80
        && size_of::<FrameUniform>() == 12 * 16 + 30 * 64
        && size_of::<MovedObject>() == 112
        && size_of::<niwaki_scene::animation::Influence>() == 24
        && size_of::<niwaki_scene::JointPose>() == 48
);
