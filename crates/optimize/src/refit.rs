//! New positions, same tree; and rotations that keep it good (Kopta et al. 2012).

use crate::pass::check_constants;
use crate::rotation::Rotations;
use crate::{Budget, OptimizeError, Optimizer, Report};
use niwaki_core::{Aabb, Bvh, BvhNode, SahConstants, TriangleMesh};
use niwaki_metrics::sah;
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// Subtrees of at most so many nodes are one task.
const GRAIN: usize = 4096;

/// Makes all boxes fit a mesh whose triangles have moved, links and ids untouched.
///
/// A leaf gets the box around its whole triangles. In a tree whose builder split triangles the
/// boxes of parts thereby become those of whole triangles: the tree stays valid, but what was
/// gained by splitting is lost; build anew if that matters.
///
/// # Errors
/// [`OptimizeError::BrokenTree`], and [`OptimizeError::PrimOutOfRange`] for a mesh with fewer
/// triangles than the tree names. The tree is then left as it was.
pub fn refit(bvh: &mut Bvh, mesh: &TriangleMesh) -> Result<(), OptimizeError> {
    check(bvh, mesh)?;
    let Bvh { nodes, prim_ids } = bvh;
    nodes.par_iter_mut().with_min_len(1024).filter(|node| node.is_leaf()).for_each(|leaf| {
        let bounds = prim_ids[leaf.prim_range()]
            .iter()
            .fold(Aabb::EMPTY, |b, &id| b.union(mesh.triangle(id as usize).bounds()));
        set_bounds(leaf, bounds);
    });
    if !refit_ranges(nodes) {
        // Children come after their parents in any case.
        for i in (0..nodes.len()).rev() {
            refit_node(nodes, i, 0);
        }
    }
    Ok(())
}

fn check(bvh: &Bvh, mesh: &TriangleMesh) -> Result<(), OptimizeError> {
    let count = bvh.nodes.len();
    let fault = |(i, node): (usize, &BvhNode)| {
        let fault = if node.is_leaf() {
            if node.prim_range().end <= bvh.prim_ids.len() {
                return None;
            }
            "its primitive references do not exist"
        } else {
            let [first, second] = node.children();
            if first > i && second < count {
                return None;
            }
            "its children do not exist or do not come after it"
        };
        Some(OptimizeError::BrokenTree { node: i, fault })
    };
    if let Some(error) = bvh.nodes.par_iter().enumerate().find_map_first(fault) {
        return Err(error);
    }
    let triangles = mesh.len();
    match bvh.prim_ids.par_iter().find_first(|&&id| id as usize >= triangles) {
        Some(&prim_id) => Err(OptimizeError::PrimOutOfRange { prim_id, triangles }),
        None => Ok(()),
    }
}

fn set_bounds(node: &mut BvhNode, bounds: Aabb) {
    (node.min, node.max) = (bounds.min, bounds.max);
}

/// Makes the box of inner node `i` fit its children; indices of children count from `base`.
fn refit_node(nodes: &mut [BvhNode], i: usize, base: usize) {
    if !nodes[i].is_leaf() {
        let [a, b] = nodes[i].children().map(|child| nodes[child - base].aabb());
        set_bounds(&mut nodes[i], a.union(b));
    }
}

/// Refits inner nodes by disjoint ranges in parallel; false, with boxes half done, if the nodes
/// are not in depth-first order.
fn refit_ranges(nodes: &mut [BvhNode]) -> bool {
    // Below a node in depth-first order: its children, what is below the first, then the second.
    let mut ranges: Vec<Range<usize>> = Vec::new();
    let mut above: Vec<usize> = Vec::new();
    let mut stack = vec![(0_usize, 1..nodes.len())];
    while let Some((i, below)) = stack.pop() {
        let Some(node) = nodes.get(i).filter(|node| !node.is_leaf()) else {
            if !below.is_empty() && i < nodes.len() {
                return false;
            }
            continue;
        };
        let [first, second] = node.children();
        if first != below.start || second >= below.end {
            return false;
        }
        above.push(i);
        if below.len() <= GRAIN {
            ranges.push(below);
            continue;
        }
        let right = &nodes[second];
        let middle = if right.is_leaf() { below.end } else { right.first as usize };
        if !(first + 2..=below.end).contains(&middle) {
            return false;
        }
        stack.push((second, middle..below.end));
        stack.push((first, first + 2..middle));
    }
    let mut parts = Vec::with_capacity(ranges.len());
    let (mut rest, mut at) = (&mut nodes[..], 0);
    for range in ranges {
        let (_, after) = std::mem::take(&mut rest).split_at_mut(range.start - at);
        let (part, after) = after.split_at_mut(range.len());
        (rest, at) = (after, range.end);
        parts.push((range.start, part));
    }
    let sound = parts.into_par_iter().with_max_len(1).all(|(base, part)| {
        (0..part.len()).rev().all(|i| {
            let [first, second] = part[i].children();
            let sound = part[i].is_leaf() || (first > base + i && second < base + part.len());
            if sound {
                refit_node(part, i, base);
            }
            sound
        })
    });
    if sound {
        above.sort_unstable();
        for i in above.into_iter().rev() {
            refit_node(nodes, i, 0);
        }
    }
    sound
}

/// Refit for animated meshes: after the boxes fit the new positions, rotations repair what the
/// motion spoiled (Kopta, Ize, Spjut, Brunvand, Davis and Kensler, *Fast, effective BVH updates
/// for animated scenes*, I3D 2012).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitRotations {
    /// Sweeps of rotations per refit; 1 by default, as in the paper.
    pub budget: Budget,
    /// Costs of [`Report`].
    pub constants: SahConstants,
}

impl Default for RefitRotations {
    fn default() -> Self {
        Self { budget: Budget::iterations(1), constants: SahConstants::default() }
    }
}

impl RefitRotations {
    /// [`refit`], then rotations. [`Report::before`] is the cost after the refit.
    ///
    /// # Errors
    /// As [`refit`], and [`OptimizeError::BadSetting`] for bad costs.
    pub fn refit(&self, bvh: &mut Bvh, mesh: &TriangleMesh) -> Result<Report, OptimizeError> {
        let start = Instant::now();
        check_constants(&self.constants)?;
        let original = bvh.clone();
        refit(bvh, mesh)?;
        let rotations = Rotations { budget: self.budget, constants: self.constants };
        match rotations.optimize(bvh) {
            Ok(report) => {
                debug_assert_eq!(report.after, sah(bvh, &self.constants));
                Ok(Report { time: start.elapsed(), ..report })
            }
            Err(error) => {
                *bvh = original;
                Err(error)
            }
        }
    }
}
