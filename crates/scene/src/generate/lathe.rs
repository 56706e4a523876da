//! Bodies turned on a lathe.

use super::{
    math::{circle, whole},
    piece::{Patch, capped},
};
use glam::{DVec2, DVec3};

/// A profile as radius, height and roundness. Roundness 0 draws the curve towards a point without
/// reaching it; above, the point is an edge, rounded off at this distance.
pub(super) type Point = (f64, f64, f64);

/// Half a ball of radius `radius` around the height `center` on the axis, as points of a profile,
/// from `from` (turns from the lower pole) to the upper pole, with the pole.
pub(super) fn ball(center: f64, radius: f64, from: f64) -> Vec<Point> {
    // A polygon around the circle; the curve touches the middle of its sides.
    let steps = whole(((0.5 - from) * 12.0).ceil()).max(2);
    let step = (0.5 - from) / steps as f64;
    let (_, inside) = super::math::sin_cos_turns(0.5 * step);
    let mut out: Vec<Point> = (0..steps)
        .map(|k| {
            let (sin, cos) = super::math::sin_cos_turns(from + (k as f64 + 0.5) * step);
            (radius / inside * sin, center - radius / inside * cos, 0.0)
        })
        .collect();
    out.push((0.0, center + radius, 0.0));
    out
}

/// A profile from the axis outward, up, and back to the axis: the outline of half a section, with
/// the body on its left. A vessel goes up outside, over the rim and down inside.
#[derive(Clone)]
pub(super) struct Profile {
    /// Of a uniform quadratic B-spline that begins and ends in its first and last point.
    controls: Vec<DVec2>,
    /// Parameters of equal spacing, by length and by bend alike.
    spacing: Vec<f64>,
}

/// Samples a control point for measuring the curve.
const FINE: usize = 12;

impl Profile {
    /// From points; the first and the last lie on the axis.
    pub(super) fn new(points: &[Point]) -> Self {
        let at = |i: usize| DVec2::new(points[i].0, points[i].1);
        let mut controls = Vec::with_capacity(3 * points.len());
        for (i, &(_, _, round)) in points.iter().enumerate() {
            let here = at(i);
            if round > 0.0 && i > 0 && i + 1 < points.len() {
                let toward = |other: DVec2| {
                    let way = other - here;
                    here + way * (round / way.length()).min(0.5)
                };
                controls.extend([toward(at(i - 1)), here, toward(at(i + 1))]);
            } else {
                controls.push(here);
            }
        }
        let mut profile = Self { controls, spacing: Vec::new() };
        profile.measure();
        profile
    }

    /// Finds the parameters up to which equal shares of length and bend lie.
    fn measure(&mut self) {
        let n = FINE * self.controls.len();
        let end = self.controls.len() as f64;
        let points: Vec<DVec2> = (0..=n).map(|i| self.curve(end * i as f64 / n as f64)).collect();
        let lengths: Vec<f64> = points.windows(2).map(|w| w[0].distance(w[1])).collect();
        let tangent = |i: usize| (points[i + 1] - points[i]).normalize_or_zero();
        let bend = |i: usize| if i == 0 { 0.0 } else { tangent(i - 1).distance(tangent(i)) };
        let bends: Vec<f64> = (0..n).map(bend).collect();
        let (length, turn): (f64, f64) = (lengths.iter().sum(), bends.iter().sum());
        let mut sum = 0.0;
        self.spacing = vec![0.0];
        for i in 0..n {
            let bend = bends[i] + bends.get(i + 1).copied().unwrap_or(0.0);
            sum += lengths[i] / length + 0.5 * bend / turn.max(1e-9);
            self.spacing.push(sum);
        }
    }

    /// The B-spline at a parameter from 0 to the number of controls.
    fn curve(&self, t: f64) -> DVec2 {
        let last = self.controls.len() - 1;
        // Each control has a unit of the parameter, from the middle before it to that after it.
        let i = whole(t).min(last);
        let s = t - i as f64;
        let c = self.controls[i];
        let before = if i == 0 { c } else { self.controls[i - 1].midpoint(c) };
        let after = if i == last { c } else { self.controls[i + 1].midpoint(c) };
        before * ((1.0 - s) * (1.0 - s)) + c * (2.0 * s * (1.0 - s)) + after * (s * s)
    }

    /// Radius and height after a share of the way, 0 to 1.
    pub(super) fn at(&self, share: f64) -> DVec2 {
        let last = self.spacing.len() - 1;
        let sum = share.clamp(0.0, 1.0) * self.spacing[last];
        let i = self.spacing.partition_point(|&s| s <= sum).clamp(1, last);
        let (a, b) = (self.spacing[i - 1], self.spacing[i]);
        let t = if b > a { ((sum - a) / (b - a)).min(1.0) } else { 0.0 };
        self.curve((i as f64 - 1.0 + t) / FINE as f64)
    }

    /// The closed body: `nu` sides, `nv` steps along the profile; `shape` places a point of the
    /// profile at `u` turns around, where turning alone is [`turned`].
    pub(super) fn lathe(
        &self,
        [nu, nv]: [usize; 2],
        shape: &(impl Fn(DVec2, f64) -> DVec3 + Sync),
    ) -> Patch {
        capped([nu, nv], &|u, v| shape(self.at(v), u))
    }
}

/// A point of a profile, `u` turns around the Y axis.
pub(super) fn turned(p: DVec2, u: f64) -> DVec3 {
    circle(-u) * p.x.max(0.0) + DVec3::Y * p.y
}
