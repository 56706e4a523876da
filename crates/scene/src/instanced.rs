//! Scenes as meshes and the places where they stand.

use crate::{
    Animation, Camera, Dropped, Environment, Light, Material, Motion, Object, Rig, Rigid, Scene,
    Texture,
    animation::{Influence, JointPose, SkinError, Skinned, invert},
    load::LoadOptions,
    object::bounds_of,
};
use glam::{DAffine3, Vec2, Vec3};
use niwaki_core::{Aabb, MeshError, TriangleMesh, to_u32};
use rayon::prelude::*;
use std::{ops::Range, sync::Arc};

/// Triangles of one material in their own coordinates (a primitive of glTF, a group of OBJ).
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// From the file.
    pub name: String,
    /// The triangles.
    pub mesh: TriangleMesh,
    /// Unit shading normals, one a vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// On which joints the vertices hang where an instance has a skin, one a vertex, or empty.
    pub influences: Vec<Influence>,
    /// Index into the scene's materials.
    pub material: u32,
}

/// A place where a part stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into the scene's parts.
    pub part: u32,
    /// From the part's coordinates to the world. In `f64`, so that long chains of nodes do not
    /// add up rounding; one that mirrors (negative determinant) turns triangles inside out, and
    /// flattening turns them back. At rest, if the instance moves.
    pub transform: DAffine3,
    /// Index into [`Rig::nodes`]: what it moves with, if it does.
    pub node: Option<u32>,
    /// Index into [`Rig::skins`]: what bends it, if anything does. Joints then say where the
    /// vertices are, and neither transform nor node does.
    pub skin: Option<u32>,
}

impl Instance {
    /// A part that does not move.
    #[must_use]
    pub const fn still(part: u32, transform: DAffine3) -> Self {
        Self { part, transform, node: None, skin: None }
    }
}

/// A scene whose repeated meshes are stored once. [`Scene`] is the same flattened.
#[derive(Clone, Debug, PartialEq)]
pub struct InstancedScene {
    /// From the file name.
    pub name: String,
    /// Each stored once.
    pub parts: Vec<Part>,
    /// Where the parts stand, in the order of the file's nodes.
    pub instances: Vec<Instance>,
    /// Never empty.
    pub materials: Vec<Material>,
    /// What the materials refer to.
    pub textures: Vec<Texture>,
    /// The file's cameras; may be empty.
    pub cameras: Vec<Camera>,
    /// The file's punctual lights.
    pub lights: Vec<Light>,
    /// The light that the file says comes from outside, `None` if it says nothing.
    pub environment: Option<Environment>,
    /// How instances move, if any does; no vertices hang on its skins yet.
    pub rig: Rig,
    /// How many seconds that motion has.
    pub duration: f64,
    /// What the loader left out.
    pub dropped: Dropped,
}

/// Why a scene could not be flattened.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlattenError {
    /// The instances have more triangles together than the options allow, or more vertices than
    /// 32 bits can number. Remedy: raise the limit, or trace the instances unflattened.
    #[error(
        "flattened, the instances have {triangles} triangles and {vertices} vertices; \
         the limit is {limit} triangles"
    )]
    TooLarge {
        /// Triangles of all instances.
        triangles: u64,
        /// Vertices of all instances.
        vertices: u64,
        /// The limit.
        limit: u64,
    },
    /// Vertices hang on joints that their skin does not have, or a part has not as many of
    /// everything. Remedy: correct the part's influences, or the skin.
    #[error("{part}: {source}")]
    Skin {
        /// The part's name.
        part: String,
        /// What is wrong.
        source: SkinError,
    },
    /// The core refuses the triangles.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

impl InstancedScene {
    /// Number of triangles once flattened.
    #[must_use]
    pub fn flattened_len(&self) -> u64 {
        self.sum(|part| part.mesh.len())
    }

    fn sum(&self, size: impl Fn(&Part) -> usize) -> u64 {
        self.instances
            .iter()
            .filter_map(|i| self.parts.get(i.part as usize))
            .map(|part| size(part) as u64)
            .sum()
    }

