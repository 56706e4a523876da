//! Camera paths.

use crate::Camera;
use glam::{DVec3, Vec3};

/// A place on a [`CameraPath`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraKey {
    /// Where the camera stands.
    pub position: Vec3,
    /// What it looks at.
    pub target: Vec3,
    /// Angle between the top and the bottom of the image in radians.
    pub vertical_fov: f32,
}

/// A smooth path of a camera through keys, each reached after the same time.
///
/// Position, target and angle each follow a uniform Catmull–Rom spline (Catmull and Rom 1974):
/// the path goes through every key, and leaves it in the direction from the key before to the key
/// after. At the ends of an open path the missing neighbour is the mirror image of the one that is
/// there.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// In order. Keys that are not finite are passed over; without any the camera stands at
    /// (0, 0, 3) and looks at the origin.
    pub keys: Vec<CameraKey>,
    /// The image's upward direction.
    pub up: Vec3,
    /// True if the path leads from the last key back to the first.
    pub closed: bool,
    /// How many frames an animation along the path has, at least 1.
    pub frames: u32,
}

impl CameraPath {
    /// Frames of a path unless said otherwise, as in the thesis's measurements (paper III, §4).
    pub const FRAMES: u32 = 200;

    /// A path of 200 frames through keys, with Y up.
    #[must_use]
    pub const fn new(keys: Vec<CameraKey>, closed: bool) -> Self {
        Self { keys, up: Vec3::Y, closed, frames: Self::FRAMES }
    }

    /// A camera that does not move.
    #[must_use]
    pub fn still(camera: &Camera) -> Self {
        let target = camera.position + camera.forward;
        let key =
            CameraKey { position: camera.position, target, vertical_fov: camera.vertical_fov };
        Self { up: camera.up, ..Self::new(vec![key], false) }
    }

    /// The camera of a frame. Frames past the last stand at the end of an open path, and go round
    /// a closed one again. The last frame of a closed path stands one step before the first.
    #[must_use]
    pub fn frame(&self, frame: u32) -> Camera {
        let frames = self.frames.max(1);
        if self.closed {
            self.at(f64::from(frame % frames) / f64::from(frames))
        } else {
            self.at(f64::from(frame.min(frames - 1)) / f64::from((frames - 1).max(1)))
        }
    }

    /// The camera after this share of the path, 0 to 1; outside the ends hold, on a closed path
    /// too. What is not a number counts as 0.
    #[must_use]
    pub fn at(&self, share: f64) -> Camera {
        let finite = |key: &&CameraKey| {
            key.position.is_finite() && key.target.is_finite() && key.vertical_fov.is_finite()
        };
        let keys: Vec<&CameraKey> = self.keys.iter().filter(finite).collect();
        let Some(last) = keys.len().checked_sub(1) else {
            return Camera::look_at(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, self.up, 0.7);
        };
        let spans = if self.closed { keys.len() } else { last };
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        let along = share * spans as f64;
        #[expect(clippy::cast_possible_truncation, reason = "from 0 to the number of spans")]
        let span = (along.floor() as usize).min(spans.saturating_sub(1));
        let t = along - span as f64;
        let key = |i: usize, get: &dyn Fn(&CameraKey) -> DVec3| -> [DVec3; 4] {
            let at = |j: usize| get(keys[if self.closed { j % keys.len() } else { j.min(last) }]);
            let (from, to) = (at(i), at(i + 1));
            let before = match i.checked_sub(1) {
                Some(j) => at(j),
                None if self.closed => at(last),
                None => from * 2.0 - to,
            };
            let after = if self.closed || i + 2 <= last { at(i + 2) } else { to * 2.0 - from };
            [before, from, to, after]
        };
        let value = |get: &dyn Fn(&CameraKey) -> DVec3| spline(key(span, get), t);
        let position = value(&|k| k.position.as_dvec3());
        let target = value(&|k| k.target.as_dvec3());
        let fov = value(&|k| DVec3::splat(f64::from(k.vertical_fov))).x;
        let limit = DVec3::splat(f64::from(f32::MAX));
        #[expect(clippy::cast_possible_truncation, reason = "an angle in f32 is enough")]
        Camera::facing(
            position.clamp(-limit, limit).as_vec3(),
            target - position,
            self.up,
            fov as f32,
        )
    }
}

