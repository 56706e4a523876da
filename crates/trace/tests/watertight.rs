//! Watertight mode: no ray leaves a closed surface, and every kernel agrees with brute force.

use fastrand::Rng;
use niwaki_core::{
    Bvh, Hit, Intersector, Ray, TriangleMesh,
    glam::{DVec3, Vec3},
};
use niwaki_hard_cases::{
    self as hard, border_point, closed_star, grid_box, median_tree, seamed_octahedron, soup_mesh,
};
use niwaki_trace::{BinaryScene, Mode, QuantisedScene, WideScene, brute_force, brute_force_in};
use niwaki_wide::{CollapseSettings, WideBvh};
use proptest::prelude::*;

/// All watertight kernels over a mesh, by name.
fn kernels(mesh: &TriangleMesh, leaf: usize) -> Vec<(String, Box<dyn Intersector>)> {
    let bvh = median_tree(mesh, leaf);
    let binary = BinaryScene::new(&bvh, mesh).unwrap();
    let mut all: Vec<(String, Box<dyn Intersector>)> =
        vec![("binary".to_owned(), Box::new(binary))];
    add_width::<4>(&bvh, mesh, &mut all);
    add_width::<8>(&bvh, mesh, &mut all);
    add_width::<16>(&bvh, mesh, &mut all);
    all
}

/// The kernels for a width.
fn add_width<const W: usize>(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    all: &mut Vec<(String, Box<dyn Intersector>)>,
) where
    WideScene<W>: Intersector + 'static,
    QuantisedScene<W>: Intersector + 'static,
{
    let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).unwrap();
    let quantised = QuantisedScene::build_in(Mode::Watertight, wide.clone(), mesh).unwrap();
    let scene = WideScene::build_in(Mode::Watertight, wide, mesh).unwrap();
    for kernel in WideScene::<W>::kernels() {
        let name = format!("{kernel}, {W} wide");
        all.push((name.clone(), Box::new(scene.clone().with_kernel(kernel).unwrap())));
        let quantised = quantised.clone().with_kernel(kernel).unwrap();
        all.push((name + ", quantised", Box::new(quantised)));
    }
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim_id]
}

/// In a cube from −1 to 1.
fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 2.0
}

/// Asserts that rays from `origins` to corners and edges all hit, with every kernel.
fn assert_tight(mesh: &TriangleMesh, rays: usize, seed: u64, origin: impl Fn(&mut Rng) -> Vec3) {
    let kernels = kernels(mesh, 2);
    let mut rng = Rng::with_seed(seed);
    for _ in 0..rays {
        let origin = origin(&mut rng);
        let mut direction = border_point(mesh, &mut rng) - origin;
        if rng.u8(0..4) == 0 {
            direction *= 2.0_f32.powi(rng.i32(-60..60));
        }
        let ray = Ray::new(origin, direction);
        if direction == Vec3::ZERO || !direction.is_finite() {
            continue;
        }
        for (name, kernel) in &kernels {
            assert!(kernel.closest_hit(&ray).is_hit(), "{name} leaks {ray:?}");
            assert!(kernel.any_hit(&ray), "{name} leaks {ray:?} (any hit)");
        }
    }
}

#[test]
fn all_kernels_give_the_bits_of_brute_force_on_every_hard_case() {
    for case in hard::meshes() {
        let mesh = &case.mesh;
        let small = mesh.len() <= 3_000;
        let kernels = kernels(mesh, 2);
        let mut rays = hard::rays(mesh, if small { 30 } else { 1 }, 11);
        rays.extend(hard::aimed_at_borders(mesh, if small { 60 } else { 2 }, 12));
        for ray in &rays {
            let expected = brute_force_in(Mode::Watertight, mesh, ray);
            for (name, kernel) in &kernels {
                let hit = kernel.closest_hit(ray);
                assert_eq!(
                    bits(&hit),
                    bits(&expected),
                    "{} {name}: {hit:?} {expected:?} {ray:?}",
                    case.name
                );
                assert_eq!(kernel.any_hit(ray), hit.is_hit(), "{} {name} {ray:?}", case.name);
            }
        }
    }
}

