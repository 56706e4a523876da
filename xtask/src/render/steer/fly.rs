//! A camera that flies where keys and mouse say.

use niwaki_core::{
    Aabb,
    glam::{DVec2, DVec3, Vec3},
};
use niwaki_scene::Camera;

/// How much of a key is left of the vertical in radians: looking straight up or down has no right.
const LEAST_TILT: f64 = 0.01;

/// The longest step in seconds: after a slow frame the camera should not be elsewhere.
const LONGEST_STEP: f64 = 0.25;

/// What a key moves that went down and up again between two frames, in seconds.
const TAP: f64 = 1.0 / 30.0;

/// How much faster with shift.
const FAST: f64 = 4.0;

/// Directions in which keys move the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Go {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
}

impl Go {
    const ALL: [Self; 6] =
        [Self::Forward, Self::Back, Self::Left, Self::Right, Self::Up, Self::Down];

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// Position and direction of a camera, and the keys that move it.
#[derive(Clone, Debug)]
pub(in crate::render) struct Fly {
    position: DVec3,
    /// Angle around `up` from `east`, and above the horizon; radians.
    yaw: f64,
    pitch: f64,
    /// Unit vectors: what is up in the scene, and two directions at right angles to it.
    up: DVec3,
    east: DVec3,
    south: DVec3,
    vertical_fov: f32,
    /// Units of length a second.
    speed: f64,
    /// Keys that are down, a bit each.
    held: u8,
    /// Keys that went down since the last frame.
    tapped: u8,
    pub(in crate::render) fast: bool,
}

impl Fly {
    /// A camera that takes about eight seconds through the bounds; `up` is that of the scene.
    pub(in crate::render) fn new(camera: &Camera, up: Vec3, bounds: Aabb) -> Self {
        let up = up.as_dvec3().try_normalize().unwrap_or(DVec3::Y);
        let east = up.any_orthonormal_vector();
        let diagonal = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length();
        let speed = if diagonal.is_finite() && diagonal > 0.0 { diagonal / 8.0 } else { 1.0 };
        let mut fly = Self {
            position: DVec3::ZERO,
            yaw: 0.0,
            pitch: 0.0,
            up,
            east,
            south: up.cross(east),
            vertical_fov: 0.8,
            speed,
            held: 0,
            tapped: 0,
            fast: false,
        };
        fly.place(camera);
        fly
    }

    /// Stands where a camera stands and looks where it looks, upright.
    pub(in crate::render) fn place(&mut self, camera: &Camera) {
        let forward = camera.forward.as_dvec3().try_normalize().unwrap_or(self.east);
        let level = DVec2::new(forward.dot(self.east), forward.dot(self.south));
        // Straight up or down says nothing about the horizon.
        if level.length() > 1e-6 {
            self.yaw = level.y.atan2(level.x);
        }
        self.pitch = forward.dot(self.up).clamp(-1.0, 1.0).asin();
        self.limit();
        self.position = camera.position.as_dvec3();
        self.vertical_fov = camera.vertical_fov;
    }

    pub(in crate::render) fn camera(&self) -> Camera {
        let limit = DVec3::splat(f64::from(f32::MAX));
        let position = self.position.clamp(-limit, limit).as_vec3();
        Camera::facing(position, self.forward(), self.up.as_vec3(), self.vertical_fov)
    }

    fn forward(&self) -> DVec3 {
        let level = self.east * self.yaw.cos() + self.south * self.yaw.sin();
        level * self.pitch.cos() + self.up * self.pitch.sin()
    }

    fn limit(&mut self) {
        let most = std::f64::consts::FRAC_PI_2 - LEAST_TILT;
        self.pitch = self.pitch.clamp(-most, most);
        self.yaw = self.yaw.rem_euclid(std::f64::consts::TAU);
    }

    /// A key goes down or up.
    pub(in crate::render) fn key(&mut self, go: Go, down: bool) {
        if down {
            self.tapped |= go.bit();
            self.held |= go.bit();
        } else {
            self.held &= !go.bit();
        }
    }

    /// All keys go up: the window is no longer the one that hears of them.
    pub(in crate::render) fn release(&mut self) {
        (self.held, self.tapped, self.fast) = (0, 0, false);
    }

    /// True if keys move it.
    pub(in crate::render) const fn moves(&self) -> bool {
        self.held | self.tapped != 0
    }

    /// Turns as a mouse drags the picture by so many pixels of a window this high.
    pub(in crate::render) fn look(&mut self, right: f64, down: f64, height: u32) {
        // The point under the mouse stays under it, at the middle of the picture.
        let angle = f64::from(self.vertical_fov) / f64::from(height.max(1));
        if right.is_finite() && down.is_finite() {
            // `south` is to the left of `east` as seen from above.
            self.yaw += right * angle;
            self.pitch += down * angle;
            self.limit();
        }
    }

    /// Faster or slower by so many steps.
    pub(in crate::render) fn shift_gear(&mut self, steps: f64) {
        if steps.is_finite() {
            self.speed = (self.speed * 1.25_f64.powf(steps)).clamp(1e-12, 1e30);
        }
    }

    pub(in crate::render) const fn speed(&self) -> f64 {
        self.speed
    }

