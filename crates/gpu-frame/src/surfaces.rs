//! A scene's triangles, materials and textures on the GPU.

use crate::{
    FrameError, Gpu, Slot,
    atlas::Atlas,
    layout::{GpuMaterial, Vertex},
};
use glam::{Vec2, Vec3};
use niwaki_scene::{Material, Scene, SceneFacts};
use wgpu::{BindingResource, BufferUsages};

/// The most materials that a pixel of a G-buffer can name.
const MOST_MATERIALS: u64 = 1 << 16;

/// What `frame/surfaces.wgsl` binds as group 0 from binding 1 on; binding 0 is a uniform of the
/// renderer's own.
#[derive(Debug)]
pub struct Surfaces {
    /// Vertices of 32 bytes ([`Vertex`]).
    pub vertices: wgpu::Buffer,
    /// Three vertices a triangle.
    pub indices: wgpu::Buffer,
    material_ids: wgpu::Buffer,
    materials: wgpu::Buffer,
    texture_infos: wgpu::Buffer,
    atlas: wgpu::TextureView,
    /// The layout of group 0.
    pub layout: wgpu::BindGroupLayout,
}

impl Surfaces {
    /// The vertices of a scene at rest; what is not finite counts as 0, positions excepted.
    #[must_use]
    pub fn vertices_of(scene: &Scene) -> Vec<Vertex> {
        (0..scene.mesh.positions().len())
            .map(|i| {
                let uv = scene.uvs.get(i).copied().filter(|v| v.is_finite()).unwrap_or(Vec2::ZERO);
                let normal =
                    scene.normals.get(i).copied().filter(|n| n.is_finite()).unwrap_or(Vec3::ZERO);
                Vertex { position: scene.mesh.positions()[i], u: uv.x, normal, v: uv.y }
            })
            .collect()
    }

    /// Uploads a scene; `vertices` are those of [`Surfaces::vertices_of`]. Materials are written
    /// by [`Surfaces::write_materials`].
    ///
    /// # Errors
    /// [`FrameError::TooLarge`] if the scene does not fit, and what the device reports.
    pub fn new(gpu: &Gpu, scene: &Scene, vertices: &[Vertex]) -> Result<Self, FrameError> {
        if scene.materials.len() as u64 > MOST_MATERIALS {
            return Err(FrameError::TooLarge {
                what: "the list of materials".into(),
                wanted: scene.materials.len() as u64,
                limit: MOST_MATERIALS,
                remedy: "merge materials that are equal",
            });
        }
        let count = scene.materials.len();
        let ids: Vec<u32> = (0..scene.mesh.len())
            .map(|i| scene.material_ids.get(i).copied().filter(|&id| (id as usize) < count))
            .map(|id| id.unwrap_or(0))
            .collect();
        let atlas = Atlas::new(gpu, &scene.textures)?;
        let storage = BufferUsages::STORAGE;
        let indices: &[u32] = bytemuck::cast_slice(scene.mesh.indices());
        let layout = gpu.layout(
            "scene",
            &[
                Slot::Uniform,
                Slot::Read,
                Slot::Read,
                Slot::Read,
                Slot::Read,
                Slot::Read,
                Slot::COLOR_ARRAY,
            ],
        );
        let materials = (count.max(1) * size_of::<GpuMaterial>()) as u64;
        Ok(Self {
            vertices: gpu.upload("vertices", vertices, storage | BufferUsages::VERTEX)?,
            indices: gpu.upload("indices", indices, storage | BufferUsages::INDEX)?,
            material_ids: gpu.upload("material numbers", &ids, storage)?,
            materials: gpu.buffer("materials", materials, storage)?,
            texture_infos: gpu.upload("texture places", &atlas.infos, storage)?,
            atlas: atlas.view,
            layout,
        })
    }

    /// Group 0 with this uniform as binding 0.
    #[must_use]
    pub fn group(&self, gpu: &Gpu, uniform: &wgpu::Buffer) -> wgpu::BindGroup {
        gpu.bind(
            &self.layout,
            &[
                uniform.as_entire_binding(),
                self.vertices.as_entire_binding(),
                self.indices.as_entire_binding(),
                self.material_ids.as_entire_binding(),
                self.materials.as_entire_binding(),
                self.texture_infos.as_entire_binding(),
                BindingResource::TextureView(&self.atlas),
            ],
        )
    }

    /// Writes the materials as kernels take them. `thickness` says what counts as
    /// [`Material::thickness`] of each, given its number, `look_through` whether rays
    /// look through glass, blended surfaces and holes in a cube map.
    pub fn write_materials(
        &self,
        gpu: &Gpu,
        scene: &Scene,
        facts: &SceneFacts,
        thickness: impl Fn(usize, &Material) -> f32,
        look_through: bool,
    ) {
        let (diagonal, textures) = (diagonal(scene), scene.textures.len());
        let material =
            |(i, (m, f))| GpuMaterial::new(m, f, thickness(i, m), diagonal, textures, look_through);
        let known = scene.materials.iter().zip(&facts.materials).enumerate();
        let materials: Vec<GpuMaterial> = known.map(material).collect();
        gpu.queue().write_buffer(&self.materials, 0, bytemuck::cast_slice(&materials));
    }
}

/// The diagonal of a scene's bounds at rest; 1 without any.
#[must_use]
pub fn diagonal(scene: &Scene) -> f32 {
    let bounds = scene.mesh.bounds();
    let diagonal = if bounds.is_empty() {
        1.0
    } else {
        (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length().min(1e30)
    };
    #[expect(clippy::cast_possible_truncation, reason = "at most 1e30")]
    let diagonal = diagonal as f32;
    diagonal
}
