//! The oracle against rational arithmetic, known values and symmetries.

use niwaki_core::{Ray, Triangle, TriangleMesh, glam::Vec3, to_u32};
use niwaki_exact::{
    Anchor, Contact, Verdict, border_distance_ulps, closest, closest_in_mesh, compare_t, contact,
    settle_any, t, t_error_bound,
};
use num_rational::BigRational;
use num_traits::{Signed, Zero};
use proptest::prelude::*;
use std::cmp::Ordering;

fn rational(x: f32) -> BigRational {
    BigRational::from_float(x).unwrap()
}

/// Cramer's rule on o + t·d = a + u·(b − a) + v·(c − a), in fractions: shares no formula and no
/// number type with the crate.
fn by_fractions(ray: &Ray, triangle: &Triangle) -> Option<(Contact, BigRational)> {
    let column = |v: Vec3| v.to_array().map(rational);
    let minus = |p: [BigRational; 3], q: &[BigRational; 3]| {
        let mut q = q.iter();
        p.map(|x| x - q.next().unwrap())
    };
    let determinant = |p: &[BigRational; 3], q: &[BigRational; 3], r: &[BigRational; 3]| {
        &p[0] * (&q[1] * &r[2] - &q[2] * &r[1]) - &q[0] * (&p[1] * &r[2] - &p[2] * &r[1])
            + &r[0] * (&p[1] * &q[2] - &p[2] * &q[1])
    };
    let a = column(triangle.v0);
    let (e1, e2) = (minus(column(triangle.v1), &a), minus(column(triangle.v2), &a));
    let back = column(-ray.direction);
    let s = minus(column(ray.origin), &a);
    let det = determinant(&e1, &e2, &back);
    if det.is_zero() {
        return None;
    }
    let u = determinant(&s, &e2, &back) / &det;
    let v = determinant(&e1, &s, &back) / &det;
    let t = determinant(&e1, &e2, &s) / &det;
    let w = BigRational::from_integer(1.into()) - &u - &v;
    let in_range =
        t >= rational(ray.t_min) && (ray.t_max.is_infinite() || t <= rational(ray.t_max));
    if !in_range || [&u, &v, &w].iter().any(|x| x.is_negative()) {
        return None;
    }
    let border = [&u, &v, &w].iter().any(|x| x.is_zero());
    Some((if border { Contact::Border } else { Contact::Interior }, t))
}

/// Small integers make edges, corners and planes common; the rest covers all magnitudes.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        1 => -1.0_f32..1.0,
        1 => (any::<i8>(), -149_i32..100).prop_map(|(m, e)| f32::from(m) * 2.0_f32.powi(e)),
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

fn triangle() -> impl Strategy<Value = Triangle> {
    (point(), point(), point()).prop_map(|(a, b, c)| Triangle::new(a, b, c))
}

