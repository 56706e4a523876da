//! Morph targets: vertices that move along differences, each by a weight (glTF 2.0 §3.7.2.2).

use super::{Rig, WeightTrack};
use glam::{DMat3, Vec3};
use niwaki_core::{Aabb, to_u32};
use rayon::prelude::*;
use std::ops::Range;

/// What a target adds to a vertex at weight 1: 32 bytes, to be copied to a GPU as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Difference {
    /// To its position.
    pub position: Vec3,
    /// Which target, from 0.
    pub target: u32,
    /// To its unit normal, before the sum is brought to unit length again.
    pub normal: Vec3,
    /// 0.
    pub pad: u32,
}

/// How normals follow vertices that morph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MorphNormals {
    /// By the differences of the targets, as smooth surfaces do.
    #[default]
    Blended,
    /// Each three vertices in order are a triangle of their own, and its normal is theirs.
    Facets,
    /// The same of triangles that a mirror has turned inside out.
    MirroredFacets,
}

/// The differences of all targets, vertex by vertex; those that are zero take no room.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets {
    count: u32,
    /// Where those of each vertex begin; one more than there are vertices.
    starts: Vec<u32>,
    /// Those of a vertex in the order of the targets.
    differences: Vec<Difference>,
    normals: MorphNormals,
}

/// Why vertices do not morph.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MorphError {
    /// A difference belongs to a vertex or a target that does not exist. Remedy: correct the
    /// number.
    #[error(
        "a difference is for vertex {vertex} of {vertices} and for target {target} of {targets}"
    )]
    Range {
        /// The vertex, from 0.
        vertex: u32,
        /// How many there are.
        vertices: usize,
        /// The target, from 0.
        target: u32,
        /// How many there are.
        targets: u32,
    },
    /// A difference is NaN or infinite. Remedy: correct it, or leave it out.
    #[error("target {target} moves vertex {vertex} by what is not finite")]
    NotFinite {
        /// The vertex, from 0.
        vertex: u32,
        /// The target, from 0.
        target: u32,
    },
    /// There are more differences than 32 bits can number. Remedy: split the mesh.
    #[error("there are {differences} differences, more than 32 bits can number")]
    TooMany {
        /// How many.
        differences: usize,
    },
    /// Not every vertex has its differences, or its normal, or not every target its weight.
    /// Remedy: give one of each a vertex, or no normals, and one weight a target.
    #[error(
        "{vertices} vertices have differences for {moved} and {normals} normals; \
         {targets} targets have {weights} weights"
    )]
    Count {
        /// Number of positions.
        vertices: usize,
        /// Number of vertices that the targets know.
        moved: usize,
        /// Number of normals.
        normals: usize,
        /// Number of targets.
        targets: u32,
        /// Number of weights.
        weights: usize,
    },
}

impl Targets {
    /// `count` targets of `vertices` vertices, from a difference each for some vertex, in any
    /// order; those of one vertex and one target add up. Zeros are left out.
    ///
    /// # Errors
    /// [`MorphError::Range`], [`MorphError::NotFinite`] and [`MorphError::TooMany`].
    pub fn new(
        count: u32,
        vertices: usize,
        differences: &[(u32, Difference)],
    ) -> Result<Self, MorphError> {
        if differences.len() >= u32::MAX as usize {
            return Err(MorphError::TooMany { differences: differences.len() });
        }
        for &(vertex, Difference { position, normal, target, .. }) in differences {
            if vertex as usize >= vertices || target >= count {
                return Err(MorphError::Range { vertex, vertices, target, targets: count });
            }
            if !(position.is_finite() && normal.is_finite()) {
                return Err(MorphError::NotFinite { vertex, target });
            }
        }
        let is_zero = |d: &Difference| d.position == Vec3::ZERO && d.normal == Vec3::ZERO;
        let kept = || differences.iter().filter(|(_, difference)| !is_zero(difference));
        let mut starts = vec![0_u32; vertices + 1];
        for (vertex, _) in kept() {
            starts[*vertex as usize + 1] += 1;
        }
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let mut next = starts.clone();
        let mut sorted = vec![Difference::default(); starts[vertices] as usize];
        for (vertex, difference) in kept() {
            let place = &mut next[*vertex as usize];
            sorted[*place as usize] = Difference { pad: 0, ..*difference };
            *place += 1;
        }
        for v in 0..vertices {
            sorted[starts[v] as usize..starts[v + 1] as usize].sort_by_key(|d| d.target);
        }
        Ok(Self { count, starts, differences: sorted, normals: MorphNormals::Blended })
    }

    /// Number of targets.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// Number of vertices, moved or not.
    #[must_use]
    pub const fn vertices(&self) -> usize {
        self.starts.len() - 1
    }

