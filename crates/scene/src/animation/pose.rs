//! One object at one point in time, as CPU and GPU apply it.

use super::{JointPose, Wave};
use glam::{DAffine3, Vec3, Vec4};
use niwaki_core::Aabb;

/// Where everything is at one point in time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScenePose {
    /// One an object.
    pub objects: Vec<ObjectPose>,
    /// One a joint, one skin after another;
    /// [`Animation::joints_of`](super::Animation::joints_of) says which are an object's.
    pub joints: Vec<JointPose>,
    /// One a morph target, one mesh after another;
    /// [`Morphed::weights`](super::Morphed::weights) says which are an object's.
    pub weights: Vec<f32>,
}

/// Where one object is and how it bends: 96 bytes of six vectors of four `f32`, to be copied to a
/// GPU as they are.
///
/// A vertex p at rest with normal n goes to the place q' with the normal n' (not yet of unit
/// length):
///
/// - s = clamp(`hold`.xyz · p + `hold`.w, 0, 1)
/// - θ = 2π frac(`wave`.xyz · p + `wave`.w)
/// - q = p + s² sin θ D, with D = `displacement`.xyz
/// - q' = (`rows[0]` · (q, 1), `rows[1]` · (q, 1), `rows[2]` · (q, 1))
/// - g = 2s sin θ `hold`.xyz \[0 < s < 1\] + 2π s² cos θ `wave`.xyz, the gradient of s² sin θ
/// - m = n − g (D · n) / (1 + D · g), the inverse transpose of I + D gᵀ applied to n
/// - n' = C m, with C the cofactor matrix of the upper left 3 × 3 of `rows`: for its rows
///   a, b, c that is (b × c, c × a, a × b) as rows
///
/// For D = 0 the bending falls away: q = p, m = n.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ObjectPose {
    /// The transform, row by row; the fourth component is the translation.
    pub rows: [Vec4; 3],
    /// Crests of the wave, from rest; w is 0.
    pub displacement: Vec4,
    /// Crests a unit of length, and in w the phase at this time, 0 to 1.
    pub wave: Vec4,
    /// How free the object is to bend, as a plane.
    pub hold: Vec4,
}

impl ObjectPose {
    /// As it stands in [`Scene::mesh`](crate::Scene::mesh).
    pub const REST: Self = Self {
        rows: [Vec4::X, Vec4::Y, Vec4::Z],
        displacement: Vec4::ZERO,
        wave: Vec4::ZERO,
        hold: Vec4::ZERO,
    };

    /// A transform after a wave at a time; what is not finite rests.
    pub(crate) fn new(transform: &DAffine3, wave: Option<&Wave>, time: f64) -> Self {
        let mut pose = Self::REST;
        let m = transform.matrix3.transpose();
        let t = transform.translation;
        let rows = [m.x_axis.extend(t.x), m.y_axis.extend(t.y), m.z_axis.extend(t.z)];
        let rows = rows.map(|row| row.as_vec4());
        if rows.iter().all(|row| row.is_finite()) {
            pose.rows = rows;
        }
        if let Some(w) = wave {
            let phase = f64::from(w.phase) - f64::from(w.frequency) * time;
            #[expect(clippy::cast_possible_truncation, reason = "from 0 to 1")]
            let phase = (phase - phase.floor()) as f32;
            let bend =
                [w.displacement.extend(0.0), w.wave.extend(phase), w.hold.extend(w.hold_offset)];
            if bend.iter().all(|v| v.is_finite()) {
                [pose.displacement, pose.wave, pose.hold] = bend;
            }
        }
        pose
    }

    /// True if it changes nothing.
    #[must_use]
    pub fn is_rest(&self) -> bool {
        self.rows == Self::REST.rows && self.displacement == Vec4::ZERO
    }

    /// s, sin θ and cos θ at a point at rest.
    fn phase(&self, p: Vec3) -> (f32, f32, f32) {
        let p = p.extend(1.0);
        let s = self.hold.dot(p).clamp(0.0, 1.0);
        let turns = self.wave.dot(p);
        let (sin, cos) = ((turns - turns.floor()) * std::f32::consts::TAU).sin_cos();
        (s, sin, cos)
    }

    /// Where a vertex at rest is now.
    #[must_use]
    pub fn point(&self, p: Vec3) -> Vec3 {
        let mut q = p;
        if self.displacement != Vec4::ZERO {
            let (s, sin, _) = self.phase(p);
            q += self.displacement.truncate() * (s * s * sin);
        }
        let q = q.extend(1.0);
        Vec3::new(self.rows[0].dot(q), self.rows[1].dot(q), self.rows[2].dot(q))
    }

    /// The unit normal now of a vertex at rest at `p` with normal `n`; `n` where there is none.
    #[must_use]
    pub fn normal(&self, p: Vec3, n: Vec3) -> Vec3 {
        let mut m = n;
        if self.displacement != Vec4::ZERO {
            let (s, sin, cos) = self.phase(p);
            let mut g = self.wave.truncate() * (std::f32::consts::TAU * s * s * cos);
            if s > 0.0 && s < 1.0 {
                g += self.hold.truncate() * (2.0 * s * sin);
            }
            let d = self.displacement.truncate();
            m -= g * (d.dot(n) / (1.0 + d.dot(g)));
        }
        let [a, b, c] = self.rows.map(Vec4::truncate);
        let turned = Vec3::new(b.cross(c).dot(m), c.cross(a).dot(m), a.cross(b).dot(m));
        turned.try_normalize().unwrap_or(n)
    }

    /// Bounds now of what has these bounds at rest; never too small, except by rounding.
    #[must_use]
    pub fn bounds(&self, rest: Aabb) -> Aabb {
        if rest.is_empty() || self.is_rest() {
            return rest;
        }
        let crest = self.displacement.truncate().abs();
        let (min, max) = (rest.min - crest, rest.max + crest);
        let corner = |i: u32| {
            let pick = |bit: u32, k: usize| if i & bit == 0 { min[k] } else { max[k] };
            let q = Vec4::new(pick(1, 0), pick(2, 1), pick(4, 2), 1.0);
            Vec3::new(self.rows[0].dot(q), self.rows[1].dot(q), self.rows[2].dot(q))
        };
        Aabb::from_points((0..8).map(corner))
    }
}
