//! Point and box queries against brute force and exact arithmetic.

mod common;

use common::split_tree;
use fastrand::Rng;
use niwaki_core::{
    Aabb, Bvh, Triangle, TriangleMesh,
    glam::{DVec3, Vec3},
};
use niwaki_hard_cases::{self as hard, median_tree, soup_mesh};
use niwaki_trace::{
    MeshQueries, NearestPoint, SceneError, nearest_on_triangle, triangle_overlaps_box,
};
use niwaki_wide::CollapseError;

fn trees(mesh: &TriangleMesh) -> [(&'static str, Bvh); 2] {
    [("median", median_tree(mesh, 3)), ("split", split_tree(mesh))]
}

/// Points around and on a mesh.
fn points(mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = Rng::with_seed(seed);
    let bounds = if mesh.is_empty() { Aabb::new(Vec3::ZERO, Vec3::ONE) } else { mesh.bounds() };
    (0..count)
        .map(|i| {
            let f = Vec3::new(rng.f32(), rng.f32(), rng.f32());
            match i % 4 {
                0 if !mesh.is_empty() => mesh.triangle(rng.usize(0..mesh.len())).v1,
                1 if !mesh.is_empty() => {
                    let t = mesh.triangle(rng.usize(0..mesh.len()));
                    t.v0 * 0.5 + t.v1 * 0.5
                }
                2 => bounds.min * (1.5 - 2.0 * f) + bounds.max * (2.0 * f - 0.5),
                _ => bounds.min * (1.0 - f) + bounds.max * f,
            }
        })
        .collect()
}

fn brute(mesh: &TriangleMesh, from: Vec3, max_distance: f64) -> Vec<NearestPoint> {
    let mut all: Vec<_> = (0..)
        .zip(mesh.triangles())
        .map(|(id, triangle)| nearest_on_triangle(&triangle, from, id))
        .filter(|found| found.distance <= max_distance)
        .collect();
    all.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.prim_id.cmp(&b.prim_id)));
    all
}

#[test]
fn nearest_equals_brute_force_on_soups_and_hard_cases() {
    let mut cases: Vec<(String, TriangleMesh)> = [(1, 1.0), (50, 0.5), (800, 0.1), (700, 0.6)]
        .iter()
        .map(|&(count, size)| (format!("soup {count}"), soup_mesh(count, size, 3)))
        .collect();
    let hard = hard::meshes().into_iter().filter(|case| case.mesh.len() <= 1_000);
    cases.extend(hard.map(|case| (case.name.to_owned(), case.mesh)));
    for (name, mesh) in &cases {
        for (tree, bvh) in trees(mesh) {
            let queries = MeshQueries::new(&bvh, mesh).unwrap();
            let mut found = vec![];
            for from in points(mesh, 60, 4) {
                let all = brute(mesh, from, f64::INFINITY);
                let context = || format!("{name}, {tree}, {from:?}");
                let nearest = queries.nearest(from, f64::INFINITY);
                assert_eq!(nearest, all.first().copied(), "{}", context());
                for most in [0, 1, 2, 5, 40] {
                    queries.nearest_prims(from, most, f64::INFINITY, &mut found);
                    assert_eq!(found, all[..most.min(all.len())], "{}", context());
                }
                // At the very distance of the tenth, and just short of it.
                let Some(tenth) = all.get(9.min(all.len().saturating_sub(1))) else { continue };
                for radius in [tenth.distance, tenth.distance.next_down(), -1.0, f64::NAN] {
                    queries.within(from, radius, &mut found);
                    let near = if radius.is_nan() { vec![] } else { brute(mesh, from, radius) };
                    assert_eq!(found, near, "{}", context());
                    assert_eq!(queries.nearest(from, radius), near.first().copied());
                }
            }
        }
    }
}

/// The distance by many points of the triangle, refined around the best.
fn sampled_distance(triangle: &Triangle, from: Vec3) -> f64 {
    let [a, b, c] = triangle.vertices().map(|v| v.as_dvec3());
    let at = |u: f64, v: f64| {
        let u = u.clamp(0.0, 1.0);
        let v = v.clamp(0.0, 1.0 - u);
        ((a + (b - a) * u + (c - a) * v).distance(from.as_dvec3()), u, v)
    };
    let (mut best, mut step) = (at(0.3, 0.3), 0.5);
    while step > 1e-9 {
        let mut better = best;
        for i in -4..=4 {
            for j in -4..=4 {
                let candidate =
                    at(best.1 + f64::from(i) * step / 4.0, best.2 + f64::from(j) * step / 4.0);
                if candidate.0 < better.0 {
                    better = candidate;
                }
            }
        }
        step *= if better.0 < best.0 { 0.9 } else { 0.5 };
        best = better;
    }
    best.0
}

