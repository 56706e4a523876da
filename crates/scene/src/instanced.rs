//! Scenes as meshes and the places where they stand.

mod moves;

use crate::{
    Camera, Dropped, Environment, Light, Material, Object, Rig, Scene, Texture,
    animation::{Influence, JointPose, MorphError, SkinError, Targets},
    load::LoadOptions,
    object::bounds_of,
};
use glam::{DAffine3, Vec2, Vec3};
use moves::{Moves, Place};
use niwaki_core::{Aabb, MeshError, TriangleMesh, to_u32};
use rayon::prelude::*;

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
    /// Its morph targets, if it has any.
    pub targets: Option<Targets>,
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
    /// Index into [`Rig::weights`]: how far it goes to the targets of its part. Without, as all
    /// else that is not there, it stays as it is.
    pub weights: Option<u32>,
}

impl Instance {
    /// A part that does not move.
    #[must_use]
    pub const fn still(part: u32, transform: DAffine3) -> Self {
        Self { part, transform, node: None, skin: None, weights: None }
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
    /// How instances move, if any does; no vertices hang on its skins and weights yet.
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
    /// A part has not as many of everything, or its instance not as many weights. Remedy: correct
    /// the part's targets, or the weights.
    #[error("{part}: {source}")]
    Morph {
        /// The part's name.
        part: String,
        /// What is wrong.
        source: MorphError,
    },
    /// The instances that morph have more differences to their targets together than the options
    /// allow. Remedy: raise the limit.
    #[error(
        "flattened, the morph targets of the instances take {bytes} bytes; the limit is {limit}"
    )]
    TooManyDifferences {
        /// Of all instances.
        bytes: u64,
        /// The limit.
        limit: u64,
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

    /// What the targets of all instances take that go to some.
    fn morph_bytes(&self) -> u64 {
        let targets = |i: &Instance| {
            i.weights.and_then(|_| self.parts.get(i.part as usize)?.targets.as_ref())
        };
        let bytes = |t: &Targets| (size_of_val(t.differences()) + size_of_val(t.starts())) as u64;
        self.instances.iter().filter_map(targets).map(bytes).fold(0, u64::saturating_add)
    }

    /// All instances as triangles in the world, in order, each an [`Object`]. Triangles whose vertices a transform
    /// takes out of the range of `f32` are dropped and counted.
    ///
    /// If some parts have normals and others not, the others get their triangles' own normals
    /// (as glTF 2.0 §3.7.2.1 asks), for which their triangles stop sharing vertices.
    ///
    /// # Errors
    /// [`FlattenError::TooLarge`] and [`FlattenError::TooManyDifferences`] before anything is
    /// allocated, [`FlattenError::Skin`] and [`FlattenError::Morph`].
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
        let bytes = self.morph_bytes();
        if bytes > options.max_bytes {
            return Err(FlattenError::TooManyDifferences { bytes, limit: options.max_bytes });
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
                let shape = moves.shape(part, instance);
                let shape = (shape.0.as_ref(), shape.1.as_ref());
                out.append(part, shape, &place, any_uvs, &mut self.dropped);
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

    /// Adds positions and normals where a place takes them.
    fn place(
        &mut self,
        (positions, normals): (&[Vec3], &[Vec3]),
        influences: &[Influence],
        at: &Place<'_>,
    ) {
        let mirrored = at.mirrors();
        match at {
            Place::At(_) if at.is_identity() => {
                self.positions.extend_from_slice(positions);
                self.normals.extend_from_slice(normals);
            }
            Place::At(transform) => {
                let place = |p: &Vec3| transform.transform_point3(p.as_dvec3()).as_vec3();
                self.positions.par_extend(positions.par_iter().map(place));
                // Normals transform by the inverse transpose; the cofactors are the same up to a
                // positive factor once the sign of the determinant is put right, and exist always.
                let m = transform.matrix3;
                let sign = if mirrored { -1.0 } else { 1.0 };
                let cofactors = [
                    m.y_axis.cross(m.z_axis) * sign,
                    m.z_axis.cross(m.x_axis) * sign,
                    m.x_axis.cross(m.y_axis) * sign,
                ];
                self.normals.par_extend(normals.par_iter().map(|n| {
                    let n = n.as_dvec3();
                    let turned = cofactors[0] * n.x + cofactors[1] * n.y + cofactors[2] * n.z;
                    turned.try_normalize().map_or(Vec3::Y, |n| n.as_vec3())
                }));
            }
            Place::By(joints) => {
                let pairs = positions.par_iter().zip(influences);
                let point = |(p, i): (&Vec3, &Influence)| JointPose::blended(joints, i).point(*p);
                self.positions.par_extend(pairs.map(point));
                let pairs = normals.par_iter().zip(influences);
                let sign = if mirrored { -1.0 } else { 1.0 };
                let normal =
                    |(n, i): (&Vec3, &Influence)| JointPose::blended(joints, i).normal(*n * sign);
                self.normals.par_extend(pairs.map(normal));
            }
        }
    }

    /// Adds a part whose positions and normals are those of `shape`.
    fn append(
        &mut self,
        part: &Part,
        shape: (&[Vec3], &[Vec3]),
        at: &Place<'_>,
        uvs: bool,
        dropped: &mut Dropped,
    ) {
        let first = self.positions.len();
        let base = to_u32(first);
        let identity = at.is_identity();
        let mirrored = at.mirrors();
        self.place(shape, &part.influences, at);
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

/// Gives every triangle of a part its own vertices with its own normal.
fn facet(part: &mut Part) {
    // Sixfold growth at most, and only where a file mixes; too many vertices, and too many
    // differences, stay as they were.
    if part.mesh.len() >= (u32::MAX / 3) as usize {
        return;
    }
    if let Some(targets) = &part.targets {
        let corners = part.mesh.indices().iter().flatten().map(|&i| i as usize);
        let Some(gathered) = targets.gathered(corners) else { return };
        part.targets = Some(gathered.faceted());
    }
    let mesh = std::mem::take(&mut part.mesh);
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
