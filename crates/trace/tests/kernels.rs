//! Every kernel against brute force and against each other.

use fastrand::Rng;
use niwaki_core::{
    Bvh, Hit, Intersector, Ray, Triangle, TriangleMesh, float::UNIT_ROUNDOFF, glam::Vec3,
};
use niwaki_exact::{Anchor, Verdict, closest_in_mesh, settle, settle_any, t_error_bound};
use niwaki_hard_cases::{self as hard, median_tree, soup_mesh};
use niwaki_trace::{BinaryScene, QuantisedScene, WideScene, brute_force};
use niwaki_wide::{CollapseMethod, CollapseSettings, WideBvh};

/// All kernels over a mesh, by name.
fn kernels(mesh: &TriangleMesh, leaf: usize) -> Vec<(String, Box<dyn Intersector>)> {
    let bvh = median_tree(mesh, leaf);
    let wide = WideScene::new(&bvh, mesh).unwrap();
    let quantised = QuantisedScene::new(&bvh, mesh).unwrap();
    let mut all: Vec<(String, Box<dyn Intersector>)> =
        vec![("binary".to_owned(), Box::new(BinaryScene::new(&bvh, mesh).unwrap()))];
    for kernel in WideScene::<8>::kernels() {
        let scene = wide.clone().with_kernel(kernel).unwrap();
        all.push((kernel.to_string(), Box::new(scene)));
        let scene = quantised.clone().with_kernel(kernel).unwrap();
        all.push((format!("{kernel}, quantised"), Box::new(scene)));
    }
    for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
        add_width::<4>(&bvh, mesh, &settings, &mut all);
        add_width::<16>(&bvh, mesh, &settings, &mut all);
    }
    all
}

/// The kernels for a width.
fn add_width<const W: usize>(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    settings: &CollapseSettings,
    all: &mut Vec<(String, Box<dyn Intersector>)>,
) where
    WideScene<W>: Intersector + 'static,
    QuantisedScene<W>: Intersector + 'static,
{
    let wide = WideBvh::<W>::collapse(bvh, settings).unwrap();
    let quantised = QuantisedScene::build_from(wide.clone(), mesh).unwrap();
    let scene = WideScene::build_from(wide, mesh).unwrap();
    for kernel in WideScene::<W>::kernels() {
        let name = format!("{kernel}, {W} wide, {:?}", settings.method);
        all.push((name.clone(), Box::new(scene.clone().with_kernel(kernel).unwrap())));
        if settings.method == CollapseMethod::Optimal {
            let quantised = quantised.clone().with_kernel(kernel).unwrap();
            all.push((name + ", quantised", Box::new(quantised)));
        }
    }
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim_id]
}

fn random_rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::with_seed(seed);
    let mut point = || Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 3.0;
    (0..count).map(|_| Ray::new(point(), point())).collect()
}

#[test]
fn all_kernels_give_the_same_bits_as_brute_force() {
    for (count, size, leaf) in
        [(1, 1.0, 1), (3, 1.0, 1), (60, 0.5, 2), (1500, 0.1, 1), (1500, 0.3, 5)]
    {
        let mesh = soup_mesh(count, size / 2.0, count as u64);
        let kernels = kernels(&mesh, leaf);
        let mut hits = 0;
        for ray in random_rays(700, 5) {
            let expected = brute_force(&mesh, &ray);
            hits += usize::from(expected.is_hit());
            for (name, kernel) in &kernels {
                let hit = kernel.closest_hit(&ray);
                assert_eq!(bits(&hit), bits(&expected), "{name}: {hit:?} {expected:?} {ray:?}");
                assert_eq!(kernel.any_hit(&ray), expected.is_hit(), "{name} {ray:?}");
                // The hit itself lies within a range that ends at it, and none before it.
                if hit.is_hit() {
                    let until = ray.with_range(0.0, hit.t);
                    assert_eq!(bits(&kernel.closest_hit(&until)), bits(&hit), "{name}");
                    let before = ray.with_range(0.0, hit.t.next_down());
                    assert!(!kernel.any_hit(&before), "{name}");
                    let exactly = ray.with_range(hit.t, hit.t);
                    assert_eq!(bits(&kernel.closest_hit(&exactly)), bits(&hit), "{name}");
                }
            }
        }
        assert!(hits > 10, "the rays must meet the triangles");
    }
}

