//! End-point overlap against known areas and Monte Carlo.

mod common;

use common::{Random, Split, build, soup};
use niwaki_core::{Aabb, Bvh, BvhNode, SahConstants, Triangle, TriangleMesh, glam::Vec3, to_u32};
use niwaki_metrics::{epo, epo_sampled};
use std::collections::HashSet;

const CONSTANTS: SahConstants = SahConstants { inner: 1.25, leaf: 0.5, triangle: 1.0 };

#[test]
fn overlaps_of_known_area() {
    let flat = Triangle::new(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0);
    let tilted = Triangle::new(
        Vec3::new(0.0, 0.0, -0.5),
        Vec3::new(1.0, 0.0, 0.5),
        Vec3::new(0.0, 1.0, 0.5),
    );
    let mesh = TriangleMesh::from_triangles(&[flat, tilted]).unwrap();
    let bvh = Bvh {
        nodes: vec![
            BvhNode::inner(mesh.bounds(), 1),
            BvhNode::leaf(flat.bounds(), 0, 1),
            BvhNode::leaf(tilted.bounds(), 1, 1),
        ],
        prim_ids: vec![0, 1],
    };
    // The tilted triangle's box holds the unit square of the flat one; the flat box holds a
    // segment of the tilted one. The areas are 2 and √3/2.
    let expected = 1.5 * 1.0 / (2.0 + 0.75_f64.sqrt());
    let value = epo(&bvh, &mesh, &CONSTANTS);
    assert!((value - expected).abs() < 1e-14, "{value} {expected}");

    // In the plane of a face counts as inside: a third triangle on top of the tilted box.
    let top =
        Triangle::new(Vec3::new(0.0, 0.0, 0.5), Vec3::new(0.5, 0.0, 0.5), Vec3::new(0.0, 0.5, 0.5));
    let mesh = TriangleMesh::from_triangles(&[flat, tilted, top]).unwrap();
    let bvh = Bvh {
        nodes: vec![
            BvhNode::inner(mesh.bounds(), 1),
            BvhNode::leaf(flat.bounds().union(top.bounds()), 0, 2),
            BvhNode::leaf(tilted.bounds(), 2, 1),
        ],
        prim_ids: vec![0, 2, 1],
    };
    // Now the first leaf also holds the part of the tilted triangle with z ≥ 0, 3/4 of it.
    let tilted_area = 0.75_f64.sqrt();
    let expected = (1.5 * (1.0 + 0.125) + 2.5 * 0.75 * tilted_area) / (2.0 + 0.125 + tilted_area);
    let value = epo(&bvh, &mesh, &CONSTANTS);
    assert!((value - expected).abs() < 1e-14, "{value} {expected}");
}

/// Σ C(n) over the nodes whose box holds a random surface point but whose subtree does not hold
/// its triangle: mean and standard error. Shares nothing with the crate but the definition.
fn monte_carlo(bvh: &Bvh, mesh: &TriangleMesh, samples: usize) -> (f64, f64) {
    // Children come after parents in the trees of these tests.
    let mut below: Vec<HashSet<u32>> = vec![HashSet::new(); bvh.nodes.len()];
    for (i, node) in bvh.nodes.iter().enumerate().rev() {
        below[i] = if node.is_leaf() {
            bvh.leaf_prims(node).iter().copied().collect()
        } else {
            let [a, b] = node.children();
            below[a].union(&below[b]).copied().collect()
        };
    }
    let mut total = 0.0;
    let cumulated: Vec<f64> = mesh
        .triangles()
        .map(|t| {
            total += t.area();
            total
        })
        .collect();
    let mut random = Random(77);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..samples {
        let place = random.unit() * total;
        let id = cumulated.partition_point(|&c| c <= place).min(mesh.len() - 1);
        let [a, b, c] = mesh.triangle(id).vertices().map(|v| v.as_dvec3());
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let point = a + (b - a) * u + (c - a) * v;
        let mut cost = 0.0;
        for (node, below) in bvh.nodes.iter().zip(&below) {
            let inside = node.min.as_dvec3().cmple(point) & node.max.as_dvec3().cmpge(point);
            if inside.all() && !below.contains(&to_u32(id)) {
                cost += if node.is_leaf() { 0.5 + f64::from(node.count) } else { 1.25 };
            }
        }
        sum += cost;
        squares += cost * cost;
    }
    let n = samples as f64;
    let mean = sum / n;
    (mean, ((squares / n - mean * mean) / n).sqrt())
}

