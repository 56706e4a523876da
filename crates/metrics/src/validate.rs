//! Structural validation.

use crate::{
    clip::{area, bounds, clip_half_space},
    preorder::prim_range,
};
use glam::DVec3;
use niwaki_core::{Aabb, Bvh, Triangle, TriangleMesh, to_u32};
use rayon::prelude::*;

/// What is wrong with a tree. Nodes are named by index in [`Bvh::nodes`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Violation {
    /// The mesh has triangles, but the tree has no nodes.
    #[error("the tree has no nodes, but the mesh has {triangles} triangles")]
    NoNodes {
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// The children of an inner node do not exist.
    #[error("node {node} has its children at {first_child}, past the {nodes} nodes")]
    ChildOutOfRange {
        /// The inner node.
        node: u32,
        /// What it says.
        first_child: u32,
        /// How many nodes there are.
        nodes: usize,
    },
    /// Children come after their parent; anything else could close a cycle.
    #[error("node {node} has its children at {first_child}, not after itself")]
    ChildNotAfterParent {
        /// The inner node.
        node: u32,
        /// What it says.
        first_child: u32,
    },
    /// More than one inner node claims this one as a child.
    #[error("node {node} has {parents} parents")]
    SharedNode {
        /// The child.
        node: u32,
        /// How many claim it.
        parents: u32,
    },
    /// No inner node claims this one as a child, and it is not the root.
    #[error("node {node} cannot be reached from the root")]
    UnreachableNode {
        /// The orphan.
        node: u32,
    },
    /// A box has a NaN, an infinity, or `min > max`.
    #[error("node {node} has the box {bounds:?}, which is not a finite box")]
    BadBox {
        /// The node.
        node: u32,
        /// Its box.
        bounds: Aabb,
    },
    /// A child's box leaves its parent's.
    #[error("the box of node {child} is not inside that of its parent {node}")]
    ChildOutsideParent {
        /// The parent.
        node: u32,
        /// The child.
        child: u32,
    },
    /// A leaf's range does not exist in [`Bvh::prim_ids`].
    #[error("leaf {node} holds entries {first}..{end}, past the {entries} entries")]
    LeafRangeOutOfRange {
        /// The leaf.
        node: u32,
        /// First entry.
        first: u32,
        /// After the last entry.
        end: u64,
        /// How many there are.
        entries: usize,
    },
    /// An entry of [`Bvh::prim_ids`] is in more than one leaf.
    #[error("entry {entry} of the primitive ids is in {leaves} leaves")]
    SharedEntry {
        /// Index in [`Bvh::prim_ids`].
        entry: u32,
        /// How many leaves hold it.
        leaves: u32,
    },
    /// An entry of [`Bvh::prim_ids`] is in no leaf.
    #[error("entry {entry} of the primitive ids is in no leaf")]
    UnusedEntry {
        /// Index in [`Bvh::prim_ids`].
        entry: u32,
    },
    /// A primitive id is not below the number of triangles.
    #[error("entry {entry} holds primitive {prim_id}, but there are only {triangles} triangles")]
    PrimOutOfRange {
        /// Index in [`Bvh::prim_ids`].
        entry: u32,
        /// What it holds.
        prim_id: u32,
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// No leaf holds this triangle.
    #[error("triangle {prim_id} is in no leaf")]
    LostPrim {
        /// The triangle.
        prim_id: u32,
    },
    /// The only leaf that holds a triangle does not enclose it.
    #[error("triangle {prim_id} is only in leaf {node}, whose box does not enclose it")]
    PrimOutsideLeaf {
        /// The triangle.
        prim_id: u32,
        /// The leaf.
        node: u32,
    },
    /// The leaves that hold a split triangle leave part of it uncovered.
    #[error("the {leaves} leaves of triangle {prim_id} leave {uncovered:e} of its area uncovered")]
    PrimNotCovered {
        /// The triangle.
        prim_id: u32,
        /// References to it.
        leaves: usize,
        /// The uncovered share of its area, 0 to 1.
        uncovered: f64,
    },
}

/// How strict [`validate_with`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValidateOptions {
    /// How many violations to report at most. At least 1.
    pub max_violations: usize,
    /// For a triangle with several references: the share of its area that their boxes may leave
    /// uncovered. Default 1e-6; exact clipping leaves about 1e-15.
    pub uncovered_area: f64,
    /// Leaf boxes are widened by this many `f32` ulp (2⁻²³ times the power of two at or below it)
    /// of the triangle's largest coordinate, before they are held against the triangle. Default
    /// 0: no tolerance, which builders that round outward can meet. 4 forgives the rounding of
    /// builders that clip in plain `f32`.
    pub widen_ulps: f64,
}

impl Default for ValidateOptions {
    fn default() -> Self {
        Self { max_violations: 100, uncovered_area: 1e-6, widen_ulps: 0.0 }
    }
}

