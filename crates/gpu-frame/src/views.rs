//! Matrices of what is rasterised: the camera's view and a spot light's.

use crate::{FrameError, ViewMatrix};
use glam::{Mat4, Vec3, Vec4};
use niwaki_core::Aabb;
use niwaki_scene::{Camera, LightFacts};

/// Rows of a clip-space matrix.
#[must_use]
pub fn clip_matrix(x: Vec4, y: Vec4, z: Vec4, w: Vec4) -> Mat4 {
    Mat4::from_cols(x, y, z, w).transpose()
}

/// The camera's view with the depth 1 at the near plane and 0 infinitely far, which spends the
/// digits of floating point evenly. `near` is the distance of the near plane.
#[must_use]
pub fn camera_view(camera: &Camera, width: u32, height: u32, near: f32) -> ViewMatrix {
    let tangent = (0.5 * camera.vertical_fov).tan();
    let aspect = width.max(1) as f32 / height.max(1) as f32;
    ViewMatrix {
        matrix: clip_matrix(
            (camera.right() / (tangent * aspect)).extend(0.0),
            (camera.up / tangent).extend(0.0),
            Vec4::new(0.0, 0.0, 0.0, near),
            camera.forward.extend(0.0),
        ),
        eye: camera.position,
        pad: 0.0,
    }
}

/// The view of a spot light on its cone, depth as [`camera_view`], and its width at distance 1.
#[must_use]
pub fn spot_view(eye: Vec3, direction: Vec3, outer: f32, near: f32) -> (ViewMatrix, f32) {
    // Room for the pixels at the edge of the cone.
    let tangent = 1.02 * outer.clamp(1e-3, LightFacts::NARROW_SPOT).tan();
    let forward = direction.try_normalize().unwrap_or(Vec3::NEG_Y);
    let right = forward.any_orthonormal_vector();
    let up = right.cross(forward);
    let matrix = clip_matrix(
        (right / tangent).extend(0.0),
        (up / tangent).extend(0.0),
        Vec4::new(0.0, 0.0, 0.0, near),
        forward.extend(0.0),
    );
    (ViewMatrix { matrix, eye, pad: 0.0 }, 2.0 * tangent)
}

/// False only if no point of a box can be in view.
#[must_use]
pub fn may_show(view: &ViewMatrix, bounds: Aabb) -> bool {
    if bounds.is_empty() {
        return false;
    }
    let corners: [Vec4; 8] = std::array::from_fn(|i| {
        let pick = |bit: usize, k: usize| if i & bit == 0 { bounds.min[k] } else { bounds.max[k] };
        let p = Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2));
        view.matrix * (p - view.eye).extend(1.0)
    });
    // Beyond one side of the view with all corners, slack for rounding included.
    let outside =
        |f: fn(&Vec4) -> f32| corners.iter().all(|c| f(c) < -1e-4 * c.abs().max_element());
    !(outside(|c| c.w + c.x)
        || outside(|c| c.w - c.x)
        || outside(|c| c.w + c.y)
        || outside(|c| c.w - c.y)
        || outside(|c| c.w))
}

/// Refuses cameras that no ray can be made from.
///
/// # Errors
/// [`FrameError::BadCamera`].
pub fn check_camera(camera: &Camera) -> Result<(), FrameError> {
    let finite = camera.position.is_finite() && camera.forward.is_finite() && camera.up.is_finite();
    let fov = camera.vertical_fov;
    if !(finite && fov > 0.0 && fov < std::f32::consts::PI) {
        return Err(FrameError::BadCamera(format!("{camera:?}")));
    }
    let lengths = [camera.forward.length(), camera.up.length(), camera.right().length()];
    if lengths.iter().any(|l| (l - 1.0).abs() > 0.01) {
        return Err(FrameError::BadCamera(format!(
            "its directions are not of unit length or not perpendicular: {camera:?}"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_view_is_that_of_primary_rays() {
        let camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, Vec3::Y, 0.9);
        let view = camera_view(&camera, 64, 36, 0.01);
        let rays = niwaki_render::View::new(&camera, 64, 36);
        for (x, y) in [(0, 0), (63, 0), (31, 35), (10, 20)] {
            let ray = rays.ray(x, y, glam::Vec2::splat(0.5));
            let clip = view.matrix * (ray.at(5.0) - view.eye).extend(1.0);
            let (cx, cy) = (clip.x / clip.w, clip.y / clip.w);
            assert!((cx - ((x as f32 + 0.5) / 32.0 - 1.0)).abs() < 1e-4, "{cx}");
            assert!((cy - (1.0 - (y as f32 + 0.5) / 18.0)).abs() < 1e-4, "{cy}");
            assert!(clip.z / clip.w > 0.0 && clip.z / clip.w < 1.0);
        }
    }
}
