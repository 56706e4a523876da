//! Who is right when two kernels disagree.

use crate::{
    closest::near_line,
    contact::{Contact, contact, contact_of_line, forward, is_flat, is_sound, plane_t},
    difficulty::{Anchor, border_distance_ulps, t_error_bound},
};
use niwaki_core::{Hit, Ray, Triangle, TriangleMesh, glam::Vec3};
use rayon::prelude::*;

/// What became of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Verdict {
    /// Both report the same primitive, at distances that are equal up to rounding; or both miss.
    Agree,
    /// Different primitives at distances that are equal or that `f32` cannot put in order: a
    /// shared edge, coincident geometry.
    Tie,
    /// One lost or gained a hit, and the exact ray passes within a few ulp of that triangle's
    /// border, lies in its plane, or has the hit at the end of its range. Never acceptable where
    /// it opens a closed surface: a watertight kernel has to be tested for that by itself.
    Rounding,
    /// The peer's claim is false: what it reports is no hit, or it missed one that no rounding
    /// excuses.
    PeerWrong,
    /// Our claim is false, whatever the peer says.
    OursWrong,
}

impl Verdict {
    /// All, best first.
    pub const ALL: [Self; 5] =
        [Self::Agree, Self::Tie, Self::Rounding, Self::PeerWrong, Self::OursWrong];
}

/// One of the two whose answers are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    /// Ours.
    Ours,
    /// The peer.
    Theirs,
}

impl Side {
    /// The side that alone is contradicted; `None` for both or neither.
    const fn alone([ours, theirs]: [bool; 2]) -> Option<Self> {
        match (ours, theirs) {
            (true, false) => Some(Self::Ours),
            (false, true) => Some(Self::Theirs),
            _ => None,
        }
    }
}

/// The name in reports: `agree`, `tie`, `rounding`, `peer wrong`, `ours wrong`.
impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Agree => "agree",
            Self::Tie => "tie",
            Self::Rounding => "rounding",
            Self::PeerWrong => "peer wrong",
            Self::OursWrong => "ours wrong",
        })
    }
}

/// Where [`settle`] draws the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettleOptions {
    /// A hit or miss within this many ulp of a triangle's border
    /// ([`border_distance_ulps`]) counts as rounding. Default 8: translating, shearing and the
    /// edge functions of a kernel, and the slabs of the boxes on the way, round a handful of
    /// times.
    pub border_ulps: f64,
    /// Where distances are measured from, which says how exact they can be ([`t_error_bound`]).
    pub anchor: Anchor,
    /// Search the whole mesh for a nearer hit that both missed, before the peer is found wrong or
    /// rounding is accepted. Default true; costs a scan of the mesh.
    pub scan: bool,
}

impl Default for SettleOptions {
    fn default() -> Self {
        Self { border_ulps: 8.0, anchor: Anchor::Best, scan: true }
    }
}

/// What exact arithmetic says about one kernel's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Claim {
    /// It reports no hit.
    Miss,
    /// It reports a primitive that does not exist.
    NoSuchPrimitive {
        /// The reported id.
        prim_id: u32,
    },
    /// It reports a hit, but the ray misses the triangle by more than rounding explains.
    FalseHit {
        /// The reported id.
        prim_id: u32,
        /// How far the line is from the triangle's border.
        border_ulps: f64,
    },
    /// It reports a triangle that the ray hits or nearly hits, but not where it is.
    FalseDistance {
        /// The reported id.
        prim_id: u32,
        /// The reported distance.
        reported: f32,
        /// The true one.
        exact: f64,
        /// How far the two may differ.
        bound: f64,
    },
    /// It reports a triangle that the ray hits, or misses by no more than rounding.
    Hit {
        /// The reported id.
        prim_id: u32,
        /// What is true.
        contact: Contact,
        /// The true distance to the triangle's plane; the reported one if the ray lies in it.
        t: f64,
        /// How far an `f32` kernel's distance may be from that.
        t_error: f64,
        /// How far the line is from the triangle's border.
        border_ulps: f64,
        /// True if rounding is no excuse for missing it: the ray pierces the inside, away from
        /// the border and from the ends of its range.
        certain: bool,
    },
}

impl Claim {
    const fn is_false(&self) -> bool {
        matches!(
            self,
            Self::NoSuchPrimitive { .. } | Self::FalseHit { .. } | Self::FalseDistance { .. }
        )
    }
}

