//! What buffers hold: the Rust twins of the structures in `hybrid/scene.wgsl` and
//! `hybrid/visibility.wgsl`; those of surfaces are in `niwaki-gpu-frame`.

use crate::{Face, March, Region, Settings, Side};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use niwaki_render::shading::Ambient;
use niwaki_scene::{Camera, Environment, Light, LightKind};

/// Longer than any map is deep, but finite: shaders may assume that there is no infinity.
const ENDLESS: f32 = 1e30;

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
    pub(crate) targets: MovedTargets,
}

/// What a dynamic object has of morph targets.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MovedTargets {
    /// Where the places of its differences begin, or `u32::MAX` without any.
    pub(crate) first_start: u32,
    /// Where its weights begin.
    pub(crate) first_weight: u32,
    /// A number of `hybrid/deform.wgsl`.
    pub(crate) normals: u32,
    pub(crate) pad: u32,
}

impl MovedTargets {
    /// The object does not morph.
    pub(crate) const NONE: Self =
        Self { first_start: u32::MAX, first_weight: 0, normals: 0, pad: 0 };
}

impl MovedObject {
    /// No joints bend the object.
    pub(crate) const NO_SKIN: u32 = u32::MAX;
}

const _: () = assert!(
    size_of::<GpuLight>() == 64
        && size_of::<FrameUniform>() == 12 * 16 + 30 * 64
        && size_of::<MovedObject>() == 128
        && size_of::<niwaki_scene::animation::Difference>() == 32
        && size_of::<niwaki_scene::animation::Influence>() == 24
        && size_of::<niwaki_scene::JointPose>() == 48
);