#[test]
fn among_equal_distances_the_smallest_id_wins() {
    // Many copies of a few triangles, in a shuffled order.
    let base = soup_mesh(40, 0.75, 9);
    let mut copies: Vec<Triangle> = (0..400).map(|i| base.triangle(i % base.len())).collect();
    Rng::with_seed(4).shuffle(&mut copies);
    let mesh = TriangleMesh::from_triangles(&copies).unwrap();
    let kernels = kernels(&mesh, 1);
    let mut hits = 0;
    for ray in random_rays(500, 6) {
        let expected = brute_force(&mesh, &ray);
        if expected.is_hit() {
            let triangle = mesh.triangle(expected.prim_id as usize);
            hits += 1;
            assert!(mesh.triangles().take(expected.prim_id as usize).all(|t| t != triangle));
        }
        for (name, kernel) in &kernels {
            assert_eq!(bits(&kernel.closest_hit(&ray)), bits(&expected), "{name}");
        }
    }
    assert!(hits > 50, "the rays must meet the triangles");
}

#[test]
fn no_kernel_is_wrong_on_the_hard_cases() {
    for case in hard::meshes() {
        let mesh = &case.mesh;
        let small = mesh.len() <= 3_000;
        let kernels = kernels(mesh, 2);
        let mut rays = hard::rays(mesh, if small { 30 } else { 1 }, 11);
        rays.extend(hard::aimed_at_borders(mesh, if small { 60 } else { 2 }, 12));
        for ray in &rays {
            let expected = brute_force(mesh, ray);
            for (name, kernel) in &kernels {
                let hit = kernel.closest_hit(ray);
                if bits(&hit) != bits(&expected) {
                    let verdict = settle(ray, mesh, &hit, &expected);
                    assert!(
                        matches!(verdict, Verdict::Agree | Verdict::Tie | Verdict::Rounding),
                        "{} {name}: {verdict:?} {hit:?} {expected:?} {ray:?}",
                        case.name
                    );
                }
                let any = kernel.any_hit(ray);
                assert!(any || !hit.is_hit(), "{} {name} {hit:?} {ray:?}", case.name);
            }
        }
    }
}

/// How far the point of the barycentric weights may be from the point of the distance.
///
/// Woop's edge functions err by what a shift of the ray by some units of roundoff of the largest
/// coordinate does to them, in proportion to the lengths of the edges; the weights divide them by
/// the area seen along the ray.
fn weights_bound(ray: &Ray, triangle: &Triangle) -> f64 {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let corners = triangle.vertices().map(|v| v.as_dvec3());
    let [a, b, c] = corners;
    let largest = corners
        .iter()
        .flat_map(|&v| [v, v - origin])
        .fold(0.0, |largest: f64, v| largest.max(v.abs().max_element()));
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let shift = 16.0 * f64::from(UNIT_ROUNDOFF) * largest;
    let area = direction.dot((b - a).cross(c - a)).abs() / direction.length();
    let distance = t_error_bound(ray, triangle, Anchor::Best) * direction.length();
    distance + shift * (1.0 + longest * longest / area)
}

