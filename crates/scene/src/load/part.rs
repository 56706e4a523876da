//! Triangles as files list them, made into valid parts.

use crate::{
    Dropped, Part,
    animation::{Influence, Targets},
};
use glam::{Vec2, Vec3};
use niwaki_core::{MeshError, TriangleMesh};
use rayon::prelude::*;

/// Triangles of one material, unchecked.
#[derive(Default)]
pub(super) struct RawPart {
    pub(super) name: String,
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    /// One a vertex, or empty.
    pub(super) influences: Vec<Influence>,
    /// Of as many vertices.
    pub(super) targets: Option<Targets>,
    pub(super) indices: Vec<[u32; 3]>,
    pub(super) material: u32,
}

impl RawPart {
    /// Leaves out triangles that cannot be, counts them in `dropped` and names the first of each
    /// kind. Attributes of another count than the vertices are left out as a whole; those that
    /// are not finite are replaced (normals by up, coordinates by zero).
    pub(super) fn check(mut self, dropped: &mut Dropped) -> Result<Part, MeshError> {
        let name = std::mem::take(&mut self.name);
        let count = self.positions.len();
        let bad_vertices = self.positions.par_iter().filter(|p| !p.is_finite()).count();
        if bad_vertices > 0 {
            dropped.non_finite_vertices += bad_vertices;
            let first = self.positions.iter().position(|p| !p.is_finite()).unwrap_or(0);
            dropped.note(|| format!("{name}: {bad_vertices} non-finite vertices, first {first}"));
        }
        let outside = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= count);
        let positions = &self.positions;
        let infinite = |t: &[u32; 3]| t.iter().any(|&i| !positions[i as usize].is_finite());
        let out_of_range = self.indices.par_iter().filter(|t| outside(t)).count();
        let mut non_finite = 0;
        if out_of_range > 0 {
            let first = self.indices.iter().position(outside).unwrap_or(0);
            dropped.index_out_of_range += out_of_range;
            dropped.note(|| {
                format!(
                    "{name}: {out_of_range} triangles with an index out of range, first {first}, \
                     among {count} vertices"
                )
            });
            self.indices.retain(|t| !outside(t));
        }
        if bad_vertices > 0 {
            non_finite = self.indices.par_iter().filter(|t| infinite(t)).count();
            self.indices.retain(|t| !infinite(t));
        }
        if non_finite > 0 {
            dropped.non_finite_triangles += non_finite;
            dropped.note(|| format!("{name}: {non_finite} triangles with a non-finite vertex"));
        }
        check_attribute(&mut self.normals, count, &name, "normals", dropped, |n| {
            match n.try_normalize() {
                // Keep the file's bits where they are good already.
                Some(_) if n.is_normalized() => Some(n),
                other => other,
            }
            .unwrap_or(Vec3::Y)
        });
        check_attribute(&mut self.uvs, count, &name, "texture coordinates", dropped, |uv| {
            if uv.is_finite() { uv } else { Vec2::ZERO }
        });
        Ok(Part {
            name,
            mesh: TriangleMesh::new(self.positions, self.indices)?,
            normals: self.normals,
            uvs: self.uvs,
            influences: self.influences,
            targets: self.targets,
            material: self.material,
        })
    }
}

fn check_attribute<T: Copy + Send + Sync>(
    values: &mut Vec<T>,
    count: usize,
    name: &str,
    what: &str,
    dropped: &mut Dropped,
    mend: impl Fn(T) -> T + Send + Sync,
) {
    if !values.is_empty() && values.len() != count {
        dropped.attributes += 1;
        dropped.note(|| format!("{name}: {} {what} for {count} vertices", values.len()));
        values.clear();
    }
    values.par_iter_mut().for_each(|v| *v = mend(*v));
}
