//! Cameras, punctual lights and what surrounds the scene.

use glam::{DVec3, Vec3};

/// A pinhole camera. Coordinates are right-handed; the image's right is `forward × up`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub position: Vec3,
    /// Where it looks, unit length.
    pub forward: Vec3,
    /// The image's upward direction, unit length, perpendicular to `forward`.
    pub up: Vec3,
    /// Angle between the top and the bottom of the image in radians, 0 to π exclusive.
    pub vertical_fov: f32,
}

impl Camera {
    /// A camera at `position` that looks at `target`, upright along `up`. Directions that cannot
    /// be formed (a target at the position, an `up` along the view) are replaced by the nearest
    /// that can; the angle is kept between 0.01 and 3.1 radians.
    #[must_use]
    pub fn look_at(position: Vec3, target: Vec3, up: Vec3, vertical_fov: f32) -> Self {
        let direction = target.as_dvec3() - position.as_dvec3();
        Self::facing(position, direction, up, vertical_fov)
    }

    /// A camera at `position` that looks along `direction` (any length), otherwise as
    /// [`Camera::look_at`].
    #[must_use]
    pub fn facing(position: Vec3, direction: DVec3, up: Vec3, vertical_fov: f32) -> Self {
        // In f64, where neither 1e30 squared overflows nor 1e-30 squared vanishes.
        let forward = direction.try_normalize().unwrap_or(DVec3::NEG_Z);
        let right = forward
            .cross(up.as_dvec3())
            .try_normalize()
            .unwrap_or_else(|| forward.any_orthonormal_vector());
        let vertical_fov =
            if vertical_fov.is_finite() { vertical_fov.clamp(0.01, 3.1) } else { 0.8 };
        let up = right.cross(forward).as_vec3();
        Self { position, forward: forward.as_vec3(), up, vertical_fov }
    }

    /// The image's direction to the right, unit length.
    #[must_use]
    pub fn right(&self) -> Vec3 {
        self.forward.cross(self.up)
    }
}

/// How a punctual light spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// From a point in all directions; falls off with the square of the distance.
    Point,
    /// From infinitely far away.
    Directional,
    /// From a point within a cone. Full up to the angle `inner` from the axis, none from `outer`
    /// on; radians, 0 ≤ `inner` < `outer` ≤ π/2.
    Spot {
        /// Where the falloff begins.
        inner: f32,
        /// Where it ends.
        outer: f32,
    },
}

/// A light without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// How it spreads.
    pub kind: LightKind,
    /// Where it stands; without meaning for directional lights.
    pub position: Vec3,
    /// Where its light travels, unit length; without meaning for point lights.
    pub direction: Vec3,
    /// Linear RGB. Point and spot: radiant intensity (power per solid angle). Directional:
    /// irradiance on a surface that faces it.
    pub intensity: Vec3,
}

impl Light {
    /// The light that arrives at `point`, without regard to what stands between: the unit
    /// direction to the light, the distance (∞ for directional lights) and the irradiance on a
    /// surface that faces it. `None` at the light itself and outside its cone.
    #[must_use]
    pub fn illuminate(&self, point: Vec3) -> Option<(Vec3, f32, Vec3)> {
        if self.kind == LightKind::Directional {
            return Some((-self.direction, f32::INFINITY, self.intensity));
        }
        let offset = self.position - point;
        let distance = offset.length();
        let to_light = offset / distance;
        if !to_light.is_finite() {
            return None;
        }
        let mut irradiance = self.intensity / (distance * distance);
        if let LightKind::Spot { inner, outer } = self.kind {
            // The falloff that KHR_lights_punctual recommends.
            let (inner, outer) = (inner.cos(), outer.cos());
            let cosine = -to_light.dot(self.direction);
            let t = ((cosine - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
            irradiance *= t * t;
        }
        (irradiance.is_finite() && irradiance.max_element() > 0.0)
            .then_some((to_light, distance, irradiance))
    }
}

/// The light that comes from outside the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Environment {
    /// The same radiance from everywhere; zero is darkness.
    Constant(Vec3),
    /// A smooth sky around the Y axis, without a sun disc (the sun is a directional light), so
    /// that sampling it by chance alone has little noise.
    Sky {
        /// Radiance from straight up.
        zenith: Vec3,
        /// Radiance from the horizon.
        horizon: Vec3,
        /// Radiance from straight down.
        ground: Vec3,
    },
}

impl Environment {
    /// No light from outside.
    pub const DARK: Self = Self::Constant(Vec3::ZERO);