#[test]
fn the_nearest_point_of_a_triangle_is_that_of_a_search() {
    let mut rng = Rng::with_seed(12);
    let mut point = || Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 4.0;
    for i in 0..300 {
        let (a, b, c) = (point(), point(), point());
        let triangle = match i % 6 {
            0 => Triangle::new(a, a, b),
            1 => Triangle::new(a, a, a),
            2 => Triangle::new(a, a * 0.5 + b * 0.5, b),
            _ => Triangle::new(a, b, c),
        };
        let from = if i % 5 == 0 { point() * 1e3 } else { point() };
        let found = nearest_on_triangle(&triangle, from, 7);
        let expected = sampled_distance(&triangle, from);
        let size = f64::from(from.length()) + 4.0;
        assert!((found.distance - expected).abs() <= 1e-7 * size, "{found:?} {expected}");
        assert!(found.distance <= expected + 1e-12 * size, "{found:?} {expected}");
        // The weights name the point, and the point is that far.
        let [a, b, c] = triangle.vertices().map(|v| v.as_dvec3());
        let (u, v) = (f64::from(found.u), f64::from(found.v));
        let named = a + (b - a) * u + (c - a) * v;
        assert!(named.distance(found.point.as_dvec3()) < 1e-5, "{found:?} {named}");
        let distance = found.point.distance(from);
        assert!((f64::from(distance) - found.distance).abs() < 1e-6 * size);
        assert_eq!(found.prim_id, 7);
    }
}

#[test]
fn around_a_shared_corner_or_edge_the_smallest_id_wins() {
    // A sheet bent away from the points above it, so that corners and edges are nearest.
    let mesh = hard::sheet(9, |i, j| {
        let (x, y) = (i as f32 * 0.37 - 1.6, j as f32 * 0.41 - 1.8);
        Vec3::new(x, y, -0.3 * x * x - 0.2 * y * y)
    });
    let bvh = median_tree(&mesh, 2);
    let queries = MeshQueries::new(&bvh, &mesh).unwrap();
    let mut shared = 0;
    let mut found = Vec::new();
    for from in points(&mesh, 400, 9) {
        let nearest = queries.nearest(from, f64::INFINITY).unwrap();
        queries.within(from, nearest.distance, &mut found);
        assert_eq!(found[0], nearest);
        assert!(found.windows(2).all(|w| w[0].prim_id < w[1].prim_id), "{found:?}");
        shared += usize::from(found.len() > 1);
    }
    assert!(shared > 100, "{shared} of 400 points are nearest to a shared corner or edge");
}

#[test]
fn points_that_are_none_find_nothing() {
    let mesh = soup_mesh(20, 0.5, 1);
    let bvh = median_tree(&mesh, 1);
    let queries = MeshQueries::new(&bvh, &mesh).unwrap();
    let mut found = Vec::new();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let from = Vec3::new(0.0, bad, 0.0);
        assert_eq!(queries.nearest(from, f64::INFINITY), None);
        queries.within(from, f64::INFINITY, &mut found);
        assert!(found.is_empty());
    }
    let nothing = MeshQueries::new(const { &Bvh { nodes: vec![], prim_ids: vec![] } }, &mesh);
    assert_eq!(nothing.unwrap().nearest(Vec3::ZERO, f64::INFINITY), None);
}