    /// Moves by what keys say in so many seconds.
    pub(in crate::render) fn step(&mut self, seconds: f64) {
        let seconds = if seconds > 0.0 { seconds.min(LONGEST_STEP) } else { 0.0 };
        let forward = self.forward();
        let right = forward.cross(self.up).normalize_or_zero();
        let mut way = DVec3::ZERO;
        for go in Go::ALL {
            let direction = match go {
                Go::Forward => forward,
                Go::Back => -forward,
                Go::Left => -right,
                Go::Right => right,
                Go::Up => self.up,
                Go::Down => -self.up,
            };
            if self.held & go.bit() != 0 {
                way += direction * seconds.max(if self.tapped & go.bit() != 0 { TAP } else { 0.0 });
            } else if self.tapped & go.bit() != 0 {
                way += direction * TAP;
            }
        }
        self.tapped = 0;
        let gear = if self.fast { FAST } else { 1.0 };
        self.position += way * (self.speed * gear);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fly() -> Fly {
        let camera =
            Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, -5.0), Vec3::Y, 0.8);
        let bounds = Aabb { min: Vec3::ZERO, max: Vec3::new(8.0, 0.0, 0.0) };
        Fly::new(&camera, Vec3::Y, bounds)
    }

    #[test]
    fn the_camera_is_the_one_that_was_given() {
        let camera = fly().camera();
        assert_eq!(camera.position, Vec3::new(1.0, 2.0, 3.0));
        assert!(camera.forward.distance(Vec3::NEG_Z) < 1e-6 && camera.up.distance(Vec3::Y) < 1e-6);
        // Any up, any direction but the vertical.
        for up in [Vec3::Y, Vec3::Z, Vec3::new(0.6, 0.0, -0.8)] {
            for direction in [Vec3::X, Vec3::new(-0.6, 0.64, 0.48), Vec3::new(0.1, -0.2, 0.9)] {
                let wanted = Camera::facing(Vec3::ONE, direction.as_dvec3(), up, 1.0);
                let got = Fly::new(&wanted, up, Aabb::EMPTY).camera();
                assert!(got.forward.distance(wanted.forward) < 1e-5, "{up} {direction}");
                assert!(got.up.distance(wanted.up) < 1e-5, "{up} {direction}");
            }
        }
        let down = Camera::facing(Vec3::ONE, DVec3::NEG_Y, Vec3::Y, 1.0);
        let got = Fly::new(&down, Vec3::Y, Aabb::EMPTY).camera();
        assert!(got.forward.dot(Vec3::NEG_Y) > 0.999 && got.up.is_finite());
    }

    #[test]
    fn keys_move_along_what_the_picture_shows() {
        for (go, along) in [
            (Go::Forward, Vec3::NEG_Z),
            (Go::Back, Vec3::Z),
            (Go::Left, Vec3::NEG_X),
            (Go::Right, Vec3::X),
            (Go::Up, Vec3::Y),
            (Go::Down, Vec3::NEG_Y),
        ] {
            let mut fly = fly();
            fly.key(go, true);
            fly.step(0.125);
            fly.key(go, false);
            fly.step(0.125);
            // A diagonal of 8 in 8 seconds.
            let moved = fly.camera().position - Vec3::new(1.0, 2.0, 3.0);
            assert!(moved.distance(along * 0.125) < 1e-5, "{go:?}: {moved}");
            assert!(!fly.moves());
        }
    }

    #[test]
    fn opposite_keys_cancel_and_shift_is_faster() {
        let mut both = fly();
        both.key(Go::Left, true);
        both.key(Go::Right, true);
        both.step(0.1);
        assert!(both.camera().position.distance(fly().camera().position) < 1e-6);
        let mut fast = fly();
        fast.fast = true;
        fast.key(Go::Up, true);
        fast.step(0.1);
        assert!((fast.camera().position.y - 2.4).abs() < 1e-5);
        fast.release();
        fast.step(0.1);
        assert!((fast.camera().position.y - 2.4).abs() < 1e-5);
    }

    #[test]
    fn slow_frames_neither_lose_taps_nor_throw_the_camera_far() {
        let mut tapped = fly();
        tapped.key(Go::Up, true);
        tapped.key(Go::Up, false);
        tapped.step(20.0);
        assert!((f64::from(tapped.camera().position.y) - 2.0 - TAP).abs() < 1e-5);
        let mut held = fly();
        held.key(Go::Up, true);
        held.step(20.0);
        assert!((f64::from(held.camera().position.y) - 2.0 - LONGEST_STEP).abs() < 1e-5);
        held.step(f64::NAN);
        assert!(held.camera().position.is_finite());
    }

    #[test]
    fn dragging_takes_the_picture_along() {
        let mut fly = fly();
        // Dragged to the right by a quarter of the height: what was to the left comes into view.
        fly.look(100.0, 0.0, 400);
        let forward = fly.camera().forward;
        assert!((forward.x + (0.2_f32).sin()).abs() < 1e-5 && forward.y.abs() < 1e-6, "{forward}");
        fly.look(-100.0, 100.0, 400);
        let forward = fly.camera().forward;
        assert!((forward.y - (0.2_f32).sin()).abs() < 1e-5 && forward.x.abs() < 1e-5, "{forward}");
        // It stops short of the vertical and comes back.
        fly.look(0.0, 1e6, 400);
        assert!(fly.camera().up.is_finite() && fly.camera().forward.y < 1.0);
        fly.look(f64::NAN, 0.0, 0);
        assert!(fly.camera().forward.is_finite());
    }

    #[test]
    fn gears_stay_within_reason() {
        let mut fly = fly();
        fly.shift_gear(3.0);
        fly.shift_gear(-3.0);
        assert!((fly.speed() - 1.0).abs() < 1e-9);
        for steps in [1e9, f64::NAN, -1e9] {
            fly.shift_gear(steps);
            assert!(fly.speed() > 0.0 && fly.speed().is_finite());
        }
    }
}
