//! Matrices of the lights' views.

use crate::Face;
use glam::{DVec3, Vec3, Vec4};
use niwaki_core::Aabb;
use niwaki_gpu_frame::{ViewMatrix, clip_matrix, spot_view};
use niwaki_scene::{Light, LightFacts, LightKind};

/// Six views from a point, as the faces of a cube map with exactly 90°, depth as
/// [`niwaki_gpu_frame::camera_view`].
fn cube_views(eye: Vec3, near: f32) -> [ViewMatrix; 6] {
    Face::ALL.map(|face| {
        let (forward, up) = (face.forward(), face.up());
        let matrix = clip_matrix(
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
    let matrix = clip_matrix(
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

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_gpu_frame::may_show;

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
