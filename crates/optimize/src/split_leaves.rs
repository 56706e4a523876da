//! Leaves of one primitive each, for passes that can then move every primitive.

use crate::pass::Outcome;
use crate::pass::improve;
use crate::tree::Tree;
use crate::{CollapseLeaves, OptimizeError, Optimizer, Report};
use niwaki_core::{Aabb, Bvh, BvhNode, PrimRef, TriangleMesh, to_u32};
use std::ops::Range;

/// Up to so many primitives, all splits in the order of each axis are compared; more are halved
/// in the order of the longest axis first.
const SWEEP_SIZE: usize = 64;

/// Replaces every leaf of several primitives by a small tree whose leaves hold one each.
///
/// The box of such a leaf is that of its triangle, cut to the box of the leaf that held it, so
/// that trees of splitting builders stay as tight as they are. Costs more than the tree given, as
/// a rule, until [`CollapseLeaves`] has merged what belongs together: [`OnSingleLeaves`] does both.
///
/// # Errors
/// [`OptimizeError::BrokenTree`], and [`OptimizeError::PrimOutOfRange`] for a mesh with fewer
/// triangles than the tree names.
pub fn split_leaves(bvh: &Bvh, mesh: &TriangleMesh) -> Result<Bvh, OptimizeError> {
    // Finds every fault that could make the walk below fail.
    Tree::new(bvh)?;
    let triangles = mesh.len();
    if let Some(&prim_id) = bvh.prim_ids.iter().find(|&&id| id as usize >= triangles) {
        return Err(OptimizeError::PrimOutOfRange { prim_id, triangles });
    }
    let mut result = Bvh {
        nodes: Vec::with_capacity(2 * bvh.prim_ids.len()),
        prim_ids: Vec::with_capacity(bvh.prim_ids.len()),
    };
    let Some(root) = bvh.nodes.first() else { return Ok(result) };
    result.nodes.push(*root);
    // The primitives of the leaf that is being split; its parts are done before the next leaf.
    let mut prims: Vec<PrimRef> = Vec::new();
    let mut stack = vec![(From::Node(0), 0_usize)];
    while let Some((from, place)) = stack.pop() {
        let (children, bounds) = match from {
            From::Node(i) => {
                let node = &bvh.nodes[i];
                if node.is_leaf() {
                    prims.clear();
                    prims.extend(bvh.leaf_prims(node).iter().map(|&id| part(mesh, node, id)));
                    stack.push((From::Prims(0..prims.len()), place));
                    continue;
                }
                let [a, b] = node.children();
                ([From::Node(a), From::Node(b)], [bvh.nodes[a].aabb(), bvh.nodes[b].aabb()])
            }
            From::Prims(range) => {
                if range.len() == 1 {
                    let bounds = result.nodes[place].aabb();
                    result.nodes[place] = BvhNode::leaf(bounds, to_u32(result.prim_ids.len()), 1);
                    result.prim_ids.push(prims[range.start].prim_id);
                    continue;
                }
                let middle = range.start + split(&mut prims[range.clone()]);
                let ranges = [range.start..middle, middle..range.end];
                let bounds = ranges.clone().map(|range| around(&prims[range]));
                (ranges.map(From::Prims), bounds)
            }
        };
        let first = result.nodes.len();
        let whole = result.nodes[place].aabb();
        result.nodes[place] = BvhNode::inner(whole, to_u32(first));
        let [left, right] = children;
        result.nodes.extend(bounds.map(|bounds| BvhNode::inner(bounds, 0)));
        stack.push((right, first + 1));
        stack.push((left, first));
    }
    Ok(result)
}

/// What a node of the result is made from.
enum From {
    Node(usize),
    Prims(Range<usize>),
}

/// A triangle as far as it lies in a leaf.
fn part(mesh: &TriangleMesh, leaf: &BvhNode, id: u32) -> PrimRef {
    let bounds = mesh.triangle(id as usize).bounds().intersection(leaf.aabb());
    PrimRef::new(if bounds.is_empty() { leaf.aabb() } else { bounds }, id)
}

fn around(prims: &[PrimRef]) -> Aabb {
    prims.iter().fold(Aabb::EMPTY, |b, p| b.union(p.aabb()))
}

/// Orders two or more references so that the first ones, whose number is returned, are one side.
fn split(prims: &mut [PrimRef]) -> usize {
    let sort = |prims: &mut [PrimRef], axis: usize| {
        prims.sort_by(|a, b| a.centroid2()[axis].total_cmp(&b.centroid2()[axis]));
    };
    let count = prims.len();
    if count > SWEEP_SIZE {
        let centroids = Aabb::from_points(prims.iter().map(|p| p.aabb().center()));
        sort(prims, centroids.longest_axis());
        return count / 2;
    }
    let mut best = (f64::INFINITY, 0, count / 2);
    for axis in 0..3 {
        sort(prims, axis);
        let mut right = [0.0; SWEEP_SIZE];
        let mut bounds = Aabb::EMPTY;
        for (i, prim) in prims.iter().enumerate().rev() {
            bounds = bounds.union(prim.aabb());
            right[i] = bounds.area() * (count - i) as f64;
        }
        let mut bounds = Aabb::EMPTY;
        for i in 1..count {
            bounds = bounds.union(prims[i - 1].aabb());
            let cost = bounds.area() * i as f64 + right[i];
            if cost < best.0 {
                best = (cost, axis, i);
            }
        }
    }
    sort(prims, best.1);
    best.2
}

/// A pass on single primitives over a tree with leaves of several: leaves are split
/// ([`split_leaves`]), the pass runs, and leaves are merged again where that costs least.
#[derive(Clone, Debug)]
pub struct OnSingleLeaves<'a, O> {
    mesh: &'a TriangleMesh,
    optimizer: O,
    collapse: CollapseLeaves,
    name: String,
}

impl<'a, O: Optimizer> OnSingleLeaves<'a, O> {
    /// `mesh` is what the trees are over. The result is kept if it costs less by the constants of
    /// `collapse`.
    #[must_use]
    pub fn new(mesh: &'a TriangleMesh, optimizer: O, collapse: CollapseLeaves) -> Self {
        let name = format!("split_leaves+{}+{}", optimizer.name(), collapse.name());
        Self { mesh, optimizer, collapse, name }
    }
}

impl<O: Optimizer> Optimizer for OnSingleLeaves<'_, O> {
    fn name(&self) -> &str {
        &self.name
    }

    /// # Errors
    /// As [`Optimizer::optimize`] of the pass, and as [`split_leaves`].
    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        improve(bvh, &self.collapse.constants, |source| {
            let mut tree = split_leaves(source, self.mesh)?;
            let split = (tree.nodes.len() - source.nodes.len()) as u64;
            let report = self.optimizer.optimize(&mut tree)?;
            let merged = self.collapse.optimize(&mut tree)?;
            let changes = split + report.changes + merged.changes;
            Ok(Some(Outcome { iterations: report.iterations, changes, bvh: Some(tree) }))
        })
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        let single = 2 * references;
        let tree = 32 * single + 4 * references;
        let steps = self
            .optimizer
            .memory_bound(single, references)
            .max(self.collapse.memory_bound(single, references))
            .max((48 + 32 + 32) * nodes.max(single));
        tree + steps
    }
}
