//! Verdicts on answers whose worth is known.

use niwaki_core::{Hit, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_exact::{
    Anchor, Claim, SettleOptions, Side, Verdict, settle, settle_any, settle_any_among,
    settle_any_with, settle_with, t_error_bound,
};

/// Two unit squares of two triangles each, at z = 0 (0, 1) and z = −1 (2, 3), a copy of triangle
/// 0 (4), and two without area, of three corners (5) and of two (6).
fn scene() -> TriangleMesh {
    let square = |z: f32| {
        let [a, b, c, d] =
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        [Triangle::new(a, b, c), Triangle::new(c, b, d)]
    };
    let flat = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X * 2.0);
    let mut triangles = [square(0.0), square(-1.0)].concat();
    let needle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X);
    triangles.extend([triangles[0], flat, needle]);
    TriangleMesh::from_triangles(&triangles).unwrap()
}

fn down(x: f32, y: f32) -> Ray {
    Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z)
}

fn hit(prim_id: u32, t: f32) -> Hit {
    Hit { t, u: 0.0, v: 0.0, prim_id }
}

#[test]
fn each_verdict() {
    use Verdict::{Agree, OursWrong, PeerWrong, Rounding, Tie};
    let mesh = scene();
    let middle = down(0.25, 0.25);
    let edge = down(0.5, 0.5);
    let step = f32::EPSILON;
    let inside_edge = down(0.5, 0.5 - 2.0 * step);
    let outside = down(-2.0 * step, 0.25);
    let far_outside = down(-0.01, 0.25);
    let one_ulp_far = 1.0_f32.next_up();
    for (name, ray, ours, theirs, verdict) in [
        ("both miss", far_outside, Hit::MISS, Hit::MISS, Agree),
        ("same", middle, hit(0, 1.0), hit(0, 1.0), Agree),
        ("same, t rounded", middle, hit(0, 1.0), hit(0, one_ulp_far), Agree),
        ("our t is off", middle, hit(0, 1.1), hit(0, 1.0), OursWrong),
        ("their t is off", middle, hit(0, 1.0), hit(0, 1.1), PeerWrong),
        ("their t is NaN", middle, hit(0, 1.0), hit(0, f32::NAN), PeerWrong),
        ("both t are off", middle, hit(0, 2.0), hit(0, 2.0), OursWrong),
        ("coincident", middle, hit(0, 1.0), hit(4, 1.0), Tie),
        ("shared edge", edge, hit(1, 1.0), hit(0, 1.0), Tie),
        ("just beside the shared edge", inside_edge, hit(1, 1.0), hit(0, 1.0), Tie),
        ("they miss", middle, hit(0, 1.0), Hit::MISS, PeerWrong),
        ("we miss", middle, Hit::MISS, hit(0, 1.0), OursWrong),
        ("they go through", middle, hit(0, 1.0), hit(2, 2.0), PeerWrong),
        ("we go through", middle, hit(2, 2.0), hit(0, 1.0), OursWrong),
        ("we gain beside the border", outside, hit(0, 1.0), Hit::MISS, Rounding),
        ("they gain beside the border", outside, Hit::MISS, hit(0, 1.0), Rounding),
        ("we gain far from the border", far_outside, hit(0, 1.0), Hit::MISS, OursWrong),
        ("they gain far from the border", far_outside, Hit::MISS, hit(0, 1.0), PeerWrong),
        ("wrong neighbour", middle, hit(0, 1.0), hit(1, 1.0), PeerWrong),
        ("no such primitive", middle, hit(0, 1.0), hit(77, 1.0), PeerWrong),
        ("without area", down(0.5, 0.0), hit(0, 1.0), hit(5, 1.0), PeerWrong),
        ("without area, alone", down(1.5, 0.0), hit(5, 1.0), Hit::MISS, OursWrong),
        ("with equal corners", down(0.5, 0.0), hit(0, 1.0), hit(6, 1.0), PeerWrong),
        ("behind t_max", middle.with_range(0.0, 0.5), Hit::MISS, hit(0, 1.0), PeerWrong),
        ("at t_max", middle.with_range(0.0, 1.0), Hit::MISS, hit(0, 1.0), Rounding),
        // Both are wrong in different ways: only the scan finds what both missed.
        ("both go through", middle, hit(2, 2.0), hit(77, 1.0), OursWrong),
        ("we miss, they invent", middle, Hit::MISS, hit(1, 1.0), OursWrong),
        ("NaN ray", Ray::new(Vec3::NAN, Vec3::X), Hit::MISS, hit(0, 1.0), PeerWrong),
    ] {
        assert_eq!(settle(&ray, &mesh, &ours, &theirs), verdict, "{name}");
    }
}