/// Half of the rays aim at a mix of the corners, as exactly as `f32` allows.
fn ray_and_triangle() -> impl Strategy<Value = (Ray, Triangle)> {
    let range = (
        prop_oneof![Just(0.0_f32), Just(1.0), 0.0_f32..2.0],
        prop_oneof![Just(f32::INFINITY), Just(1.0), 0.0_f32..4.0],
    );
    (point(), point(), triangle(), 0_u8..6, range).prop_map(|(o, d, tri, aim, (t_min, t_max))| {
        let target = match aim {
            0 => tri.v0,
            1 => (tri.v0 + tri.v1) * 0.5,
            2 => tri.v0 * 0.25 + tri.v1 * 0.25 + tri.v2 * 0.5,
            _ => o + d,
        };
        (Ray::new(o, target - o).with_range(t_min, t_max), tri)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn fractions_agree((ray, triangle) in ray_and_triangle()) {
        let expected = by_fractions(&ray, &triangle);
        let found = contact(&ray, &triangle);
        prop_assert_eq!(found, expected.as_ref().map_or(Contact::Miss, |e| e.0));
        let t = t(&ray, &triangle);
        prop_assert_eq!(t.is_some(), found.is_hit());
        if let (Some(t), Some((_, exact))) = (t, expected) {
            // Rounded to nearest: no neighbour is nearer.
            let distance = |x: f64| (BigRational::from_float(x).unwrap() - &exact).abs();
            prop_assert!(distance(t) <= distance(t.next_up()));
            prop_assert!(distance(t) <= distance(t.next_down()));
        }
    }

    #[test]
    fn order_and_winding_of_the_corners_do_not_matter((ray, tri) in ray_and_triangle()) {
        let Triangle { v0: a, v1: b, v2: c } = tri;
        for other in [[b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]] {
            let other = Triangle::new(other[0], other[1], other[2]);
            prop_assert_eq!(contact(&ray, &other), contact(&ray, &tri));
            prop_assert_eq!(t(&ray, &other), t(&ray, &tri));
            prop_assert_eq!(compare_t(&ray, &other, &tri), Ordering::Equal);
        }
    }

    #[test]
    fn powers_of_two_do_not_matter((ray, tri) in ray_and_triangle(), e in -20_i32..20) {
        // Denormals lose bits when they are scaled down: leave those out.
        let scale = 2.0_f32.powi(e);
        let scaled = |v: Vec3| v * scale;
        let exact = [ray.origin, ray.direction, tri.v0, tri.v1, tri.v2];
        prop_assume!(exact.iter().all(|&v| scaled(v) * scale.recip() == v));
        let larger = Triangle::new(scaled(tri.v0), scaled(tri.v1), scaled(tri.v2));
        let moved = Ray { origin: scaled(ray.origin), direction: scaled(ray.direction), ..ray };
        prop_assert_eq!(contact(&moved, &larger), contact(&ray, &tri));
        prop_assert_eq!(t(&moved, &larger), t(&ray, &tri));
        // A longer direction counts in longer steps.
        let faster = Ray { direction: ray.direction * 4.0, t_min: ray.t_min / 4.0, t_max: ray.t_max / 4.0, ..ray };
        prop_assert_eq!(contact(&faster, &tri), contact(&ray, &tri));
    }

    #[test]
    fn the_closest_of_many_is_the_least_fraction(
        tris in prop::collection::vec(triangle(), 1..12),
        (ray, _) in ray_and_triangle(),
    ) {
        let hits: Vec<(u32, Contact, BigRational)> = tris
            .iter()
            .enumerate()
            .filter_map(|(i, tri)| by_fractions(&ray, tri).map(|(c, t)| (to_u32(i), c, t)))
            .collect();
        let least = hits.iter().map(|h| &h.2).min();
        let ties: Vec<_> =
            hits.iter().filter(|h| Some(&h.2) == least).map(|h| (h.0, h.1)).collect();
        let found = closest(&ray, (0..).zip(tris.iter().copied()));
        prop_assert_eq!(found.as_ref().map_or(vec![], |f| f.ties.clone()), ties);
        let mesh = TriangleMesh::from_triangles(&tris).unwrap();
        prop_assert_eq!(closest_in_mesh(&ray, &mesh), found);
        for pair in hits.windows(2) {
            let order = compare_t(&ray, &tris[pair[0].0 as usize], &tris[pair[1].0 as usize]);
            prop_assert_eq!(order, pair[0].2.cmp(&pair[1].2));
        }
    }
}

#[test]
fn fans_of_a_grid_share_corners_and_edges() {
    // 4 × 4 cells of two triangles in z = 0, seen from above.
    let corner = |k: u8| Vec3::new(f32::from(k % 5), f32::from(k / 5), 0.0);
    let cells = (0..4_u32).flat_map(|y| (0..4).map(move |x| 5 * y + x));
    let indices = cells.flat_map(|a| [[a, a + 1, a + 5], [a + 5, a + 1, a + 6]]).collect();
    let mesh = TriangleMesh::new((0..25).map(corner).collect(), indices).unwrap();
    let down = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 2.0), Vec3::NEG_Z);
    for (x, y, count) in [
        (0.0, 0.0, 1),
        (4.0, 0.0, 2),
        (2.0, 0.0, 3),
        (2.0, 2.0, 6),
        (2.5, 2.0, 2),
        (1.5, 1.5, 2),
        (1.25, 1.25, 1),
        (1.0 + 2.0_f32.powi(-23), 1.5, 1),
        (-0.0, 0.5, 1),
        (-1e-45, 0.5, 0),
        (4.0_f32.next_up(), 0.5, 0),
    ] {
        let hit = closest_in_mesh(&down(x, y), &mesh);
        assert_eq!(hit.as_ref().map_or(0, |h| h.ties.len()), count, "({x}, {y})");
        if let Some(hit) = hit {
            assert_eq!(hit.t, 2.0);
            let border = hit.ties.iter().all(|tie| tie.1 == Contact::Border);
            assert_eq!(border, count != 1 || x == 0.0, "({x}, {y})");
        }
    }
}