    /// Where in [`Targets::differences`] those of each vertex begin, and where the last ends.
    #[must_use]
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// All differences, vertex after vertex.
    #[must_use]
    pub fn differences(&self) -> &[Difference] {
        &self.differences
    }

    /// How normals follow.
    #[must_use]
    pub const fn normals(&self) -> MorphNormals {
        self.normals
    }

    fn of(&self, vertex: usize) -> &[Difference] {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        &self.differences[range]
    }

    /// The targets of a mesh whose vertices are these of this one, which exist. `None` if they
    /// are more than 32 bits can number.
    pub(crate) fn gathered(&self, vertices: impl Iterator<Item = usize> + Clone) -> Option<Self> {
        let total: usize = vertices.clone().map(|v| self.of(v).len()).sum();
        if total >= u32::MAX as usize {
            return None;
        }
        let mut differences = Vec::with_capacity(total);
        let mut starts = vec![0];
        for v in vertices {
            differences.extend_from_slice(self.of(v));
            starts.push(to_u32(differences.len()));
        }
        Some(Self { count: self.count, starts, differences, normals: self.normals })
    }

    /// The same with the normals of triangles of three vertices each.
    pub(crate) fn faceted(self) -> Self {
        Self { normals: MorphNormals::Facets, ..self }
    }

    /// The targets of a mesh that a transform takes elsewhere; `normals` are the unit normals
    /// before it, if there are any, and `mirrored` says that it turns triangles inside out.
    pub(crate) fn transformed(&self, matrix: &DMat3, normals: &[Vec3], mirrored: bool) -> Self {
        let sign = if mirrored { -1.0 } else { 1.0 };
        let m = matrix;
        let cofactors = DMat3::from_cols(
            m.y_axis.cross(m.z_axis) * sign,
            m.z_axis.cross(m.x_axis) * sign,
            m.x_axis.cross(m.y_axis) * sign,
        );
        let mut moved = self.clone();
        for v in 0..self.vertices() {
            // As much as the normal itself is scaled to unit length.
            let length = normals.get(v).map_or(0.0, |n| (cofactors * n.as_dvec3()).length());
            let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
            for d in &mut moved.differences[self.starts[v] as usize..self.starts[v + 1] as usize] {
                d.position = (*m * d.position.as_dvec3()).as_vec3();
                d.normal = (cofactors * d.normal.as_dvec3() * scale).as_vec3();
            }
        }
        moved.mirrored(mirrored)
    }

    /// The same for normals that are the other way round, if asked for.
    fn mirrored(self, mirrored: bool) -> Self {
        let normals = match self.normals {
            MorphNormals::Facets if mirrored => MorphNormals::MirroredFacets,
            MorphNormals::MirroredFacets if mirrored => MorphNormals::Facets,
            same => same,
        };
        Self { normals, ..self }
    }

    /// The same for a mesh whose normals are turned round.
    pub(crate) fn with_turned_normals(&self) -> Self {
        let mut turned = self.clone();
        turned.differences.iter_mut().for_each(|d| d.normal = -d.normal);
        turned.mirrored(true)
    }

    /// Writes where vertices and normals are with these weights; weights that are missing are 0.
    pub(crate) fn shape(
        &self,
        weights: &[f32],
        base: (&[Vec3], &[Vec3]),
        positions: &mut [Vec3],
        normals: &mut [Vec3],
    ) {
        let weight = |d: &Difference| weights.get(d.target as usize).copied().unwrap_or(0.0);
        let of = |v: usize| self.of(v).iter();
        let moved = positions.par_iter_mut().zip(base.0).take(self.vertices()).enumerate();
        moved.with_min_len(4096).for_each(|(v, (p, base))| {
            *p = of(v).fold(*base, |p, d| p + d.position * weight(d));
        });
        let turned = normals.par_iter_mut().zip(base.1).take(self.vertices()).enumerate();
        turned.with_min_len(4096).for_each(|(v, (n, base))| {
            let sum = of(v).fold(*base, |n, d| n + d.normal * weight(d));
            *n = sum.try_normalize().unwrap_or(*base);
        });
        let sign = match self.normals {
            MorphNormals::Blended => return,
            MorphNormals::Facets => 1.0,
            MorphNormals::MirroredFacets => -1.0,
        };
        let triangles = normals.par_chunks_exact_mut(3).zip(positions.par_chunks_exact(3));
        triangles.with_min_len(1024).for_each(|(normals, p)| {
            if let Some(n) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() {
                normals.fill(n * sign);
            }
        });
    }
}

/// How far a mesh goes to each of its targets over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphWeights {
    /// One a target, at rest, and always without a track.
    pub rest: Vec<f32>,
    /// Over time, for as many targets.
    pub track: Option<WeightTrack>,
}