#[test]
fn clipping_agrees_with_monte_carlo() {
    for (count, size, leaf_size, split) in [
        (60, 0.8, 1, Split::Never),
        (200, 0.3, 2, Split::Never),
        (60, 0.8, 2, Split::Sometimes),
        (150, 0.4, 4, Split::Sometimes),
    ] {
        let mesh = soup(count, size, count as u64);
        let bvh = build(&mesh, leaf_size, split);
        assert_eq!(bvh.prim_ids.len() > mesh.len(), split == Split::Sometimes);
        let exact = epo(&bvh, &mesh, &CONSTANTS);
        let (mean, error) = monte_carlo(&bvh, &mesh, 20_000);
        assert!(error < 0.03 * mean, "the test is sharp: {mean} ± {error}");
        assert!((exact - mean).abs() < 4.0 * error, "{count}: {exact}, sampled {mean} ± {error}");
    }
}

#[test]
fn splitting_all_triangles_leaves_no_overlap() {
    let mesh = soup(20, 0.5, 60);
    let bvh = build(&mesh, 4, Split::Always);
    assert!(bvh.prim_ids.len() > mesh.len() * 3 / 2, "{}", bvh.prim_ids.len());
    // Without the cuts the same halving leaves some.
    let uncut = epo(&build(&mesh, 4, Split::Never), &mesh, &CONSTANTS);
    assert!(uncut > 0.1, "{uncut}");
    // Boxes meet in planes and overlap by what rounding them outward adds.
    let value = epo(&bvh, &mesh, &CONSTANTS);
    assert!(value < 1e-5, "{value}");
}

#[test]
fn samples_estimate_the_whole() {
    let mesh = soup(3_000, 0.15, 5);
    let bvh = build(&mesh, 2, Split::Never);
    let exact = epo(&bvh, &mesh, &CONSTANTS);
    let mut outside = 0;
    for seed in 0..40 {
        let estimate = epo_sampled(&bvh, &mesh, &CONSTANTS, 300, seed);
        assert_eq!(estimate.samples, 300);
        assert!(estimate.standard_error > 0.0 && estimate.standard_error < 0.1 * exact);
        outside += u32::from((estimate.value - exact).abs() > 2.0 * estimate.standard_error);
        assert_eq!(estimate, epo_sampled(&bvh, &mesh, &CONSTANTS, 300, seed));
    }
    // Two sigmas leave out 5 %: 2 of 40 are expected, 8 have a chance below one in a thousand.
    assert!(outside <= 7, "{outside} of 40 estimates are off by more than two standard errors");

    let all = epo_sampled(&bvh, &mesh, &CONSTANTS, 3_000, 1);
    assert_eq!((all.value, all.standard_error), (exact, 0.0));
    let none = epo_sampled(&bvh, &mesh, &CONSTANTS, 0, 1);
    assert_eq!((none.standard_error, none.samples), (f64::INFINITY, 0));
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let mesh = soup(4_000, 0.1, 6);
    let bvh = build(&mesh, 2, Split::Sometimes);
    let on = |threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let estimate = epo_sampled(&bvh, &mesh, &CONSTANTS, 100, 3);
            (epo(&bvh, &mesh, &CONSTANTS).to_bits(), estimate.value.to_bits())
        })
    };
    assert_eq!(on(1), on(2));
    assert_eq!(on(1), on(7));
}

#[test]
fn scale_does_not_matter_and_nothing_costs_nothing() {
    let mesh = soup(300, 0.3, 8);
    let value = epo(&build(&mesh, 2, Split::Never), &mesh, &CONSTANTS);
    assert!(value > 0.5, "{value}");
    for exponent in [-100, 100] {
        let scale = 2.0_f32.powi(exponent);
        let positions = mesh.positions().iter().map(|&p| p * scale).collect();
        let scaled = TriangleMesh::new(positions, mesh.indices().to_vec()).unwrap();
        let again = epo(&build(&scaled, 2, Split::Never), &scaled, &CONSTANTS);
        assert!((again / value - 1.0).abs() < 1e-12, "2^{exponent}: {again} {value}");
    }
    let empty = TriangleMesh::default();
    assert_eq!(epo(&Bvh::default(), &empty, &CONSTANTS), 0.0);
    let points =
        TriangleMesh::from_triangles(&[Triangle::new(Vec3::X, Vec3::X, Vec3::X); 3]).unwrap();
    let bvh = build(&points, 1, Split::Never);
    assert_eq!(epo(&bvh, &points, &CONSTANTS), 0.0);
    assert_eq!(epo_sampled(&bvh, &points, &CONSTANTS, 2, 0).value, 0.0);
    // A tree that holds nothing of the mesh: all surface is foreign to its one leaf.
    let strange = Bvh {
        nodes: vec![BvhNode::leaf(Aabb::new(Vec3::splat(-9.0), Vec3::splat(9.0)), 0, 1)],
        prim_ids: vec![u32::MAX],
    };
    assert!((epo(&strange, &mesh, &CONSTANTS) - 1.5).abs() < 1e-12);
}
