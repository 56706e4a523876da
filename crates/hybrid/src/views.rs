//! Matrices of what is rasterised: the camera's view and the lights'.

use crate::{Face, layout::ViewMatrix};
use glam::{DVec3, Mat4, Vec3, Vec4};
use niwaki_core::Aabb;
use niwaki_scene::{Camera, Light, LightFacts, LightKind};

/// Rows of a clip-space matrix.
fn matrix(x: Vec4, y: Vec4, z: Vec4, w: Vec4) -> Mat4 {
    Mat4::from_cols(x, y, z, w).transpose()
}

/// The camera's view with the depth 1 at the near plane and 0 infinitely far, which spends the
/// digits of floating point evenly. `near` is the distance of the near plane.
pub(crate) fn camera_view(camera: &Camera, width: u32, height: u32, near: f32) -> ViewMatrix {
    let tangent = (0.5 * camera.vertical_fov).tan();
    let aspect = width.max(1) as f32 / height.max(1) as f32;
    ViewMatrix {
        matrix: matrix(
            (camera.right() / (tangent * aspect)).extend(0.0),
            (camera.up / tangent).extend(0.0),
            Vec4::new(0.0, 0.0, 0.0, near),
            camera.forward.extend(0.0),
        ),
        eye: camera.position,
        pad: 0.0,
    }
}

/// Six views from a point, as the faces of a cube map with exactly 90°, depth as
/// [`camera_view`].
fn cube_views(eye: Vec3, near: f32) -> [ViewMatrix; 6] {
    Face::ALL.map(|face| {
        let (forward, up) = (face.forward(), face.up());
        let matrix = matrix(
            forward.cross(up).extend(0.0),
            up.extend(0.0),
            Vec4::new(0.0, 0.0, 0.0, near),
            forward.extend(0.0),
        );
        ViewMatrix { matrix, eye, pad: 0.0 }
    })
}

/// The view of a directional light on all that lies within `bounds`, depth 1 nearest to it and 0
/// farthest; and the width of the view in units of length.
fn directional_view(direction: Vec3, bounds: Aabb) -> (ViewMatrix, f32) {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let center = (min + max) * 0.5;
    #[expect(clippy::cast_possible_truncation, reason = "a length in f32 is enough")]
    let radius = (((max - min).length() * 0.5).clamp(1e-30, 1e30) * 1.001) as f32;
    let forward = direction.as_dvec3().try_normalize().unwrap_or(DVec3::NEG_Y);
    let right = forward.any_orthonormal_vector();
    let up = right.cross(forward);
    let scale = |v: DVec3| (v / f64::from(radius)).as_vec3().extend(0.0);
    let matrix = matrix(
        scale(right),
        scale(up),
        scale(forward * -0.5) + Vec4::new(0.0, 0.0, 0.0, 0.5),
        Vec4::W,
    );
    (ViewMatrix { matrix, eye: center.as_vec3(), pad: 0.0 }, 2.0 * radius)
}

/// A light with its shadow maps.
pub(crate) struct LightViews {
    /// Number of its first map.
    pub(crate) layer: u32,
    /// Its maps.
    pub(crate) views: Vec<ViewMatrix>,
    /// Width of its maps at distance 1 along their axis; of directional lights at any distance.
    pub(crate) width: f32,
}

/// The view of a spot light on its cone, depth as [`camera_view`], and its width at distance 1.
fn spot_view(eye: Vec3, direction: Vec3, outer: f32, near: f32) -> (ViewMatrix, f32) {
    // Room for the pixels at the edge of the cone.
    let tangent = 1.02 * outer.clamp(1e-3, LightFacts::NARROW_SPOT).tan();
    let forward = direction.try_normalize().unwrap_or(Vec3::NEG_Y);
    let right = forward.any_orthonormal_vector();
    let up = right.cross(forward);
    let matrix = matrix(
        (right / tangent).extend(0.0),
        (up / tangent).extend(0.0),
        Vec4::new(0.0, 0.0, 0.0, near),
        forward.extend(0.0),
    );
    (ViewMatrix { matrix, eye, pad: 0.0 }, 2.0 * tangent)
}

/// How many shadow maps a light takes.
pub(crate) fn maps_of(kind: LightKind) -> u32 {
    match kind {
        LightKind::Directional => 1,
        LightKind::Spot { outer, .. } if outer <= LightFacts::NARROW_SPOT => 1,
        _ => 6,
    }
}

/// The shadow maps of lights, in their order, for a scene within `bounds`.
pub(crate) fn light_views(lights: &[Light], bounds: Aabb) -> Vec<LightViews> {
    let mut layer = 0;
    lights
        .iter()
        .map(|light| {
            let (views, width) = match light.kind {
                LightKind::Directional => {
                    let (view, width) = directional_view(light.direction, bounds);
                    (vec![view], width)
                }
                kind => {
                    let p = light.position;
                    let far = (bounds.min - p).abs().max((bounds.max - p).abs()).max_element();
                    let near = if far.is_finite() { far * 1e-5 } else { 1e-5 };
                    let near = near.max(1e-30);
                    match kind {
                        LightKind::Spot { outer, .. } if maps_of(kind) == 1 => {
                            let (view, width) = spot_view(p, light.direction, outer, near);
                            (vec![view], width)
                        }
                        _ => (cube_views(p, near).to_vec(), 2.0),
                    }
                }
            };
            let first = layer;
            layer += niwaki_core::to_u32(views.len());
            LightViews { layer: first, views, width }
        })
        .collect()
}

/// False only if no point of a box can be in view.
pub(crate) fn may_show(view: &ViewMatrix, bounds: Aabb) -> bool {
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

    #[test]
    fn lights_see_all_of_the_scene() {
        let bounds = Aabb { min: Vec3::new(-3.0, 0.0, -8.0), max: Vec3::new(5.0, 2.0, 1.0) };
        let light = |kind| Light {
            kind,
            position: Vec3::new(0.0, 1.5, 0.0),
            direction: Vec3::new(0.2, -0.9, 0.1).normalize(),
            intensity: Vec3::ONE,
        };
        let lights = [light(LightKind::Directional), light(LightKind::Point)];
        let views = light_views(&lights, bounds);
        assert_eq!((views[0].layer, views[1].layer, views[1].views.len()), (0, 1, 6));
        for i in 0..8 {
            let pick = |bit, k: usize| if i & bit == 0 { bounds.min[k] } else { bounds.max[k] };
            let p = Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2));
            for light in &views {
                let shown = light.views.iter().any(|v| {
                    let c = v.matrix * (p - v.eye).extend(1.0);
                    c.w > 0.0 && c.x.abs() <= c.w && c.y.abs() <= c.w && c.z >= 0.0 && c.z <= c.w
                });
                assert!(shown, "{p}");
            }
        }
        assert!(may_show(&views[0].views[0], bounds) && !may_show(&views[0].views[0], Aabb::EMPTY));
    }
}
