//! The cube around the camera that separates traced from marched geometry, and the six views that
//! continue it outwards.

use glam::{DMat4, DVec3, Mat4, Vec3};
use niwaki_core::Aabb;
use niwaki_scene::Camera;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Field of view of a face in degrees, wider than 90 so that a ray along an edge of the cube
/// belongs to at least one face (section 3.2).
pub const FACE_FOV: f64 = 90.2;

/// A face of the cube map, named by the axis it looks along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Face {
    /// +X.
    PosX,
    /// −X.
    NegX,
    /// +Y.
    PosY,
    /// −Y.
    NegY,
    /// +Z.
    PosZ,
    /// −Z.
    NegZ,
}

impl Face {
    /// All six, in the order of layers of the cube map: face 2·a looks along axis a, face 2·a + 1
    /// against it.
    pub const ALL: [Self; 6] =
        [Self::PosX, Self::NegX, Self::PosY, Self::NegY, Self::PosZ, Self::NegZ];

    /// Its layer.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The direction in which it looks.
    #[must_use]
    pub const fn forward(self) -> Vec3 {
        match self {
            Self::PosX => Vec3::X,
            Self::NegX => Vec3::NEG_X,
            Self::PosY => Vec3::Y,
            Self::NegY => Vec3::NEG_Y,
            Self::PosZ => Vec3::Z,
            Self::NegZ => Vec3::NEG_Z,
        }
    }

    /// The upward direction of its image.
    #[must_use]
    pub const fn up(self) -> Vec3 {
        match self {
            Self::PosY => Vec3::Z,
            Self::NegY => Vec3::NEG_Z,
            _ => Vec3::Y,
        }
    }

    /// The face that lies beyond a side of this one's image.
    #[must_use]
    pub fn neighbour(self, side: Side) -> Self {
        let right = self.forward().cross(self.up());
        let direction = match side {
            Side::Right => right,
            Side::Left => -right,
            Side::Top => self.up(),
            Side::Bottom => -self.up(),
        };
        Self::ALL.into_iter().find(|f| f.forward() == direction).unwrap_or(self)
    }
}

impl fmt::Display for Face {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(["+X", "-X", "+Y", "-Y", "+Z", "-Z"][self.index()])
    }
}

/// A side of a face's image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// x = w in clip space.
    Right,
    /// x = −w.
    Left,
    /// y = w.
    Top,
    /// y = −w.
    Bottom,
}

impl Side {
    /// In the order in which the tracing kernel numbers them.
    pub const ALL: [Self; 4] = [Self::Right, Self::Left, Self::Top, Self::Bottom];
}

/// Vectors as three numbers.
mod triple {
    use glam::Vec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(v: &Vec3, to: S) -> Result<S::Ok, S::Error> {
        v.to_array().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec3, D::Error> {
        <[f32; 3]>::deserialize(from).map(Vec3::from)
    }
}

/// The axis-aligned cube around the camera within which rays meet triangles, and how far the scene
/// goes beyond.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// The camera's position.
    #[serde(with = "triple")]
    pub center: Vec3,
    /// Half the side of the cube: distance of the near planes of the faces.
    pub half_size: f32,
    /// Distance of the far planes of the faces, beyond everything.
    pub far: f32,
    /// Half the side of the cube of triangles that are traced: `half_size` and the overlap.
    pub traced: f32,
}

