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
                pipeline: pipelines.reducer(gpu, &scene.surfaces.layout, entry)?,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{HybridRenderer, March, NearRegion, Settings};
    use std::sync::Arc;

    type Range = [f32; 2];
    const NOTHING: Range = [3.0e38, -3.0e38];

    /// Twin of `hybrid/pyramid.wgsl`: the levels above ranges of pixels, rows of `side`.
    fn reduce(pixels: &[Range], side: usize) -> Vec<Vec<Range>> {
        let mut levels: Vec<Vec<Range>> = Vec::new();
        let mut width = (side.next_power_of_two() / 2).max(1);
        loop {
            let below = levels.last().map_or(pixels, Vec::as_slice);
            let below_width = if levels.is_empty() { side } else { 2 * width };
            let level = (0..width * width).map(|i| {
                let (x, y) = (2 * (i % width), 2 * (i / width));
                let mut range = NOTHING;
                for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)] {
                    if x < below_width && y < below_width {
                        let [low, high] = below[y * below_width + x];
                        range = [range[0].min(low), range[1].max(high)];
                    }
                }
                range
            });
            let level = level.collect();
            levels.push(level);
            if width == 1 {
                return levels;
            }
            width /= 2;
        }
    }

    /// Reads a layer of a level of a texture.
    fn read<T: Pod>(
        gpu: &Gpu,
        view: &wgpu::TextureView,
        aspect: wgpu::TextureAspect,
        level: u32,
        layer: u32,
    ) -> Vec<T> {
        let texture = view.texture();
        let side = texture.width() >> level;
        let row = (to_u32(size_of::<T>()) * side).next_multiple_of(256);
        let usage = BufferUsages::COPY_SRC;
        let buffer = gpu.buffer("copy", u64::from(row) * u64::from(side), usage).unwrap();
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: level,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                aspect,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: Some(side),
                },
            },
            wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
        );
        gpu.queue().submit([encoder.finish()]);
        let per_row = row as usize / size_of::<T>();
        let all: Vec<T> = gpu.read(&buffer, per_row * side as usize).unwrap();
        all.chunks(per_row).flat_map(|r| r[..side as usize].to_vec()).collect()
    }

    #[test]
    fn levels_hold_the_least_and_the_greatest_of_their_pixels() {
        let gpu = match Gpu::new() {
            Ok(gpu) => gpu,
            Err(error) => {
                let required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
                assert!(!required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
                println!("skipped: {error}");
                return;
            }
        };
        let scene = Arc::new(niwaki_scene::generate::generate("gallery", 3000, 1).unwrap());
        for (side, layers) in [(64, 1), (100, 2), (1, 1)] {
            let settings = Settings {
                near_region: NearRegion::ShareOfScene(0.05),
                march: March::Hierarchical,
                layers,
                face_resolution: side,
                max_depth: 1,
                shadows: crate::Shadows::None,
                shadow_resolution: 16,
                ..Settings::default()
            };
            let mut renderer =
                HybridRenderer::new(&gpu, Arc::clone(&scene), settings.clone()).unwrap();
            let camera = scene.cameras[0];
            let (plan, _) = renderer.draw(&camera, 64, 36, 0.0).unwrap();
            assert!(plan.runs(crate::Effect::DepthPyramid), "{plan}");
            let (n, f) = (plan.region.half_size, plan.region.far);
            let diagonal = scene.mesh.bounds().extent().length();
            let mut seen = 0;
            for layer in 0..6 * layers {
                let face = crate::Face::ALL[layer as usize % 6];
                if !plan.uses(crate::Effect::CubeFace(face)) {
                    continue;
                }
                let (cube, pyramid) = (&renderer.cube, &renderer.pyramid);
                let all = wgpu::TextureAspect::All;
                let only = wgpu::TextureAspect::DepthOnly;
                let depth: Vec<f32> = read(&gpu, &cube.depth.all, only, 0, layer);
                let surface: Vec<[u32; 4]> = read(&gpu, &cube.surface.all, all, 0, layer);
                let pixels: Vec<Range> = depth
                    .iter()
                    .zip(&surface)
                    .map(|(z, surface)| {
                        if *z >= 1.0 {
                            return NOTHING;
                        }
                        let w = n * f / (f - z * (f - n));
                        let m = &scene.materials[(surface[2] >> 16) as usize];
                        let thin = m.transmission > 0.0;
                        let thickness = if thin { 0.0 } else { m.thickness * diagonal };
                        let endless = !thin && m.thickness >= 1.0;
                        [w, w + if endless { 1e30 } else { thickness }]
                    })
                    .collect();
                seen += pixels.iter().filter(|p| **p != NOTHING).count();
                for (k, level) in (0..).zip(reduce(&pixels, side as usize)) {
                    let found: Vec<Range> = read(&gpu, &pyramid.all, all, k, layer);
                    assert_eq!(found.len(), level.len());
                    for (i, (a, b)) in found.iter().zip(&level).enumerate() {
                        // Divisions on the device err by some units in the last place, and the
                        // difference under them by more where the far plane is far.
                        let near = |a: f32, b: f32| (a - b).abs() <= 1e-4 * b.abs();
                        assert!(
                            near(a[0], b[0]) && near(a[1], b[1]),
                            "layer {layer}, level {}, cell {i}: {a:?}, not {b:?}",
                            k + 1
                        );
                    }
                }
                assert_eq!(pyramid.top_level(), (side.next_power_of_two() / 2).max(1).ilog2() + 1);
            }
            assert!(seen > 0, "the faces show nothing");
        }
    }
}
