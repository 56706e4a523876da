//! The edge volume heuristic (Dammertz and Keller 2008).

use crate::early::{check_positive, doublings};
use crate::partition::{check_max_extra, max_references};
use crate::pieces::{Emit, halve, memory_bound, within};
use crate::pre_split::{PreSplitter, check_count};
use niwaki_core::float::{round_down, round_up};
use niwaki_core::glam::{DVec3, Vec3};
use niwaki_core::{
    Aabb, BoxClip, BuildError, PrimRef, Triangle, TriangleMesh, scene_bounds, to_u32,
};

/// The edge volume heuristic (Dammertz and Keller 2008, "The Edge Volume Heuristic – Robust
/// Triangle Subdivision for Improved BVH Performance"): a triangle whose edges' boxes exceed a
/// volume is cut from the middle of the edge with the largest to the corner opposite, and so are
/// its parts. Triangles that share an edge cut it at the same points.
///
/// Edges along an axis plane have boxes without volume, so axis-aligned triangles stay whole, as
/// their boxes are tight already.
///
/// Of bare boxes the diagonal is taken for the only edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeVolume {
    /// The volume above which edges are cut, as a fraction of the scene's box: 2^−t in the paper.
    /// From 2⁻⁶⁰ up, finite.
    pub max_volume: f32,
    /// The most references that splitting adds, as a fraction of the input. If the threshold
    /// would add more, it is raised by factors of 2^(1/4) until it does not. Finite and not
    /// negative.
    pub max_extra: f32,
}

impl Default for EdgeVolume {
    /// The paper's t = 14, and at most as many references again as there were.
    fn default() -> Self {
        Self { max_volume: 2.0_f32.powi(-14), max_extra: 1.0 }
    }
}

impl EdgeVolume {
    fn check(&self) -> Result<(), BuildError> {
        check_positive("max_volume", self.max_volume)?;
        if self.max_volume < 2.0_f32.powi(-60) {
            return Err(BuildError::BadSetting {
                setting: "max_volume",
                value: self.max_volume.to_string(),
                remedy: "2⁻⁶⁰ or more of the scene's volume",
            });
        }
        check_max_extra(self.max_extra)
    }

    fn threshold(&self, scene: &Aabb) -> f64 {
        volume(scene.min.as_dvec3(), scene.max.as_dvec3()) * f64::from(self.max_volume)
    }
}

/// The volume of the box around two points.
fn volume(a: DVec3, b: DVec3) -> f64 {
    (a - b).abs().element_product()
}

/// Each bisection halves an edge; after so many, parts are no larger than rounding errors.
const MAX_DEPTH: u32 = 64;

/// Cuts a triangle until no edge's box has more than `threshold` volume.
fn bisect(triangle: &Triangle, id: u32, threshold: f64, emit: Emit<'_>) {
    let whole = triangle.bounds();
    let mut stack = vec![(triangle.vertices().map(Vec3::as_dvec3), 0)];
    while let Some((corners, depth)) = stack.pop() {
        let [a, b, c] = corners;
        let volumes = [volume(a, b), volume(b, c), volume(c, a)];
        let largest = (1..3).fold(0, |best, i| if volumes[i] > volumes[best] { i } else { best });
        if depth < MAX_DEPTH && volumes[largest] > threshold {
            let [p, q, opposite] = [0, 1, 2].map(|i| corners[(largest + i) % 3]);
            // The same for both triangles at this edge, as addition commutes.
            let middle = (p + q) * 0.5;
            stack.push(([middle, q, opposite], depth + 1));
            stack.push(([p, middle, opposite], depth + 1));
        } else if !emit(PrimRef::new(around(&corners, depth, &whole), id)) {
            return;
        }
    }
}

/// A box around a part of a triangle, whatever rounding did to its corners.
fn around(corners: &[DVec3; 3], depth: u32, whole: &Aabb) -> Aabb {
    // Each bisection rounds twice in f64, relative to coordinates no larger than the triangle's.
    let largest = whole.min.abs().max(whole.max.abs()).as_dvec3();
    let error = largest * (f64::EPSILON * 2.0 * f64::from(depth));
    let low = corners[0].min(corners[1]).min(corners[2]) - error;
    let high = corners[0].max(corners[1]).max(corners[2]) + error;
    Aabb::new(
        Vec3::new(round_down(low.x), round_down(low.y), round_down(low.z)),
        Vec3::new(round_up(high.x), round_up(high.y), round_up(high.z)),
    )
    .intersection(*whole)
}

impl PreSplitter for EdgeVolume {
    /// `evh`.
    fn suffix(&self) -> &'static str {
        "evh"
    }

    fn split_mesh(&self, mesh: &TriangleMesh) -> Result<Vec<PrimRef>, BuildError> {
        self.check()?;
        check_count(mesh.len())?;
        let (threshold, most) = (self.threshold(&mesh.bounds()), self.max_references(mesh.len()));
        let doublings = doublings(self.max_volume);
        Ok(within(mesh.len(), most, threshold, doublings, |i, threshold, emit| {
            bisect(&mesh.triangle(i), to_u32(i), threshold, emit);
        }))
    }

    fn split_boxes(&self, prims: &[PrimRef]) -> Result<Vec<PrimRef>, BuildError> {
        self.check()?;
        let scene = scene_bounds(prims)?.bounds;
        let (threshold, most) = (self.threshold(&scene), self.max_references(prims.len()));
        let doublings = doublings(self.max_volume);
        let measure = |b: &Aabb| volume(b.min.as_dvec3(), b.max.as_dvec3());
        Ok(within(prims.len(), most, threshold, doublings, |i, threshold, emit| {
            halve(prims[i], &BoxClip, threshold, measure, emit);
        }))
    }

    fn max_references(&self, count: usize) -> usize {
        max_references(count, self.max_extra)
    }

    fn memory_bound(&self, count: usize) -> usize {
        memory_bound(count, self.max_references(count))
    }
}
