//! One ray against many triangles.

use crate::{
    contact::{Contact, compare_t, contact, plane_t},
    difficulty::View,
};
use niwaki_core::{Ray, Triangle, TriangleMesh, to_u32};
use rayon::prelude::*;
use std::cmp::Ordering;

/// The exact closest hit of a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Closest {
    /// Distance, rounded to the nearest `f64`.
    pub t: f64,
    /// All triangles hit at exactly this distance, in ascending order of id: several where the ray
    /// meets a shared edge or corner, or coincident geometry. Never empty.
    pub ties: Vec<(u32, Contact)>,
}

/// The closest of the candidates that a ray hits, by exact comparison; `None` if it hits none. An
/// id that is given twice is reported twice.
pub fn closest(
    ray: &Ray,
    candidates: impl IntoIterator<Item = (u32, Triangle)>,
) -> Option<Closest> {
    let mut nearest: Option<Triangle> = None;
    let mut ties = Vec::new();
    let mut last: Option<(Triangle, Contact)> = None;
    for (id, triangle) in candidates {
        // Equal triangles often stand side by side, and exact arithmetic takes its time.
        let again = last.filter(|(last, _)| *last == triangle);
        let contact = again.map_or_else(|| contact(ray, &triangle), |(_, contact)| contact);
        last = Some((triangle, contact));
        if !contact.is_hit() {
            continue;
        }
        if again.is_some() && nearest == Some(triangle) {
            ties.push((id, contact));
            continue;
        }
        match nearest.map_or(Ordering::Less, |nearest| compare_t(ray, &triangle, &nearest)) {
            Ordering::Less => {
                nearest = Some(triangle);
                ties.clear();
                ties.push((id, contact));
            }
            Ordering::Equal => ties.push((id, contact)),
            Ordering::Greater => {}
        }
    }
    ties.sort_by_key(|tie| tie.0);
    let t = plane_t(ray, &nearest?)?;
    Some(Closest { t, ties })
}

/// [`closest`] over all triangles of a mesh: a scan in parallel with a cheap filter in `f64`,
/// then exact tests of the few that are left. Takes time linear in the mesh.
#[must_use]
pub fn closest_in_mesh(ray: &Ray, mesh: &TriangleMesh) -> Option<Closest> {
    closest(ray, near_line(ray, mesh, 0.0).into_iter().map(|i| (i, mesh.triangle(i as usize))))
}

/// All triangles that the line of the ray hits or passes within `ulps` of the border
/// ([`crate::border_distance_ulps`]), and perhaps some more; in order.
pub(crate) fn near_line(ray: &Ray, mesh: &TriangleMesh, ulps: f64) -> Vec<u32> {
    let Some(view) = View::of(ray) else { return Vec::new() };
    (0..to_u32(mesh.len()))
        .into_par_iter()
        .with_min_len(1 << 14)
        .filter(|&i| view.may_come_near(&mesh.triangle(i as usize), ulps))
        .collect()
}
