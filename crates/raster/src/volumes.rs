//! What shadow volumes are extracted into and drawn from.

use crate::{Edges, Solids, SpotLight, layout::Caster, pipelines::Pipelines};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use niwaki_core::to_u32;
use niwaki_gpu_frame::{FrameError, Gpu, Surfaces, wgpu};
use niwaki_scene::{AlphaMode, Scene};
use wgpu::BufferUsages;

/// `Origin` in `raster/volumes.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Origin {
    light: Vec3,
    pad: f32,
}

/// Arguments of the draws before anything was extracted: two indexed ones of five words, one of
/// four, and two words that nothing uses. The sides of solids follow.
const NOTHING: [u32; 16] = [0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0];
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
    solids: Solids,
    /// Solids that are seen through in part. What is behind such a triangle is not where the count of
    /// crossings takes it to be, so these cast from both sides.
    masked: Vec<bool>,
    /// How solids wind around the eye, and around lights at these places.
    around_eye: Vec<i32>,
    around_lights: Vec<(Vec3, Vec<i32>)>,
}

/// What extraction and drawing bind for a light.
pub(crate) struct Bound {
    pub(crate) casters: wgpu::BindGroup,
    pub(crate) volumes: wgpu::BindGroup,
    /// What [`Volumes::draws`] holds before extraction.
    begin: wgpu::Buffer,
}

impl Volumes {
    pub(crate) fn new(gpu: &Gpu, scene: &Scene) -> Result<Self, FrameError> {
        let edges = Edges::of(&scene.mesh);
        let solids = Solids::of(&scene.mesh, &edges);
        let mut masked = vec![false; solids.len()];
        for (solid, material) in solids.of_triangles().iter().zip(&scene.material_ids) {
            let material = scene.materials.get(*material as usize);
            let is_opaque = material.is_none_or(|m| m.alpha_mode == AlphaMode::Opaque);
            if let (Some(solid), false) = (solid.checked_sub(1), is_opaque) {
                masked[solid as usize] = true;
            }
        }
        let storage = BufferUsages::STORAGE;
        let triangles = scene.mesh.len() as u64;
        let index = storage | BufferUsages::INDEX;
        let indirect = storage | BufferUsages::INDIRECT | BufferUsages::COPY_SRC;
        Ok(Self {
            triangles: to_u32(scene.mesh.len()),
            edges: to_u32(edges.edges.len()),
            edge_list: gpu.upload("edges", &edges.edges, storage)?,
            incidences: gpu.upload("triangles of edges", &edges.incidences, storage)?,
            // Numbers of solids stay; the lowest two bits are the facing of the light at hand.
            facings: gpu.upload(
                "facings",
                &solids.of_triangles().iter().map(|solid| solid << 2).collect::<Vec<_>>(),
                storage,
            )?,
            fronts: gpu.buffer("triangles that face a light", 12 * triangles, index)?,
            backs: gpu.buffer("triangles that do not", 12 * triangles, index)?,
            // No edge has more walls than triangles.
            walls: gpu.buffer("walls", 8 * edges.incidences.len() as u64, storage)?,
            draws: gpu.buffer(
                "draws of volumes",
                (size_of_val(&NOTHING) + 4 * solids.len()) as u64,
                indirect,
            )?,
            around_eye: Vec::new(),
            around_lights: Vec::new(),
            masked,
            solids,
        })
    }

    /// Finds which solids the eye and the lights are in; lights are looked at when they move.
    pub(crate) fn place(&mut self, scene: &Scene, eye: Vec3, lights: &[SpotLight]) {
        self.around_eye = self.solids.windings(&scene.mesh, eye);
        self.around_lights.truncate(lights.len());
        for (number, light) in lights.iter().enumerate() {
            let at = light.position;
            if self.around_lights.get(number).is_none_or(|known| known.0 != at) {
                let known = (at, self.solids.windings(&scene.mesh, at));
                if number < self.around_lights.len() {
                    self.around_lights[number] = known;
                } else {
                    self.around_lights.push(known);
                }
            }
        }
    }

    /// The side from which each solid casts for a light: 1 from where it faces the light, −1 from
    /// its back, 0 from both.
    fn sides(&self, light: usize) -> Vec<i32> {
        let Some((_, around_light)) = self.around_lights.get(light) else { return Vec::new() };
        let pairs = self.around_eye.iter().zip(around_light).zip(&self.masked);
        let side = |((eye, light), masked): ((&i32, &i32), &bool)| match masked {
            true => 0,
            false if eye >= light => 1,
            false => -1,
        };
        pairs.map(side).collect()
    }

    pub(crate) fn bind(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        surfaces: &Surfaces,
        view: &wgpu::Buffer,
        caster: &Caster,
        one_sided_light: Option<usize>,
    ) -> Result<Bound, FrameError> {
        let origin = Origin { light: caster.position, pad: 0.0 };
        let caster = gpu.upload("caster", &[*caster], BufferUsages::UNIFORM)?;
        let origin = gpu.upload("origin", &[origin], BufferUsages::UNIFORM)?;
        let mut sides = one_sided_light.map(|light| self.sides(light)).unwrap_or_default();
        sides.resize(self.solids.len(), 0);
        let mut begin = NOTHING.to_vec();
        begin.extend(sides.into_iter().map(i32::cast_unsigned));
        let begin = gpu.upload("draws without volumes", &begin, BufferUsages::COPY_SRC)?;
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
            begin,
        })
    }

    /// Forgets what was extracted, and says from which side solids cast.
    pub(crate) fn reset(&self, encoder: &mut wgpu::CommandEncoder, bound: &Bound) {
        let bytes = (size_of_val(&NOTHING) + 4 * self.solids.len()) as u64;
        encoder.copy_buffer_to_buffer(&bound.begin, 0, &self.draws, 0, bytes);
    }

    /// How many triangles face the light, how many turn their back, and how many walls there are.
    pub(crate) fn counts(&self, gpu: &Gpu) -> Result<[u32; 3], FrameError> {
        let words: Vec<u32> = gpu.read(&self.draws, NOTHING.len())?;
        Ok([words[0] / 3, words[5] / 3, words[10] / 6])
    }
}
