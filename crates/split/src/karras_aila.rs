//! The triangle splitting of Karras and Aila 2013.

use crate::partition::{check_max_extra, max_references};
use crate::pieces::{Emit, memory_bound, number, write};
use crate::pre_split::{PreSplitter, check_count};
use niwaki_core::{Aabb, BoxClip, BuildError, Clip, PrimRef, TriangleMesh, scene_bounds};
use rayon::prelude::*;

/// Splitting by priority within a budget (Karras and Aila 2013, "Fast Parallel Construction of
/// High-Quality Bounding Volume Hierarchies", section 4): every triangle gets a share of the budget
/// that follows its priority, and is cut at the most important spatial median planes of the scene
/// that its box crosses.
///
/// The priority is the cube root of 2^i·(`A_aabb` − `A_ideal`): `A_ideal` is what is left of the
/// surface area of the box after infinitely many splits, and i ≤ 0 the level of the most important
/// plane, so that planes which the tree will split at first count most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KarrasAila {
    /// The budget: the most references that splitting adds, as a fraction of the input. Finite and
    /// not negative.
    pub max_extra: f32,
}

impl Default for KarrasAila {
    /// A budget of 0.3, which the paper recommends.
    fn default() -> Self {
        Self { max_extra: 0.3 }
    }
}

/// Rounds of bisection for the factor between priority and number of splits. The paper's 6 do where
/// its first guess of an upper bound is near, but not where most priorities round down to no split.
const ROUNDS: u32 = 24;

/// Bits of a position along an axis of the scene.
const BITS: u32 = 32;

/// The spatial median planes of a scene: the one in the middle of an axis has level 1, those in the
/// middle of its halves level 2, and so on.
struct Planes {
    scene: Aabb,
}

/// A plane that crosses a box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Median {
    level: u32,
    axis: usize,
    position: f32,
}

impl Planes {
    /// The most important plane that crosses the inside of a box along one axis.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positions are in the scene, so from 0 to 2^32; the plane is checked in f32"
    )]
    fn along(&self, aabb: &Aabb, axis: usize) -> Option<Median> {
        let start = f64::from(self.scene.min[axis]);
        let extent = f64::from(self.scene.max[axis]) - start;
        let (min, max) = (aabb.min[axis], aabb.max[axis]);
        if extent <= 0.0 || min >= max {
            return None;
        }
        let scale = f64::from(BITS).exp2();
        let place = |x: f32| (f64::from(x) - start) / extent * scale;
        // The cells of both ends: a plane between them crosses the box.
        let first = place(min).floor().max(0.0) as u64;
        let last = (place(max).ceil() - 1.0).max(0.0) as u64;
        if first >= last {
            return None;
        }
        let level = BITS - (first ^ last).ilog2();
        let shift = BITS - level;
        let position = (start + (last >> shift << shift) as f64 / scale * extent) as f32;
        (min < position && position < max).then_some(Median { level, axis, position })
    }

    /// The most important plane that crosses a box: the smallest level, then the longest edge.
    fn across(&self, aabb: &Aabb) -> Option<Median> {
        let extent = aabb.extent();
        (0..3).filter_map(|axis| self.along(aabb, axis)).reduce(|best, other| {
            let better = other.level < best.level
                || (other.level == best.level && extent[other.axis] > extent[best.axis]);
            if better { other } else { best }
        })
    }

    /// The priority of a box in which a primitive has the given ideal area.
    fn priority(&self, aabb: &Aabb, ideal: f64) -> f64 {
        let Some(plane) = self.across(aabb) else { return 0.0 };
        let area = (aabb.area() - ideal).max(0.0);
        (area * (-f64::from(plane.level)).exp2()).cbrt()
    }

    /// Cuts a reference `splits` times.
    fn cut<C: Clip>(&self, prim: PrimRef, splits: u64, clip: &C, emit: Emit<'_>) {
        let mut stack = vec![(prim, splits)];
        while let Some((prim, splits)) = stack.pop() {
            let plane = if splits > 0 { self.across(&prim.aabb()) } else { None };
            let parts = plane
                .map_or([Aabb::EMPTY; 2], |plane| clip.clip(&prim, plane.axis, plane.position));
            let piece = |part: &Aabb| PrimRef { min: part.min, max: part.max, ..prim };
            match parts.each_ref().map(|part| !part.is_empty()) {
                [true, true] => {
                    // What is left goes to both in proportion to their longest edges.
                    let [a, b] = parts.each_ref().map(|p| f64::from(p.extent().max_element()));
                    let rest = splits - 1;
                    let share = if a + b > 0.0 { a / (a + b) } else { 0.5 };
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "at most `rest`"
                    )]
                    let first = ((rest as f64 * share + 0.5).floor() as u64).min(rest);
                    stack.push((piece(&parts[1]), rest - first));
                    stack.push((piece(&parts[0]), first));
                }
                [true, false] => stack.push((piece(&parts[0]), splits - 1)),
                [false, true] => stack.push((piece(&parts[1]), splits - 1)),
                [false, false] => {
                    if !emit(prim) {
                        return;
                    }
                }
            }
        }
    }
}

