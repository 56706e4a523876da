//! Rays that leave a triangle never hit it again (pbrt's Reintersect test), and the offset stays
//! small.

mod common;

use common::single;
use niwaki_build_binned::Binned;
use niwaki_core::{
    Builder, Intersector, Ray, Triangle,
    glam::{DVec3, Vec3},
};
use niwaki_render::offset::{CLEARANCE, offset_origin};
use niwaki_trace::{BinaryScene, WideScene};
use proptest::prelude::*;

/// Coordinates of all magnitudes, as in pbrt's tests.
fn coordinate() -> impl Strategy<Value = f32> {
    (-8.0_f32..8.0, prop::bool::ANY).prop_map(|(e, negative)| {
        let x = 10.0_f32.powf(e);
        if negative { -x } else { x }
    })
}

fn corner() -> impl Strategy<Value = Vec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

/// Directions into the hemisphere of `normal`, half of them grazing.
fn directions(normal: DVec3) -> impl Iterator<Item = Vec3> {
    let (a, b) = normal.any_orthonormal_pair();
    (0..1000).map(move |i| {
        let phi = f64::from(i) * 2.399_963;
        let t = f64::from(i % 500) / 500.0;
        let z = if i < 500 { t } else { 10.0_f64.powf(-1.0 - 7.0 * t) };
        let r = (1.0 - z * z).max(0.0).sqrt();
        (a * (r * phi.cos()) + b * (r * phi.sin()) + normal * z).as_vec3()
    })
}

/// Height over longest edge.
fn thinness(t: &Triangle) -> f64 {
    let [a, b, c] = t.vertices().map(|p| p.as_dvec3());
    let longest = [a - b, b - c, c - a].map(DVec3::length).into_iter().fold(0.0, f64::max);
    2.0 * t.area() / (longest * longest)
}

/// Rays from both sides of a point of the triangle that meet it again, by any kernel.
fn false_hits(t: Triangle, u: f64, v: f64) -> Vec<(Ray, &'static str)> {
    let [a, b, c] = t.vertices().map(|p| p.as_dvec3());
    let Some(normal) = (b - a).cross(c - a).try_normalize() else { return vec![] };
    let mesh = single(t);
    let bvh = Binned::default().build(&mesh.prim_refs()).unwrap();
    let binary = BinaryScene::new(&bvh, &mesh).unwrap();
    let wide = WideScene::new(&bvh, &mesh).unwrap();
    let point = a + (b - a) * u + (c - a) * v;
    let reach = [a, b, c].map(|p| p.distance(point)).into_iter().fold(0.0, f64::max);
    let mut found = vec![];
    for side in [normal, -normal] {
        let origin = offset_origin(point, side.as_vec3(), reach);
        for direction in directions(side) {
            // Rounding the direction may turn a grazing ray into the surface; those may hit.
            if direction.as_dvec3().dot(side) <= 0.0 {
                continue;
            }
            let ray = Ray::new(origin, direction);
            if niwaki_trace::brute_force(&mesh, &ray).is_hit() {
                found.push((ray, "brute force"));
            }
            if binary.any_hit(&ray) {
                found.push((ray, "binary"));
            }
            if wide.any_hit(&ray) {
                found.push((ray, "wide"));
            }
        }
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 1_000_000, ..ProptestConfig::default() })]

    #[test]
    fn no_ray_returns_to_its_triangle(
        a in corner(), b in corner(), c in corner(), u in 0.0_f64..1.0, v in 0.0_f64..1.0,
    ) {
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let triangle = Triangle::new(a, b, c);
        // Of slivers, kernels that compute in `f32` know too little about which way they face: at
        // 1e-5 rays have been seen to return.
        prop_assume!(thinness(&triangle) > 1e-2);
        let found = false_hits(triangle, u, v);
        prop_assert!(found.is_empty(), "{} false hits, {:?}", found.len(), found[0]);
    }

    #[test]
    fn no_ray_returns_to_a_well_shaped_triangle_far_away(
        offset in corner(), size in -4.0_f32..4.0, turn in prop::array::uniform9(-1.0_f32..1.0),
        u in 0.0_f64..1.0, v in 0.0_f64..1.0,
    ) {
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let p = |i: usize| offset + Vec3::from_slice(&turn[i..]) * 10.0_f32.powf(size);
        let found = false_hits(Triangle::new(p(0), p(3), p(6)), u, v);
        prop_assert!(found.is_empty(), "{} false hits, {:?}", found.len(), found[0]);
    }

    #[test]
    fn the_origin_is_off_the_plane_by_the_clearance_and_by_little_more(
        point in corner(), n in prop::array::uniform3(-1.0_f64..1.0), reach in -6.0_f64..6.0,
    ) {
        let Some(normal) = DVec3::from(n).try_normalize() else { return Ok(()) };
        let (normal, reach) = (normal.as_vec3().as_dvec3(), 10.0_f64.powf(reach));
        let point = point.as_dvec3() * 1.000_000_123_4;
        let moved = offset_origin(point, normal.as_vec3(), reach).as_dvec3() - point;
        let wanted = f64::from(CLEARANCE) * reach;
        let rounding = point.abs().element_sum() * f64::EPSILON * 4.0;
        prop_assert!(moved.dot(normal) >= wanted * 0.999_999 - rounding);
        // At most one unit in the last place of each coordinate more.
        let ulp = (point.abs().max_element() + wanted) * f64::from(f32::EPSILON);
        prop_assert!(moved.length() <= wanted * 1.000_001 + 2.0 * ulp);
    }
}

#[test]
fn triangles_in_coordinate_planes_and_known_hard_ones_are_left() {
    let hard = [
        Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y),
        Triangle::new(Vec3::splat(-1e3), Vec3::new(1e3, -1e3, -1e3), Vec3::new(0.0, -1e3, 1e3)),
        // A ground plane of a kilometre under a camera at its middle.
        Triangle::new(Vec3::new(-5e5, 0.0, -5e5), Vec3::Z * 1e6, Vec3::X * 1e6),
        Triangle::new(Vec3::ZERO, Vec3::X * 1e3, Vec3::new(500.0, 1e-6, 0.0)),
        Triangle::new(
            Vec3::new(148_376.0, 1_234.0, -223_423.0),
            Vec3::new(148_377.0, 1_234.0, -223_423.0),
            Vec3::new(148_376.0, 1_235.0, -223_422.0),
        ),
    ];
    for triangle in hard {
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.5, 0.5), (0.25, 0.3), (1e-6, 1e-6)] {
            let found = false_hits(triangle, u, v);
            assert!(found.is_empty(), "{triangle:?} {u} {v}: {:?}", found[0]);
        }
    }
}
