//! A scene on the GPU.

use crate::{
    Gpu, HybridError, ObjectFacts, Settings,
    layout::{FrameUniform, MovedObject},
};
use niwaki_core::to_u32;
use niwaki_gpu_frame::{Surfaces, Vertex, diagonal};
use niwaki_scene::{Animation, ObjectPose, Scene, SceneFacts, ScenePose, animation::Influence};
use std::ops::Range;
use wgpu::BufferUsages;

/// Triangles, materials and textures on the GPU, and the objects of the scene on the CPU.
pub(crate) struct GpuScene {
    /// Vertices stand in them as in this frame.
    pub(crate) surfaces: Surfaces,
    /// What dynamic objects are made from; only with such.
    rest: Option<Rest>,
    frame: wgpu::Buffer,
    pub(crate) group: wgpu::BindGroup,
    pub(crate) facts: SceneFacts,
    /// Of the bounds of the scene at rest.
    pub(crate) diagonal: f32,
    /// The objects at rest.
    pub(crate) objects: Vec<ObjectFacts>,
    vertex_ranges: Vec<Range<u32>>,
}

/// Dynamic objects before they move.
pub(crate) struct Rest {
    /// At rest, or as bound to a skin.
    pub(crate) vertices: wgpu::Buffer,
    /// On which joints bound vertices hang, object after object.
    pub(crate) influences: wgpu::Buffer,
    /// Where those of each object begin, or [`MovedObject::NO_SKIN`].
    first_influence: Vec<u32>,
}

impl Rest {
    /// `vertices` are all of the scene at rest.
    fn new(gpu: &Gpu, scene: &Scene, vertices: &[Vertex]) -> Result<Self, HybridError> {
        let mut vertices = vertices.to_vec();
        let mut influences: Vec<Influence> = Vec::new();
        let objects = scene.objects_or_whole();
        let mut first_influence = vec![MovedObject::NO_SKIN; objects.len()];
        for (i, object) in objects.iter().enumerate() {
            let Some(skinned) = scene.animation.as_ref().and_then(|a| a.skinned(i)) else {
                continue;
            };
            let range = object.vertices.start as usize..object.vertices.end as usize;
            let Some(bound) = vertices.get_mut(range) else { continue };
            // Kernels find the influence of a vertex by its number in the object.
            if bound.len() != skinned.influences().len() {
                continue;
            }
            first_influence[i] = to_u32(influences.len());
            influences.extend_from_slice(skinned.influences());
            for (vertex, position) in bound.iter_mut().zip(skinned.positions()) {
                vertex.position = *position;
            }
            for (vertex, normal) in bound.iter_mut().zip(skinned.normals()) {
                vertex.normal = *normal;
            }
        }
        let storage = BufferUsages::STORAGE;
        Ok(Self {
            vertices: gpu.upload("vertices at rest", &vertices, storage)?,
            influences: gpu.upload("influences of joints", &influences, storage)?,
            first_influence,
        })
    }
}

impl GpuScene {
    pub(crate) fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self, HybridError> {
        let facts = SceneFacts::new(scene, settings.mirror_roughness);
        let objects = ObjectFacts::of(scene, &facts);
        let vertex_ranges: Vec<_> =
            scene.objects_or_whole().iter().map(|o| o.vertices.clone()).collect();
        let vertices = Surfaces::vertices_of(scene);
        let dynamic = objects.iter().any(|o| o.dynamic);
        let rest = if dynamic { Some(Rest::new(gpu, scene, &vertices)?) } else { None };
        let surfaces = Surfaces::new(gpu, scene, &vertices)?;
        let frame = gpu.buffer("frame", size_of::<FrameUniform>() as u64, BufferUsages::UNIFORM)?;
        let group = surfaces.group(gpu, &frame);
        let uploaded = Self {
            surfaces,
            rest,
            frame,
            group,
            facts,
            diagonal: diagonal(scene),
            objects,
            vertex_ranges,
        };
        uploaded.write_materials(gpu, scene, settings);
        gpu.check()?;
        Ok(uploaded)
    }

    /// Looks at the materials again under other settings.
    pub(crate) fn restate(&mut self, gpu: &Gpu, scene: &Scene, settings: &Settings) {
        // Going through all triangles and textures takes longer than some frames.
        if self.facts.mirror_roughness != settings.mirror_roughness {
            self.facts = SceneFacts::new(scene, settings.mirror_roughness);
            self.objects = ObjectFacts::of(scene, &self.facts);
        }
        self.write_materials(gpu, scene, settings);
    }

    fn write_materials(&self, gpu: &Gpu, scene: &Scene, settings: &Settings) {
        self.surfaces.write_materials(
            gpu,
            scene,
            &self.facts,
            settings.thickness,
            settings.look_through,
        );
    }

    pub(crate) fn write_frame(&self, gpu: &Gpu, frame: &FrameUniform) {
        gpu.queue().write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
    }

    /// The facts of the objects in this pose of the scene; `last` is that of the frame before.
    pub(crate) fn objects_at(
        &self,
        scene: &Scene,
        pose: &ScenePose,
        last: Option<&ScenePose>,
    ) -> Vec<ObjectFacts> {
        let at = |(i, object): (usize, &ObjectFacts)| {
            let moved_from = last
                .filter(|last| object.dynamic && moved(scene.animation.as_ref(), i, last, pose))
                .map(|last| scene.bounds_in(last, i, object.bounds));
            let bounds = scene.bounds_in(pose, i, object.bounds);
            ObjectFacts { bounds, moved_from, ..object.clone() }
        };
        self.objects.iter().enumerate().map(at).collect()
    }

    /// What dynamic objects are made from and the list of them, as `hybrid/deform.wgsl` takes
    /// them; `None` if nothing is dynamic.
    pub(crate) fn moved(
        &self,
        scene: &Scene,
        poses: &[ObjectPose],
    ) -> Option<(&Rest, Vec<MovedObject>)> {
        let rest = self.rest.as_ref()?;
        let moved: Vec<MovedObject> = self
            .vertex_ranges
            .iter()
            .zip(&self.objects)
            .zip(poses)
            .enumerate()
            .filter(|(_, ((range, object), _))| object.dynamic && !range.is_empty())
            .map(|(i, ((range, _), pose))| {
                let none = MovedObject::NO_SKIN;
                let joints = scene.animation.as_ref().and_then(|a| a.joints_of(i));
                MovedObject {
                    pose: *pose,
                    first: range.start,
                    count: range.end - range.start,
                    first_influence: rest.first_influence.get(i).copied().unwrap_or(none),
                    first_joint: joints.map_or(0, |joints| to_u32(joints.start)),
                }
            })
            .collect();
        (!moved.is_empty()).then_some((rest, moved))
    }

    /// Number of triangles.
    pub(crate) fn triangles(&self) -> u32 {
        to_u32(self.facts.triangles)
    }
}

/// True if object `i` is not as it was.
fn moved(animation: Option<&Animation>, i: usize, before: &ScenePose, now: &ScenePose) -> bool {
    let joints = animation.and_then(|a| a.joints_of(i));
    let bent = joints.is_some_and(|j| before.joints.get(j.clone()) != now.joints.get(j));
    bent || before.objects.get(i) != now.objects.get(i)
}