#[test]
fn no_kernel_contradicts_exact_arithmetic_on_the_hard_cases() {
    let (mut hits, mut sharp) = (0, 0);
    // The error bounds do not count underflow.
    let left_out = ["denormal"];
    let cases = hard::meshes();
    for case in cases.iter().filter(|c| c.mesh.len() <= 3_000 && !left_out.contains(&c.name)) {
        let mesh = &case.mesh;
        let bvh = median_tree(mesh, 2);
        let best = WideScene::new(&bvh, mesh).unwrap();
        let binary = BinaryScene::new(&bvh, mesh).unwrap();
        let quantised = QuantisedScene::new(&bvh, mesh).unwrap();
        let scenes: [(&str, &dyn Intersector); 3] =
            [("best", &best), ("binary", &binary), ("quantised", &quantised)];
        let mut rays = hard::rays(mesh, 10, 21);
        rays.extend(hard::aimed_at_borders(mesh, 30, 22));
        for ray in &rays {
            let exact = closest_in_mesh(ray, mesh);
            let expected = exact.as_ref().map_or(Hit::MISS, |closest| Hit {
                #[expect(clippy::cast_possible_truncation, reason = "as a kernel would report it")]
                t: closest.t as f32,
                prim_id: closest.ties[0].0,
                ..Hit::MISS
            });
            // A kernel cannot report a distance that is no f32.
            if exact.is_some() && expected.t.is_infinite() {
                continue;
            }
            for (name, scene) in scenes {
                let hit = scene.closest_hit(ray);
                let verdict = settle(ray, mesh, &hit, &expected);
                assert!(
                    matches!(verdict, Verdict::Agree | Verdict::Tie | Verdict::Rounding),
                    "{} {name}: {verdict:?} {hit:?} {exact:?} {ray:?}",
                    case.name
                );
                let verdict = settle_any(ray, mesh, scene.any_hit(ray), exact.is_some());
                assert!(
                    matches!(verdict, Verdict::Agree | Verdict::Rounding),
                    "{} {name}: any hit is {verdict:?} {exact:?} {ray:?}",
                    case.name
                );
                if !hit.is_hit() {
                    continue;
                }
                let triangle = mesh.triangle(hit.prim_id as usize);
                let [a, b, c] = triangle.vertices().map(|v| v.as_dvec3());
                let (u, v) = (f64::from(hit.u), f64::from(hit.v));
                let by_weights = a + (b - a) * u + (c - a) * v;
                let by_distance =
                    ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(hit.t);
                let (distance, bound) =
                    (by_weights.distance(by_distance), weights_bound(ray, &triangle));
                assert!(
                    distance <= bound,
                    "{} {name}: {distance} > {bound} for {hit:?} {ray:?} {triangle:?}",
                    case.name
                );
                hits += 1;
                sharp += usize::from(bound < 1e-3 * a.distance(b).min(a.distance(c)));
            }
        }
    }
    assert!(hits > 1_000 && sharp * 2 > hits, "{hits} hits, {sharp} of them with a sharp bound");
}

#[test]
fn rays_that_hit_nothing_by_definition_miss() {
    for case in hard::meshes().iter().filter(|case| case.mesh.len() <= 3_000) {
        for (name, kernel) in kernels(&case.mesh, 1) {
            for ray in hard::bad_rays(&case.mesh) {
                assert_eq!(kernel.closest_hit(&ray), Hit::MISS, "{} {name} {ray:?}", case.name);
                assert!(!kernel.any_hit(&ray), "{} {name} {ray:?}", case.name);
            }
        }
    }
}

#[test]
fn the_length_of_the_direction_scales_t_alone() {
    let mesh = soup_mesh(300, 0.2, 3);
    for (name, kernel) in kernels(&mesh, 1) {
        for ray in random_rays(200, 8) {
            let hit = kernel.closest_hit(&ray);
            for exponent in [-120, -60, -10, 10, 60, 120] {
                let k = 2.0_f32.powi(exponent);
                let scaled = kernel.closest_hit(&Ray::new(ray.origin, ray.direction * k));
                assert_eq!(scaled.prim_id, hit.prim_id, "{name} 2^{exponent}");
                if hit.is_hit() {
                    assert_eq!((scaled.t * k, scaled.u, scaled.v), (hit.t, hit.u, hit.v), "{name}");
                }
            }
        }
    }
}

#[test]
fn from_inside_a_flat_box_an_axis_parallel_ray_in_its_plane_goes_on() {
    // Both triangles' boxes are flat in y; the ray runs in that plane and meets the wall behind.
    let quad = |x: f32| {
        Triangle::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 0.0, 0.0), Vec3::new(x, 0.0, 1.0))
    };
    let wall = Triangle::new(
        Vec3::new(5.0, -1.0, -1.0),
        Vec3::new(5.0, 2.0, -1.0),
        Vec3::new(5.0, -1.0, 2.0),
    );
    let mesh = TriangleMesh::from_triangles(&[quad(0.0), quad(2.0), wall]).unwrap();
    for (name, kernel) in kernels(&mesh, 1) {
        for zero in [0.0, -0.0] {
            let ray = Ray::new(Vec3::new(-1.0, 0.0, 0.25), Vec3::new(1.0, zero, zero));
            let hit = kernel.closest_hit(&ray);
            assert_eq!((hit.prim_id, hit.t), (2, 6.0), "{name}");
        }
    }
}
