//! End-point overlap.

use crate::{
    clip::{Overlap, area, bounds, clip_to_box, overlap},
    preorder::{LeavesOfPrims, Preorder},
    sah::node_cost,
};
use glam::DVec3;
use niwaki_core::{Bvh, SahConstants, Triangle, TriangleMesh};
use rayon::prelude::*;

/// End-point overlap (Aila, Karras and Laine 2013; thesis section 3.4): the work that
/// rays starting or ending on surfaces waste in nodes whose subtree does not hold that surface,
///
/// `Σ C(n) · A((S ∖ Q(n)) ∩ n) / A(S)` over all nodes,
///
/// where `S` are all triangles of the mesh, `Q(n)` those with a reference below `n`, `C(n)` is
/// C_I for an inner node and C_L + C_T·N for a leaf. Boxes are closed: a triangle in the plane of
/// a box's face counts as inside.
///
/// Triangles are clipped to boxes as polygons in `f64`, so the only error is rounding. Triangles
/// without area add nothing; if all have none the result is 0. Parallel over triangles; the same
/// bits for every number of threads. Cost: for each triangle, the nodes that its surface touches.
#[must_use]
pub fn epo(bvh: &Bvh, mesh: &TriangleMesh, constants: &SahConstants) -> f64 {
    let walker = Walker::new(bvh, mesh.len(), constants);
    // Fixed chunks, added in order: the sum does not depend on the number of threads.
    let sums: Vec<(f64, f64)> = (0..mesh.len().div_ceil(CHUNK))
        .into_par_iter()
        .map_init(Scratch::default, |scratch, chunk| {
            let first = chunk * CHUNK;
            let mut sums = (0.0, 0.0);
            for i in first..mesh.len().min(first + CHUNK) {
                let triangle = mesh.triangle(i);
                sums.0 += walker.foreign_cost(i, &triangle, scratch);
                sums.1 += triangle.area();
            }
            sums
        })
        .collect();
    let (cost, surface) = sums.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    if surface > 0.0 { cost / surface } else { 0.0 }
}

const CHUNK: usize = 256;

/// An estimate of [`epo`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EpoEstimate {
    /// The estimate, without bias.
    pub value: f64,
    /// Its standard error (one sigma), from the spread of the samples; an upper estimate, because
    /// it ignores what stratification gains. 0 if every triangle was counted.
    pub standard_error: f64,
    /// How many samples were drawn; the number of triangles if every one was counted.
    pub samples: usize,
}

/// [`epo`] from about `samples` triangles, for scenes where all are too many: the mesh's surface,
/// laid out triangle after triangle, is cut in `samples` parts of equal area; a seeded random
/// point of each part chooses its triangle. Triangles are thus drawn in proportion to their area,
/// large ones perhaps several times. With at least as many samples as triangles, the result is
/// exact.
///
/// Deterministic in all arguments.
#[must_use]
pub fn epo_sampled(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    constants: &SahConstants,
    samples: usize,
    seed: u64,
) -> EpoEstimate {
    if samples >= mesh.len() {
        let value = epo(bvh, mesh, constants);
        return EpoEstimate { value, standard_error: 0.0, samples: mesh.len() };
    }
    let areas: Vec<f64> =
        (0..mesh.len()).into_par_iter().map(|i| mesh.triangle(i).area()).collect();
    let surface: f64 = areas.iter().sum();
    if samples == 0 || surface <= 0.0 {
        let standard_error = if surface > 0.0 { f64::INFINITY } else { 0.0 };
        return EpoEstimate { value: 0.0, standard_error, samples: 0 };
    }
    // The triangle at each sampled place on the cumulated surface.
    let mut chosen = Vec::with_capacity(samples);
    let (mut triangle, mut reached) = (0, areas[0]);
    for k in 0..samples {
        let place = (k as f64 + unit_random(seed, k as u64)) / samples as f64 * surface;
        while reached <= place && triangle + 1 < areas.len() {
            triangle += 1;
            reached += areas[triangle];
        }
        chosen.push(triangle);
    }
    let walker = Walker::new(bvh, mesh.len(), constants);
    let values: Vec<f64> = chosen
        .par_iter()
        .map_init(Scratch::default, |scratch, &i| {
            // Rounding may place the last sample on a triangle without area.
            let area = areas[i];
            if area > 0.0 { walker.foreign_cost(i, &mesh.triangle(i), scratch) / area } else { 0.0 }
        })
        .collect();
    let n = samples as f64;
    let value = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - value) * (x - value)).sum();
    let standard_error = if samples > 1 { (squares / (n - 1.0) / n).sqrt() } else { f64::INFINITY };
    EpoEstimate { value, standard_error, samples }
}

