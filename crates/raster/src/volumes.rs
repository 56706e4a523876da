//! What shadow volumes are extracted into and drawn from.

use crate::{Edges, layout::Caster, pipelines::Pipelines};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use niwaki_core::to_u32;
use niwaki_gpu_frame::{FrameError, Gpu, Surfaces, wgpu};
use niwaki_scene::Scene;
use wgpu::BufferUsages;

/// `Origin` in `raster/volumes.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Origin {
    light: Vec3,
    pad: f32,
}

/// Arguments of the draws before anything was extracted: two indexed ones of five words, and one
/// of four.
const NOTHING: [u32; 14] = [0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0];
/// Where each begins, in bytes.
pub(crate) const BACKS: u64 = 20;
/// See [`BACKS`].
pub(crate) const WALLS: u64 = 40;

/// Buffers for the shadow volumes of a scene from one light at a time.
pub(crate) struct Volumes {
    pub(crate) triangles: u32,
    pub(crate) edges: u32,
    edge_list: wgpu::Buffer,
    incidences: wgpu::Buffer,
    facings: wgpu::Buffer,
    pub(crate) fronts: wgpu::Buffer,
    pub(crate) backs: wgpu::Buffer,
    walls: wgpu::Buffer,
    pub(crate) draws: wgpu::Buffer,
    nothing: wgpu::Buffer,
}

/// What extraction and drawing bind for a light.
pub(crate) struct Bound {
    pub(crate) casters: wgpu::BindGroup,
    pub(crate) volumes: wgpu::BindGroup,
}

impl Volumes {
    pub(crate) fn new(gpu: &Gpu, scene: &Scene) -> Result<Self, FrameError> {
        let edges = Edges::of(&scene.mesh);
        let storage = BufferUsages::STORAGE;
        let triangles = scene.mesh.len() as u64;
        let index = storage | BufferUsages::INDEX;
        let indirect = storage | BufferUsages::INDIRECT | BufferUsages::COPY_SRC;
        Ok(Self {
            triangles: to_u32(scene.mesh.len()),
            edges: to_u32(edges.edges.len()),
            edge_list: gpu.upload("edges", &edges.edges, storage)?,
            incidences: gpu.upload("triangles of edges", &edges.incidences, storage)?,
            facings: gpu.buffer("facings", 4 * triangles, storage)?,
            fronts: gpu.buffer("triangles that face a light", 12 * triangles, index)?,
            backs: gpu.buffer("triangles that do not", 12 * triangles, index)?,
            // No edge has more walls than triangles.
            walls: gpu.buffer("walls", 8 * edges.incidences.len() as u64, storage)?,
            draws: gpu.buffer("draws of volumes", 64, indirect)?,
            nothing: gpu.upload("no volumes", &NOTHING, BufferUsages::COPY_SRC)?,
        })
    }

    pub(crate) fn bind(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        surfaces: &Surfaces,
        view: &wgpu::Buffer,
        caster: &Caster,
    ) -> Result<Bound, FrameError> {
        let origin = Origin { light: caster.position, pad: 0.0 };
        let caster = gpu.upload("caster", &[*caster], BufferUsages::UNIFORM)?;
        let origin = gpu.upload("origin", &[origin], BufferUsages::UNIFORM)?;
        let casters = [
            &caster,
            &self.edge_list,
            &self.incidences,
            &self.facings,
            &self.fronts,
            &self.backs,
            &self.walls,
            &self.draws,
        ]
        .map(wgpu::Buffer::as_entire_binding);
        let volumes =
            [view, &origin, &surfaces.vertices, &self.walls].map(wgpu::Buffer::as_entire_binding);
        Ok(Bound {
            casters: gpu.bind(&pipelines.casters, &casters),
            volumes: gpu.bind(&pipelines.volumes, &volumes),
        })
    }

    /// Forgets what was extracted.
    pub(crate) fn reset(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(
            &self.nothing,
            0,
            &self.draws,
            0,
            size_of_val(&NOTHING) as u64,
        );
    }

    /// How many triangles face the light, how many turn their back, and how many walls there are.
    pub(crate) fn counts(&self, gpu: &Gpu) -> Result<[u32; 3], FrameError> {
        let words: Vec<u32> = gpu.read(&self.draws, NOTHING.len())?;
        Ok([words[0] / 3, words[5] / 3, words[10] / 6])
    }
}
