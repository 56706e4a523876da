//! Spotlights with a reach.

use glam::{DVec3, Vec3};
use niwaki_scene::{Light, LightFacts, LightKind};

/// A spotlight that lights nothing beyond its range, so that what it lights has a volume.
///
/// Its irradiance on a surface that faces it at distance d is
/// I · f(angle) · (1 − (d / range)⁴)² / d², where f falls from 1 at `inner` to 0 at `outer` as that
/// of [`Light::illuminate`]; the window is the one that Karis 2013 gives ("Real shading in Unreal
/// Engine 4"), so that the light ends without a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotLight {
    /// Where it stands.
    pub position: Vec3,
    /// Where it shines, unit length.
    pub direction: Vec3,
    /// Angle from the axis up to which it is full, in radians, from 0.
    pub inner: f32,
    /// Angle from the axis from which on there is no light, in radians, up to
    /// [`SpotLight::WIDEST`], since one shadow map has to hold it.
    pub outer: f32,
    /// Radiant intensity, linear RGB.
    pub intensity: Vec3,
    /// Distance from which on there is no light.
    pub range: f32,
}

impl SpotLight {
    /// The widest cone, from its axis, in radians.
    pub const WIDEST: f32 = LightFacts::NARROW_SPOT;

    /// A light at `position` that shines at `target`, inner angle 0.8 of the outer.
    #[must_use]
    pub fn aimed(position: Vec3, target: Vec3, outer: f32, range: f32, intensity: Vec3) -> Self {
        let direction = (target.as_dvec3() - position.as_dvec3()).as_vec3();
        Self { position, direction, inner: 0.8 * outer, outer, intensity, range }.sanitized()
    }

    /// A spotlight of a scene; `None` for lights of other kinds. It reaches as far as its
    /// irradiance is at least `least` (of the largest channel).
    #[must_use]
    pub fn from_light(light: &Light, least: f32) -> Option<Self> {
        let LightKind::Spot { inner, outer } = light.kind else { return None };
        let range = (light.intensity.max_element().max(0.0) / least.max(1e-30)).sqrt();
        let Light { position, direction, intensity, .. } = *light;
        Some(Self { position, direction, inner, outer, intensity, range }.sanitized())
    }

    /// The light with every number in its range: one that is not finite becomes a light that
    /// lights nothing.
    #[must_use]
    pub fn sanitized(self) -> Self {
        let finite = self.position.is_finite()
            && self.direction.is_finite()
            && self.intensity.is_finite()
            && [self.inner, self.outer, self.range].iter().all(|x| x.is_finite());
        let direction = self.direction.as_dvec3().try_normalize().unwrap_or(DVec3::NEG_Y);
        if !finite {
            return Self {
                position: Vec3::ZERO,
                direction: Vec3::NEG_Y,
                inner: 0.5,
                outer: 1.0,
                intensity: Vec3::ZERO,
                range: 1e-3,
            };
        }
        let outer = self.outer.clamp(1e-3, Self::WIDEST);
        Self {
            direction: direction.as_vec3(),
            inner: self.inner.clamp(0.0, outer),
            outer,
            intensity: self.intensity.max(Vec3::ZERO),
            range: self.range.clamp(1e-15, 1e15),
            ..self
        }
    }

    /// The light that arrives at `point`, whatever stands between: the unit direction to the light
    /// and the irradiance on a surface that faces it. `None` where there is none.
    #[must_use]
    pub fn illuminate(&self, point: Vec3) -> Option<(Vec3, Vec3)> {
        let offset = self.position.as_dvec3() - point.as_dvec3();
        let (squared, range) = (offset.length_squared(), f64::from(self.range));
        if !(squared > 0.0 && squared < range * range) {
            return None;
        }
        let to_light = offset / squared.sqrt();
        let cosine = -to_light.dot(self.direction.as_dvec3());
        let (inner, outer) = (f64::from(self.inner).cos(), f64::from(self.outer).cos());
        let t = ((cosine - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
        let q = squared / (range * range);
        let window = 1.0 - q * q;
        let irradiance = self.intensity.as_dvec3() * (t * t * window * window / squared);
        (irradiance.max_element() > 0.0).then(|| (to_light.as_vec3(), irradiance.as_vec3()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_ends_at_the_range_and_at_the_cone() {
        let light = SpotLight::aimed(Vec3::Y, Vec3::ZERO, 0.5, 4.0, Vec3::splat(2.0));
        let (to_light, irradiance) = light.illuminate(Vec3::ZERO).unwrap();
        assert_eq!(to_light, Vec3::Y);
        assert!((irradiance.x - 2.0 * (1.0 - 1.0 / 256.0_f32).powi(2)).abs() < 1e-6);
        assert!(light.illuminate(Vec3::new(0.0, -3.1, 0.0)).is_none());
        assert!(light.illuminate(Vec3::new(0.0, -2.9, 0.0)).is_some());
        assert!(light.illuminate(Vec3::X).is_none() && light.illuminate(Vec3::Y).is_none());
    }

    #[test]
    fn broken_lights_light_nothing() {
        let good = SpotLight::aimed(Vec3::Y, Vec3::ZERO, 0.5, 4.0, Vec3::ONE);
        for broken in [
            SpotLight { position: Vec3::NAN, ..good },
            SpotLight { direction: Vec3::INFINITY, ..good },
            SpotLight { range: f32::NAN, ..good },
            SpotLight { intensity: Vec3::splat(-1.0), ..good },
        ] {
            let light = broken.sanitized();
            assert!(light.position.is_finite() && light.illuminate(Vec3::ZERO).is_none());
            assert!((light.direction.length() - 1.0).abs() < 1e-6);
        }
        assert_eq!(SpotLight { outer: 3.0, ..good }.sanitized().outer, SpotLight::WIDEST);
    }

    #[test]
    fn only_spotlights_of_scenes_are_spotlights() {
        let light = Light {
            kind: LightKind::Spot { inner: 0.2, outer: 0.4 },
            position: Vec3::ZERO,
            direction: Vec3::X,
            intensity: Vec3::splat(4.0),
        };
        let spot = SpotLight::from_light(&light, 0.01).unwrap();
        assert!((spot.range - 20.0).abs() < 1e-4);
        assert!(SpotLight::from_light(&Light { kind: LightKind::Point, ..light }, 0.01).is_none());
    }
}
