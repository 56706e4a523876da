//! The surface area heuristic against definitions and enumeration.

mod common;

use common::{Split, build, soup};
use niwaki_core::{Aabb, Bvh, BvhNode, SahConstants, glam::Vec3, to_u32};
use niwaki_metrics::sah;

/// The `n`-th Catalan number (thesis section 3.3, equation 2): the number of shapes of a full
/// binary tree with `n + 1` leaves.
fn catalan(n: u64) -> u64 {
    (0..n).fold(1, |c, i| c * 2 * (2 * i + 1) / (i + 2))
}

/// A full binary tree over consecutive leaves.
#[derive(Clone)]
enum Shape {
    Leaf(usize),
    Inner(Box<[Self; 2]>),
}

/// All of them over `first..end`.
fn shapes(first: usize, end: usize) -> Vec<Shape> {
    if end - first == 1 {
        return vec![Shape::Leaf(first)];
    }
    let mut all = Vec::new();
    for middle in first + 1..end {
        for left in shapes(first, middle) {
            for right in shapes(middle, end) {
                all.push(Shape::Inner(Box::new([left.clone(), right])));
            }
        }
    }
    all
}

/// The tree of a shape, with one box a leaf.
fn tree(shape: &Shape, boxes: &[Aabb]) -> Bvh {
    fn place(shape: &Shape, slot: usize, boxes: &[Aabb], nodes: &mut Vec<BvhNode>) -> Aabb {
        match shape {
            Shape::Leaf(i) => {
                nodes[slot] = BvhNode::leaf(boxes[*i], to_u32(*i), 1);
                boxes[*i]
            }
            Shape::Inner(children) => {
                let first = nodes.len();
                nodes.extend([BvhNode::leaf(Aabb::EMPTY, 0, 1); 2]);
                let left = place(&children[0], first, boxes, nodes);
                let right = place(&children[1], first + 1, boxes, nodes);
                nodes[slot] = BvhNode::inner(left.union(right), to_u32(first));
                left.union(right)
            }
        }
    }
    let mut nodes = vec![BvhNode::leaf(Aabb::EMPTY, 0, 1)];
    place(shape, 0, boxes, &mut nodes);
    Bvh { nodes, prim_ids: (0..to_u32(boxes.len())).collect() }
}

#[test]
fn the_least_cost_over_all_trees_is_what_dynamic_programming_finds() {
    let constants = SahConstants { inner: 1.5, leaf: 0.25, triangle: 1.0 };
    for count in 1..=8_usize {
        let boxes: Vec<Aabb> = soup(count, 0.6, 9).triangles().map(|t| t.bounds()).collect();
        let all = shapes(0, count);
        assert_eq!(all.len() as u64, catalan(count as u64 - 1));
        let least = all
            .iter()
            .map(|shape| sah(&tree(shape, &boxes), &constants))
            .fold(f64::INFINITY, f64::min);

        // cost[i][j] of the best tree over boxes i..j, times the area of the root.
        let area =
            |i: usize, j: usize| boxes[i..j].iter().fold(Aabb::EMPTY, |b, &c| b.union(c)).area();
        let mut cost = vec![vec![0.0; count + 1]; count + 1];
        for size in 1..=count {
            for i in 0..=count - size {
                let j = i + size;
                cost[i][j] = if size == 1 {
                    1.25 * area(i, j)
                } else {
                    let parts = (i + 1..j).map(|k| cost[i][k] + cost[k][j]);
                    1.5 * area(i, j) + parts.fold(f64::INFINITY, f64::min)
                };
            }
        }
        let best = cost[0][count] / area(0, count);
        assert!((least - best).abs() < 1e-12 * best, "{count}: {least} {best}");
    }
}

#[test]
fn catalan_numbers_are_the_published_ones() {
    assert_eq!((0..9).map(catalan).collect::<Vec<_>>(), [1, 1, 2, 5, 14, 42, 132, 429, 1430]);
}

#[test]
fn the_cost_does_not_depend_on_scale() {
    let mesh = soup(500, 0.1, 4);
    let bvh = build(&mesh, 2, Split::Never);
    let cost = sah(&bvh, &SahConstants::THESIS_IV);
    // Powers of two scale without rounding: 2^100 is about 1e30.
    for exponent in [-100, -40, 40, 100, 120] {
        let scale = 2.0_f32.powi(exponent);
        let mut scaled = bvh.clone();
        for node in &mut scaled.nodes {
            (node.min, node.max) = (node.min * scale, node.max * scale);
        }
        assert_eq!(sah(&scaled, &SahConstants::THESIS_IV), cost, "2^{exponent}");
    }
    assert!(cost > 10.0 && cost < 1000.0, "{cost}");
}

#[test]
fn a_root_without_area_has_the_cost_of_its_limit() {
    let constants = SahConstants::THESIS_IV;
    let pair = |a: Aabb, b: Aabb| Bvh {
        nodes: vec![BvhNode::inner(a.union(b), 1), BvhNode::leaf(a, 0, 1), BvhNode::leaf(b, 1, 2)],
        prim_ids: vec![0, 1, 2],
    };
    let segment = |a: f32, b: f32| Aabb::new(Vec3::X * a, Vec3::X * b);
    // On a line: 2 + (3/4)·1 + (1/4)·2.
    assert_eq!(sah(&pair(segment(0.0, 3.0), segment(3.0, 4.0)), &constants), 3.25);
    // The same with a margin, which then vanishes.
    let margin = |b: Aabb, m: f32| Aabb::new(b.min - m, b.max + m);
    let near =
        sah(&pair(margin(segment(0.0, 3.0), 1e-5), margin(segment(3.0, 4.0), 1e-5)), &constants);
    assert!((near - 3.25).abs() < 1e-4, "{near}");
    // At a point every ray that meets the root meets all: 2 + 1 + 2.
    assert_eq!(sah(&pair(segment(1.0, 1.0), segment(1.0, 1.0)), &constants), 5.0);
    assert_eq!(sah(&Bvh::default(), &constants), 0.0);
}
