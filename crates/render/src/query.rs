//! What a ray meets, and whether a light is seen, with alpha taken into account.

use crate::{
    offset::{CLEARANCE, offset_origin},
    stats::Observer,
    surface::Surface,
};
use glam::Vec3;
use niwaki_core::{Intersector, Ray, glam};
use niwaki_scene::Scene;

/// Most surfaces that one ray may pass where alpha cuts them out; further ones block it.
const MAX_CUTOUTS: u32 = 1024;

/// A scene with the tracer that answers for it.
pub(crate) struct Query<'a, I: Intersector + ?Sized> {
    pub(crate) scene: &'a Scene,
    pub(crate) intersector: &'a I,
    /// Some surface may let rays pass by its alpha: look.
    pub(crate) alpha: bool,
}

/// How far along a ray has come through surfaces that let it pass.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Passed {
    pub(crate) distance: f32,
    pub(crate) surfaces: u32,
}

/// A surface that a ray meets.
pub(crate) struct Found<'a> {
    pub(crate) surface: Surface<'a>,
    /// How far the ray has come, surfaces passed included.
    pub(crate) passed: Passed,
    /// Above 0; 1 if nothing may pass.
    pub(crate) opacity: f32,
}

impl<'a, I: Intersector + ?Sized> Query<'a, I> {
    /// The first surface on a ray that starts after `passed` for which `meets` says yes, given
    /// its opacity (between 0 and 1; surfaces of opacity 0 and 1 are not asked about).
    pub(crate) fn closest(
        &self,
        mut ray: Ray,
        mut passed: Passed,
        observer: &mut impl Observer,
        mut meets: impl FnMut(f32) -> bool,
    ) -> Option<Found<'a>> {
        loop {
            let hit = self.intersector.closest_hit(&ray);
            let surface = Surface::at(self.scene, &ray, &hit)?;
            passed.distance += hit.t;
            let mut opacity = 1.0;
            if self.alpha && passed.surfaces < MAX_CUTOUTS {
                observer.alpha_test();
                opacity = surface.opacity(self.scene);
            }
            if opacity >= 1.0 || (opacity > 0.0 && meets(opacity)) {
                return Some(Found { surface, passed, opacity: opacity.min(1.0) });
            }
            observer.continuation();
            passed.surfaces += 1;
            ray = beyond(&surface, ray.direction);
        }
    }

    /// The share of light that nothing in the ray's range holds back.
    pub(crate) fn visibility(&self, mut ray: Ray, observer: &mut impl Observer) -> f32 {
        if !self.alpha {
            return if self.intersector.any_hit(&ray) { 0.0 } else { 1.0 };
        }
        let mut visible = 1.0;
        for _ in 0..MAX_CUTOUTS {
            let hit = self.intersector.closest_hit(&ray);
            let Some(surface) = Surface::at(self.scene, &ray, &hit) else { return visible };
            observer.alpha_test();
            visible *= 1.0 - surface.opacity(self.scene);
            if visible <= 0.0 {
                return 0.0;
            }
            observer.continuation();
            ray = beyond(&surface, ray.direction).with_range(0.0, ray.t_max - hit.t);
        }
        0.0
    }
}

/// The ray that goes straight on from a surface.
pub(crate) fn beyond(surface: &Surface<'_>, direction: Vec3) -> Ray {
    let origin = offset_origin(surface.point, -surface.geometric_normal, surface.reach);
    Ray::new(origin, direction)
}

/// The origin of a ray that leaves in `direction`; `None` if shading and geometric normal disagree
/// on whether it goes through the surface.
pub(crate) fn leave(surface: &Surface<'_>, direction: Vec3, reflected: bool) -> Option<Vec3> {
    let normal = surface.geometric_normal;
    let outside = normal.dot(direction) > 0.0;
    (outside == reflected).then(|| {
        offset_origin(surface.point, if outside { normal } else { -normal }, surface.reach)
    })
}

/// The ray from a surface to a punctual light in `direction` (unit) at `distance` (∞ for
/// directional lights); `reflected` says that the light shines on the viewer's side by the shading
/// normal. `None` if the geometric normal disagrees.
pub(crate) fn shadow_ray(
    surface: &Surface<'_>,
    direction: Vec3,
    distance: f32,
    reflected: bool,
) -> Option<Ray> {
    let origin = leave(surface, direction, reflected)?;
    if !distance.is_finite() {
        return Some(Ray::new(origin, direction));
    }
    // Aim anew from the offset origin, and end short of the light by the error of `t`, so that a
    // light that lies on a surface shines.
    let target = surface.point + direction.as_dvec3() * f64::from(distance);
    let span = (target - origin.as_dvec3()).as_vec3();
    let length = span.length();
    (length > 0.0 && span.dot(direction) > 0.0)
        .then(|| Ray::new(origin, span / length).with_range(0.0, length * (1.0 - CLEARANCE)))
}