/// Whether a triangle and a box of whole numbers meet, by clipping in exact arithmetic: the
/// separating axes with 128-bit integers.
fn integers_overlap(triangle: [[i64; 3]; 3], low: [i64; 3], high: [i64; 3]) -> bool {
    let sub = |a: [i64; 3], b: [i64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross = |a: [i64; 3], b: [i64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let [a, b, c] = triangle;
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let mut axes = vec![cross(edges[0], edges[1])];
    axes.extend(units);
    axes.extend(edges.iter().flat_map(|&edge| units.map(|unit| cross(edge, unit))));
    axes.iter().all(|axis| {
        let dot =
            |p: [i64; 3]| (0..3).map(|k| i128::from(axis[k]) * i128::from(p[k])).sum::<i128>();
        let along = triangle.map(dot);
        let corners =
            (0..8).map(|i| dot([0, 1, 2].map(|k| if i >> k & 1 == 0 { low[k] } else { high[k] })));
        let (mut first, mut last) = (i128::MAX, i128::MIN);
        for at in corners {
            (first, last) = (first.min(at), last.max(at));
        }
        along.iter().min().is_some_and(|&min| min <= last)
            && along.iter().max().is_some_and(|&max| max >= first)
    })
}

#[test]
fn overlap_is_exact_on_whole_numbers() {
    let mut rng = Rng::with_seed(5);
    let (mut yes, mut no, mut boxes_only) = (0, 0, 0);
    for i in 0..60_000 {
        // Small numbers touch often; large ones have long products.
        let size = [3, 8, 40, 1 << 13][i % 4];
        let offset = [0, 100_000, -7_777][i % 3];
        let mut point = || [0; 3].map(|_| rng.i64(-size..=size) + offset);
        let triangle = [point(), point(), point()];
        let (p, q) = (point(), point());
        let low = [0, 1, 2].map(|k| p[k].min(q[k]));
        let high = [0, 1, 2].map(|k| if i % 5 == 0 { low[k] } else { p[k].max(q[k]) });
        let float = |p: [i64; 3]| Vec3::from_array(p.map(|x| x as f32));
        let [a, b, c] = triangle.map(float);
        let t = Triangle::new(a, b, c);
        let bounds = Aabb::new(float(low), float(high));
        let expected = integers_overlap(triangle, low, high);
        assert_eq!(triangle_overlaps_box(&t, &bounds), expected, "{triangle:?} {low:?} {high:?}");
        yes += usize::from(expected);
        no += usize::from(!expected);
        let touch = !t.bounds().intersection(bounds).is_empty();
        boxes_only += usize::from(touch && !expected);
    }
    assert!(yes > 5_000 && no > 5_000 && boxes_only > 2_000, "{yes} {no} {boxes_only}");
}

#[test]
fn overlap_leaves_nothing_out() {
    // Boxes around a point of the triangle, of any scale; and infinite, empty and bad ones.
    let mut rng = Rng::with_seed(6);
    for _ in 0..20_000 {
        let scale = 10.0_f32.powi(rng.i32(-30..=30));
        let mut point = || Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * scale;
        let (a, b, c, extent) = (point(), point(), point(), point().abs());
        let t = Triangle::new(a, b, c);
        let (u, v) = (f64::from(rng.f32()) * 0.5, f64::from(rng.f32()) * 0.5);
        let [a, b, c] = t.vertices().map(|v| v.as_dvec3());
        let on: DVec3 = a + (b - a) * u + (c - a) * v;
        // Rounded outwards by an ulp of f32, the box contains the point.
        let (min, max) = (on.as_vec3(), on.as_vec3());
        let min = Vec3::from_array(min.to_array().map(f32::next_down));
        let max = Vec3::from_array(max.to_array().map(f32::next_up));
        for bounds in
            [Aabb::new(min, max), Aabb::new(min - extent, max), Aabb::new(min, max + extent)]
        {
            assert!(triangle_overlaps_box(&t, &bounds), "{t:?} {bounds:?}");
        }
        let all = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
        assert!(triangle_overlaps_box(&t, &all));
        let half = Aabb::new(Vec3::NEG_INFINITY, max);
        assert!(triangle_overlaps_box(&t, &half));
        assert!(!triangle_overlaps_box(&t, &Aabb::EMPTY));
        assert!(!triangle_overlaps_box(&t, &Aabb::new(min, max.with_y(f32::NAN))));
    }
}

#[test]
fn box_queries_equal_brute_force() {
    let mut cases: Vec<(String, TriangleMesh)> =
        vec![("soup".into(), soup_mesh(600, 0.2, 2)), ("large".into(), soup_mesh(300, 1.5, 2))];
    let hard = hard::meshes().into_iter().filter(|case| case.mesh.len() <= 1_000);
    cases.extend(hard.map(|case| (case.name.to_owned(), case.mesh)));
    let mut fewer = 0;
    for (name, mesh) in &cases {
        for (tree, bvh) in trees(mesh) {
            let queries = MeshQueries::new(&bvh, mesh).unwrap();
            let (mut ids, mut candidates) = (vec![1, 2], vec![3]);
            let corners = points(mesh, 80, 7);
            let boxes = corners.windows(2).map(|w| Aabb::from_points([w[0], w[1]]));
            let small =
                corners.windows(2).map(|w| Aabb::from_points([w[0], w[0] * 0.9 + w[1] * 0.1]));
            let all = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
            for bounds in boxes.chain(small).chain([all, Aabb::EMPTY]) {
                let prims = || (0..).zip(mesh.triangles());
                let expected: Vec<u32> = prims()
                    .filter(|(_, t)| triangle_overlaps_box(t, &bounds))
                    .map(|(id, _)| id)
                    .collect();
                queries.overlapping(&bounds, &mut ids);
                assert_eq!(ids, expected, "{name}, {tree}, {bounds:?}");
                let boxes: Vec<u32> = prims()
                    .filter(|(_, t)| !t.bounds().intersection(bounds).is_empty())
                    .map(|(id, _)| id)
                    .collect();
                queries.box_candidates(&bounds, &mut candidates);
                if tree == "median" {
                    assert_eq!(candidates, boxes, "{name}, {bounds:?}");
                } else {
                    assert!(candidates.iter().all(|id| boxes.contains(id)), "{name}");
                    assert!(ids.iter().all(|id| candidates.contains(id)), "{name}");
                }
                fewer += usize::from(ids.len() < candidates.len());
            }
        }
    }
    assert!(fewer > 100, "{fewer} boxes meet boxes of triangles, but not all of the triangles");
}

#[test]
fn trees_of_other_meshes_and_broken_ones_are_refused() {
    let mesh = soup_mesh(40, 0.5, 1);
    let mut bvh = median_tree(&mesh, 1);
    let small = soup_mesh(30, 0.5, 1);
    let error = MeshQueries::new(&bvh, &small).unwrap_err();
    assert!(matches!(error, SceneError::NoSuchTriangle { triangles: 30, .. }), "{error}");
    bvh.nodes[3].first = 1;
    let error = MeshQueries::new(&bvh, &mesh).unwrap_err();
    assert!(matches!(error, SceneError::Collapse(CollapseError::Malformed { .. })), "{error}");
}
