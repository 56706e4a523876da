//! The pyramid over the depth of the cube map: the least and the greatest distance of the surfaces
//! of each cell, thickness included, so that a march passes at once what it cannot meet.
//!
//! Level k has cells of 2ᵏ × 2ᵏ pixels; level 0 is the map itself. Faces whose side is no power of
//! two have cells that reach beyond it, where there is nothing.

use crate::{
    Gpu, HybridError,
    pipelines::{Pipelines, RANGE},
    targets::CubeMap,
    upload::GpuScene,
};
use bytemuck::{Pod, Zeroable};
use niwaki_core::to_u32;
use wgpu::{BindingResource, BufferUsages, TextureUsages, TextureViewDimension};

/// Levels that one dispatch makes.
const AT_ONCE: usize = 4;

/// The pyramid of all faces and layers of a cube map.
pub(crate) struct Pyramid {
    /// Side of the faces in pixels.
    pub(crate) side: u32,
    /// Layers of the cube map.
    pub(crate) layers: u32,
    /// All levels; the first of the texture is level 1.
    pub(crate) all: wgpu::TextureView,
    levels: Vec<wgpu::TextureView>,
    /// What the last dispatch writes instead of levels that are not there, and the first reads.
    spare: Vec<wgpu::TextureView>,
}

/// `Reduction` in `hybrid/pyramid.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Reduction {
    levels: u32,
    pad: [u32; 3],
    layers: [u32; 12],
}

impl Pyramid {
    /// A pyramid over faces of this side.
    pub(crate) fn new(gpu: &Gpu, side: u32, layers: u32) -> Result<Self, HybridError> {
        let base = (side.next_power_of_two() / 2).max(1);
        let count = base.ilog2() + 1;
        let mut usage = TextureUsages::STORAGE_BINDING;
        if cfg!(test) {
            usage |= TextureUsages::COPY_SRC;
        }
        let size = [base, base, 6 * layers];
        let texture = gpu.mipped_texture("depth pyramid", size, count, RANGE, usage)?;
        let least = 1 << (AT_ONCE - 1);
        let spare = gpu.mipped_texture("spare levels", [least, least, 1], 4, RANGE, usage)?;
        let level = |texture: &wgpu::Texture, level| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(TextureViewDimension::D2Array),
                base_mip_level: level,
                mip_level_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        Ok(Self {
            side,
            layers,
            all: texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(TextureViewDimension::D2Array),
                ..wgpu::TextureViewDescriptor::default()
            }),
            levels: (0..count).map(|i| level(&texture, i)).collect(),
            spare: (0..4).map(|i| level(&spare, i)).collect(),
        })
    }

    /// The highest level.
    pub(crate) fn top_level(&self) -> u32 {
        to_u32(self.levels.len())
    }

    /// What it takes to reduce these array layers of the map.
    pub(crate) fn prepare(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        scene: &GpuScene,
        cube: &CubeMap,
        layers: &[u32],
    ) -> Result<Reducing, HybridError> {
        let mut numbers = [0; 12];
        for (number, layer) in numbers.iter_mut().zip(layers) {
            *number = *layer;
        }
        let mut steps = Vec::new();
        for first in (0..self.levels.len()).step_by(AT_ONCE) {
            let made = &self.levels[first..self.levels.len().min(first + AT_ONCE)];
            let entry = if first == 0 { "from_map" } else { "from_level" };
            let below = if first == 0 { &self.spare[0] } else { &self.levels[first - 1] };
            let reduction = Reduction { levels: to_u32(made.len()), pad: [0; 3], layers: numbers };
            let params = gpu.upload("levels to make", &[reduction], BufferUsages::UNIFORM)?;
            let written = made.iter().chain(&self.spare[1..]).take(AT_ONCE);
            let mut resources = vec![
                params.as_entire_binding(),
                BindingResource::TextureView(&cube.depth.all),
                BindingResource::TextureView(&cube.surface.all),
                BindingResource::TextureView(below),
            ];
            resources.extend(written.map(BindingResource::TextureView));
            // The first of the levels is half as wide as the level below it.
            let cells = (self.levels[0].texture().width() >> first).max(1);
            steps.push(Step {
                pipeline: pipelines.reducer(gpu, &scene.layout, entry)?,
                group: gpu.bind(&pipelines.pyramid_layout, &resources),
                groups: [cells.div_ceil(8), cells.div_ceil(8), to_u32(layers.len().min(12))],
            });
        }
        Ok(Reducing { steps })
    }
}

/// A dispatch that makes up to four levels.
struct Step {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    groups: [u32; 3],
}

/// A reduction that can be recorded.
pub(crate) struct Reducing {
    steps: Vec<Step>,
}

impl Reducing {
    /// Records the dispatches and returns how many they are. `scene` is the scene's bind group.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &wgpu::BindGroup,
    ) -> u32 {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for Step { pipeline, group, groups: [x, y, z] } in &self.steps {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, scene, &[]);
            pass.set_bind_group(1, group, &[]);
            pass.dispatch_workgroups(*x, *y, *z);
        }
        to_u32(self.steps.len())
    }
}
