//! Where rays end, beside the work that they take.

use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Builder, Ray, TriangleMesh, glam::Vec3};
use niwaki_trace::{BinaryScene, Counts, Kernel, QuantisedScene, WideScene};

/// A floor of 30 × 30 squares.
fn floor() -> TriangleMesh {
    let (mut corners, mut indices) = (Vec::new(), Vec::new());
    for x in 0..30_u16 {
        for z in 0..30_u16 {
            let first = u32::try_from(corners.len()).unwrap();
            let at = Vec3::new(f32::from(x), 0.0, f32::from(z));
            corners.extend([at, at + Vec3::X, at + Vec3::X + Vec3::Z, at + Vec3::Z]);
            indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    TriangleMesh::new(corners, indices).unwrap()
}

fn down(x: f32, z: f32) -> Ray {
    Ray::new(Vec3::new(x, 5.0, z), Vec3::NEG_Y)
}

#[test]
fn walks_count_what_counting_kernels_count() {
    let mesh = floor();
    let bvh = Sbvh::default().build_mesh(&mesh).unwrap();
    let binary = BinaryScene::new(&bvh, &mesh).unwrap();
    let wide = WideScene::<8>::new(&bvh, &mesh).unwrap();
    let mut random = fastrand::Rng::with_seed(2);
    for _ in 0..500 {
        let target = Vec3::new(40.0 * random.f32() - 5.0, 0.0, 40.0 * random.f32() - 5.0);
        let origin = Vec3::new(15.0, 4.0, 15.0);
        let ray = Ray::new(origin, target - origin);
        let (hit, walk) = binary.closest_hit_walked(&ray);
        assert_eq!((hit, walk.counts), binary.closest_hit_counted(&ray));
        assert_eq!(walk.end.is_some(), walk.counts.nodes + walk.counts.leaves > 0);
        let (hit, walk) = wide.closest_hit_walked(&ray);
        assert_eq!((hit, walk.counts), wide.closest_hit_counted(&ray));
        assert!(walk.end.is_some());
    }
}

/// Straight down on a floor, the way leads through one leaf, which is the end: rays to the same
/// triangle end alike, and to squares far from each other do not.
#[test]
fn an_end_is_a_place() {
    let mesh = floor();
    let bvh = Sbvh::default().build_mesh(&mesh).unwrap();
    let binary = BinaryScene::new(&bvh, &mesh).unwrap();
    let wide = WideScene::<8>::new(&bvh, &mesh).unwrap();
    for end in [
        |b: &BinaryScene, _: &WideScene<8>, ray: &Ray| b.closest_hit_walked(ray).1.end,
        |_: &BinaryScene, w: &WideScene<8>, ray: &Ray| w.closest_hit_walked(ray).1.end,
    ] {
        let at = |x: f32, z: f32| end(&binary, &wide, &down(x, z));
        assert_eq!(at(3.7, 4.3), at(3.75, 4.3));
        assert_ne!(at(3.7, 4.3), at(23.7, 14.3));
        assert!(at(3.7, 4.3).is_some());
    }
    // The binary kernel tests the root's box first, and goes nowhere.
    assert_eq!(binary.closest_hit_walked(&down(-9.0, 3.0)).1.end, None);
}

/// Triangles of all sizes and directions, through and over each other.
fn heap() -> TriangleMesh {
    let mut random = fastrand::Rng::with_seed(7);
    let mut corners = Vec::new();
    for _ in 0..4_000 {
        let mut point = || Vec3::new(random.f32(), random.f32(), random.f32());
        let (at, size) = (point() * 20.0, point().x * 2.0);
        corners.extend([at, at + point() * size, at + point() * size]);
    }
    let indices =
        (0..u32::try_from(corners.len() / 3).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    TriangleMesh::new(corners, indices.collect()).unwrap()
}

/// Kernels with vectors find what the scalar one finds, and take the same way but for children as far
/// as each other.
#[test]
fn every_kernel_counts_what_the_scalar_one_counts() {
    let mesh = heap();
    let bvh = Sbvh::default().build_mesh(&mesh).unwrap();
    let mut random = fastrand::Rng::with_seed(3);
    let rays: Vec<Ray> = (0..2_000)
        .map(|_| {
            let mut point = || Vec3::new(random.f32(), random.f32(), random.f32());
            let (from, to) = (point() * 24.0 - 2.0, point() * 20.0);
            Ray::new(from, to - from).with_range(0.0, 1.5 * point().x)
        })
        .collect();
    macro_rules! compare {
        ($scene:expr) => {{
            let scene = $scene;
            let (mut sums, mut twin) = ([Counts::default(); 2], [Counts::default(); 2]);
            let mut alike = 0;
            for ray in &rays {
                let ((hit, walk), (wanted, way)) =
                    (scene.closest_hit_traced(ray), scene.closest_hit_walked(ray));
                assert_eq!(hit, wanted);
                let ((is_hit, counts), (is_wanted, work)) =
                    (scene.any_hit_traced(ray), scene.any_hit_counted(ray));
                assert_eq!(is_hit, is_wanted);
                alike += usize::from(walk == way && counts == work);
                for (sums, more) in
                    [(&mut sums, [walk.counts, counts]), (&mut twin, [way.counts, work])]
                {
                    sums[0] += more[0];
                    sums[1] += more[1];
                }
            }
            if scene.kernel() == Kernel::Scalar {
                assert_eq!(alike, rays.len());
            }
            assert!(alike * 100 >= rays.len() * 90, "{:?}: {alike}", scene.kernel());
            for (sum, twin) in sums.iter().zip(&twin) {
                for (a, b) in [
                    (sum.nodes, twin.nodes),
                    (sum.boxes, twin.boxes),
                    (sum.leaves, twin.leaves),
                    (sum.triangles, twin.triangles),
                ] {
                    assert!(a > 1000 && a.abs_diff(b) * 100 <= b, "{:?}: {a} {b}", scene.kernel());
                }
            }
        }};
    }
    for kernel in WideScene::<8>::kernels() {
        compare!(WideScene::<8>::new(&bvh, &mesh).unwrap().with_kernel(kernel).unwrap());
        compare!(QuantisedScene::<8>::new(&bvh, &mesh).unwrap().with_kernel(kernel).unwrap());
    }
}
