//! One ray against one or two triangles.

use crate::number::{Bounded, Dyadic, Number, cross, difference, dot, vector};
use niwaki_core::{Ray, Triangle};
use std::cmp::Ordering;

/// How a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Contact {
    /// No common point within the ray's range, or one of the cases that count as a miss (see the
    /// crate documentation).
    Miss,
    /// The ray pierces the inside of the triangle.
    Interior,
    /// The ray pierces an edge or a corner.
    Border,
}

impl Contact {
    /// True unless this is a miss.
    #[must_use]
    pub const fn is_hit(self) -> bool {
        !matches!(self, Self::Miss)
    }
}

/// Decides exactly whether a ray hits a closed triangle within its closed range.
#[must_use]
pub fn contact(ray: &Ray, triangle: &Triangle) -> Contact {
    contact_of_line(&forward(ray), triangle)
}

/// The ray with a negative `t_min` taken as 0, as kernels take it.
pub(crate) fn forward(ray: &Ray) -> Ray {
    if ray.t_min < 0.0 { ray.with_range(0.0, ray.t_max) } else { *ray }
}

/// [`contact`] that goes behind the origin where the range does.
pub(crate) fn contact_of_line(ray: &Ray, triangle: &Triangle) -> Contact {
    if !is_sound(ray) || !is_finite(triangle) {
        return Contact::Miss;
    }
    try_contact::<Bounded>(ray, triangle)
        .or_else(|| try_contact::<Dyadic>(ray, triangle))
        .unwrap_or(Contact::Miss)
}

/// Distance at which a ray hits a triangle, in lengths of its direction: the exact value rounded
/// to the nearest `f64`. `None` if it misses.
#[must_use]
pub fn t(ray: &Ray, triangle: &Triangle) -> Option<f64> {
    if contact(ray, triangle).is_hit() { plane_t(ray, triangle) } else { None }
}

/// Compares exactly the distances at which the line of a ray crosses the planes of two triangles,
/// whether or not it hits them. A plane that it does not cross in one point (a parallel plane, a
/// triangle without area, input that is not finite) is infinitely far.
#[must_use]
pub fn compare_t(ray: &Ray, a: &Triangle, b: &Triangle) -> Ordering {
    let crosses = |triangle: &Triangle| crosses_plane(ray, triangle);
    match (crosses(a), crosses(b)) {
        (true, true) => try_compare::<Bounded>(ray, a, b)
            .or_else(|| try_compare::<Dyadic>(ray, a, b))
            .unwrap_or(Ordering::Equal),
        (true, false) => Ordering::Less,
        (false, true) => Ordering::Greater,
        (false, false) => Ordering::Equal,
    }
}

/// True if the line of the ray crosses the plane of the triangle in one point.
pub(crate) fn crosses_plane(ray: &Ray, triangle: &Triangle) -> bool {
    let finite = ray.origin.is_finite() && ray.direction.is_finite() && is_finite(triangle);
    finite && {
        let sign = Plane::<Bounded>::of(ray, triangle)
            .det
            .sign()
            .or_else(|| Plane::<Dyadic>::of(ray, triangle).det.sign());
        sign != Some(Ordering::Equal)
    }
}

/// True if the corners lie on one line, or in one point.
pub(crate) fn is_flat(triangle: &Triangle) -> bool {
    let is_zero = |n: Option<Ordering>| n == Some(Ordering::Equal);
    is_finite(triangle)
        && Plane::<Bounded>::normal(triangle).iter().all(|n| n.sign().is_none_or(|s| s.is_eq()))
        && Plane::<Dyadic>::normal(triangle).iter().all(|n| is_zero(n.sign()))
}

/// Where the line crosses the plane, rounded to nearest; `None` if not in one point.
pub(crate) fn plane_t(ray: &Ray, triangle: &Triangle) -> Option<f64> {
    if !(ray.origin.is_finite() && ray.direction.is_finite() && is_finite(triangle)) {
        return None;
    }
    let plane = Plane::<Dyadic>::of(ray, triangle);
    plane.distance.divide(&plane.det)
}

/// Finite where it must be; the range is not NaN.
pub(crate) fn is_sound(ray: &Ray) -> bool {
    ray.origin.is_finite()
        && ray.direction.is_finite()
        && ray.t_min < f32::INFINITY
        && ray.t_max > f32::NEG_INFINITY
}

fn is_finite(triangle: &Triangle) -> bool {
    triangle.vertices().iter().all(|v| v.is_finite())
}

/// The line crosses the plane at `t = distance / det`.
struct Plane<N> {
    distance: N,
    det: N,
}

impl<N: Number> Plane<N> {
    fn of(ray: &Ray, triangle: &Triangle) -> Self {
        let a = vector::<N>(triangle.v0);
        let normal = Self::normal(triangle);
        Self {
            distance: dot(&difference(&a, &vector(ray.origin)), &normal),
            det: dot(&vector(ray.direction), &normal),
        }
    }

    fn normal(triangle: &Triangle) -> [N; 3] {
        let [a, b, c] = triangle.vertices().map(vector::<N>);
        cross(&difference(&b, &a), &difference(&c, &a))
    }
}

/// Signs of the volumes that the direction spans with pairs of corners seen from the origin: the
/// barycentric weights of the crossing times `det`. `None` if the numbers cannot tell.
fn try_contact<N: Number>(ray: &Ray, triangle: &Triangle) -> Option<Contact> {
    let direction = vector::<N>(ray.direction);
    let origin = vector::<N>(ray.origin);
    let [a, b, c] = triangle.vertices().map(|v| difference(&vector(v), &origin));
    let weights = [(&b, &c), (&c, &a), (&a, &b)].map(|(p, q)| dot(&direction, &cross(p, q)).sign());
    // Two weights of opposite sign settle a miss, whatever is unknown about the third.
    if weights.contains(&Some(Ordering::Less)) && weights.contains(&Some(Ordering::Greater)) {
        return Some(Contact::Miss);
    }
    let Plane { distance, det } = Plane::<N>::of(ray, triangle);
    let side = det.sign()?;
    if side == Ordering::Equal {
        return Some(Contact::Miss);
    }
    let mut result = Contact::Interior;
    for weight in weights {
        match weight? {
            Ordering::Equal => result = Contact::Border,
            sign if sign != side => return Some(Contact::Miss),
            _ => {}
        }
    }
    // t − limit has the sign of (distance − limit·det)·det.
    let against = |limit: f32| {
        let sign = distance.sub(&N::new(limit).mul(&det)).sign()?;
        Some(if side == Ordering::Less { sign.reverse() } else { sign })
    };
    if ray.t_min.is_finite() && against(ray.t_min)? == Ordering::Less {
        return Some(Contact::Miss);
    }
    if ray.t_max.is_finite() && against(ray.t_max)? == Ordering::Greater {
        return Some(Contact::Miss);
    }
    Some(result)
}

fn try_compare<N: Number>(ray: &Ray, a: &Triangle, b: &Triangle) -> Option<Ordering> {
    let (a, b) = (Plane::<N>::of(ray, a), Plane::<N>::of(ray, b));
    let sign = a.distance.mul(&b.det).sub(&b.distance.mul(&a.det)).sign()?;
    let reversed = a.det.sign()? != b.det.sign()?;
    Some(if reversed { sign.reverse() } else { sign })
}