/// How many splits each primitive gets, given its priority and a factor.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative; the sum is compared with the budget before it is used"
)]
fn splits(priority: f64, factor: f64) -> u64 {
    (priority * factor) as u64
}

/// The largest factor found whose splits do not exceed the budget (section 4.3).
fn factor(priorities: &[f64], budget: u64) -> f64 {
    // Chunks are summed in order, so that the number of threads does not show.
    let chunks: Vec<f64> = priorities.par_chunks(4096).map(|chunk| chunk.iter().sum()).collect();
    let sum: f64 = chunks.iter().sum();
    if sum <= 0.0 || budget == 0 {
        return 0.0;
    }
    let spent = |factor: f64| -> u64 {
        priorities
            .par_iter()
            .with_min_len(4096)
            .map(|&p| splits(p, factor))
            .reduce(|| 0, u64::saturating_add)
    };
    let mut low = budget as f64 / sum;
    while spent(low) > budget {
        // Rounding of the sum, at most.
        low *= 0.999;
    }
    let mut high = low * 2.0;
    while spent(high) <= budget {
        (low, high) = (high, high * 2.0);
    }
    for _ in 0..ROUNDS {
        let middle = (low + high) * 0.5;
        if spent(middle) <= budget { low = middle } else { high = middle }
    }
    low
}

impl KarrasAila {
    fn split<C: Clip>(
        &self,
        scene: Aabb,
        prims: &[PrimRef],
        ideal: impl Fn(usize) -> f64 + Sync,
        clip: &C,
    ) -> Result<Vec<PrimRef>, BuildError> {
        check_count(prims.len())?;
        let planes = Planes { scene };
        let priorities: Vec<f64> = prims
            .par_iter()
            .enumerate()
            .with_min_len(1024)
            .map(|(i, prim)| planes.priority(&prim.aabb(), ideal(i)))
            .collect();
        let most = self.max_references(prims.len());
        let factor = factor(&priorities, (most - prims.len()) as u64);
        let visit = |i: usize, emit: Emit<'_>| {
            planes.cut(prims[i], splits(priorities[i], factor), clip, emit);
        };
        // Splits are within the budget, so there is nothing to stop for.
        let numbers = number(prims.len(), usize::MAX, visit).unwrap_or_default();
        Ok(write(&numbers, visit))
    }
}

impl PreSplitter for KarrasAila {
    /// `ka`.
    fn suffix(&self) -> &'static str {
        "ka"
    }

    fn split_mesh(&self, mesh: &TriangleMesh) -> Result<Vec<PrimRef>, BuildError> {
        check_max_extra(self.max_extra)?;
        let ideal = |i: usize| {
            let [a, b, c] = mesh.triangle(i).vertices().map(|v| v.as_dvec3());
            (b - a).cross(c - a).abs().element_sum()
        };
        self.split(mesh.bounds(), &mesh.prim_refs(), ideal, mesh)
    }

    /// Nothing is known of the ideal area, which counts as 0.
    fn split_boxes(&self, prims: &[PrimRef]) -> Result<Vec<PrimRef>, BuildError> {
        check_max_extra(self.max_extra)?;
        self.split(scene_bounds(prims)?.bounds, prims, |_| 0.0, &BoxClip)
    }

    fn max_references(&self, count: usize) -> usize {
        max_references(count, self.max_extra)
    }

    fn memory_bound(&self, count: usize) -> usize {
        memory_bound(count, self.max_references(count))
    }
}
