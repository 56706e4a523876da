//! Primary rays of a pinhole camera.

use glam::{Vec2, Vec3};
use niwaki_core::{Ray, glam};
use niwaki_scene::Camera;

/// A camera with an image plane of a given number of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where the camera stands.
    pub position: Vec3,
    /// From the camera to the image's top left corner, in units of the focal length.
    pub corner: Vec3,
    /// From one pixel to the next in a row.
    pub step_x: Vec3,
    /// From one row to the next.
    pub step_y: Vec3,
}

impl View {
    /// The view of `camera` on an image of `width` × `height` square pixels.
    #[must_use]
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let (width, height) = (width.max(1) as f32, height.max(1) as f32);
        let half_height = (0.5 * camera.vertical_fov).tan();
        let half_width = half_height * width / height;
        Self {
            position: camera.position,
            corner: camera.forward - camera.right() * half_width + camera.up * half_height,
            step_x: camera.right() * (2.0 * half_width / width),
            step_y: camera.up * (-2.0 * half_height / height),
        }
    }

    /// The ray through column `x` and row `y` (from the top); `within` is the place in the pixel,
    /// (0.5, 0.5) its centre. The direction has unit length.
    #[must_use]
    pub fn ray(&self, x: u32, y: u32, within: Vec2) -> Ray {
        let direction =
            self.corner + self.step_x * (x as f32 + within.x) + self.step_y * (y as f32 + within.y);
        Ray::new(self.position, direction.normalize_or(Vec3::NEG_Z))
    }
}