impl ValidateOptions {
    /// For trees of other libraries, whose clipping rounds to nearest: `widen_ulps` of 4.
    #[must_use]
    pub fn rounded_clipping() -> Self {
        Self { widen_ulps: 4.0, ..Self::default() }
    }
}

/// [`validate_with`] the default options: at most 100 violations, exact boxes.
///
/// # Errors
/// The violations.
pub fn validate(bvh: &Bvh, mesh: &TriangleMesh) -> Result<(), Vec<Violation>> {
    validate_with(bvh, mesh, &ValidateOptions::default())
}

/// Checks that a tree is sound and covers a mesh:
///
/// - children are in range, adjacent (by [`niwaki_core::BvhNode`]'s layout) and after their
///   parent, and every node but the root has one parent: no cycle, no orphan;
/// - boxes are finite and enclose those of the children;
/// - the ranges of the leaves are in range, disjoint, and together are all of [`Bvh::prim_ids`];
/// - ids are in range and every triangle is in a leaf;
/// - a triangle that is referenced once lies inside the box of its leaf; of one that is
///   referenced more often (by builders that split), the leaves' boxes together cover the whole,
///   which is decided by subtracting the boxes from the polygon in `f64`.
///
/// Reports faults of the structure alone if there are any, because what follows would be
/// meaningless; otherwise the geometric ones, in order of node and triangle. Never recurses, and
/// takes time linear in nodes and references, except for triangles with many references (each
/// costs the product of its references and of the pieces left).
///
/// # Errors
/// Up to [`ValidateOptions::max_violations`] violations.
pub fn validate_with(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    options: &ValidateOptions,
) -> Result<(), Vec<Violation>> {
    let max = options.max_violations.max(1);
    let mut found = structure(bvh, mesh, max);
    if found.is_empty() {
        found = boxes(bvh, max);
        if found.len() < max {
            let more = coverage(bvh, mesh, options, max - found.len());
            found.extend(more);
        }
    }
    if found.is_empty() { Ok(()) } else { Err(found) }
}

/// Links, ranges and ids.
fn structure(bvh: &Bvh, mesh: &TriangleMesh, max: usize) -> Vec<Violation> {
    let mut found = Vec::new();
    if bvh.nodes.is_empty() && !mesh.is_empty() {
        found.push(Violation::NoNodes { triangles: mesh.len() });
    }
    let mut parents = vec![0_u32; bvh.nodes.len()];
    let mut leaves = vec![0_u32; bvh.prim_ids.len()];
    for (i, node) in bvh.nodes.iter().enumerate() {
        let index = to_u32(i);
        if node.is_leaf() {
            let end = u64::from(node.first) + u64::from(node.count);
            if end > bvh.prim_ids.len() as u64 {
                found.push(Violation::LeafRangeOutOfRange {
                    node: index,
                    first: node.first,
                    end,
                    entries: bvh.prim_ids.len(),
                });
            }
            for entry in prim_range(bvh, index) {
                leaves[entry] = leaves[entry].saturating_add(1);
            }
            continue;
        }
        let [first, second] = node.children();
        if second >= bvh.nodes.len() {
            found.push(Violation::ChildOutOfRange {
                node: index,
                first_child: node.first,
                nodes: bvh.nodes.len(),
            });
        } else if first <= i {
            found.push(Violation::ChildNotAfterParent { node: index, first_child: node.first });
        } else {
            parents[first] += 1;
            parents[second] += 1;
        }
    }
    // With every child after its one parent, all nodes hang below the root and none in a cycle.
    for (i, &parents) in parents.iter().enumerate().skip(1) {
        match parents {
            0 => found.push(Violation::UnreachableNode { node: to_u32(i) }),
            1 => {}
            _ => found.push(Violation::SharedNode { node: to_u32(i), parents }),
        }
    }
    for (entry, &leaves) in leaves.iter().enumerate() {
        match leaves {
            0 => found.push(Violation::UnusedEntry { entry: to_u32(entry) }),
            1 => {}
            _ => found.push(Violation::SharedEntry { entry: to_u32(entry), leaves }),
        }
    }
    let mut referenced = vec![false; mesh.len()];
    for (entry, &prim_id) in bvh.prim_ids.iter().enumerate() {
        match referenced.get_mut(prim_id as usize) {
            Some(flag) => *flag = true,
            None => found.push(Violation::PrimOutOfRange {
                entry: to_u32(entry),
                prim_id,
                triangles: mesh.len(),
            }),
        }
    }
    let lost = referenced.iter().enumerate().filter(|&(_, &flag)| !flag);
    found.extend(lost.map(|(id, _)| Violation::LostPrim { prim_id: to_u32(id) }));
    found.truncate(max);
    found
}