/// A verdict with its reasons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settlement {
    /// The verdict.
    pub verdict: Verdict,
    /// What our answer is worth.
    pub ours: Claim,
    /// What the peer's answer is worth.
    pub theirs: Claim,
    /// A hit that rounding cannot excuse missing, nearer than our answer, found by the scan.
    pub missed: Option<Claim>,
    /// Of [`Verdict::Rounding`]: the side whose answer exact arithmetic contradicts. It reports a
    /// triangle that the ray misses exactly ([`Contact::Miss`]), or none where the ray hits one
    /// (closed triangle, closed range: a hit at an end of the range counts), or one that lies
    /// behind another by more than the error bounds of both. `None` if that holds for both sides,
    /// and for all other verdicts. Without [`SettleOptions::scan`], only the reported triangles
    /// are considered.
    pub rounding_side: Option<Side>,
}

/// A verdict on two any-hit kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AnySettlement {
    /// The verdict.
    pub verdict: Verdict,
    /// Of [`Verdict::Rounding`]: the side whose answer exact arithmetic contradicts, which is the
    /// one without a hit if any triangle is hit exactly (closed triangle, closed range), and the
    /// one with a hit otherwise. `None` for all other verdicts.
    pub rounding_side: Option<Side>,
}

impl AnySettlement {
    const fn clear(verdict: Verdict) -> Self {
        Self { verdict, rounding_side: None }
    }
}

/// [`settle_with`] the default options, verdict only.
#[must_use]
pub fn settle(ray: &Ray, mesh: &TriangleMesh, ours: &Hit, theirs: &Hit) -> Verdict {
    settle_with(ray, mesh, ours, theirs, &SettleOptions::default()).verdict
}

/// Settles what two closest-hit kernels report for a ray.
///
/// Each reported hit is tested exactly: it is *false* if the ray misses the triangle by more than
/// [`SettleOptions::border_ulps`] or if its `t` is further from the truth than
/// [`t_error_bound`], or if the triangle has no area, exactly; one that closes a seam, so that each
/// of its edges is an edge of another triangle with another third corner, counts as its own border,
/// as rounding may give it an area. A hit is *certain* if the ray pierces the triangle's inside, further than that
/// from its border and, by more than the error of `t`, from the ends of the range and of `f32`. Then:
///
/// | case | verdict |
/// |---|---|
/// | both miss, or the same primitive at true distances | agree |
/// | a claim is false | that side is wrong; ours if both |
/// | one misses what the other hits | certain: the one is wrong; otherwise rounding |
/// | different primitives, one certain and, with its bound, before the *reported* distance of the other | the other side is wrong |
/// | different primitives otherwise, distances apart by no more than both bounds | tie |
/// | different primitives otherwise | rounding |
///
/// The reported distance is what a kernel compares others with, so the error bound of the farther
/// triangle, which may be large at a grazing angle, does not excuse the loss of a nearer one.
///
/// Where this would find the peer wrong or excuse rounding, the whole mesh is searched
/// ([`SettleOptions::scan`]), and ours is wrong after all if a certain hit lies nearer than what
/// we report. Agreement and ties are not searched: a fault that both share takes a comparison
/// with [`crate::closest_in_mesh`].
#[must_use]
pub fn settle_with(
    ray: &Ray,
    mesh: &TriangleMesh,
    ours: &Hit,
    theirs: &Hit,
    options: &SettleOptions,
) -> Settlement {
    let claims = [ours, theirs].map(|hit| examine(ray, mesh, hit, options));
    let verdict = weigh(claims, [ours, theirs]);
    let mut settlement = Settlement {
        verdict,
        ours: claims[0],
        theirs: claims[1],
        missed: None,
        rounding_side: None,
    };
    let mut candidates = claims.to_vec();
    if options.scan && matches!(verdict, Verdict::PeerWrong | Verdict::Rounding) {
        candidates.extend(near_line(ray, mesh, 0.0).into_iter().map(|i| {
            examine_triangle(ray, i, &mesh.triangle(i as usize), None, Some(mesh), options)
        }));
        settlement.missed = candidates.iter().copied().find(|c| surely_before(c, ours));
        if settlement.missed.is_some() {
            settlement.verdict = Verdict::OursWrong;
        }
    }
    if settlement.verdict == Verdict::Rounding {
        settlement.rounding_side =
            Side::alone(claims.map(|claim| contradicted(&claim, &candidates)));
    }
    settlement
}

/// [`settle_any_with`] the default options, verdict only.
#[must_use]
pub fn settle_any(ray: &Ray, mesh: &TriangleMesh, ours: bool, theirs: bool) -> Verdict {
    settle_any_with(ray, mesh, ours, theirs, &SettleOptions::default()).verdict
}