#[test]
fn a_triangle_without_area_counts_where_it_closes_a_seam() {
    let mesh = niwaki_hard_cases::seamed_octahedron(Vec3::ZERO);
    // The fourth triangle lies on the edge from (3, 0, 0) to (0, 3, 0).
    let (origin, at) = (Vec3::ZERO, Vec3::new(1.0, 2.0, 0.0));
    let ray = Ray::new(origin, at);
    assert_eq!(settle(&ray, &mesh, &hit(3, 1.0), &hit(1, 1.0)), Verdict::Tie);
    assert_eq!(settle(&ray, &mesh, &hit(3, 1.5), &hit(1, 1.0)), Verdict::OursWrong);
    let without = TriangleMesh::new(mesh.positions().to_vec(), mesh.indices()[1..].to_vec());
    assert_eq!(settle(&ray, &without.unwrap(), &hit(2, 1.0), &hit(0, 1.0)), Verdict::OursWrong);
}

#[test]
fn the_scan_finds_what_both_missed() {
    let mesh = scene();
    let blind = SettleOptions { scan: false, ..SettleOptions::default() };
    let (ours, theirs) = (hit(2, 2.0), hit(77, 1.0));
    let ray = down(0.25, 0.25);
    assert_eq!(settle_with(&ray, &mesh, &ours, &theirs, &blind).verdict, Verdict::PeerWrong);
    let seen = settle_with(&ray, &mesh, &ours, &theirs, &SettleOptions::default());
    assert!(matches!(seen.missed, Some(Claim::Hit { prim_id: 0 | 4, certain: true, .. })));
    assert_eq!(seen.theirs, Claim::NoSuchPrimitive { prim_id: 77 });
}

#[test]
fn rays_in_the_plane_are_rounding_where_the_triangle_is() {
    let mesh = scene();
    let along = Ray::new(Vec3::new(-1.0, 0.25, 0.0), Vec3::X);
    assert_eq!(settle(&along, &mesh, &Hit::MISS, &hit(0, 1.5)), Verdict::Rounding);
    assert_eq!(settle(&along, &mesh, &Hit::MISS, &hit(0, 9.0)), Verdict::PeerWrong);
    let beside = Ray::new(Vec3::new(-1.0, 1.25, 0.0), Vec3::X);
    assert_eq!(settle(&beside, &mesh, &Hit::MISS, &hit(0, 1.5)), Verdict::PeerWrong);
}

#[test]
fn verdicts_on_any_hit() {
    use Verdict::{Agree, OursWrong, PeerWrong, Rounding};
    let mesh = scene();
    let beside = down(-2.0 * f32::EPSILON, 0.25);
    for (ray, ours, theirs, verdict) in [
        (down(0.25, 0.25), true, true, Agree),
        (down(0.25, 0.25), true, false, PeerWrong),
        (down(0.25, 0.25), false, true, OursWrong),
        (down(-0.5, 0.25), true, false, OursWrong),
        (down(-0.5, 0.25), false, true, PeerWrong),
        (beside, true, false, Rounding),
        (beside, false, true, Rounding),
        // The shared edge alone decides nothing.
        (down(0.5, 0.5).with_range(0.0, 1.5), false, true, Rounding),
    ] {
        assert_eq!(settle_any(&ray, &mesh, ours, theirs), verdict, "{ray:?} {ours} {theirs}");
        let all = (0..).zip(mesh.triangles());
        let among = settle_any_among(&ray, all, ours, theirs, &SettleOptions::default());
        assert_eq!(among, verdict);
    }
}

