//! The kernel in double precision.

use fastrand::Rng;
use niwaki_core::{
    BuildError, Builder, Bvh, Intersector, PrimRef, Ray, TriangleMesh,
    glam::{DVec3, Vec3},
};
use niwaki_hard_cases::{closed_star, median_tree, soup_mesh};
use niwaki_trace::{DoubleRay, DoubleScene, DoubleSceneError, WideScene};

/// [`median_tree`] over references.
struct Median;

impl Builder for Median {
    fn name(&self) -> &'static str {
        "median"
    }
    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        let flat = |p: &PrimRef| niwaki_core::Triangle::new(p.min, p.max, p.min);
        let boxes: Vec<_> = prims.iter().map(flat).collect();
        Ok(median_tree(&TriangleMesh::from_triangles(&boxes).expect("finite"), 2))
    }
    fn memory_bound(&self, count: usize) -> usize {
        200 * count
    }
}

/// A mesh in double precision, scaled and moved.
fn placed(mesh: &TriangleMesh, scale: f64, offset: DVec3) -> (Vec<DVec3>, DoubleScene) {
    let positions: Vec<_> =
        mesh.positions().iter().map(|v| v.as_dvec3() * scale + offset).collect();
    let scene = DoubleScene::new(&Median, &positions, mesh.indices()).unwrap();
    (positions, scene)
}

#[test]
fn stars_far_from_the_origin_keep_their_rays() {
    let star = closed_star(4, 1.0, Vec3::ZERO, 5);
    for (scale, offset) in [
        (1.0, DVec3::ZERO),
        (1.0, DVec3::new(1.5e11, -3e10, 7e9)),
        (1e-200, DVec3::ZERO),
        (1e140, DVec3::ZERO),
        (1e-3, DVec3::splat(1e8)),
    ] {
        let (positions, scene) = placed(&star, scale, offset);
        let mut rng = Rng::with_seed(1);
        for _ in 0..5_000 {
            let [a, b, _] = star.indices()[rng.usize(0..star.len())].map(|i| positions[i as usize]);
            let target = if rng.bool() { a } else { a + (b - a) * rng.f64() };
            let origin = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5);
            let origin = origin * (0.5 * scale) + offset;
            let power = 2.0_f64.powi(rng.i32(-100..100));
            let ray = DoubleRay::new(origin, (target - origin) * power);
            let hit = scene.closest_hit(&ray);
            assert!(scene.any_hit(&ray), "leak: {ray:?}");
            let hit = hit.unwrap_or_else(|| panic!("leak: {ray:?}"));
            // The weights and the distance name the same point.
            let corners = star.indices()[hit.prim_id as usize];
            let [a, b, c] = corners.map(|i| positions[i as usize] - origin);
            let by_weights = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
            let by_distance = (target - origin) * (hit.t * power);
            assert!(by_weights.distance(by_distance) <= 1e-14 * scale, "{hit:?} {ray:?}");
        }
    }
}

#[test]
fn hits_agree_with_single_precision() {
    let mesh = soup_mesh(400, 0.3, 3);
    let (_, double) = placed(&mesh, 1.0, DVec3::ZERO);
    let single = WideScene::new(&median_tree(&mesh, 2), &mesh).unwrap();
    let mut rng = Rng::with_seed(2);
    let mut point = || Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 3.0;
    let (mut hits, mut differ) = (0, 0);
    for _ in 0..3_000 {
        let ray = Ray::new(point(), point());
        let hit = single.closest_hit(&ray);
        let found =
            double.closest_hit(&DoubleRay::new(ray.origin.as_dvec3(), ray.direction.as_dvec3()));
        hits += usize::from(hit.is_hit());
        match found {
            Some(found) if found.prim_id == hit.prim_id => {
                assert!((found.t - f64::from(hit.t)).abs() <= 1e-4 * found.t.max(1.0));
            }
            None if !hit.is_hit() => {}
            _ => differ += 1,
        }
    }
    assert!(hits > 300 && differ <= 2, "{differ} of {hits}");
}

#[test]
fn bad_input_is_named_and_bad_rays_miss() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::NAN];
    let bad = |triangle: [u32; 3]| DoubleScene::new(&Median, &corners, &[[0, 1, 2], triangle]);
    for triangle in [[0, 1, 3], [0, 1, 4]] {
        let expected = DoubleSceneError::BadTriangle { triangle: 1 };
        assert_eq!(bad(triangle).unwrap_err(), expected);
    }
    let scene = DoubleScene::new(&Median, &corners, &[[0, 1, 2]]).unwrap();
    let origin = DVec3::new(0.25, 0.25, 1.0);
    let ray = DoubleRay::new(origin, -DVec3::Z);
    assert!(scene.any_hit(&ray));
    for ray in [
        DoubleRay { direction: DVec3::ZERO, ..ray },
        DoubleRay { direction: DVec3::NAN, ..ray },
        DoubleRay { origin: DVec3::INFINITY, ..ray },
        DoubleRay { t_min: 2.0, t_max: 1.0, ..ray },
        DoubleRay { t_max: f64::NAN, ..ray },
        DoubleRay { t_min: f64::NAN, ..ray },
        DoubleRay { t_max: 0.5, ..ray },
        DoubleRay { t_min: 1.5, ..ray },
    ] {
        assert_eq!(scene.closest_hit(&ray), None, "{ray:?}");
    }
    assert!(DoubleScene::new(&Median, &[], &[]).is_ok_and(|empty| !empty.any_hit(&ray)));
}

#[test]
fn triangles_without_area_are_hit_only_where_they_close_a_seam() {
    let mut rng = Rng::with_seed(4);
    let scene = |triangles: &[[u32; 3]], positions: &[DVec3]| {
        DoubleScene::new(&Median, positions, triangles).unwrap()
    };
    for _ in 0..300 {
        // Exact, as the steps are small integers times a power of two.
        let start = DVec3::from([0; 3].map(|_| rng.f64() - 0.5)) * 1e6;
        let start = (start * 1024.0).round() / 1024.0;
        let step = DVec3::from([0; 3].map(|_| f64::from(rng.i32(-9..10))));
        let line = [0.0, 1.0, 0.25].map(|k| start + step * k);
        let origin = start + DVec3::from([0; 3].map(|_| 3.0 * (rng.f64() - 0.5)));
        let ray = DoubleRay::new(origin, line[1] + (line[0] - line[1]) * rng.f64() - origin);
        assert_eq!(scene(&[[0, 1, 2], [2, 0, 1]], &line).closest_hit(&ray), None);
    }
    let mesh = niwaki_hard_cases::seamed_octahedron(Vec3::ZERO);
    // No power of two: middles of edges are still exact, other points are not.
    let (positions, tight) = placed(&mesh, 3.0, DVec3::new(5.0, -7.0, 1e6));
    let open: Vec<_> = mesh.indices().iter().copied().enumerate().collect();
    let open: Vec<_> = open.into_iter().filter(|(i, _)| i % 4 != 3).map(|(_, t)| t).collect();
    let open = scene(&open, &positions);
    let mut lost = 0;
    for _ in 0..20_000 {
        let [a, b, _] = mesh.indices()[4 * rng.usize(0..4) + 3].map(|i| positions[i as usize]);
        let origin = DVec3::new(5.0, -7.0, 1e6) + DVec3::from([0; 3].map(|_| rng.f64() - 0.5));
        let ray = DoubleRay::new(origin, a + (b - a) * rng.f64() - origin);
        assert!(tight.any_hit(&ray), "{ray:?}");
        lost += u32::from(!open.any_hit(&ray));
    }
    assert!(lost > 0, "or the seams need no closing");
}