impl MorphWeights {
    /// At a time in seconds, or at rest; as many as there are at rest, where the track has no
    /// finite value that one.
    fn at(&self, time: Option<f64>) -> Vec<f32> {
        let mut weights = self.rest.clone();
        if let (Some(time), Some(track)) = (time, &self.track) {
            for (weight, now) in weights.iter_mut().zip(track.at(time)) {
                #[expect(clippy::cast_possible_truncation, reason = "weights are f32 in files")]
                let now = now as f32;
                if now.is_finite() {
                    *weight = now;
                }
            }
        }
        weights
    }
}

impl Rig {
    /// The weights of all [`Rig::weights`] at a time in seconds, or at rest, one after another.
    #[must_use]
    pub fn weights_at(&self, time: Option<f64>) -> Vec<f32> {
        self.weights.iter().flat_map(|weights| weights.at(time)).collect()
    }

    /// Where the weights of number `index` of [`Rig::weights`] are in what [`Rig::weights_at`]
    /// returns.
    #[must_use]
    pub fn weight_range(&self, index: u32) -> Option<Range<usize>> {
        let count = self.weights.get(index as usize)?.rest.len();
        let first = self.weights[..index as usize].iter().map(|w| w.rest.len()).sum();
        Some(first..first + count)
    }
}

/// The vertices of one object before they morph, and what its targets add to them.
///
/// With base b, weights w and differences d a vertex is at b + Σ wₖ dₖ, and its normal the same
/// sum of normals, brought to unit length. What bends or moves the object comes after.
#[derive(Clone, Debug, PartialEq)]
pub struct Morphed {
    weights: Range<u32>,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    targets: Targets,
    /// Of the vertices before they morph.
    bounds: Aabb,
    /// Bounds of what each target adds to any vertex, nothing included, where it adds something.
    reach: Vec<(u32, Aabb)>,
}

impl Morphed {
    /// Vertices with targets, whose weights are `weights` among those of a pose
    /// ([`Rig::weight_range`]); `normals` may be empty.
    ///
    /// # Errors
    /// [`MorphError::Count`].
    pub fn new(
        weights: Range<usize>,
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        targets: Targets,
    ) -> Result<Self, MorphError> {
        let vertices = positions.len();
        if targets.vertices() != vertices
            || !(normals.is_empty() || normals.len() == vertices)
            || weights.len() != targets.count as usize
            || weights.end > u32::MAX as usize
        {
            return Err(MorphError::Count {
                vertices,
                moved: targets.vertices(),
                normals: normals.len(),
                targets: targets.count,
                weights: weights.len(),
            });
        }
        let bounds = Aabb::from_points(positions.iter().copied().filter(|p| p.is_finite()));
        // In the order of the targets, without room for those that move nothing.
        let mut order: Vec<&Difference> = targets.differences.iter().collect();
        order.sort_by_key(|d| d.target);
        let of_target = order.chunk_by(|a, b| a.target == b.target).map(|same| {
            let points = same.iter().map(|d| d.position).chain([Vec3::ZERO]);
            (same[0].target, Aabb::from_points(points))
        });
        let reach = of_target.collect();
        let weights = to_u32(weights.start)..to_u32(weights.end);
        Ok(Self { weights, positions, normals, targets, bounds, reach })
    }

    /// Where its weights are among [`ScenePose::weights`](super::ScenePose::weights).
    #[must_use]
    pub const fn weights(&self) -> Range<usize> {
        self.weights.start as usize..self.weights.end as usize
    }

    /// Vertices before they morph.
    #[must_use]
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Unit normals before they morph, one a vertex or none.
    #[must_use]
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// What is added to them.
    #[must_use]
    pub const fn targets(&self) -> &Targets {
        &self.targets
    }

    /// Writes vertices, and normals if there are as many, with these weights.
    pub(crate) fn shape(&self, weights: &[f32], positions: &mut [Vec3], normals: &mut [Vec3]) {
        self.targets.shape(weights, (&self.positions, &self.normals), positions, normals);
    }

    /// The bounds of what these weights add to any vertex; never too small, except by rounding.
    #[must_use]
    pub fn growth(&self, weights: &[f32]) -> Aabb {
        let zero = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        self.reach.iter().fold(zero, |sum, (target, reach)| {
            let weight = weights.get(*target as usize).copied().unwrap_or(0.0);
            let (a, b) = (reach.min * weight, reach.max * weight);
            Aabb { min: sum.min + a.min(b), max: sum.max + a.max(b) }
        })
    }

    /// Bounds of the vertices with these weights; never too small, except by rounding.
    #[must_use]
    pub fn bounds(&self, weights: &[f32]) -> Aabb {
        grown(self.bounds, self.growth(weights))
    }
}

/// Bounds of points within `bounds`, moved by anything within `growth`.
pub(super) fn grown(bounds: Aabb, growth: Aabb) -> Aabb {
    if bounds.is_empty() {
        return bounds;
    }
    Aabb { min: bounds.min + growth.min, max: bounds.max + growth.max }
}