    /// All instances as triangles in the world, in order, each an [`Object`]. Triangles whose vertices a transform
    /// takes out of the range of `f32` are dropped and counted.
    ///
    /// If some parts have normals and others not, the others get their triangles' own normals
    /// (as glTF 2.0 §3.7.2.1 asks), for which their triangles stop sharing vertices.
    ///
    /// # Errors
    /// [`FlattenError::TooLarge`] before anything is allocated.
    pub fn flatten(mut self, options: &LoadOptions) -> Result<Scene, FlattenError> {
        let any_normals = self.parts.iter().any(|p| !p.normals.is_empty());
        let any_uvs = self.parts.iter().any(|p| !p.uvs.is_empty());
        if any_normals {
            self.parts.par_iter_mut().filter(|p| p.normals.is_empty()).for_each(facet);
        }
        let triangles = self.flattened_len();
        let vertices = self.sum(|part| part.mesh.positions().len());
        let limit = options.max_triangles;
        if triangles > limit || vertices >= u64::from(u32::MAX) {
            return Err(FlattenError::TooLarge { triangles, vertices, limit });
        }
        let material_count = self.materials.len();
        let mut moves = Moves::new(std::mem::take(&mut self.rig));
        let mut out = Flat::default();
        let single = self.parts.len() == 1
            && matches!(self.instances[..], [only] if only == Instance::still(0, DAffine3::IDENTITY));
        if single && let Some(part) = self.parts.pop() {
            out.material_ids = vec![part.material; part.mesh.len()];
            out.objects = vec![Object::whole(&part.name, &part.mesh)];
            (out.positions, out.indices) = part.mesh.into_parts();
            (out.normals, out.uvs) = (part.normals, part.uvs);
        } else {
            out.reserve(triangles, vertices, any_normals, any_uvs);
            for instance in &self.instances {
                let Some(part) = self.parts.get(instance.part as usize) else { continue };
                let motion = moves.motion(part, instance, &mut self.dropped)?;
                let joints = moves.joints(instance).filter(|_| !part.influences.is_empty());
                let place = joints.map_or(Place::At(instance.transform), Place::By);
                out.append(part, &place, any_uvs, &mut self.dropped);
                if let Some(object) = out.objects.last_mut() {
                    object.dynamic = !motion.is_rest();
                }
                moves.motions.push(motion);
            }
        }
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        for id in out.material_ids.iter_mut().filter(|id| **id as usize >= material_count.max(1)) {
            *id = 0;
        }
        let mesh = TriangleMesh::new(out.positions, out.indices)?;
        out.objects.par_iter_mut().for_each(|o| o.bounds = bounds_of(&mesh, o.triangles.clone()));
        let mut scene = Scene {
            name: self.name,
            mesh,
            normals: out.normals,
            uvs: out.uvs,
            material_ids: out.material_ids,
            materials: self.materials,
            textures: self.textures,
            objects: out.objects,
            cameras: self.cameras,
            path: None,
            animation: moves.finish(self.duration),
            lights: self.lights,
            environment: self.environment.unwrap_or(Environment::DARK),
            dropped: self.dropped,
        };
        crate::automatic::complete(&mut scene, self.environment.is_none());
        scene.derive_thickness();
        Ok(scene)
    }
}

#[derive(Default)]
struct Flat {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    material_ids: Vec<u32>,
    objects: Vec<Object>,
}

impl Flat {
    fn reserve(&mut self, triangles: u64, vertices: u64, normals: bool, uvs: bool) {
        let triangles = usize::try_from(triangles).unwrap_or(0);
        let vertices = usize::try_from(vertices).unwrap_or(0);
        self.positions.reserve_exact(vertices);
        self.indices.reserve_exact(triangles);
        self.material_ids.reserve_exact(triangles);
        self.normals.reserve_exact(if normals { vertices } else { 0 });
        self.uvs.reserve_exact(if uvs { vertices } else { 0 });
    }

