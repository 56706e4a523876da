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

/// The mean length of lines within an object, 4 V / S by Cauchy's formula. Of surfaces that are
/// not closed, V is that of the cones between them and the middle of their bounds.
fn mean_chord(mesh: &TriangleMesh, object: &Object) -> f64 {
    let middle = 0.5 * (object.bounds.min.as_dvec3() + object.bounds.max.as_dvec3());
    let mut volume = 0.0;
    let mut surface = 0.0;
    for i in object.triangles.start as usize..(object.triangles.end as usize).min(mesh.len()) {
        let triangle = mesh.triangle(i);
        let [a, b, c] =
            [triangle.v0, triangle.v1, triangle.v2].map(|vertex| vertex.as_dvec3() - middle);
        volume += a.dot(b.cross(c)) / 6.0;
        surface += 0.5 * (b - a).cross(c - a).length();
    }
    // Whichever way the triangles are wound.
    if surface > 0.0 { 4.0 * volume.abs() / surface } else { 0.0 }
}

/// The share of the mean side of its bounds that the mean chord of a body of glass has at least: a
/// ball has 0.67, a figure about 0.4, a drinking glass 0.05.
const SOLID: f64 = 0.2;

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
    /// An object that does not move and whose two longest sides are at least a quarter of the
    /// scene's diagonal is a wall, a room or a ground behind which nothing should be seen: 1. Any
    /// other is as deep as rays through it are long in the mean: four times its volume over its
    /// surface (Cauchy's formula for the mean chord of a body), at most its longest side, over the
    /// scene's diagonal; sheets hold no volume and are thin. A material takes the largest of its
    /// objects.
    ///
    /// One that transmits light takes the smallest mean chord, and its walls are thin
    /// ([`Material::thin_walled`]) if some object that wears it is no body of it alone: where the mean
    /// chord is less than a fifth of the mean side of the bounds, and where the object wears other
    /// materials too.
    pub fn derive_thickness(&mut self) {
        let objects = self.objects_or_whole().into_owned();
        let bounds = self.mesh.bounds();
        let diagonal = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        let mut thickness = vec![None; self.materials.len()];
        let mut thin = vec![false; self.materials.len()];
        for object in &objects {
            let size = object.bounds.max.as_dvec3() - object.bounds.min.as_dvec3();
            // A long arch hides little, so the length of one side makes no wall.
            let second_longest =
                size.to_array().into_iter().fold([0.0; 2], |[a, b], side| {
                    if side > a { [side, a] } else { [a, side.max(b)] }
                })[1];
            let is_wall = !object.dynamic && second_longest >= 0.25 * diagonal;
            let chord = mean_chord(&self.mesh, object).min(size.max_element());
            #[expect(clippy::cast_possible_truncation, reason = "a share of one in f32 is enough")]
            let deep = if is_wall { 1.0 } else { (chord / diagonal).clamp(0.0, 1.0) as f32 };
            if deep.is_nan() {
                continue;
            }
            let range = object.triangles.start as usize..object.triangles.end as usize;
            let ids = self.material_ids.get(range).unwrap_or(&[]);
            // A window is not as deep as its house.
            let is_body = chord >= SOLID * size.element_sum() / 3.0
                && ids.iter().all(|id| Some(id) == ids.first());
            #[expect(clippy::cast_possible_truncation, reason = "a share of one in f32 is enough")]
            let inside = (chord / diagonal).clamp(0.0, 1.0) as f32;
            let mut last = None;
            for &id in ids {
                // Triangles of one material lie together.
                if last.replace(id) != Some(id)
                    && let Some(entry) = thickness.get_mut(id as usize)
                {
                    let passes = self.materials[id as usize].transmission > 0.0;
                    thin[id as usize] |= !is_body;
                    *entry = Some(match *entry {
                        Some(other) if passes => inside.min(other),
                        Some(other) => deep.max(other),
                        None if passes => inside,
                        None => deep,
                    });
                }
            }
        }
        for ((material, thickness), thin) in self.materials.iter_mut().zip(thickness).zip(thin) {
            material.thin_walled = material.transmission > 0.0 && thin;
            material.thickness = match thickness {
                Some(thickness) => thickness,
                None if material.transmission > 0.0 => 0.0,
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
