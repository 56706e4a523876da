//! Camera paths for scenes that bring none.

use super::{DIRECTIONS, Grid};
use crate::{Camera, CameraKey, CameraPath, Scene, generate::math::sin_cos_turns};
use glam::{DVec3, Vec3};
use niwaki_core::TriangleMesh;

/// Keys of an orbit, and about so many of a walk.
const KEYS: usize = 24;
/// Straight pieces of a walk.
const LEGS: usize = 3;
/// Cells that a walk keeps from what it walks towards.
const CLEARANCE: f64 = 3.0;

/// A path of 200 frames that begins with this view of a mesh with Y up, deterministically.
///
/// A camera outside the bounds goes round them once. One within walks where there is room: along
/// its view, then, up to two times, on in the direction of the longest view that does not lead
/// back, always at least three cells of the grid of [`automatic_camera`](crate::automatic_camera)
/// short of what it walks towards. Without room it turns where it stands.
#[must_use]
pub fn automatic_path(mesh: &TriangleMesh, camera: &Camera) -> CameraPath {
    let bounds = mesh.bounds();
    if bounds.is_empty() || !camera.position.is_finite() || !camera.forward.is_finite() {
        return CameraPath::still(camera);
    }
    let grid = bounds.contains_point(camera.position).then(|| Grid::new(mesh)).flatten();
    match grid {
        Some(grid) => grid.walk(camera),
        None => orbit(mesh, camera),
    }
}

impl Scene {
    /// The path of the file or the generator, or else [`automatic_path`] from the first camera,
    /// which looks at every triangle and is best asked for once.
    #[must_use]
    pub fn camera_path(&self) -> CameraPath {
        match (&self.path, self.cameras.first()) {
            (Some(path), _) => path.clone(),
            (None, Some(camera)) => automatic_path(&self.mesh, camera),
            (None, None) => automatic_path(&self.mesh, &super::automatic_camera(&self.mesh).camera),
        }
    }
}

/// Once round the bounds, counterclockwise from above.
fn orbit(mesh: &TriangleMesh, camera: &Camera) -> CameraPath {
    let bounds = mesh.bounds();
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let center = (min + max) * 0.5;
    let half = (max - min) * 0.5;
    let arm = camera.position.as_dvec3() - center;
    let forward = camera.forward.as_dvec3();
    // Where the view passes the centre; somewhere before the camera if it looks away.
    let ahead = (-arm.dot(forward)).max(arm.length() * 0.1).max(f64::MIN_POSITIVE);
    let target = arm + forward * ahead;
    // Where the circle would cut the bounds, it widens.
    let radius = arm.x.hypot(arm.z);
    let least = 1.05 * half.x.hypot(half.z);
    let within = arm.y.abs() <= half.y * 1.05;
    let wide = if within && radius > 0.0 { (least / radius).max(1.0) } else { 1.0 };
    let key = |i: usize| {
        let share = i as f64 / KEYS as f64;
        let (sin, cos) = sin_cos_turns(share);
        let turn = |p: DVec3| DVec3::new(p.x * cos + p.z * sin, p.y, p.z * cos - p.x * sin);
        // Widest opposite to where it begins, as the given view is to stay.
        let away = 1.0 + (wide - 1.0) * (4.0 * share * (1.0 - share)).min(1.0).sqrt();
        let out = DVec3::new(arm.x * away, arm.y, arm.z * away);
        place(center + turn(out), center + turn(target), camera.vertical_fov)
    };
    CameraPath { up: upright(camera), ..CameraPath::new((0..KEYS).map(key).collect(), true) }
}

fn place(position: DVec3, target: DVec3, vertical_fov: f32) -> CameraKey {
    let limit = DVec3::splat(f64::from(f32::MAX));
    let narrow = |p: DVec3| p.clamp(-limit, limit).as_vec3();
    CameraKey { position: narrow(position), target: narrow(target), vertical_fov }
}

/// The axis that the camera holds upright, Y unless it looks along it.
fn upright(camera: &Camera) -> Vec3 {
    if camera.forward.y.abs() < 0.999 && camera.up.y > 0.0 { Vec3::Y } else { camera.up }
}