#[test]
fn the_ends_of_the_range_belong_to_it() {
    let tri = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let ray = Ray::new(Vec3::new(0.25, 0.25, 3.0), Vec3::NEG_Z);
    for (t_min, t_max, hit) in [
        (3.0, 3.0, true),
        (0.0, 3.0, true),
        (3.0, f32::INFINITY, true),
        (3.0_f32.next_up(), f32::INFINITY, false),
        (0.0, 3.0_f32.next_down(), false),
        (4.0, 2.0, false),
        (f32::NEG_INFINITY, f32::INFINITY, true),
        (f32::INFINITY, f32::INFINITY, false),
        (f32::NAN, 9.0, false),
        (0.0, f32::NAN, false),
    ] {
        assert_eq!(contact(&ray.with_range(t_min, t_max), &tri).is_hit(), hit, "{t_min} {t_max}");
    }
    // Nothing behind the origin is hit, whatever the range.
    let behind = Ray::new(Vec3::new(0.25, 0.25, -3.0), Vec3::NEG_Z);
    for t_min in [-4.0, f32::NEG_INFINITY] {
        let ray = behind.with_range(t_min, f32::INFINITY);
        assert_eq!(contact(&ray, &tri), Contact::Miss);
        assert_eq!(contact(&ray.with_range(t_min, -1.0), &tri), Contact::Miss);
        assert_eq!(t(&ray, &tri), None);
        let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]).unwrap();
        assert_eq!(settle_any(&ray, &mesh, true, false), Verdict::OursWrong);
    }
    // Behind, and from the surface itself.
    assert_eq!(contact(&Ray::new(Vec3::new(0.25, 0.25, -3.0), Vec3::NEG_Z), &tri), Contact::Miss);
    assert_eq!(t(&Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::NEG_Z), &tri), Some(0.0));
}

#[test]
fn what_counts_as_a_miss() {
    let tri = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let mesh = TriangleMesh::from_triangles(&[tri]).unwrap();
    for ray in niwaki_hard_cases::bad_rays(&mesh) {
        assert_eq!(contact(&ray, &tri), Contact::Miss, "{ray:?}");
        assert_eq!(closest_in_mesh(&ray, &mesh), None, "{ray:?}");
    }
    // In the plane, through the middle.
    assert_eq!(contact(&Ray::new(Vec3::new(-1.0, 0.25, 0.0), Vec3::X), &tri), Contact::Miss);
    let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
    for bad in [f32::NAN, f32::INFINITY] {
        let broken = Triangle::new(Vec3::ZERO, Vec3::X * bad, Vec3::Y);
        assert_eq!(contact(&ray, &broken), Contact::Miss);
        assert_eq!(compare_t(&ray, &tri, &broken), Ordering::Less);
        assert_eq!(border_distance_ulps(&ray, &broken), f64::INFINITY);
    }
}

#[test]
fn known_values() {
    let cases = niwaki_hard_cases::meshes();
    let find = |name| &cases.iter().find(|c| c.name == name).unwrap().mesh;
    // pbrt's collinear triangle: also for rays aimed at its corners and its middle.
    let collinear = find("pbrt_collinear");
    let tri = collinear.triangle(0);
    for target in [tri.v0, tri.v1, tri.v2, (tri.v0 + tri.v1) * 0.5] {
        let origin = Vec3::new(-1081.477, -83.0, -50.0);
        assert_eq!(contact(&Ray::new(origin, target - origin), &tri), Contact::Miss);
    }
    // Embree's split-epsilon pair covers its rectangle without a gap along the diagonal.
    let pair = find("embree_split_epsilon");
    let (a, b) = (pair.triangle(0).v1, pair.triangle(0).v2);
    for i in 0..=1000_u16 {
        let on = a + (b - a) * (f32::from(i) / 1000.0);
        let on = on.clamp(pair.bounds().min, pair.bounds().max);
        let hit = closest_in_mesh(&Ray::new(on.with_z(0.0), Vec3::Z), pair);
        assert_eq!(hit.map(|h| h.t), Some(34.0), "{on:?}");
    }
    // Triangles without area are never hit, whatever the rays.
    for name in ["points", "scattered_points", "collinear"] {
        let mesh = find(name);
        for ray in niwaki_hard_cases::rays(mesh, 20, 5) {
            assert_eq!(closest_in_mesh(&ray, mesh), None, "{name} {ray:?}");
        }
    }
}

