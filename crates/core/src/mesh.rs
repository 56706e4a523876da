//! Indexed triangle meshes.

use crate::{Aabb, PrimRef, Triangle, to_u32};
use glam::Vec3;
use rayon::prelude::*;

/// Why a mesh was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// An index points past the vertices. Remedy: correct or drop the triangle; the loaders of
    /// `niwaki-scene` drop and count such triangles.
    #[error("triangle {triangle} uses vertex {index}, but there are only {vertices} vertices")]
    IndexOutOfRange {
        /// The first such triangle.
        triangle: usize,
        /// The index it holds.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A vertex that a triangle uses is NaN or infinite. Remedy: correct the vertex or drop its
    /// triangles.
    #[error("triangle {triangle} uses vertex {index}, whose position {position:?} is not finite")]
    NonFiniteVertex {
        /// The first such triangle.
        triangle: usize,
        /// The vertex.
        index: u32,
        /// Its position.
        position: [f32; 3],
    },
    /// More triangles than 32-bit ids can name. Remedy: build several meshes.
    #[error("{0} triangles are more than a 32-bit id can name")]
    TooManyTriangles(usize),
}

/// Triangles as indices into shared vertices. Degenerate triangles are welcome.
///
/// Constructed meshes are *valid*: every index is in range and every used vertex is finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// A mesh of `positions` and, per triangle, three indices into them.
    ///
    /// # Errors
    /// [`MeshError`] names the first triangle with an index out of range or a vertex that is not
    /// finite.
    pub fn new(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if indices.len() >= u32::MAX as usize {
            return Err(MeshError::TooManyTriangles(indices.len()));
        }
        let bad = indices.par_iter().position_first(|triangle| {
            triangle.iter().any(|&i| !positions.get(i as usize).is_some_and(|p| p.is_finite()))
        });
        let Some(triangle) = bad else { return Ok(Self { positions, indices }) };
        for index in indices[triangle] {
            match positions.get(index as usize) {
                None => {
                    return Err(MeshError::IndexOutOfRange {
                        triangle,
                        index,
                        vertices: positions.len(),
                    });
                }
                Some(p) if !p.is_finite() => {
                    return Err(MeshError::NonFiniteVertex {
                        triangle,
                        index,
                        position: p.to_array(),
                    });
                }
                Some(_) => {}
            }
        }
        unreachable!("the parallel search found a fault in triangle {triangle}")
    }

    /// A mesh without shared vertices.
    ///
    /// # Errors
    /// As [`TriangleMesh::new`].
    pub fn from_triangles(triangles: &[Triangle]) -> Result<Self, MeshError> {
        if triangles.len() > (u32::MAX / 3) as usize {
            return Err(MeshError::TooManyTriangles(triangles.len()));
        }
        let positions = triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]).collect();
        let indices = (0..to_u32(triangles.len())).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Self::new(positions, indices)
    }

    /// The positions and indices, without copying them.
    #[must_use]
    pub fn into_parts(self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        (self.positions, self.indices)
    }

    /// Vertex positions.
    #[must_use]
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Three vertex indices per triangle.
    #[must_use]
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// Number of triangles.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.indices.len()
    }

    /// True without triangles.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The `i`-th triangle.
    ///
    /// # Panics
    /// If `i` is not below [`TriangleMesh::len`].
    #[must_use]
    #[inline]
    pub fn triangle(&self, i: usize) -> Triangle {
        let [a, b, c] = self.indices[i];
        Triangle {
            v0: self.positions[a as usize],
            v1: self.positions[b as usize],
            v2: self.positions[c as usize],
        }
    }

    /// All triangles in order.
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = Triangle> + '_ {
        (0..self.len()).map(|i| self.triangle(i))
    }

    /// The box around all triangles (unused vertices do not count).
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        (0..self.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| self.triangle(i).bounds())
            .reduce(|| Aabb::EMPTY, Aabb::union)
    }

    /// One reference a triangle, in order; computed on the current rayon pool.
    #[must_use]
    pub fn prim_refs(&self) -> Vec<PrimRef> {
        (0..to_u32(self.len()))
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| PrimRef::new(self.triangle(i as usize).bounds(), i))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_named() {
        let vertices = vec![Vec3::ZERO, Vec3::X, Vec3::splat(f32::NAN)];
        let error = TriangleMesh::new(vertices.clone(), vec![[0, 1, 1], [0, 7, 1]]).unwrap_err();
        assert_eq!(error, MeshError::IndexOutOfRange { triangle: 1, index: 7, vertices: 3 });
        let error = TriangleMesh::new(vertices.clone(), vec![[0, 1, 1], [0, 1, 2]]).unwrap_err();
        assert!(matches!(error, MeshError::NonFiniteVertex { triangle: 1, index: 2, .. }));
        // A bad vertex that nothing uses is no fault.
        assert!(TriangleMesh::new(vertices, vec![[0, 1, 1]]).is_ok());
    }
}
