//! Reflection and refraction at smooth interfaces.

use glam::Vec3;

/// The share of unpolarised light that a dielectric reflects, 0 to 1.
///
/// `cosine` is that of the angle between the incoming direction and the normal on its own side, 0
/// to 1; `eta` is the index of refraction beyond the interface divided by that before it. Past the
/// critical angle (only where `eta` < 1) all is reflected and the result is 1. Fresnel's
/// equations, as in Pharr, Jakob and Humphreys 2023, section 9.5.1.
///
/// ```
/// use niwaki_render::fresnel::dielectric;
/// assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6); // ((1.5 − 1) / (1.5 + 1))²
/// assert_eq!(dielectric(0.5, 1.0 / 1.5), 1.0); // 60° inside glass: total internal reflection
/// ```
#[must_use]
pub fn dielectric(cosine: f32, eta: f32) -> f32 {
    // Without a step in the index there is no interface, not even at grazing angles.
    if eta == 1.0 {
        return 0.0;
    }
    let cosine = cosine.clamp(0.0, 1.0);
    let sine_squared = (1.0 - cosine * cosine) / (eta * eta);
    if sine_squared >= 1.0 {
        return 1.0;
    }
    let beyond = (1.0 - sine_squared).sqrt();
    let parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
    let perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
    (0.5 * (parallel * parallel + perpendicular * perpendicular)).clamp(0.0, 1.0)
}

/// The share that a metal reflects whose share at normal incidence is `f0` (Schlick 1994).
#[must_use]
pub fn conductor(cosine: f32, f0: Vec3) -> Vec3 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let x2 = x * x;
    f0 + (Vec3::ONE - f0) * (x2 * x2 * x)
}

/// `wo` mirrored at `normal`, both unit and pointing away from the surface.
#[must_use]
pub fn reflect(wo: Vec3, normal: Vec3) -> Vec3 {
    2.0 * wo.dot(normal) * normal - wo
}

/// The direction in which light from `wo` (away from the surface, on the side of `normal`) goes on
/// beyond the interface by Snell's law, unit length; `None` past the critical angle. `eta` as in
/// [`dielectric`].
#[must_use]
pub fn refract(wo: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cosine = wo.dot(normal);
    let sine_squared = (1.0 - cosine * cosine).max(0.0) / (eta * eta);
    if sine_squared >= 1.0 {
        return None;
    }
    let beyond = (1.0 - sine_squared).sqrt();
    (-wo / eta + (cosine / eta - beyond) * normal).try_normalize()
}