impl Region {
    /// The region around `camera` for a scene that lies within `bounds` now and within `rest` when
    /// nothing moves (what [`NearRegion::ShareOfScene`](crate::NearRegion::ShareOfScene) counts in).
    ///
    /// A cube too small to be divided by becomes a 2²⁰th of the distance to the farthest geometry.
    /// Distances that follow from `bounds` come in steps of a quarter octave, so that objects that
    /// move a little leave them, and what was made for them, as they are.
    #[must_use]
    pub fn new(camera: &Camera, bounds: Aabb, rest: Aabb, settings: &crate::Settings) -> Self {
        use crate::NearRegion;
        let center = camera.position;
        let reach = if bounds.is_empty() {
            1.0
        } else {
            let from = (bounds.min.as_dvec3() - center.as_dvec3()).abs();
            let to = (bounds.max.as_dvec3() - center.as_dvec3()).abs();
            let reach = from.max(to).max_element().clamp(1e-30, 1e30);
            (0.25 * (4.0 * (reach * 1.01).log2()).ceil()).exp2()
        };
        let longest = if rest.is_empty() {
            1.0
        } else {
            (rest.max.as_dvec3() - rest.min.as_dvec3()).max_element()
        };
        let wanted = match settings.near_region {
            NearRegion::HalfSize(x) => f64::from(x),
            NearRegion::ShareOfScene(x) => f64::from(x) * longest,
            NearRegion::WholeScene => reach,
        };
        let half_size = wanted.clamp(reach / f64::from(1 << 20), reach);
        let far = (reach * 1.01).max(half_size * 1.001);
        let traced = half_size * (1.0 + f64::from(settings.overlap));
        #[expect(clippy::cast_possible_truncation, reason = "within the range of f32 by the clamp")]
        let [half_size, far, traced] = [half_size, far, traced].map(|x| x as f32);
        Self { center, half_size, far, traced }
    }

    /// The cube whose triangles are traced.
    #[must_use]
    pub fn traced_bounds(&self) -> Aabb {
        Aabb { min: self.center - self.traced, max: self.center + self.traced }
    }

    /// True if nothing within `bounds` lies beyond the near planes.
    #[must_use]
    pub fn holds(&self, bounds: Aabb) -> bool {
        let c = self.center.as_dvec3();
        let far = (bounds.min.as_dvec3() - c).abs().max((bounds.max.as_dvec3() - c).abs());
        bounds.is_empty() || far.max_element() <= f64::from(self.half_size)
    }

    /// True if a box meets the traced cube.
    #[must_use]
    pub fn meets(&self, bounds: Aabb) -> bool {
        let own = self.traced_bounds();
        !bounds.is_empty() && own.min.cmple(bounds.max).all() && bounds.min.cmple(own.max).all()
    }

    /// True if a box may be visible in a face: it reaches beyond the near plane and into the
    /// frustum.
    #[must_use]
    pub fn seen_by(&self, face: Face, bounds: Aabb) -> bool {
        if bounds.is_empty() {
            return false;
        }
        let forward = face.forward().as_dvec3();
        let tangent = face_tangent();
        let (min, max) = (
            bounds.min.as_dvec3() - self.center.as_dvec3(),
            bounds.max.as_dvec3() - self.center.as_dvec3(),
        );
        let reach = |n: DVec3| (n * min).max(n * max).element_sum();
        let up = face.up().as_dvec3();
        let right = forward.cross(up);
        // A little slack for the rounding of matrices and vertices on the GPU.
        let slack = 1e-5 * f64::from(self.far);
        reach(forward) + slack >= f64::from(self.half_size)
            && [right, -right, up, -up].iter().all(|&n| reach(forward * tangent + n) + slack >= 0.0)
    }

    /// World space to clip space of a face: x to the right, y up, both within ±w, z from 0 at the
    /// near plane to w at the far plane.
    #[must_use]
    pub fn view_projection(&self, face: Face) -> Mat4 {
        self.view_projection_f64(face).as_mat4()
    }

    fn view_projection_f64(&self, face: Face) -> DMat4 {
        let (n, f) = (f64::from(self.half_size), f64::from(self.far));
        let scale = 1.0 / face_tangent();
        let forward = face.forward().as_dvec3();
        let up = face.up().as_dvec3();
        let right = forward.cross(up);
        let c = self.center.as_dvec3();
        let row = |v: DVec3, k: f64| v.extend(-v.dot(c)) * k;
        let z = f / (f - n);
        let depth = row(forward, z) - DVec3::ZERO.extend(z * n);
        DMat4::from_cols(row(right, scale), row(up, scale), depth, row(forward, 1.0)).transpose()
    }