#[test]
fn closed_meshes_are_closed_for_every_ray_from_inside() {
    for (size, offset) in [
        (1.0, Vec3::ZERO),
        (1.0, Vec3::new(1e3, 7e2, -1.3e3)),
        (1e-30, Vec3::ZERO),
        (1e30, Vec3::ZERO),
    ] {
        let mesh = niwaki_hard_cases::closed_star(2, size, offset, 7);
        for mut ray in niwaki_hard_cases::aimed_at_borders(&mesh, 150, 3) {
            // From near the middle, at what the ray was aimed at.
            let target = ray.origin + ray.direction;
            ray.origin = offset + Vec3::new(0.01, -0.02, 0.03) * size;
            ray.direction = target - ray.origin;
            let hit = closest_in_mesh(&ray, &mesh);
            assert!(hit.is_some(), "{ray:?} leaves the mesh of size {size}");
        }
    }
}

/// `t` by Möller and Trumbore 1997, in the form with the normal, in f32.
fn from_first_corner(ray: &Ray, tri: &Triangle) -> f64 {
    let normal = (tri.v1 - tri.v0).cross(tri.v2 - tri.v0);
    f64::from(normal.dot(tri.v0 - ray.origin) / normal.dot(ray.direction))
}

/// A needle of 190 units of length and 4 of width, hit at its blunt end.
#[test]
fn the_far_end_of_a_needle_makes_a_worse_first_corner() {
    let ray = Ray::new(Vec3::new(3.999998, 1.0, 1.0), Vec3::new(-2.999998, 125.0, 0.0));
    let far = Vec3::new(107.999954, 107.99993, 107.99991);
    let tri = Triangle::new(far, Vec3::new(4.0, 1.0, 1.0), Vec3::ZERO);
    let exact = t(&ray, &tri).unwrap();
    let bound = |anchor| t_error_bound(&ray, &tri, anchor);
    let error = (from_first_corner(&ray, &tri) - exact).abs();
    assert!(error <= bound(Anchor::First), "{error:e}");
    assert!(bound(Anchor::First) > 10.0 * bound(Anchor::Best));
    let turned = Triangle::new(tri.v1, tri.v2, tri.v0);
    let error = (from_first_corner(&ray, &turned) - exact).abs();
    assert!(error <= bound(Anchor::Best), "{error:e}");
}

#[test]
fn the_error_bound_of_t_holds_for_plain_f32_and_is_not_vacuous() {
    let (mut tested, mut tight) = (0, 0);
    let mesh = niwaki_hard_cases::closed_star(3, 1.0, Vec3::new(10.0, 0.0, 0.0), 7);
    for ray in niwaki_hard_cases::rays(&mesh, 60, 9) {
        for tri in mesh.triangles() {
            let Some(exact) = t(&ray, &tri) else { continue };
            // Möller and Trumbore 1997 in f32.
            let (e1, e2) = (tri.v1 - tri.v0, tri.v2 - tri.v0);
            let p = ray.direction.cross(e2);
            let s = ray.origin - tri.v0;
            let found = f64::from(e2.dot(s.cross(e1)) / e1.dot(p));
            if !found.is_finite() || ray.direction.length_squared() < 1e-30 {
                continue;
            }
            let bound = t_error_bound(&ray, &tri, Anchor::First);
            assert!((found - exact).abs() <= bound, "{ray:?} {tri:?}: {found} {exact} ± {bound}");
            tested += 1;
            tight += u32::from(bound <= 1e-4 * exact.abs());
        }
    }
    assert!(tested > 200 && tight * 10 > tested * 7, "{tight} of {tested} bounds are tight");
}
