//! Leaf counts of rays whose path is known.

mod common;

use common::{Random, Split, build, chain, soup};
use niwaki_core::{Ray, glam::Vec3};
use niwaki_metrics::{LeafCounts, lcv, leaf_counts};

#[test]
fn a_row_of_leaves_is_counted_up_to_the_hit() {
    // Ten triangles in planes x = 0, …, 9, each with its flat box from (x, 0, 0) to (x, 1, 1).
    let (bvh, mesh) = chain(10);
    // Through the corner of every box that its triangle leaves free.
    let past_all = Ray::new(Vec3::new(-1.0, 0.9, 0.9), Vec3::X);
    // Into the first triangle; from between; against the row; short.
    let first = Ray::new(Vec3::new(-1.0, 0.2, 0.2), Vec3::X);
    let between = Ray::new(Vec3::new(5.5, 0.9, 0.9), Vec3::X);
    let back = Ray::new(Vec3::new(99.0, 0.2, 0.2), Vec3::NEG_X);
    let short = past_all.with_range(0.5, 4.5);
    let beside = Ray::new(Vec3::new(-1.0, 1.5, 0.2), Vec3::X);
    for (ray, leaves) in
        [(past_all, 10), (first, 1), (between, 4), (back, 1), (short, 4), (beside, 0)]
    {
        let counts = leaf_counts(&bvh, &mesh, &[ray]);
        assert_eq!((counts.max, counts.standard_deviation), (leaves, 0.0), "{ray:?}");
    }
    // 10 and 4: mean 7, deviation 3.
    let two = leaf_counts(&bvh, &mesh, &[past_all, between]);
    assert_eq!(two, LeafCounts { rays: 2, mean: 7.0, standard_deviation: 3.0, max: 10 });
    assert_eq!(lcv(&bvh, &mesh, &[past_all, between]), 3.0);
    assert_eq!(leaf_counts(&bvh, &mesh, &[]), LeafCounts::default());
}

#[test]
fn rays_that_hit_nothing_by_definition_open_no_leaf() {
    let (bvh, mesh) = chain(10);
    for ray in niwaki_hard_cases::bad_rays(&mesh) {
        assert_eq!(leaf_counts(&bvh, &mesh, &[ray]).max, 0, "{ray:?}");
    }
}

#[test]
fn counts_lie_between_what_is_needed_and_what_the_line_meets() {
    let mesh = soup(2_000, 0.05, 3);
    let bvh = build(&mesh, 2, Split::Never);
    let mut random = Random(4);
    let meets = |ray: &Ray, b: &niwaki_core::Aabb, limit: f64| {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (t0, t1) = ((b.min.as_dvec3() - o) / d, (b.max.as_dvec3() - o) / d);
        let near = t0.min(t1).max_element().max(0.0);
        near <= t0.max(t1).min_element().min(limit)
    };
    let mut hits = 0;
    for _ in 0..200 {
        let ray = Ray::new(random.point(), random.point());
        let closest = mesh
            .triangles()
            .filter_map(|t| {
                let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
                let [a, b, c] = t.vertices().map(|v| v.as_dvec3() - o);
                let w = [d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b))];
                let same = w.iter().all(|&w| w > 0.0) || w.iter().all(|&w| w < 0.0);
                let normal = (b - a).cross(c - a);
                let t = a.dot(normal) / d.dot(normal);
                (same && t >= 0.0).then_some(t)
            })
            .fold(f64::INFINITY, f64::min);
        hits += usize::from(closest.is_finite());
        let leaves = || bvh.nodes.iter().filter(|n| n.is_leaf());
        let needed = leaves().filter(|n| meets(&ray, &n.aabb(), closest)).count();
        let all = leaves().filter(|n| meets(&ray, &n.aabb(), f64::INFINITY)).count();
        let opened = leaf_counts(&bvh, &mesh, &[ray]).max as usize;
        assert!(needed <= opened && opened <= all, "{needed} {opened} {all}");
    }
    assert!((20..180).contains(&hits), "both kinds of rays are tested: {hits} hit");
}