/// A certain triangle (0) at the exact distance `at` of the ray, and a sliver (1) at 10 that the
/// ray meets at so grazing an angle that its `t` is uncertain by 4 to 7.
fn grazing(at: f32) -> (TriangleMesh, Ray) {
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let wall = Triangle::new(
        Vec3::new(at, -1.0, -1.0),
        Vec3::new(at, 2.0, -1.0),
        Vec3::new(at, -1.0, 2.0),
    );
    // In the plane y = 2⁻¹⁸ · (x − 10); all corners are exact.
    let point = |x: f32, z: f32| Vec3::new(x, (x - 10.0) / 262_144.0, z);
    let sliver = Triangle::new(point(2.0, -1.0), point(18.0, -1.0), point(10.0, 4.0));
    (TriangleMesh::from_triangles(&[wall, sliver]).unwrap(), ray)
}

#[test]
fn a_large_error_bound_of_one_triangle_does_not_excuse_the_loss_of_another() {
    use Verdict::{OursWrong, PeerWrong, Tie};
    let (mesh, ray) = grazing(6.0);
    let bound = t_error_bound(&ray, &mesh.triangle(1), Anchor::Best);
    assert!((4.0..7.0).contains(&bound), "{bound}");
    for (name, at, sliver_t, verdict) in [
        ("the wall is before what was reported", 6.0, 10.2, OursWrong),
        ("so it is where the sliver came out too near", 6.0, 6.5, OursWrong),
        ("the sliver came out before the wall", 8.0, 7.5, Tie),
        ("the sliver came out at the wall", 8.0, 8.0, Tie),
        ("the wall is behind both", 12.0, 10.2, Tie),
        ("the wall is behind the sliver, which came out behind it", 12.0, 12.5, OursWrong),
    ] {
        let (mesh, ray) = grazing(at);
        let (sliver, wall) = (hit(1, sliver_t), hit(0, at));
        assert_eq!(settle(&ray, &mesh, &sliver, &wall), verdict, "{name}");
        let other = if verdict == OursWrong { PeerWrong } else { verdict };
        assert_eq!(settle(&ray, &mesh, &wall, &sliver), other, "{name}, the sides exchanged");
        // Where the peer's claim is false, the scan must find the same.
        let scanned = if verdict == OursWrong { OursWrong } else { PeerWrong };
        assert_eq!(settle(&ray, &mesh, &sliver, &hit(77, 1.0)), scanned, "{name}, by the scan");
    }
}

#[test]
fn rounding_has_a_side() {
    use Side::{Ours, Theirs};
    let mesh = scene();
    let step = f32::EPSILON;
    let (edge, outside) = (down(0.0, 0.25), down(-2.0 * step, 0.25));
    let inside = down(2.0 * step, 0.25);
    let at_end = down(0.25, 0.25).with_range(0.0, 1.0);
    let at_start = down(0.25, 0.25).with_range(1.0, 1.5);
    let before_end = down(0.25, 0.25).with_range(0.0, 1.0_f32.next_down());
    let only = SettleOptions { scan: false, ..SettleOptions::default() };
    for (name, ray, ours, theirs, side) in [
        ("we lose an interior hit", inside, Hit::MISS, hit(0, 1.0), Ours),
        ("they lose an interior hit", inside, hit(0, 1.0), Hit::MISS, Theirs),
        ("we lose a border hit", edge, Hit::MISS, hit(0, 1.0), Ours),
        ("we gain a hit", outside, hit(0, 1.0), Hit::MISS, Ours),
        ("they gain a hit", outside, Hit::MISS, hit(0, 1.0), Theirs),
        ("we exclude t_max", at_end, Hit::MISS, hit(0, 1.0), Ours),
        ("they exclude t_min", at_start, hit(0, 1.0), Hit::MISS, Theirs),
        ("they go past t_max", before_end, Hit::MISS, hit(0, 1.0), Theirs),
        ("we go through at a border", edge, hit(2, 2.0), hit(0, 1.0), Ours),
        ("they go through at a border", edge, hit(0, 1.0), hit(2, 2.0), Theirs),
    ] {
        for options in [SettleOptions::default(), only] {
            let settled = settle_with(&ray, &mesh, &ours, &theirs, &options);
            assert_eq!(settled.verdict, Verdict::Rounding, "{name}");
            assert_eq!(settled.rounding_side, Some(side), "{name}");
        }
    }
    // One leaks through the shared edge, the other reports the side of it that the ray misses.
    let beside = down(0.5, 0.5 - 2.0 * step).with_range(0.0, 1.5);
    let settled = settle_with(&beside, &mesh, &hit(1, 1.0), &Hit::MISS, &SettleOptions::default());
    assert_eq!((settled.verdict, settled.rounding_side), (Verdict::Rounding, None));
    // Nothing else has a side.
    let clear = settle_with(&down(0.25, 0.25), &mesh, &hit(0, 1.0), &Hit::MISS, &only);
    assert_eq!((clear.verdict, clear.rounding_side), (Verdict::PeerWrong, None));
}

