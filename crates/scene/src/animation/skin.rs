//! Skins: vertices that hang on several joints at once.

use super::{Rig, morph::grown};
use glam::{DAffine3, Vec3, Vec4};
use niwaki_core::Aabb;
use rayon::prelude::*;

/// The joints of a skin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// In the order in which vertices count them.
    pub joints: Vec<Joint>,
}

/// A joint: at time t it takes a point from where it was bound to the world by W(t) ·
/// `from_bind`, with W the place of its node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Index into [`Rig::nodes`]; `None` for a joint that stands still.
    pub node: Option<u32>,
    /// From bound points to the node's coordinates, or to the world without a node.
    pub from_bind: DAffine3,
}

/// On which joints a vertex hangs: 24 bytes, to be copied to a GPU as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Influence {
    /// Indices into [`Skin::joints`].
    pub joints: [u16; 4],
    /// By how much; 0 or more, with a sum of 1.
    pub weights: [f32; 4],
}

/// What a joint does at a time: a transform row by row, the translation in the fourth component;
/// 48 bytes, to be copied to a GPU as they are.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct JointPose {
    /// The rows.
    pub rows: [Vec4; 3],
}

/// Why vertices do not hang on a skin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkinError {
    /// A vertex hangs on a joint that the skin does not have. Remedy: correct the number, or give
    /// it no weight.
    #[error("vertex {vertex} hangs on joint {joint}, but the skin has {joints}")]
    Joint {
        /// The vertex, from 0.
        vertex: usize,
        /// The joint, from 0.
        joint: u16,
        /// How many there are.
        joints: usize,
    },
    /// A weight is negative, NaN or infinite, or the weights of a vertex do not add up to 1.
    /// Remedy: [`Influence::normalized`].
    #[error("vertex {vertex} has the weights {weights:?}, which do not add up to 1")]
    Weights {
        /// The vertex, from 0.
        vertex: usize,
        /// Its weights.
        weights: [f32; 4],
    },
    /// Not every vertex has its influences, or its normal. Remedy: give one of each a vertex, or
    /// no normals.
    #[error("{vertices} vertices have {influences} influences and {normals} normals")]
    Count {
        /// Number of positions.
        vertices: usize,
        /// Number of influences.
        influences: usize,
        /// Number of normals.
        normals: usize,
    },
}

impl Influence {
    /// With weights that add up to 1, the vertex on its first joint if it has none. What is not
    /// finite, and what is negative, counts as 0; joints of no weight become joint 0.
    #[must_use]
    pub fn normalized(self) -> Self {
        let weight = |w: f32| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
        let weights = self.weights.map(weight);
        let sum: f64 = weights.iter().sum();
        if sum <= 0.0 {
            let joints = [self.joints[0], 0, 0, 0];
            return Self { joints, weights: [1.0, 0.0, 0.0, 0.0] };
        }
        #[expect(clippy::cast_possible_truncation, reason = "a share of one in f32 is enough")]
        let weights = weights.map(|w| (w / sum) as f32);
        let joint = |k: usize| if weights[k] > 0.0 { self.joints[k] } else { 0 };
        Self { joints: std::array::from_fn(joint), weights }
    }

    /// The joints that have weight, and theirs.
    fn pulls(&self) -> impl Iterator<Item = (u16, f32)> + '_ {
        self.joints.iter().copied().zip(self.weights).filter(|(_, weight)| *weight != 0.0)
    }
}

/// The vertices of one object as they were bound to a skin.
#[derive(Clone, Debug, PartialEq)]
pub struct Skinned {
    skin: u32,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    influences: Vec<Influence>,
    /// Bounds of the bound vertices that hang on each joint, where there are any.
    reach: Vec<(u16, Aabb)>,
}

impl Skinned {
    /// Binds vertices to skin number `skin`, which has `joints` joints; `normals` may be empty.
    ///
    /// # Errors
    /// [`SkinError`] names the first vertex that is wrong.
    pub fn new(
        skin: u32,
        joints: usize,
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        influences: Vec<Influence>,
    ) -> Result<Self, SkinError> {
        let vertices = positions.len();
        if influences.len() != vertices || !(normals.is_empty() || normals.len() == vertices) {
            let (influences, normals) = (influences.len(), normals.len());
            return Err(SkinError::Count { vertices, influences, normals });
        }
        let mut reach = vec![Aabb::EMPTY; joints];
        for (vertex, (influence, position)) in influences.iter().zip(&positions).enumerate() {
            let weights = influence.weights;
            let sum: f32 = weights.iter().sum();
            if !(weights.iter().all(|w| *w >= 0.0) && (sum - 1.0).abs() < 1e-3) {
                return Err(SkinError::Weights { vertex, weights });
            }
            for &joint in &influence.joints {
                // Those of no weight too: kernels read their matrices.
                if usize::from(joint) >= joints {
                    return Err(SkinError::Joint { vertex, joint, joints });
                }
            }
            for (joint, _) in influence.pulls() {
                if position.is_finite() {
                    let bounds = &mut reach[usize::from(joint)];
                    *bounds = bounds.union(Aabb::from_points([*position]));
                }
            }
        }
        let reach = (0..=u16::MAX).zip(reach).filter(|(_, bounds)| !bounds.is_empty()).collect();
        Ok(Self { skin, positions, normals, influences, reach })
    }