/// The Catmull–Rom spline between the second and the third point.
fn spline([a, b, c, d]: [DVec3; 4], t: f64) -> DVec3 {
    let (m, n) = ((c - a) * 0.5, (d - b) * 0.5);
    let (t2, t3) = (t * t, t * t * t);
    b * (2.0 * t3 - 3.0 * t2 + 1.0)
        + m * (t3 - 2.0 * t2 + t)
        + c * (3.0 * t2 - 2.0 * t3)
        + n * (t3 - t2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(x: f32, z: f32) -> CameraKey {
        CameraKey { position: Vec3::new(x, 1.0, z), target: Vec3::ZERO, vertical_fov: 0.8 }
    }

    #[test]
    fn the_path_goes_through_its_keys() {
        let keys = vec![key(4.0, 0.0), key(0.0, 4.0), key(-4.0, 1.0), key(0.0, -4.0)];
        for closed in [false, true] {
            let path = CameraPath::new(keys.clone(), closed);
            let spans = if closed { 4 } else { 3 };
            for (i, k) in keys.iter().enumerate() {
                let camera = path.at(i as f64 / f64::from(spans));
                assert!(camera.position.distance(k.position) < 1e-5, "{i}: {camera:?}");
                let forward = (k.target - k.position).normalize();
                assert!(camera.forward.dot(forward) > 0.999_99);
            }
            let end = if closed { keys[0] } else { keys[3] };
            assert!(path.at(1.0).position.distance(end.position) < 1e-5);
            assert_eq!(path.at(7.0), path.at(1.0));
            assert_eq!(path.at(f64::NAN), path.at(0.0));
        }
    }

    #[test]
    fn straight_paths_are_walked_evenly() {
        let path = CameraPath::new((0..5_u8).map(|i| key(f32::from(i), -9.0)).collect(), false);
        for i in 0..200_u8 {
            let expected = 4.0 * f32::from(i) / 199.0;
            assert!((path.frame(u32::from(i)).position.x - expected).abs() < 1e-5);
        }
        assert_eq!(path.frame(5000), path.frame(199));
    }

    #[test]
    fn no_keys_one_key_and_broken_keys() {
        let nothing = CameraPath::new(Vec::new(), true);
        assert!(nothing.frame(3).position.is_finite());
        let broken = CameraKey { position: Vec3::NAN, ..key(0.0, 0.0) };
        for closed in [false, true] {
            let one = CameraPath::new(vec![broken, key(3.0, 0.0), broken], closed);
            assert_eq!(one.frame(0), one.frame(150));
            assert_eq!(one.frame(0).position, Vec3::new(3.0, 1.0, 0.0));
            let far = CameraPath::new(vec![key(f32::MAX, 0.0), key(-f32::MAX, f32::MAX)], closed);
            for i in 0..200 {
                let c = far.frame(i);
                assert!(c.position.is_finite() && (c.forward.length() - 1.0).abs() < 1e-5);
            }
        }
        let none = CameraPath { frames: 0, ..CameraPath::new(vec![key(1.0, 1.0)], true) };
        assert!(none.frame(9).position.is_finite());
    }

    #[test]
    fn closed_paths_have_no_seam() {
        let keys = vec![key(4.0, 0.0), key(0.0, 4.0), key(-4.0, 0.0), key(0.0, -4.0)];
        let path = CameraPath::new(keys, true);
        let step = |a: u32, b: u32| path.frame(a).position.distance(path.frame(b).position);
        assert!(step(199, 200) < 1.5 * step(100, 101));
    }
}