    /// A clear noon sky of radiance near 1.
    pub const DAYLIGHT: Self = Self::Sky {
        zenith: Vec3::new(0.30, 0.50, 0.95),
        horizon: Vec3::new(0.85, 0.92, 1.0),
        ground: Vec3::new(0.25, 0.22, 0.20),
    };

    /// The radiance that arrives from `direction` (away from the scene; any length). Linear RGB.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match *self {
            Self::Constant(radiance) => radiance,
            Self::Sky { zenith, horizon, ground } => {
                let y = direction.try_normalize().map_or(0.0, |d| d.y);
                // Brightness changes fastest near the horizon; squaring the complement does that.
                let t = 1.0 - (1.0 - y.abs()) * (1.0 - y.abs());
                horizon.lerp(if y >= 0.0 { zenith } else { ground }, t)
            }
        }
    }

    /// True if no light comes from outside.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        match *self {
            Self::Constant(radiance) => radiance.max_element() <= 0.0,
            Self::Sky { zenith, horizon, ground } => {
                zenith.max(horizon).max(ground).max_element() <= 0.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_orthonormal_whatever_they_look_at() {
        let cases = [
            (Vec3::ZERO, Vec3::X, Vec3::Y),
            (Vec3::ZERO, Vec3::ZERO, Vec3::Y),
            (Vec3::ZERO, Vec3::Y, Vec3::Y),
            (Vec3::splat(1e7), Vec3::splat(-1e7), Vec3::Z),
            (Vec3::ZERO, Vec3::splat(1e-30), Vec3::ZERO),
        ];
        for (position, target, up) in cases {
            let c = Camera::look_at(position, target, up, 1.0);
            assert!((c.forward.length() - 1.0).abs() < 1e-5 && (c.up.length() - 1.0).abs() < 1e-5);
            assert!(c.forward.dot(c.up).abs() < 1e-5, "{c:?}");
        }
    }

    #[test]
    fn point_lights_fall_off_with_the_square() {
        let light = Light {
            kind: LightKind::Point,
            position: Vec3::Y,
            direction: Vec3::NEG_Y,
            intensity: Vec3::ONE,
        };
        let (to_light, distance, irradiance) = light.illuminate(Vec3::new(0.0, -1.0, 0.0)).unwrap();
        assert_eq!((to_light, distance, irradiance), (Vec3::Y, 2.0, Vec3::splat(0.25)));
        assert!(light.illuminate(Vec3::Y).is_none());
        let spot = Light { kind: LightKind::Spot { inner: 0.1, outer: 0.2 }, ..light };
        assert!(spot.illuminate(Vec3::new(0.0, -1.0, 0.0)).is_some());
        assert!(spot.illuminate(Vec3::new(2.0, 0.0, 0.0)).is_none());
    }

    #[test]
    fn the_sky_runs_from_horizon_to_zenith_and_ground() {
        let Environment::Sky { zenith, horizon, ground } = Environment::DAYLIGHT else {
            unreachable!("daylight is a sky")
        };
        assert_eq!(Environment::DAYLIGHT.radiance(Vec3::Y * 3.0), zenith);
        assert_eq!(Environment::DAYLIGHT.radiance(Vec3::X), horizon);
        assert_eq!(Environment::DAYLIGHT.radiance(Vec3::NEG_Y), ground);
        assert_eq!(Environment::DAYLIGHT.radiance(Vec3::NAN), horizon);
        assert!(Environment::DARK.is_dark() && !Environment::DAYLIGHT.is_dark());
    }
}