    /// Index into [`Rig::skins`].
    #[must_use]
    pub const fn skin(&self) -> u32 {
        self.skin
    }

    /// Vertices as bound.
    #[must_use]
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Unit normals as bound, one a vertex or none.
    #[must_use]
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// On which joints the vertices hang.
    #[must_use]
    pub fn influences(&self) -> &[Influence] {
        &self.influences
    }

    /// Writes vertices, and normals if there are as many, as they were bound.
    pub(crate) fn place(&self, positions: &mut [Vec3], normals: &mut [Vec3]) {
        positions.iter_mut().zip(&self.positions).for_each(|(p, bound)| *p = *bound);
        normals.iter_mut().zip(&self.normals).for_each(|(n, bound)| *n = *bound);
    }

    /// Takes vertices, and normals if there are as many, from where they were bound to where these
    /// joints bend them.
    pub(crate) fn bend(&self, joints: &[JointPose], positions: &mut [Vec3], normals: &mut [Vec3]) {
        let moved = positions.par_iter_mut().zip(&self.influences).with_min_len(4096);
        moved.for_each(|(p, influence)| *p = JointPose::blended(joints, influence).point(*p));
        let turned = normals.par_iter_mut().zip(&self.influences).with_min_len(4096);
        turned.for_each(|(n, influence)| *n = JointPose::blended(joints, influence).normal(*n));
    }

    /// Bounds of the vertices when the joints of the skin are like this; never too small, except
    /// by rounding. What morphs moved bound vertices by something within `growth`
    /// ([`Morphed::growth`](super::Morphed::growth)), if anything did.
    ///
    /// A vertex is a weighted mean of where its joints would take it, so it lies in the box of
    /// the boxes that each joint makes of the vertices that hang on it.
    #[must_use]
    pub fn bounds(&self, joints: &[JointPose], growth: Option<Aabb>) -> Aabb {
        self.reach.iter().fold(Aabb::EMPTY, |bounds, (joint, reach)| {
            let pose = joints.get(usize::from(*joint)).unwrap_or(&JointPose::BOUND);
            let reach = growth.map_or(*reach, |growth| grown(*reach, growth));
            bounds.union(pose.bounds(reach))
        })
    }
}

impl JointPose {
    /// Leaves points where they were bound.
    pub const BOUND: Self = Self { rows: [Vec4::X, Vec4::Y, Vec4::Z] };

    /// A transform; what is not finite leaves points where they were bound.
    #[must_use]
    pub fn new(transform: &DAffine3) -> Self {
        let m = transform.matrix3.transpose();
        let t = transform.translation;
        let rows = [m.x_axis.extend(t.x), m.y_axis.extend(t.y), m.z_axis.extend(t.z)];
        let rows = rows.map(|row| row.as_vec4());
        if rows.iter().all(|row| row.is_finite()) { Self { rows } } else { Self::BOUND }
    }

    /// The weighted mean of the joints on which a vertex hangs.
    #[must_use]
    pub fn blended(joints: &[Self], influence: &Influence) -> Self {
        let mut rows = [Vec4::ZERO; 3];
        for (joint, weight) in influence.pulls() {
            let pose = joints.get(usize::from(joint)).unwrap_or(&Self::BOUND);
            for (row, of_joint) in rows.iter_mut().zip(&pose.rows) {
                *row += *of_joint * weight;
            }
        }
        Self { rows }
    }

    /// Where a bound point is now.
    #[must_use]
    pub fn point(&self, p: Vec3) -> Vec3 {
        let p = p.extend(1.0);
        Vec3::new(self.rows[0].dot(p), self.rows[1].dot(p), self.rows[2].dot(p))
    }

    /// The unit normal now of a bound one, by the cofactors of the transform; `n` where there is
    /// none.
    #[must_use]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        let [a, b, c] = self.rows.map(Vec4::truncate);
        let turned = Vec3::new(b.cross(c).dot(n), c.cross(a).dot(n), a.cross(b).dot(n));
        turned.try_normalize().unwrap_or(n)
    }

    fn bounds(&self, bound: Aabb) -> Aabb {
        let corner = |i: u32| {
            let pick = |bit: u32, k: usize| if i & bit == 0 { bound.min[k] } else { bound.max[k] };
            self.point(Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2)))
        };
        Aabb::from_points((0..8).map(corner))
    }
}

impl Rig {
    /// What the joints of all skins do, one skin after another, given where the nodes are
    /// ([`Rig::worlds`]).
    #[must_use]
    pub fn joints(&self, worlds: &[DAffine3]) -> Vec<JointPose> {
        let joints = self.skins.iter().flat_map(|skin| &skin.joints);
        joints.map(|joint| JointPose::new(&joint.transform(worlds))).collect()
    }
}

impl Joint {
    /// From bound points to the world, given where the nodes are.
    pub(crate) fn transform(&self, worlds: &[DAffine3]) -> DAffine3 {
        let world = self.node.and_then(|node| worlds.get(node as usize));
        world.map_or(self.from_bind, |world| *world * self.from_bind)
    }
}
