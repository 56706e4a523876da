//! Objects: the pieces of a scene that move, and are culled, as one.

use crate::{Material, Scene};
use glam::Vec3;
use niwaki_core::{Aabb, TriangleMesh, to_u32};
use std::{borrow::Cow, ops::Range};

/// A run of triangles, with vertices of its own, that moves as one.
///
/// Renderers that keep only what is near in a tree cull by whole objects first and by triangles
/// after (Ganestam and Doggett 2015, §3.3).
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// From the file or the generator; need not be unique.
    pub name: String,
    /// Its triangles in [`Scene::mesh`].
    pub triangles: Range<u32>,
    /// Its vertices in [`Scene::mesh`]. Its triangles use no others, and no other object's
    /// triangles use these.
    pub vertices: Range<u32>,
    /// Bounds of its triangles at rest, empty without any;
    /// [`ObjectPose::bounds`](crate::ObjectPose::bounds) has those at another time.
    pub bounds: Aabb,
    /// True if it moves or changes its shape. What renderers build for others may be kept from
    /// frame to frame.
    pub dynamic: bool,
}

/// The bounds of some triangles of a mesh.
pub(crate) fn bounds_of(mesh: &TriangleMesh, triangles: Range<u32>) -> Aabb {
    let (positions, all) = (mesh.positions(), mesh.indices());
    let triangles = all.get(triangles.start as usize..triangles.end as usize).unwrap_or(&[]);
    Aabb::from_points(triangles.iter().flatten().map(|&i| positions[i as usize]))
}

impl Object {
    /// All of a mesh as one object that does not move.
    #[must_use]
    pub fn whole(name: &str, mesh: &TriangleMesh) -> Self {
        Self {
            name: name.into(),
            triangles: 0..to_u32(mesh.len()),
            vertices: 0..to_u32(mesh.positions().len()),
            bounds: mesh.bounds(),
            dynamic: false,
        }
    }
}

impl Scene {
    /// The objects; one that holds everything if the scene, put together by hand, lists none.
    #[must_use]
    pub fn objects_or_whole(&self) -> Cow<'_, [Object]> {
        if self.objects.is_empty() {
            Cow::Owned(vec![Object::whole(&self.name, &self.mesh)])
        } else {
            Cow::Borrowed(&self.objects)
        }
    }

    /// Sets [`Material::thickness`] of every material from the objects that it covers, as loaders
    /// and generators do.
    ///
    /// An object that does not move and is at least a quarter as long as the scene's diagonal is a
    /// wall or a ground behind which nothing should be seen: 1. Any other is as deep as it is
    /// long: the longest side of its bounds over the scene's diagonal. A material takes the
    /// largest of its objects; one that transmits light is thin (§3.4 of the paper): 0.
    pub fn derive_thickness(&mut self) {
        let objects = self.objects_or_whole().into_owned();
        let bounds = self.mesh.bounds();
        let diagonal = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        let mut thickness = vec![None; self.materials.len()];
        for object in &objects {
            let size = object.bounds.max.as_dvec3() - object.bounds.min.as_dvec3();
            let share = (size.max_element() / diagonal).clamp(0.0, 1.0);
            #[expect(clippy::cast_possible_truncation, reason = "a share of one in f32 is enough")]
            let deep = if !object.dynamic && share >= 0.25 { 1.0 } else { share as f32 };
            if deep.is_nan() {
                continue;
            }
            let range = object.triangles.start as usize..object.triangles.end as usize;
            let mut last = None;
            for &id in self.material_ids.get(range).unwrap_or(&[]) {
                // Triangles of one material lie together.
                if last.replace(id) != Some(id)
                    && let Some(entry) = thickness.get_mut(id as usize)
                {
                    *entry = Some(entry.unwrap_or(0.0_f32).max(deep));
                }
            }
        }
        for (material, thickness) in self.materials.iter_mut().zip(thickness) {
            material.thickness = match thickness {
                _ if material.transmission > 0.0 => 0.0,
                Some(thickness) => thickness,
                None => Material::default().thickness,
            };
        }
    }
}

impl Default for Scene {
    /// No triangles, one default material, and a camera at (0, 0, 3) that looks at the origin,
    /// under a clear sky: a beginning for scenes put together by hand.
    fn default() -> Self {
        let eye = Vec3::new(0.0, 0.0, 3.0);
        Self {
            name: String::from("scene"),
            mesh: TriangleMesh::default(),
            normals: Vec::new(),
            uvs: Vec::new(),
            material_ids: Vec::new(),
            materials: vec![Material::default()],
            textures: Vec::new(),
            objects: Vec::new(),
            cameras: vec![crate::Camera::look_at(eye, Vec3::ZERO, Vec3::Y, 0.7)],
            path: None,
            animation: None,
            lights: Vec::new(),
            environment: crate::Environment::DAYLIGHT,
            dropped: crate::Dropped::default(),
        }
    }
}
