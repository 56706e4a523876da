//! What is looked at, and from where.

use niwaki_core::{Ray, glam::Vec3};

/// A pinhole camera: rays from `position` through `forward + x·right + y·up` with x and y from −1
/// to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where all rays begin.
    pub position: Vec3,
    /// The middle of the image.
    pub forward: Vec3,
    /// From the middle to the right edge.
    pub right: Vec3,
    /// From the middle to the upper edge.
    pub up: Vec3,
}

impl View {
    /// A camera that looks from `position` to `target`, with the vertical field of view in radians
    /// and the image's width over its height. `up` need not be perpendicular; if it is parallel to
    /// the view, another is chosen.
    #[must_use]
    pub fn look_at(position: Vec3, target: Vec3, up: Vec3, vertical_fov: f32, aspect: f32) -> Self {
        let forward = (target - position).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(up).normalize_or(forward.any_orthonormal_vector());
        let height = (0.5 * vertical_fov).tan();
        Self {
            position,
            forward,
            right: right * (height * aspect),
            up: right.cross(forward) * height,
        }
    }

    /// The ray through a place of the image, of unit direction: `x` from 0 (left) to 1, `y` from 0
    /// (top) to 1.
    #[must_use]
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let direction = self.forward + self.right * (2.0 * x - 1.0) + self.up * (1.0 - 2.0 * y);
        Ray::new(self.position, direction.normalize_or(Vec3::NEG_Z))
    }
}

/// Where shadow rays go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightSample {
    /// To a point.
    Point(Vec3),
    /// Against the direction in which the light shines, without end.
    Directional(Vec3),
}