/// Settles what two any-hit kernels report for a ray: [`settle_any_among`] all triangles of the
/// mesh. The mesh is scanned whenever the answers differ, whatever [`SettleOptions::scan`] says.
#[must_use]
pub fn settle_any_with(
    ray: &Ray,
    mesh: &TriangleMesh,
    ours: bool,
    theirs: bool,
    options: &SettleOptions,
) -> AnySettlement {
    if ours == theirs {
        return AnySettlement::clear(Verdict::Agree);
    }
    let candidates = near_line(ray, mesh, options.border_ulps);
    let candidates = candidates.into_iter().map(|i| (i, mesh.triangle(i as usize)));
    any_among(ray, candidates, ours, theirs, Some(mesh), options)
}

/// Settles what two any-hit kernels report for a ray, among candidates that must include every
/// triangle that the ray hits or passes within [`SettleOptions::border_ulps`].
///
/// If one of them is a certain hit (see [`settle_with`]), who reports none is wrong; if rounding
/// could make a hit of one, rounding; if not even that, who reports a hit is wrong. A triangle without
/// area is no hit, for nothing is known here of seams that it might close.
pub fn settle_any_among(
    ray: &Ray,
    candidates: impl IntoIterator<Item = (u32, Triangle)>,
    ours: bool,
    theirs: bool,
    options: &SettleOptions,
) -> Verdict {
    any_among(ray, candidates, ours, theirs, None, options).verdict
}

fn any_among(
    ray: &Ray,
    candidates: impl IntoIterator<Item = (u32, Triangle)>,
    ours: bool,
    theirs: bool,
    mesh: Option<&TriangleMesh>,
    options: &SettleOptions,
) -> AnySettlement {
    if ours == theirs {
        return AnySettlement::clear(Verdict::Agree);
    }
    let (mut possible, mut exact) = (false, false);
    for (id, triangle) in candidates {
        if let Claim::Hit { certain, contact, .. } =
            examine_triangle(ray, id, &triangle, None, mesh, options)
        {
            possible = true;
            exact |= contact.is_hit();
            if certain {
                let verdict = if ours { Verdict::PeerWrong } else { Verdict::OursWrong };
                return AnySettlement::clear(verdict);
            }
        }
    }
    if possible {
        let rounding_side = Side::alone([ours != exact, theirs != exact]);
        AnySettlement { verdict: Verdict::Rounding, rounding_side }
    } else {
        AnySettlement::clear(if ours { Verdict::OursWrong } else { Verdict::PeerWrong })
    }
}

fn weigh([ours, theirs]: [Claim; 2], [our_hit, their_hit]: [&Hit; 2]) -> Verdict {
    if ours.is_false() {
        return Verdict::OursWrong;
    }
    if theirs.is_false() {
        return Verdict::PeerWrong;
    }
    match (ours, theirs) {
        (Claim::Hit { certain, .. }, Claim::Miss) => {
            if certain {
                Verdict::PeerWrong
            } else {
                Verdict::Rounding
            }
        }
        (Claim::Miss, Claim::Hit { certain, .. }) => {
            if certain {
                Verdict::OursWrong
            } else {
                Verdict::Rounding
            }
        }
        (
            Claim::Hit { t: our_t, t_error: our_error, .. },
            Claim::Hit { t: their_t, t_error: their_error, .. },
        ) => {
            if our_hit.prim_id == their_hit.prim_id {
                Verdict::Agree
            } else if surely_before(&theirs, our_hit) {
                // At most one of these holds, as each reported distance is within its bound.
                Verdict::OursWrong
            } else if surely_before(&ours, their_hit) {
                Verdict::PeerWrong
            } else if (our_t - their_t).abs() <= our_error + their_error {
                Verdict::Tie
            } else {
                // Apart, and the nearer one is not certain, or this would be settled by now.
                Verdict::Rounding
            }
        }
        _ => Verdict::Agree,
    }
}

fn examine(ray: &Ray, mesh: &TriangleMesh, hit: &Hit, options: &SettleOptions) -> Claim {
    if !hit.is_hit() {
        return Claim::Miss;
    }
    let prim_id = hit.prim_id;
    if prim_id as usize >= mesh.len() {
        return Claim::NoSuchPrimitive { prim_id };
    }
    let triangle = mesh.triangle(prim_id as usize);
    examine_triangle(ray, prim_id, &triangle, Some(hit.t), Some(mesh), options)
}

