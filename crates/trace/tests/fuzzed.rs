//! What fuzz targets have found, each case by what it is.

use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh, glam::Vec3};
use niwaki_exact::{Verdict, closest_in_mesh, settle};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{BinaryScene, Mode, WideScene, brute_force_in};
use niwaki_wide::{CollapseSettings, WideBvh};

/// Calls `f` with every kernel over the mesh in both modes, brute force included.
fn each_kernel(mesh: &TriangleMesh, mut f: impl FnMut(&str, &dyn Fn(&Ray) -> Hit)) {
    fn width<const W: usize>(
        mode: Mode,
        mesh: &TriangleMesh,
        f: &mut impl FnMut(&str, &dyn Fn(&Ray) -> Hit),
    ) where
        WideScene<W>: Intersector,
    {
        let bvh = median_tree(mesh, 1);
        let wide = WideBvh::<W>::collapse(&bvh, &CollapseSettings::default()).unwrap();
        let scene = WideScene::build_in(mode, wide, mesh).unwrap();
        for kernel in WideScene::<W>::kernels() {
            let scene = scene.clone().with_kernel(kernel).unwrap();
            f(&format!("{kernel}, {W} wide, {mode}"), &|ray| scene.closest_hit(ray));
        }
    }
    for mode in Mode::ALL {
        f(&format!("brute force, {mode}"), &|ray| brute_force_in(mode, mesh, ray));
        let binary = BinaryScene::new_in(mode, &median_tree(mesh, 1), mesh).unwrap();
        f(&format!("binary, {mode}"), &|ray| binary.closest_hit(ray));
        width::<4>(mode, mesh, &mut f);
        width::<8>(mode, mesh, &mut f);
        width::<16>(mode, mesh, &mut f);
    }
}

#[test]
fn a_scene_from_the_least_to_the_largest_f32_is_hit() {
    // Its extent is no f32.
    let m = f32::MAX;
    let corners = [(m, m, 0.0), (-m, -m, 1.0), (0.0, -m, m), (-m, -m, -m)];
    let positions = corners.map(|(x, y, z)| Vec3::new(x, y, z)).to_vec();
    let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let mesh = TriangleMesh::new(positions, faces).unwrap();
    let ray = Ray::new(Vec3::new(4.0, 0.0, -0.0), Vec3::X);
    let exact = closest_in_mesh(&ray, &mesh).unwrap();
    assert!((exact.t / f64::from(m) - 0.25).abs() < 1e-6, "{exact:?}");
    let theirs = Hit {
        t: niwaki_core::float::round_down(exact.t),
        u: 0.0,
        v: 0.0,
        prim_id: exact.ties[0].0,
    };
    each_kernel(&mesh, |name, closest| {
        let hit = closest(&ray);
        assert!(hit.is_hit(), "{name}");
        assert_ne!(settle(&ray, &mesh, &hit, &theirs), Verdict::OursWrong, "{name}: {hit:?}");
    });
}

#[test]
fn hits_of_denormal_rays_are_in_range() {
    let positions = vec![Vec3::ZERO, Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
    let mesh = TriangleMesh::new(positions, vec![[0, 1, 2]]).unwrap();
    let least = f32::from_bits(1);
    // The plane of the triangle is met at t = 0; the range begins after that, by less than a
    // distance in units of the scene can say.
    let direction = Vec3::new(least, 0.0, 0.0);
    let on_it = Ray::new(Vec3::new(0.0, 0.25, 0.25), direction);
    for t_min in [0.0, least, 1e-30, 0.0078125, 0.5, 1.0, 1.4, 1e10] {
        let ray = on_it.with_range(t_min, f32::INFINITY);
        each_kernel(&mesh, |name, closest| {
            let hit = closest(&ray);
            assert_eq!(hit.is_hit(), t_min == 0.0, "{name}: {hit:?} of {ray:?}");
        });
    }
    // And before it, by t = 1.
    let before = Ray::new(Vec3::new(-least, 0.25, 0.25), direction);
    for (t_min, t_max) in [(0.0, 0.7), (0.0, 1.4), (0.7, 1.0), (1.0, 1.4), (1.4, 1.4), (0.6, 0.9)] {
        let ray = before.with_range(t_min, t_max);
        each_kernel(&mesh, |name, closest| {
            let hit = closest(&ray);
            assert!(
                !hit.is_hit() || (t_min..=t_max).contains(&hit.t),
                "{name}: {hit:?} of {ray:?}"
            );
            let exact = closest_in_mesh(&ray, &mesh).map_or(Hit::MISS, |exact| Hit {
                t: 1.0,
                prim_id: exact.ties[0].0,
                ..Hit::MISS
            });
            assert_ne!(settle(&ray, &mesh, &hit, &exact), Verdict::OursWrong, "{name}: {hit:?}");
        });
    }
}

#[test]
fn minus_zero_is_the_end_of_a_range_as_zero_is() {
    let mesh = soup_mesh(60, 0.8, 4);
    let bvh = median_tree(&mesh, 1);
    fn each_width<const W: usize>(bvh: &Bvh, mesh: &TriangleMesh)
    where
        WideScene<W>: Intersector,
    {
        for mode in Mode::ALL {
            let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).unwrap();
            let scene = WideScene::build_in(mode, wide, mesh).unwrap();
            for kernel in WideScene::<W>::kernels() {
                let scene = scene.clone().with_kernel(kernel).unwrap();
                let rays = mesh
                    .triangles()
                    .map(|t| Ray::new((t.v0 + t.v1 + t.v2) / 3.0 - Vec3::X * 0.01, Vec3::X));
                for ray in rays {
                    let any = [0.0, -0.0].map(|end| scene.any_hit(&ray.with_range(-0.0, end)));
                    assert_eq!(any, [false; 2], "{kernel}, {W} wide, {mode}: {ray:?}");
                }
            }
        }
    }
    each_width::<4>(&bvh, &mesh);
    each_width::<8>(&bvh, &mesh);
    each_width::<16>(&bvh, &mesh);
}

#[test]
fn the_fast_mode_misses_triangles_without_area() {
    // On one line, exactly; rounded products of its edges differ.
    let on_line = |s: f32| Vec3::new(18.132_813, 2.0, -f32::MIN_POSITIVE) * s;
    let positions = [1.0, 0.671_875, 0.005_249_023].map(on_line).to_vec();
    let mesh = TriangleMesh::new(positions, vec![[0, 1, 2]]).unwrap();
    let ray = Ray::new(Vec3::ZERO, Vec3::new(3.0117188, 0.0, 1.0));
    assert_eq!(closest_in_mesh(&ray, &mesh), None);
    each_kernel(&mesh, |name, closest| {
        let hit = closest(&ray);
        assert_eq!(hit, Hit::MISS, "{name}");
    });
}