    fn append(&mut self, part: &Part, at: &Place<'_>, uvs: bool, dropped: &mut Dropped) {
        let first = self.positions.len();
        let base = to_u32(first);
        let identity = matches!(at, Place::At(transform) if *transform == DAffine3::IDENTITY);
        let mirrored = at.mirrors();
        match at {
            Place::At(_) if identity => {
                self.positions.extend_from_slice(part.mesh.positions());
                self.normals.extend_from_slice(&part.normals);
            }
            Place::At(transform) => {
                let place = |p: &Vec3| transform.transform_point3(p.as_dvec3()).as_vec3();
                self.positions.par_extend(part.mesh.positions().par_iter().map(place));
                // Normals transform by the inverse transpose; the cofactors are the same up to a
                // positive factor once the sign of the determinant is put right, and exist always.
                let m = transform.matrix3;
                let sign = if mirrored { -1.0 } else { 1.0 };
                let cofactors = [
                    m.y_axis.cross(m.z_axis) * sign,
                    m.z_axis.cross(m.x_axis) * sign,
                    m.x_axis.cross(m.y_axis) * sign,
                ];
                self.normals.par_extend(part.normals.par_iter().map(|n| {
                    let n = n.as_dvec3();
                    let turned = cofactors[0] * n.x + cofactors[1] * n.y + cofactors[2] * n.z;
                    turned.try_normalize().map_or(Vec3::Y, |n| n.as_vec3())
                }));
            }
            Place::By(joints) => {
                let pairs = part.mesh.positions().par_iter().zip(&part.influences);
                let point = |(p, i): (&Vec3, &Influence)| JointPose::blended(joints, i).point(*p);
                self.positions.par_extend(pairs.map(point));
                let pairs = part.normals.par_iter().zip(&part.influences);
                let sign = if mirrored { -1.0 } else { 1.0 };
                let normal =
                    |(n, i): (&Vec3, &Influence)| JointPose::blended(joints, i).normal(*n * sign);
                self.normals.par_extend(pairs.map(normal));
            }
        }
        self.uvs.extend_from_slice(&part.uvs);
        if uvs {
            self.uvs.resize(self.positions.len(), Vec2::ZERO);
        }
        let placed = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| i + base);
            if mirrored { [a, c, b] } else { [a, b, c] }
        };
        if identity || self.positions[first..].par_iter().all(|p| p.is_finite()) {
            self.indices.par_extend(part.mesh.indices().par_iter().map(placed));
        } else {
            let finite = |t: &[u32; 3]| t.iter().all(|&i| self.positions[i as usize].is_finite());
            let kept = part.mesh.indices().iter().map(placed).filter(finite);
            let before = self.indices.len();
            self.indices.extend(kept);
            let lost = part.mesh.len() - (self.indices.len() - before);
            dropped.non_finite_triangles += lost;
            dropped.note(|| {
                format!("{}: {lost} triangles whose transform is out of range", part.name)
            });
        }
        let triangles = to_u32(self.material_ids.len())..to_u32(self.indices.len());
        self.material_ids.resize(self.indices.len(), part.material);
        self.objects.push(Object {
            name: part.name.clone(),
            triangles,
            vertices: base..to_u32(self.positions.len()),
            bounds: Aabb::EMPTY,
            dynamic: false,
        });
    }
}

/// Where an instance stands at rest.
enum Place<'a> {
    At(DAffine3),
    /// Where these joints take its vertices.
    By(&'a [JointPose]),
}

impl Place<'_> {
    /// True if it turns triangles inside out.
    fn mirrors(&self) -> bool {
        match self {
            Self::At(transform) => transform.matrix3.determinant() < 0.0,
            Self::By(joints) => {
                let mirrors = |joint: &&JointPose| {
                    let [a, b, c] = joint.rows.map(|row| row.truncate().as_dvec3());
                    a.dot(b.cross(c)) < 0.0
                };
                2 * joints.iter().filter(mirrors).count() > joints.len()
            }
        }
    }
}

/// The motions of the objects, as they are flattened.
struct Moves {
    rig: Rig,
    /// Where the nodes rest.
    worlds: Vec<DAffine3>,
    /// What the joints of all skins do at rest, and which are each skin's.
    joints: Vec<JointPose>,
    ranges: Vec<Range<usize>>,
    motions: Vec<Motion>,
}