fn examine_triangle(
    ray: &Ray,
    prim_id: u32,
    triangle: &Triangle,
    reported: Option<f32>,
    mesh: Option<&TriangleMesh>,
    options: &SettleOptions,
) -> Claim {
    let ray = &forward(ray);
    let contact = contact(ray, triangle);
    let border_ulps = border_distance_ulps(ray, triangle);
    let false_hit = Claim::FalseHit { prim_id, border_ulps };
    let near_border = border_ulps <= options.border_ulps;
    if !is_sound(ray) || ray.t_min > ray.t_max {
        return false_hit;
    }
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    let Some(t) = plane_t(ray, triangle) else {
        // In the plane, or without area, where rounding may give it one (kernels keep such
        // triangles where they close seams): within a trace of the border if at all, at any distance
        // along it.
        return if near_border
            && (!is_flat(triangle) || mesh.is_some_and(|mesh| closes_seam(triangle, mesh)))
            && let Some(span) = span_in_plane(ray, triangle, reported)
        {
            Claim::Hit { prim_id, contact, t: span.0, t_error: span.1, border_ulps, certain: false }
        } else {
            false_hit
        };
    };
    let t_error = t_error_bound(ray, triangle, options.anchor);
    let in_range = t_min - t_error <= t && t <= t_max + t_error;
    if !(in_range && (near_border || crosses_inside(ray, triangle))) {
        return false_hit;
    }
    if let Some(reported) = reported
        && (reported.is_nan() || (f64::from(reported) - t).abs() > t_error)
    {
        return Claim::FalseDistance { prim_id, reported, exact: t, bound: t_error };
    }
    let certain = contact == Contact::Interior
        && !near_border
        && t_min + t_error <= t
        // No f32 says a distance past the largest.
        && t <= t_max.min(f64::from(f32::MAX)) - t_error;
    Claim::Hit { prim_id, contact, t, t_error, border_ulps, certain }
}

/// True if each edge of a triangle is an edge of another with another third corner, by position.
fn closes_seam(triangle: &Triangle, mesh: &TriangleMesh) -> bool {
    let is_distinct = |[a, b, c]: [Vec3; 3]| a != b && b != c && c != a;
    let corners = triangle.vertices();
    let shared = |i: usize| {
        let (p, q, third) = (corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]);
        (0..mesh.len()).into_par_iter().with_min_len(1 << 14).any(|other| {
            let other = mesh.triangle(other).vertices();
            is_distinct(other)
                && other.contains(&p)
                && other.contains(&q)
                && !other.contains(&third)
        })
    };
    is_distinct(corners) && (0..3).all(shared)
}

/// True if the line of the ray hits the triangle at whatever distance.
fn crosses_inside(ray: &Ray, triangle: &Triangle) -> bool {
    contact_of_line(&ray.with_range(f32::NEG_INFINITY, f32::INFINITY), triangle).is_hit()
}

/// For a ray in the plane of a triangle: the middle of the distances at which it may be next to
/// it, and half their extent; `None` if they are out of range or do not include the reported one.
fn span_in_plane(ray: &Ray, triangle: &Triangle, reported: Option<f32>) -> Option<(f64, f64)> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let along = triangle
        .vertices()
        .map(|v| (v.as_dvec3() - origin).dot(direction) / direction.length_squared());
    let low = along.into_iter().fold(f64::INFINITY, f64::min);
    let high = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let margin = (high - low + low.abs().max(high.abs())) * 1e-6;
    let (low, high) = (low - margin, high + margin);
    let in_range = low <= f64::from(ray.t_max) && high >= f64::from(ray.t_min);
    let reported = reported.is_none_or(|t| low <= f64::from(t) && f64::from(t) <= high);
    (in_range && reported).then_some(((low + high) * 0.5, (high - low) * 0.5))
}

/// True if a kernel that reports `answer` lost the claimed hit: it is certain, and whatever its
/// rounding, its distance would have been less than the one that the kernel kept.
fn surely_before(claim: &Claim, answer: &Hit) -> bool {
    let limit = if answer.is_hit() { f64::from(answer.t) } else { f64::INFINITY };
    matches!(*claim, Claim::Hit { certain: true, t, t_error, .. } if t + t_error < limit)
}

/// True if exact arithmetic contradicts a claim: see [`Settlement::rounding_side`].
fn contradicted(claim: &Claim, candidates: &[Claim]) -> bool {
    let limit = match *claim {
        Claim::Miss => f64::INFINITY,
        Claim::Hit { contact, t, t_error, .. } if contact.is_hit() => t - t_error,
        _ => return true,
    };
    candidates.iter().any(|other| {
        matches!(*other, Claim::Hit { contact, t, t_error, .. }
            if contact.is_hit() && (limit == f64::INFINITY || t + t_error < limit))
    })
}
