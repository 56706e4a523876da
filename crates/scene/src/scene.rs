//! A scene: triangles with what a renderer needs to know about them.

use crate::{Animation, Camera, CameraPath, Environment, Light, Material, Object, Texture};
use glam::{Vec2, Vec3};
use niwaki_core::TriangleMesh;
use std::fmt;

/// How many notes [`Dropped`] keeps, so that a file with a million faults needs no million lines.
const MOST_NOTES: usize = 64;

/// What a loader left out, counted and named. Degenerate triangles are never left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Dropped {
    /// Triangles with an index past the vertices.
    pub index_out_of_range: usize,
    /// Triangles with a vertex that is NaN or infinite, in the file or after its transform.
    pub non_finite_triangles: usize,
    /// Vertices whose position is NaN or infinite, used or not.
    pub non_finite_vertices: usize,
    /// Points and lines, which have no surface.
    pub points_and_lines: usize,
    /// Textures that are missing, could not be decoded or use an unknown format; materials go
    /// without them.
    pub textures: usize,
    /// Material libraries that are missing or broken, and materials that are used but not
    /// defined; the default material stands in.
    pub materials: usize,
    /// Normals or texture coordinates that were unusable (not finite, of another count than the
    /// vertices, out of range), in meshes or faces.
    pub attributes: usize,
    /// Cameras and lights that say nothing usable.
    pub cameras_and_lights: usize,
    /// Channels of the animation that move what is not read, and objects that it
    /// moves from nothing and to nothing, which rest.
    pub animations: usize,
    /// What was left out and why, in the order found, at most 64 lines; the counts go on.
    pub notes: Vec<String>,
}

impl Dropped {
    /// True if nothing was left out.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.triangles() == 0
            && self.non_finite_vertices == 0
            && self.points_and_lines == 0
            && self.textures == 0
            && self.materials == 0
            && self.attributes == 0
            && self.cameras_and_lights == 0
            && self.animations == 0
    }

    /// Number of triangles left out.
    #[must_use]
    pub const fn triangles(&self) -> usize {
        self.index_out_of_range + self.non_finite_triangles
    }

    /// Adds a line, unless there are too many already.
    pub(crate) fn note(&mut self, text: impl FnOnce() -> String) {
        if self.notes.len() < MOST_NOTES {
            self.notes.push(text());
        }
    }
}

impl fmt::Display for Dropped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("nothing dropped");
        }
        let counts = [
            (self.index_out_of_range, "triangles with an index out of range"),
            (self.non_finite_triangles, "triangles with a non-finite vertex"),
            (self.non_finite_vertices, "non-finite vertices"),
            (self.points_and_lines, "points and lines"),
            (self.textures, "textures"),
            (self.materials, "materials"),
            (self.attributes, "normals or texture coordinates"),
            (self.cameras_and_lights, "cameras and lights"),
            (self.animations, "motions"),
        ];
        let parts: Vec<String> =
            counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        write!(f, "dropped {}", parts.join(", "))?;
        for note in &self.notes {
            write!(f, "\n  {note}")?;
        }
        Ok(())
    }
}

/// Triangles in world space with materials, cameras and lights. Right-handed, Y up for glTF and
/// the generators, as in the file for OBJ.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// From the file name or the generator.
    pub name: String,
    /// The triangles.
    pub mesh: TriangleMesh,
    /// Shading normals of unit length, one a vertex; empty where the file has none (shade with
    /// the triangles' own normals then).
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a vertex, as [`Texture::sample`] takes them; empty where the file
    /// has none.
    pub uvs: Vec<Vec2>,
    /// One index into `materials` a triangle.
    pub material_ids: Vec<u32>,
    /// Never empty.
    pub materials: Vec<Material>,
    /// What the materials refer to.
    pub textures: Vec<Texture>,
    /// What moves, and is culled, as one. Together they hold every triangle and every vertex once,
    /// in order; loaders and generators list them. Empty only in scenes put together by hand,
    /// where [`Scene::objects_or_whole`] has one for everything.
    pub objects: Vec<Object>,
    /// Never empty: the file's, or one chosen by [`automatic_camera`](crate::automatic_camera).
    pub cameras: Vec<Camera>,
    /// How a camera moves through the scene, if that is known; [`Scene::camera_path`] finds a path
    /// where it is not.
    pub path: Option<CameraPath>,
    /// How the objects move, if any does.
    pub animation: Option<Animation>,
    /// Punctual lights. Emissive triangles are found through their materials.
    pub lights: Vec<Light>,
    /// The light from outside; a sky where the file has neither lights nor emissive materials,
    /// otherwise darkness.
    pub environment: Environment,
    /// What the loader left out.
    pub dropped: Dropped,
}

impl Scene {
    /// The material of a triangle.
    ///
    /// # Panics
    /// If `triangle` is not below the number of triangles.
    #[must_use]
    pub fn material(&self, triangle: usize) -> &Material {
        &self.materials[self.material_ids[triangle] as usize]
    }

    /// The triangles that give off light, in order.
    #[must_use]
    pub fn emissive_triangles(&self) -> Vec<u32> {
        let emissive: Vec<bool> = self.materials.iter().map(Material::is_emissive).collect();
        if !emissive.contains(&true) {
            return Vec::new();
        }
        (0_u32..)
            .zip(&self.material_ids)
            .filter(|(_, id)| emissive.get(**id as usize).copied().unwrap_or(false))
            .map(|(triangle, _)| triangle)
            .collect()
    }
}
