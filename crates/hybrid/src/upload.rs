//! A scene on the GPU.

use crate::{
    Gpu, HybridError, ObjectFacts, Settings,
    layout::{FrameUniform, MovedObject, MovedTargets},
};
use niwaki_core::to_u32;
use niwaki_gpu_frame::{Surfaces, Vertex, diagonal};
use niwaki_scene::{
    Animation, ObjectPose, Scene, SceneFacts, ScenePose,
    animation::{Difference, Influence, MorphNormals},
};
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
    /// Which materials some object wears that stands still.
    still: Vec<bool>,
}

/// Dynamic objects before they move.
pub(crate) struct Rest {
    /// At rest, or as bound to a skin, or before they morph.
    pub(crate) vertices: wgpu::Buffer,
    /// On which joints bound vertices hang, object after object.
    pub(crate) influences: wgpu::Buffer,
    /// Where those of each object begin, or [`MovedObject::NO_SKIN`].
    first_influence: Vec<u32>,
    /// Where the differences of each vertex that morphs begin, object after object, each with one
    /// word more for where they end.
    pub(crate) starts: wgpu::Buffer,
    /// What their targets add to vertices.
    pub(crate) differences: wgpu::Buffer,
    /// What each object has of them.
    targets: Vec<MovedTargets>,
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
        let mut starts: Vec<u32> = Vec::new();
        let mut differences: Vec<Difference> = Vec::new();
        let mut targets = vec![MovedTargets::NONE; objects.len()];
        for (i, object) in objects.iter().enumerate() {
            let Some(morphed) = scene.animation.as_ref().and_then(|a| a.morphed(i)) else {
                continue;
            };
            let range = object.vertices.start as usize..object.vertices.end as usize;
            let Some(base) = vertices.get_mut(range) else { continue };
            // Kernels find the differences of a vertex by its number in the object.
            if base.len() != morphed.positions().len() {
                continue;
            }
            let each = morphed.targets();
            let all = differences.len() + each.differences().len();
            if all > u32::MAX as usize || starts.len() + each.starts().len() > u32::MAX as usize {
                return Err(HybridError::TooLarge {
                    what: "the number of differences of morph targets".into(),
                    wanted: all as u64,
                    limit: u64::from(u32::MAX),
                    remedy: "leave some of the targets out",
                });
            }
            targets[i] = MovedTargets {
                first_start: to_u32(starts.len()),
                first_weight: to_u32(morphed.weights().start),
                normals: match each.normals() {
                    MorphNormals::Blended => 0,
                    MorphNormals::Facets => 1,
                    MorphNormals::MirroredFacets => 2,
                },
                pad: 0,
            };
            let first = to_u32(differences.len());
            starts.extend(each.starts().iter().map(|start| first + start));
            differences.extend_from_slice(each.differences());
            for (vertex, position) in base.iter_mut().zip(morphed.positions()) {
                vertex.position = *position;
            }
            for (vertex, normal) in base.iter_mut().zip(morphed.normals()) {
                vertex.normal = *normal;
            }
        }
        let storage = BufferUsages::STORAGE;
        Ok(Self {
            vertices: gpu.upload("vertices at rest", &vertices, storage)?,
            influences: gpu.upload("influences of joints", &influences, storage)?,
            first_influence,
            starts: gpu.upload("places of differences", &starts, storage)?,
            differences: gpu.upload("differences of morph targets", &differences, storage)?,
            targets,
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
            still: still(scene),
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
            |i, material| {
                let has_no_end = settings.endless_when_still && self.still.get(i) == Some(&true);
                if has_no_end { 1.0 } else { material.thickness * settings.thickness }
            },
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
                    targets: rest.targets.get(i).copied().unwrap_or(MovedTargets::NONE),
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

/// Which materials some object wears that stands still.
fn still(scene: &Scene) -> Vec<bool> {
    let mut still = vec![false; scene.materials.len()];
    for object in scene.objects_or_whole().iter().filter(|object| !object.dynamic) {
        let range = object.triangles.start as usize..object.triangles.end as usize;
        for &id in scene.material_ids.get(range).unwrap_or(&[]) {
            if let Some(still) = still.get_mut(id as usize) {
                *still = true;
            }
        }
    }
    still
}

/// True if object `i` is not as it was.
fn moved(animation: Option<&Animation>, i: usize, before: &ScenePose, now: &ScenePose) -> bool {
    let joints = animation.and_then(|a| a.joints_of(i));
    let bent = joints.is_some_and(|j| before.joints.get(j.clone()) != now.joints.get(j));
    let weights = animation.and_then(|a| a.morphed(i)).map(|morphed| morphed.weights());
    let morphed = weights.is_some_and(|w| before.weights.get(w.clone()) != now.weights.get(w));
    bent || morphed || before.objects.get(i) != now.objects.get(i)
}