/// Boxes against the boxes of their children; the structure is sound.
fn boxes(bvh: &Bvh, max: usize) -> Vec<Violation> {
    let mut found: Vec<Violation> = bvh
        .nodes
        .par_iter()
        .enumerate()
        .with_min_len(4096)
        .flat_map_iter(|(i, node)| {
            let bounds = node.aabb();
            let bad = !bounds.is_finite() || bounds.is_empty();
            let bad = bad.then(|| Violation::BadBox { node: to_u32(i), bounds });
            let children = if node.is_leaf() { 0..0 } else { 0..2 };
            let outside = children
                .map(|k| node.children()[k])
                .filter(move |&child| !bounds.contains(&bvh.nodes[child].aabb()))
                .map(move |child| Violation::ChildOutsideParent {
                    node: to_u32(i),
                    child: to_u32(child),
                });
            bad.into_iter().chain(outside)
        })
        .collect();
    found.truncate(max);
    found
}

/// Triangles against the boxes of their leaves; the structure is sound.
fn coverage(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    options: &ValidateOptions,
    max: usize,
) -> Vec<Violation> {
    // References sorted by triangle, then leaf.
    let mut references: Vec<(u32, u32)> = bvh
        .nodes
        .par_iter()
        .enumerate()
        .with_min_len(4096)
        .flat_map_iter(|(i, node)| {
            bvh.prim_ids[node.prim_range()].iter().map(move |&id| (id, to_u32(i)))
        })
        .collect();
    references.par_sort_unstable();
    let groups: Vec<&[(u32, u32)]> = references.chunk_by(|a, b| a.0 == b.0).collect();
    let mut found: Vec<Violation> = groups
        .par_iter()
        .with_min_len(1024)
        .filter_map(|group| {
            let prim_id = group[0].0;
            let triangle = mesh.triangle(prim_id as usize);
            let margin = options.widen_ulps * ulp_of_largest(&triangle);
            let corners = triangle.vertices().map(|v| v.as_dvec3());
            let leaf_box = |&(_, node): &(u32, u32)| {
                let b = bvh.nodes[node as usize].aabb();
                (b.min.as_dvec3() - margin, b.max.as_dvec3() + margin)
            };
            let encloses = |(low, high): (DVec3, DVec3)| {
                corners.iter().all(|&p| (p.cmpge(low) & p.cmple(high)).all())
            };
            if group.iter().any(|reference| encloses(leaf_box(reference))) {
                return None;
            }
            if let [(_, node)] = group {
                return Some(Violation::PrimOutsideLeaf { prim_id, node: *node });
            }
            let uncovered = uncovered(&corners, group.iter().map(leaf_box));
            (uncovered > options.uncovered_area || uncovered.is_nan())
                .then_some(Violation::PrimNotCovered { prim_id, leaves: group.len(), uncovered })
        })
        .collect();
    found.truncate(max);
    found
}

/// One `f32` ulp of the largest coordinate.
fn ulp_of_largest(triangle: &Triangle) -> f64 {
    let bounds = triangle.bounds();
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    // Not upward: above the largest f32 there is infinity, and no tolerance of 0 times that. Below a
    // power of two steps are half as long.
    let below = f64::from(largest) - f64::from(largest.next_down());
    if largest.next_up().is_finite() {
        f64::from(largest.next_up()) - f64::from(largest)
    } else {
        below
    }
}

/// The share of a triangle's area that lies in none of the boxes.
fn uncovered(corners: &[DVec3; 3], boxes: impl Iterator<Item = (DVec3, DVec3)>) -> f64 {
    let whole = area(corners);
    if whole == 0.0 {
        // No area to cover, and nothing that a ray could hit.
        return 0.0;
    }
    let mut pieces = vec![corners.to_vec()];
    for (low, high) in boxes {
        let mut left = Vec::new();
        for piece in pieces {
            subtract(piece, low, high, &mut left);
        }
        pieces = left;
        if pieces.is_empty() {
            return 0.0;
        }
    }
    pieces.iter().map(|piece| area(piece)).sum::<f64>() / whole
}

/// Appends the parts of a convex polygon outside the closed box: at most one for each face.
fn subtract(mut piece: Vec<DVec3>, low: DVec3, high: DVec3, left: &mut Vec<Vec<DVec3>>) {
    let (min, max) = bounds(&piece);
    if !(min.cmple(high) & max.cmpge(low)).all() {
        left.push(piece);
        return;
    }
    for axis in 0..3 {
        for (plane, keep_lower) in [(low[axis], false), (high[axis], true)] {
            let beyond = |p: &DVec3| if keep_lower { p[axis] > plane } else { p[axis] < plane };
            if !piece.iter().any(beyond) {
                continue;
            }
            let mut outside = Vec::with_capacity(piece.len() + 1);
            clip_half_space(&piece, axis, plane, !keep_lower, &mut outside);
            if area(&outside) > 0.0 {
                left.push(outside);
            }
            let mut inside = Vec::with_capacity(piece.len() + 1);
            clip_half_space(&piece, axis, plane, keep_lower, &mut inside);
            piece = inside;
            if piece.is_empty() {
                return;
            }
        }
    }
}