impl Moves {
    fn new(rig: Rig) -> Self {
        let worlds = rig.worlds(None);
        let joints = rig.joints(&worlds);
        let mut next = 0;
        let range = |skin: &crate::animation::Skin| {
            let first = next;
            next += skin.joints.len();
            first..next
        };
        let ranges = rig.skins.iter().map(range).collect();
        Self { rig, worlds, joints, ranges, motions: Vec::new() }
    }

    /// What the joints of an instance do at rest, if it has a skin.
    fn joints(&self, instance: &Instance) -> Option<&[JointPose]> {
        self.joints.get(self.ranges.get(instance.skin? as usize)?.clone())
    }

    fn motion(
        &mut self,
        part: &Part,
        instance: &Instance,
        dropped: &mut Dropped,
    ) -> Result<Motion, FlattenError> {
        if let Some(number) = instance.skin
            && let Some(skin) = self.rig.skins.get(number as usize)
            && !part.influences.is_empty()
        {
            let mirrored = self.joints(instance).is_some_and(|joints| Place::By(joints).mirrors());
            let sign = if mirrored { -1.0 } else { 1.0 };
            // Also where nothing moves: what follows relies on the numbers of joints.
            let skinned = Skinned::new(
                number,
                skin.joints.len(),
                part.mesh.positions().to_vec(),
                part.normals.iter().map(|n| *n * sign).collect(),
                part.influences.clone(),
            )
            .map_err(|source| FlattenError::Skin { part: part.name.clone(), source })?;
            if skin.joints.iter().all(|joint| joint.node.is_none()) {
                return Ok(Motion::default());
            }
            self.rig.skinned.push(skinned);
            let skinned = Some(to_u32(self.rig.skinned.len() - 1));
            return Ok(Motion { skinned, ..Motion::default() });
        }
        let Some(node) = instance.node else { return Ok(Motion::default()) };
        match self.worlds.get(node as usize).and_then(invert) {
            Some(from_rest) => {
                Ok(Motion { rigid: Rigid::Node { node, from_rest }, ..Motion::default() })
            }
            None => {
                dropped.animations += 1;
                dropped.note(|| format!("{}: it is flat at rest, so it cannot move", part.name));
                Ok(Motion::default())
            }
        }
    }

    /// The animation, if anything moves.
    fn finish(self, duration: f64) -> Option<Animation> {
        let moves = self.motions.iter().any(|motion| !motion.is_rest());
        // A single pose has no length, but there is something to show.
        let duration = if duration > 0.0 { duration } else { 1.0 };
        moves.then(|| Animation { motions: self.motions, duration, rig: Arc::new(self.rig) })
    }
}

/// Gives every triangle of a part its own vertices with its own normal.
fn facet(part: &mut Part) {
    let mesh = std::mem::take(&mut part.mesh);
    // Sixfold growth at most, and only where a file mixes; too many vertices stay as they were.
    if mesh.len() >= (u32::MAX / 3) as usize {
        part.mesh = mesh;
        return;
    }
    let flat = |i: u32| [3 * i, 3 * i + 1, 3 * i + 2];
    let normal = |t: niwaki_core::Triangle| {
        let [a, b, c] = t.vertices().map(|v| v.as_dvec3());
        [(b - a).cross(c - a).try_normalize().map_or(Vec3::Y, |n| n.as_vec3()); 3]
    };
    part.normals = mesh.triangles().flat_map(normal).collect();
    if !part.uvs.is_empty() {
        part.uvs = mesh.indices().iter().flatten().map(|&i| part.uvs[i as usize]).collect();
    }
    if !part.influences.is_empty() {
        let influence = |&i: &u32| part.influences[i as usize];
        part.influences = mesh.indices().iter().flatten().map(influence).collect();
    }
    let positions: Vec<Vec3> = mesh.triangles().flat_map(|t| t.vertices()).collect();
    let indices = (0..to_u32(mesh.len())).map(flat).collect();
    part.mesh = TriangleMesh::new(positions, indices).unwrap_or(mesh);
}