#[test]
fn stars_of_every_size_and_place_keep_their_rays() {
    for (size, offset) in [
        (1.0, Vec3::ZERO),
        (1.0, Vec3::new(1e3, 7e2, -1.3e3)),
        (1e-6, Vec3::ZERO),
        (1e6, Vec3::ZERO),
        (1e-30, Vec3::ZERO),
        (1e30, Vec3::ZERO),
        (1e-38, Vec3::ZERO),
        (1e3, Vec3::new(1e7, -1e7, 1e7)),
        (1e-20, Vec3::new(1e-15, 0.0, -1e-16)),
        (1e25, Vec3::new(1e29, 1e29, 0.0)),
    ] {
        let mesh = closed_star(4, size, offset, 3);
        assert_tight(&mesh, 3_000, 1, |rng| point(rng) * (0.25 * size) + offset);
    }
}

#[test]
fn the_fast_mode_loses_what_the_watertight_one_keeps() {
    let mesh = closed_star(4, 1.0, Vec3::ZERO, 3);
    let fast = WideScene::new_in(Mode::Fast, &median_tree(&mesh, 2), &mesh).unwrap();
    assert_eq!(fast.mode(), Mode::Fast);
    let mut rng = Rng::with_seed(1);
    let lost = (0..3_000).filter(|_| {
        let origin = point(&mut rng) * 0.25;
        !fast.closest_hit(&Ray::new(origin, border_point(&mesh, &mut rng) - origin)).is_hit()
    });
    assert!(lost.count() > 100, "or the test above shows nothing");
}

