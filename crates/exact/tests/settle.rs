//! Verdicts on answers whose worth is known.

use niwaki_core::{Hit, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_exact::{
    Claim, SettleOptions, Verdict, settle, settle_any, settle_any_among, settle_with,
};

/// Two unit squares of two triangles each, at z = 0 (0, 1) and z = −1 (2, 3), a copy of triangle
/// 0 (4), and one without area (5).
fn scene() -> TriangleMesh {
    let square = |z: f32| {
        let [a, b, c, d] =
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        [Triangle::new(a, b, c), Triangle::new(c, b, d)]
    };
    let flat = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X * 2.0);
    let mut triangles = [square(0.0), square(-1.0)].concat();
    triangles.extend([triangles[0], flat]);
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