#[test]
fn rounding_of_any_hit_has_a_side() {
    use Side::{Ours, Theirs};
    let mesh = scene();
    let step = f32::EPSILON;
    let middle = down(0.25, 0.25);
    for (ray, with_hit_is_wrong) in [
        (down(-2.0 * step, 0.25), true),
        (down(2.0 * step, 0.25), false),
        (down(0.0, 0.25), false),
        (middle.with_range(0.0, 1.0), false),
        (middle.with_range(2.0, 3.0), false),
        (middle.with_range(0.0, 1.0_f32.next_down()), true),
    ] {
        for ours in [true, false] {
            let settled = settle_any_with(&ray, &mesh, ours, !ours, &SettleOptions::default());
            let side = if ours == with_hit_is_wrong { Ours } else { Theirs };
            assert_eq!(settled.verdict, Verdict::Rounding, "{ray:?} {ours}");
            assert_eq!(settled.rounding_side, Some(side), "{ray:?} {ours}");
        }
    }
    let clear = settle_any_with(&middle, &mesh, true, false, &SettleOptions::default());
    assert_eq!((clear.verdict, clear.rounding_side), (Verdict::PeerWrong, None));
}

#[test]
fn triangles_that_are_points_from_afar_have_an_error_bound() {
    // Their corners are 10⁻³⁸ apart, which f64 cannot tell as seen from a distance of 1.
    let m = f32::MIN_POSITIVE;
    let (a, b, c) = (Vec3::new(m, -m, 0.0), Vec3::new(0.0, -m, m), Vec3::new(-m, m, 1.0));
    let mesh = TriangleMesh::new(vec![a, b, c, Vec3::splat(-m)], vec![[0, 1, 2], [0, 2, 3]]);
    let mesh = mesh.unwrap();
    let ray = Ray::new(Vec3::ONE, Vec3::NEG_ONE);
    for triangle in mesh.triangles() {
        assert!(t_error_bound(&ray, &triangle, Anchor::Best) > 0.0, "{triangle:?}");
    }
    // Whichever is hit, and whether, is rounding.
    for (ours, theirs) in
        [(hit(0, 1.0), hit(1, 1.0)), (Hit::MISS, hit(1, 1.0)), (hit(0, 1.0), Hit::MISS)]
    {
        let verdict = settle(&ray, &mesh, &ours, &theirs);
        assert!(
            matches!(verdict, Verdict::Tie | Verdict::Rounding),
            "{ours:?} {theirs:?}: {verdict}"
        );
    }
}

#[test]
fn a_hit_as_far_as_f32_reaches_may_be_missed() {
    let at = |z: f32| {
        let corners = [(-1e38, -1e38), (1e38, -1e38), (0.0, 1e38)];
        let positions = corners.map(|(x, y)| Vec3::new(x, y, z)).to_vec();
        TriangleMesh::new(positions, vec![[0, 1, 2]]).unwrap()
    };
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    assert_eq!(settle(&ray, &at(f32::MAX), &Hit::MISS, &hit(0, f32::MAX)), Verdict::Rounding);
    assert_eq!(settle(&ray, &at(3e38), &Hit::MISS, &hit(0, 3e38)), Verdict::OursWrong);
}