/// A number in [0, 1) from a seed and an index (`SplitMix64`: Steele, Lea and Flood 2014).
fn unit_random(seed: u64, index: u64) -> f64 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 * (0.5_f64).powi(53)
}

/// A polygon that is valid until the walk leaves a subtree.
struct Piece {
    /// Where that subtree ends, in depth-first order.
    end: u32,
    /// Where the polygon's points start in [`Scratch::points`].
    start: usize,
    bounds: (DVec3, DVec3),
    area: f64,
}

#[derive(Default)]
struct Scratch {
    points: Vec<DVec3>,
    pieces: Vec<Piece>,
    polygon: Vec<DVec3>,
    spare: Vec<DVec3>,
}

struct Walker {
    order: Preorder,
    costs: Vec<f64>,
    leaves: LeavesOfPrims,
}

impl Walker {
    fn new(bvh: &Bvh, prims: usize, constants: &SahConstants) -> Self {
        let order = Preorder::of(bvh);
        let leaves = LeavesOfPrims::of(bvh, &order, prims);
        let costs = order
            .nodes
            .iter()
            .map(|n| node_cost(&bvh.nodes[n.index as usize], constants))
            .collect();
        Self { order, costs, leaves }
    }

    /// Σ C(n)·(area of the triangle inside n) over the nodes n that do not reference it below.
    fn foreign_cost(&self, prim: usize, triangle: &Triangle, scratch: &mut Scratch) -> f64 {
        let Scratch { points, pieces, polygon, spare } = scratch;
        points.clear();
        pieces.clear();
        points.extend(triangle.vertices().map(|v| v.as_dvec3()));
        let whole = area(points);
        if whole == 0.0 {
            return 0.0;
        }
        pieces.push(Piece { end: u32::MAX, start: 0, bounds: bounds(points), area: whole });
        let own = self.leaves.of_prim(prim);
        let mut cost = 0.0;
        let mut position = 0;
        while let Some(node) = self.order.nodes.get(position as usize) {
            while let Some(piece) = pieces.pop_if(|piece| piece.end <= position) {
                points.truncate(piece.start);
            }
            let Some(piece) = pieces.last() else { break };
            let mut inside = piece.area;
            match overlap(piece.bounds, &node.bounds) {
                Overlap::Apart => {
                    position = node.end;
                    continue;
                }
                Overlap::Inside => {}
                Overlap::Partial => {
                    polygon.clear();
                    polygon.extend_from_slice(&points[piece.start..]);
                    let (low, high) = (node.bounds.min.as_dvec3(), node.bounds.max.as_dvec3());
                    clip_to_box(polygon, low, high, spare);
                    inside = area(polygon);
                    if inside == 0.0 {
                        position = node.end;
                        continue;
                    }
                    let start = points.len();
                    points.extend_from_slice(polygon);
                    pieces.push(Piece {
                        end: node.end,
                        start,
                        bounds: bounds(polygon),
                        area: inside,
                    });
                }
            }
            // Leaves that reference the triangle, in order: is one of them in this subtree?
            let next_own = own.partition_point(|&leaf| leaf < position);
            if own.get(next_own).is_none_or(|&leaf| leaf >= node.end) {
                cost += self.costs[position as usize] * inside;
            }
            position += 1;
        }
        cost
    }
}