impl Grid {
    fn walk(&self, camera: &Camera) -> CameraPath {
        let eye = camera.position.as_dvec3();
        let level = DVec3::new(camera.forward.x.into(), 0.0, camera.forward.z.into());
        let mut corners = vec![eye];
        let mut direction = level.try_normalize();
        for _ in 0..LEGS {
            let from = corners[corners.len() - 1];
            let Some(along) = direction.take().or_else(|| self.onward(&corners)) else { break };
            let room = self.room(from, along) - CLEARANCE;
            if room < 1.0 {
                // The first view may be at something close: then it sets out elsewhere.
                if corners.len() > 1 {
                    break;
                }
                let Some(along) = self.onward(&corners) else { break };
                let room = self.room(from, along) - CLEARANCE;
                if room < 1.0 {
                    break;
                }
                corners.push(from + along * (0.8 * room * self.cell));
                continue;
            }
            corners.push(from + along * (0.8 * room * self.cell));
        }
        let path = if corners.len() == 1 { self.turn(camera) } else { self.tour(camera, &corners) };
        CameraPath { up: upright(camera), ..path }
    }

    /// Cells of free view, to the border of the scene where nothing is in the way.
    fn room(&self, from: DVec3, direction: DVec3) -> f64 {
        let mut distance = 0.5;
        while self.at(from + direction * (distance * self.cell)).is_some_and(|c| c.samples == 0) {
            distance += 0.5;
        }
        distance
    }

    /// The horizontal direction with the most room that does not lead back.
    fn onward(&self, corners: &[DVec3]) -> Option<DVec3> {
        let from = *corners.last()?;
        let back = corners.len().checked_sub(2).map(|i| (corners[i] - from).normalize_or_zero());
        let ways = (0..DIRECTIONS).map(|k| {
            let (sin, cos) = sin_cos_turns(k as f64 / DIRECTIONS as f64);
            DVec3::new(cos, 0.0, sin)
        });
        ways.filter(|way| back.is_none_or(|back| way.dot(back) < 0.5))
            .map(|way| (self.room(from, way), way))
            .fold(None, |best: Option<(f64, DVec3)>, next| match best {
                Some(best) if best.0 >= next.0 => Some(best),
                _ => Some(next),
            })
            .map(|(_, way)| way)
    }

    /// Keys evenly along corners, each looking ahead on the way; the first looks as the camera.
    fn tour(&self, camera: &Camera, corners: &[DVec3]) -> CameraPath {
        let lengths: Vec<f64> = corners.windows(2).map(|w| w[0].distance(w[1])).collect();
        let total: f64 = lengths.iter().sum();
        let at = |mut distance: f64| {
            for (leg, length) in corners.windows(2).zip(&lengths) {
                if distance <= *length {
                    return leg[0].lerp(leg[1], distance / length);
                }
                distance -= length;
            }
            corners[corners.len() - 1]
        };
        let forward = camera.forward.as_dvec3();
        let last = corners[corners.len() - 1];
        let end = (last - corners[corners.len() - 2]).normalize_or(forward);
        let reach = 0.3 * total;
        let key = |i: usize| {
            let distance = total * i as f64 / KEYS as f64;
            let position = at(distance);
            let past = (distance + reach - total).max(0.0);
            let ahead = (at(distance + reach) + end * past - position).normalize_or(end);
            // From the camera's own view to that of the walk over the first quarter.
            let own = (1.0 - 4.0 * i as f64 / KEYS as f64).max(0.0);
            let look = ahead.lerp(forward, own).normalize_or(forward);
            place(position, position + look * reach.max(self.cell), camera.vertical_fov)
        };
        CameraPath::new((0..=KEYS).map(key).collect(), false)
    }

    /// A full turn on the spot.
    fn turn(&self, camera: &Camera) -> CameraPath {
        let eye = camera.position.as_dvec3();
        let forward = camera.forward.as_dvec3() * self.cell;
        let key = |i: usize| {
            let (sin, cos) = sin_cos_turns(i as f64 / KEYS as f64);
            let f = forward;
            let look = DVec3::new(f.x * cos + f.z * sin, f.y, f.z * cos - f.x * sin);
            place(eye, eye + look, camera.vertical_fov)
        };
        CameraPath::new((0..KEYS).map(key).collect(), true)
    }
}