    /// Clip space of `from` to clip space of `to`: a ray that leaves a face through a side goes on
    /// in the next through one multiplication (section 3.4).
    #[must_use]
    pub fn face_to_face(&self, from: Face, to: Face) -> Mat4 {
        // Without the common translation, which would only cost digits.
        let local = Self { center: Vec3::ZERO, ..*self };
        (local.view_projection_f64(to) * local.view_projection_f64(from).inverse()).as_mat4()
    }
}

/// Tangent of half a face's field of view.
#[must_use]
pub fn face_tangent() -> f64 {
    (0.5 * FACE_FOV.to_radians()).tan()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NearRegion, Settings};
    use glam::Vec4;

    fn region() -> Region {
        let camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, Vec3::Y, 1.0);
        let bounds = Aabb { min: Vec3::splat(-20.0), max: Vec3::splat(20.0) };
        let near_region = NearRegion::HalfSize(2.0);
        Region::new(&camera, bounds, bounds, &Settings { near_region, ..Settings::default() })
    }

    #[test]
    fn neighbours_lie_beyond_their_sides() {
        for face in Face::ALL {
            let others: Vec<_> = Side::ALL.iter().map(|s| face.neighbour(*s)).collect();
            for (k, other) in others.iter().enumerate() {
                assert_eq!(other.forward().dot(face.forward()), 0.0);
                assert!(!others[..k].contains(other), "{face} has {other} twice");
            }
        }
    }

    #[test]
    fn clip_space_has_the_near_plane_at_zero_and_the_far_at_w() {
        let r = region();
        for face in Face::ALL {
            let m = r.view_projection(face);
            let at = |d: f32| m * (r.center + face.forward() * d).extend(1.0);
            assert!(at(r.half_size).z.abs() < 1e-5);
            let far = at(r.far);
            assert!((far.z / far.w - 1.0).abs() < 1e-5 && (far.w - r.far).abs() < 1e-3);
        }
    }

    #[test]
    fn going_from_face_to_face_is_projecting_anew() {
        let r = region();
        let p = Vec3::new(9.0, 10.5, -4.0).extend(1.0);
        for from in Face::ALL {
            for side in Side::ALL {
                let to = from.neighbour(side);
                let there = r.face_to_face(from, to) * (r.view_projection(from) * p);
                let direct: Vec4 = r.view_projection(to) * p;
                assert!((there - direct).abs().max_element() < 1e-3, "{there} {direct}");
            }
        }
    }

    #[test]
    fn every_point_outside_belongs_to_a_face_and_none_inside_does() {
        let r = region();
        let point = |p: Vec3| Aabb { min: r.center + p, max: r.center + p };
        for p in [Vec3::splat(5.0), Vec3::new(3.0, 3.0, 0.0), Vec3::new(-7.0, 1.0, 7.0)] {
            assert!(Face::ALL.iter().any(|f| r.seen_by(*f, point(p))), "{p}");
        }
        assert!(!Face::ALL.iter().any(|f| r.seen_by(*f, point(Vec3::ONE))));
        assert!(r.meets(point(Vec3::ONE)) && r.holds(point(Vec3::ONE)));
        assert!(!r.meets(point(Vec3::splat(5.0))) && !r.holds(point(Vec3::splat(5.0))));
    }

    #[test]
    fn the_whole_scene_fits_whatever_its_size() {
        for scale in [1e-20_f32, 1.0, 1e20] {
            let camera = Camera::look_at(Vec3::splat(3.0 * scale), Vec3::ZERO, Vec3::Y, 1.0);
            let bounds = Aabb { min: Vec3::splat(-scale), max: Vec3::splat(scale) };
            let r = Region::new(&camera, bounds, bounds, &Settings::exact());
            assert!(r.holds(bounds) && r.far > r.half_size, "{r:?}");
            assert!(!Face::ALL.iter().any(|f| r.seen_by(*f, Aabb::EMPTY)));
        }
    }
}
