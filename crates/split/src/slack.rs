//! Splitting of large boxes that hold little of their triangle.

use crate::early::check_positive;
use crate::partition::{check_max_extra, max_references};
use crate::pieces::{Emit, memory_bound, within};
use crate::pre_split::{PreSplitter, check_count};
use niwaki_core::{Aabb, BoxClip, BuildError, Clip, PrimRef, TriangleMesh, scene_bounds};
use rayon::prelude::*;

/// Splits a large reference where its parts have far smaller boxes: those of both together have at
/// most [`SlackSplit::max_ratio`] of the surface area of the whole, or
/// [`SlackSplit::max_ratio_largest`] for the largest. Parts are split on by the same rule.
///
/// A split adds a node to the tree, so what it saves must be a fair share of the box. A long
/// triangle across all three axes is cut, at 1/2; a wall in the plane of two axes, at 3/4 or more,
/// is not, and stays high up in the tree, where rays find it early. Sizes are relative to the mean
/// box, so that evenly tessellated scenes stay as they are.
///
/// The rule is that of the pre-splitting in obvhs, here with a bound on the references and on all
/// threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlackSplit {
    /// The most that the areas of two parts may have of the area of the whole: above 0, at most 1.
    /// 1/1.6 by default.
    pub max_ratio: f32,
    /// The same for boxes with more area than nine tenths of the mean and one tenth of the largest:
    /// 1/1.8 by default. They stand at the top of the tree, where another node costs most.
    pub max_ratio_largest: f32,
    /// Boxes of at most this surface area, in mean areas of all boxes, stay whole. Finite and
    /// positive; 3 by default.
    pub min_area: f32,
    /// Planes that are compared, evenly along the longest edge of the box; at least 1. 11 by
    /// default.
    pub planes: u32,
    /// The most references that splitting adds, as a fraction of the input. If the rule would add
    /// more, the least area is raised by factors of 2^(1/4) until it does not. Finite and not
    /// negative; 0.3 by default, of which most scenes use less than a sixth.
    pub max_extra: f32,
}

impl Default for SlackSplit {
    fn default() -> Self {
        Self {
            max_ratio: 1.0 / 1.6,
            max_ratio_largest: 1.0 / 1.8,
            min_area: 3.0,
            planes: 11,
            max_extra: 0.3,
        }
    }
}

/// References of one partial sum.
const CHUNK: usize = 4096;

impl SlackSplit {
    fn check(&self) -> Result<(), BuildError> {
        for (setting, ratio) in
            [("max_ratio", self.max_ratio), ("max_ratio_largest", self.max_ratio_largest)]
        {
            if !(ratio > 0.0 && ratio <= 1.0) {
                return Err(BuildError::BadSetting {
                    setting,
                    value: ratio.to_string(),
                    remedy: "above 0 and at most 1",
                });
            }
        }
        if self.planes == 0 {
            return Err(BuildError::BadSetting {
                setting: "planes",
                value: "0".to_owned(),
                remedy: "at least 1",
            });
        }
        check_positive("min_area", self.min_area)?;
        check_max_extra(self.max_extra)
    }

    fn split<C: Clip>(&self, prims: &[PrimRef], clip: &C) -> Result<Vec<PrimRef>, BuildError> {
        check_count(prims.len())?;
        // Chunks are summed in order, so that the number of threads does not show.
        let chunks: Vec<(f64, f64)> = prims
            .par_chunks(CHUNK)
            .map(|chunk| {
                let areas = chunk.iter().map(|prim| prim.aabb().area());
                areas.fold((0.0, 0.0), |(sum, largest), area| (sum + area, area.max(largest)))
            })
            .collect();
        let (sum, largest) = chunks.iter().fold((0.0, 0.0_f64), |a, b| (a.0 + b.0, a.1.max(b.1)));
        let mean = sum / prims.len().max(1) as f64;
        let threshold = mean * f64::from(self.min_area);
        let large = 0.9 * mean + 0.1 * largest;
        if largest <= threshold || threshold <= 0.0 {
            return Ok(prims.to_vec());
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the ratio is above 1; its logarithm in f64 below 2200"
        )]
        let doublings = (largest / threshold).log2().ceil() as u32 + 1;
        let most = self.max_references(prims.len());
        Ok(within(prims.len(), most, threshold, doublings, |i, threshold, emit| {
            self.cut(prims[i], [threshold, large], clip, emit);
        }))
    }

    /// The parts of a reference, given the areas above which boxes are split at all, and above which
    /// they are among the largest.
    fn cut<C: Clip>(&self, prim: PrimRef, areas: [f64; 2], clip: &C, emit: Emit<'_>) {
        let [threshold, large] = areas;
        if prim.aabb().area() <= threshold {
            emit(prim);
            return;
        }
        let mut stack = vec![prim];
        while let Some(prim) = stack.pop() {
            let area = prim.aabb().area();
            let ratio = if area > large { self.max_ratio_largest } else { self.max_ratio };
            let least = area * f64::from(ratio);
            match if area > threshold { self.parts(&prim, least, clip) } else { None } {
                Some([a, b]) => stack.extend([b, a]),
                None => {
                    if !emit(prim) {
                        return;
                    }
                }
            }
        }
    }

    /// The two parts of least area together, if that is at most `least`.
    fn parts<C: Clip>(&self, prim: &PrimRef, mut least: f64, clip: &C) -> Option<[PrimRef; 2]> {
        let aabb = prim.aabb();
        let axis = aabb.longest_axis();
        let (min, max) = (aabb.min[axis], aabb.max[axis]);
        let mut best = None;
        for plane in 1..=self.planes {
            let share = plane as f32 / (self.planes + 1) as f32;
            let position = min * (1.0 - share) + max * share;
            // Boxes as thin as a rounding error have no inside.
            if !(min < position && position < max) {
                continue;
            }
            let parts = clip.clip(prim, axis, position);
            let area = parts[0].area() + parts[1].area();
            if area <= least && !parts.iter().any(Aabb::is_empty) {
                least = area;
                best = Some(parts);
            }
        }
        best.map(|parts| parts.map(|part| PrimRef { min: part.min, max: part.max, ..*prim }))
    }
}

impl PreSplitter for SlackSplit {
    /// `slack`.
    fn suffix(&self) -> &'static str {
        "slack"
    }

    fn split_mesh(&self, mesh: &TriangleMesh) -> Result<Vec<PrimRef>, BuildError> {
        self.check()?;
        self.split(&mesh.prim_refs(), mesh)
    }

    /// The parts of a full box have together no less area than the whole, so that boxes stay as
    /// they are for every [`SlackSplit::max_ratio`] below 1.
    fn split_boxes(&self, prims: &[PrimRef]) -> Result<Vec<PrimRef>, BuildError> {
        self.check()?;
        scene_bounds(prims)?;
        self.split(prims, &BoxClip)
    }

    fn max_references(&self, count: usize) -> usize {
        max_references(count, self.max_extra)
    }

    fn memory_bound(&self, count: usize) -> usize {
        memory_bound(count, self.max_references(count))
    }
}