#[test]
fn an_integer_grid_keeps_rays_along_its_lines() {
    for offset in [Vec3::ZERO, Vec3::splat(-3.0), Vec3::new(1e6, 3.0, -1e6)] {
        let n = 6;
        let mesh = grid_box(n, offset);
        assert_tight(&mesh, 1_000, 5, |rng| {
            Vec3::from([0; 3].map(|_| rng.u32(1..n) as f32)) + offset
        });
        // Parallel to the axes, through corners, along edges, and through diagonals; with zeros
        // of both signs and components that vanish beside the others.
        let kernels = kernels(&mesh, 3);
        for x in 1..2 * n {
            for y in 1..2 * n {
                let across = [x as f32 * 0.5, y as f32 * 0.5];
                for axis in 0..3 {
                    for tiny in [0.0, -0.0, 1e-42, -1e-30, 1e-18, -1e-10] {
                        let mut origin = Vec3::splat(3.0);
                        let mut direction = Vec3::splat(tiny);
                        origin[(axis + 1) % 3] = across[0];
                        origin[(axis + 2) % 3] = across[1];
                        direction[axis] = if tiny > 0.0 { 1.0 } else { -1.0 };
                        let ray = Ray::new(origin + offset, direction);
                        for (name, kernel) in &kernels {
                            let hit = kernel.closest_hit(&ray);
                            assert_eq!(hit.t, 3.0, "{name} leaks {ray:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn triangles_without_area_close_seams() {
    // The middles are exact, so that the closing triangles have no area at all.
    for offset in [Vec3::ZERO, Vec3::new(1.0, -2.0, 64.0)] {
        let mesh = seamed_octahedron(offset);
        let mut rng = Rng::with_seed(8);
        let kernels = kernels(&mesh, 1);
        for _ in 0..20_000 {
            let origin = point(&mut rng) * 0.5 + offset;
            let seam = mesh.triangle(4 * rng.usize(0..4) + 3);
            let target = seam.v0 + (seam.v1 - seam.v0) * rng.f32();
            let ray = Ray::new(origin, target - origin);
            for (name, kernel) in &kernels {
                assert!(kernel.closest_hit(&ray).is_hit(), "{name} leaks {ray:?}");
            }
        }
    }
}

/// Corners on a line to the last bit: along an axis, a diagonal, with integer steps, or equal ones.
fn flat_corners(rng: &mut Rng) -> [Vec3; 3] {
    let (a, b) = (point(rng), point(rng));
    let whole = |rng: &mut Rng| rng.i32(-9..10) as f32;
    match rng.u8(0..8) {
        0 => [a, a, b],
        1 => [a, b, a],
        2 => [b, a, a],
        3 => [a, a, a],
        4 => {
            let axis = rng.usize(0..3);
            [0; 3].map(|_| {
                let mut on = a;
                on[axis] = 3.0 * rng.f32();
                on
            })
        }
        5 => [0; 3].map(|_| Vec3::splat(rng.f32())),
        // pbrt's.
        6 => [-79.049_614, -87.092_27, -79.209_015].map(|y| Vec3::new(-1_113.454_6, y, -56.243_19)),
        _ => {
            let start = Vec3::new(whole(rng), whole(rng), whole(rng));
            let step = Vec3::new(whole(rng), whole(rng), whole(rng));
            [0.0, whole(rng), whole(rng)].map(|k| start + step * k)
        }
    }
}

#[test]
fn triangles_without_area_that_close_nothing_are_never_hit() {
    let mut rng = Rng::with_seed(2);
    for _ in 0..2_000 {
        let corners = flat_corners(&mut rng);
        let [a, b, c] = corners;
        // A copy of it closes nothing.
        let indices = vec![[0, 1, 2]; rng.usize(1..3)];
        let mesh = TriangleMesh::new(corners.to_vec(), indices).unwrap();
        let origin = a + point(&mut rng) * 3.0;
        let aim = if rng.bool() { a + (b - a) * rng.f32() } else { c };
        let ray = Ray::new(origin, aim - origin);
        assert!(ray.direction != Vec3::ZERO);
        for mode in Mode::ALL {
            assert_eq!(brute_force_in(mode, &mesh, &ray), Hit::MISS, "{corners:?} {ray:?}");
            let scene = WideScene::new_in(mode, &median_tree(&mesh, 2), &mesh).unwrap();
            assert_eq!(scene.closest_hit(&ray), Hit::MISS, "{mode}: {corners:?} {ray:?}");
        }
        for (name, kernel) in kernels(&mesh, 2) {
            assert_eq!(kernel.closest_hit(&ray), Hit::MISS, "{name}: {corners:?} {ray:?}");
            assert!(!kernel.any_hit(&ray), "{name}: {corners:?} {ray:?}");
        }
    }
}

#[test]
fn weights_and_distance_agree_with_arithmetic_in_double_precision() {
    let mesh = soup_mesh(300, 0.4, 5);
    let mut rng = Rng::with_seed(6);
    let mut hits = 0;
    for _ in 0..3_000 {
        let ray = Ray::new(point(&mut rng) * 2.0, point(&mut rng));
        let hit = brute_force(&mesh, &ray);
        if !hit.is_hit() {
            continue;
        }
        let [a, b, c] = mesh.triangle(hit.prim_id as usize).vertices().map(Vec3::as_dvec3);
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let n = (b - a).cross(c - a);
        let t = n.dot(a - o) / n.dot(d);
        // Only where the plane is not seen from its edge.
        if n.dot(d).abs() < 0.05 * n.length() * d.length() {
            continue;
        }
        hits += 1;
        assert!((f64::from(hit.t) - t).abs() <= 1e-4 * t.abs().max(1.0), "{hit:?} {t}");
        let p: DVec3 = a + (b - a) * f64::from(hit.u) + (c - a) * f64::from(hit.v);
        assert!(p.distance(o + d * t) <= 1e-4, "{hit:?} {ray:?}");
    }
    assert!(hits > 300);
}

/// How far a point is inside a tetrahedron, as a share of its size; negative outside.
fn depth(corners: [Vec3; 4], point: Vec3) -> f64 {
    let v = corners.map(Vec3::as_dvec3);
    let size = v.iter().map(|p| p.distance(v[0])).fold(0.0, f64::max);
    let faces = [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]];
    let depths = faces.map(|[a, b, c, other]| {
        let n = (v[b] - v[a]).cross(v[c] - v[a]).normalize_or_zero();
        let side = n.dot(v[other] - v[a]).signum();
        n.dot(point.as_dvec3() - v[a]) * side / size
    });
    depths.into_iter().fold(f64::INFINITY, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// Tetrahedra of any shape, size and place: whatever their angles, a ray from further inside
    /// than rounding reaches hits, aimed at corners, edges, or anywhere.
    #[test]
    fn tetrahedra_keep_their_rays(
        corners in prop::array::uniform4(prop::array::uniform3(-1.0_f32..1.0)),
        thin in 0_i32..12,
        exponent in -100_i32..100,
        shift in prop::array::uniform3(-8.0_f32..8.0),
        weights in prop::array::uniform4(0.01_f32..1.0),
        along in prop::array::uniform3(-1.0_f32..1.0),
        edge in 0.0_f32..1.0,
    ) {
        let scale = 2.0_f32.powi(exponent);
        let squeeze = Vec3::new(1.0, 1.0, 2.0_f32.powi(-thin));
        let v = corners.map(|c| (Vec3::from(c) * squeeze + Vec3::from(shift)) * scale);
        let sum: f32 = weights.iter().sum();
        let origin = (0..4).map(|i| v[i] * (weights[i] / sum)).sum();
        prop_assume!(depth(v, origin) > 2.0_f64.powi(-16));
        let indices = vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
        let mesh = TriangleMesh::new(v.to_vec(), indices).unwrap();
        let wide = WideScene::new(&median_tree(&mesh, 1), &mesh).unwrap();
        let quantised = QuantisedScene::new(&median_tree(&mesh, 1), &mesh).unwrap();
        let aims = [v[0], v[3], v[0] + (v[1] - v[0]) * edge, v[2] + (v[3] - v[2]) * edge];
        let directions = aims.map(|aim| aim - origin).into_iter().chain([Vec3::from(along)]);
        for direction in directions.filter(|d| *d != Vec3::ZERO) {
            let ray = Ray::new(origin, direction);
            let hit = brute_force(&mesh, &ray);
            prop_assert!(hit.is_hit(), "{ray:?} leaks");
            for kernel in WideScene::<8>::kernels() {
                let found = wide.clone().with_kernel(kernel).unwrap().closest_hit(&ray);
                prop_assert_eq!(bits(&found), bits(&hit));
                let found = quantised.clone().with_kernel(kernel).unwrap().closest_hit(&ray);
                prop_assert_eq!(bits(&found), bits(&hit));
            }
        }
    }

    /// On any finite bit patterns the kernels agree with brute force.
    #[test]
    fn any_bits_give_the_same_bits(
        seed in any::<u64>(),
        count in 1_usize..40,
    ) {
        let mut rng = Rng::with_seed(seed);
        let float = |rng: &mut Rng| loop {
            let x = match rng.u8(0..4) {
                0 => f32::from_bits(rng.u32(..)),
                1 => rng.i32(-3..4) as f32,
                _ => rng.f32() - 0.5,
            };
            if x.is_finite() {
                return x;
            }
        };
        let vec = |rng: &mut Rng| Vec3::new(float(rng), float(rng), float(rng));
        let positions: Vec<Vec3> = (0..count + 2).map(|_| vec(&mut rng)).collect();
        let index = |rng: &mut Rng| rng.u32(0..u32::try_from(count).unwrap() + 2);
        let indices =
            (0..count).map(|_| [index(&mut rng), index(&mut rng), index(&mut rng)]).collect();
        let mesh = TriangleMesh::new(positions, indices).unwrap();
        let kernels = kernels(&mesh, 2);
        for _ in 0..8 {
            let ray = Ray::new(vec(&mut rng), vec(&mut rng));
            let expected = brute_force(&mesh, &ray);
            for (name, kernel) in &kernels {
                let hit = kernel.closest_hit(&ray);
                prop_assert_eq!(bits(&hit), bits(&expected), "{} {:?} {:?}", name, ray, expected);
                prop_assert!(kernel.any_hit(&ray) == hit.is_hit(), "{name} {ray:?}");
            }
        }
    }
}
