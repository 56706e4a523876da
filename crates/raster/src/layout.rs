//! What buffers hold: the Rust twins of the structures in `raster/*.wgsl`.

use crate::{Algorithm, Settings, SpotLight};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use niwaki_gpu_frame::spot_view;
use niwaki_render::shading::Ambient;
use niwaki_scene::{Camera, Environment};

/// `RasterFrame` in `raster/frame.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameUniform {
    eye: Vec3,
    width: u32,
    corner: Vec3,
    height: u32,
    step_x: Vec3,
    near: f32,
    step_y: Vec3,
    light_count: u32,
    zenith: Vec3,
    exposure: f32,
    horizon: Vec3,
    map_side: f32,
    ground: Vec3,
    bias_constant: f32,
    ambient_up: Vec3,
    bias_slope: f32,
    ambient_down: Vec3,
    bias_normal: f32,
    taps: u32,
    least_filter: f32,
    least_deviation: f32,
    bleeding: f32,
    most_filter: f32,
    pad: [f32; 3],
}

impl FrameUniform {
    pub(crate) fn new(
        camera: &Camera,
        [width, height]: [u32; 2],
        near: f32,
        light_count: u32,
        settings: &Settings,
        environment: &Environment,
    ) -> Self {
        let half_height = (0.5 * camera.vertical_fov).tan();
        let half_width = half_height * width.max(1) as f32 / height.max(1) as f32;
        let [zenith, horizon, ground] = match *environment {
            Environment::Constant(radiance) => [radiance; 3],
            Environment::Sky { zenith, horizon, ground } => [zenith, horizon, ground],
        };
        let ambient = Ambient::of(environment, settings.ambient);
        let bias = match settings.algorithm {
            Algorithm::VarianceShadowMaps => settings.variance.bias,
            _ => settings.bias,
        };
        Self {
            eye: camera.position,
            width,
            corner: camera.forward - camera.right() * half_width + camera.up * half_height,
            height,
            step_x: camera.right() * (2.0 * half_width / width.max(1) as f32),
            near,
            step_y: camera.up * (-2.0 * half_height / height.max(1) as f32),
            light_count,
            zenith,
            exposure: settings.exposure,
            horizon,
            map_side: settings.shadow_resolution as f32,
            ground,
            bias_constant: bias.constant,
            ambient_up: ambient.up,
            bias_slope: bias.slope,
            ambient_down: ambient.down,
            bias_normal: bias.normal,
            taps: settings.filter.taps(),
            least_filter: settings.variance.least_filter,
            least_deviation: settings.variance.least_deviation,
            bleeding: settings.variance.bleeding,
            most_filter: settings.variance.most_filter,
            pad: [0.0; 3],
        }
    }
}

/// `SpotLight` in `raster/frame.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct GpuLight {
    position: Vec3,
    range: f32,
    direction: Vec3,
    cos_inner: f32,
    intensity: Vec3,
    cos_outer: f32,
    pub(crate) matrix: Mat4,
    width: f32,
    pub(crate) near: f32,
    tangent: f32,
    pad: f32,
}

/// Sides of the cone that encloses what a light lights, `SIDES` in `raster/light.wgsl`.
pub(crate) const CONE_SIDES: u32 = 24;

impl GpuLight {
    pub(crate) fn new(light: &SpotLight) -> Self {
        // What is nearer to the light than this casts no shadow.
        let near = light.range * 1e-4;
        let (view, width) = spot_view(light.position, light.direction, light.outer, near);
        let enclosing = 1.0 / (std::f32::consts::PI / CONE_SIDES as f32).cos();
        Self {
            position: light.position,
            range: light.range,
            direction: light.direction,
            cos_inner: light.inner.cos(),
            intensity: light.intensity,
            cos_outer: light.outer.cos(),
            matrix: view.matrix,
            width,
            near,
            tangent: light.outer.tan() * enclosing * 1.001,
            pad: 0.0,
        }
    }
}

/// `Caster` in `raster/silhouettes.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Caster {
    pub(crate) matrix: Mat4,
    pub(crate) position: Vec3,
    pub(crate) range: f32,
    pub(crate) triangles: u32,
    pub(crate) edges: u32,
    pub(crate) pad: [u32; 2],
}

const _: () = assert!(
    size_of::<FrameUniform>() == 176 && size_of::<GpuLight>() == 128 && size_of::<Caster>() == 96
);
