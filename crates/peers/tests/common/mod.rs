//! Scenes, rays and checks that the tests of both peers share.
#![allow(dead_code, unreachable_pub, reason = "each test file is a crate that uses some of this")]

use niwaki_core::{Hit, Intersector, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_exact::{Verdict, closest_in_mesh, settle, settle_any};
use niwaki_peers::{Embree, EmbreeSettings, LIBRARY_NAMES};
use std::{io::Write, path::Path};

/// A small seeded generator (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1), a multiple of 2⁻²⁴.
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / 16_777_216.0
    }

    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let d = self.point() * 2.0 - 1.0;
            if d.length_squared() > 0.01 && d.length_squared() < 1.0 {
                return d.normalize();
            }
        }
    }
}

/// Triangles of random size in the unit cube, up to `size` long.
pub fn soup(count: usize, size: f32, seed: u64) -> TriangleMesh {
    let mut random = Random(seed);
    let triangles: Vec<Triangle> = (0..count)
        .map(|_| {
            let v = random.point();
            let mut corner = || v + (random.point() - 0.5) * size;
            let (a, b) = (corner(), corner());
            Triangle::new(v, a, b)
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

/// Points, lines, equal triangles and some sound ones.
pub fn degenerate() -> TriangleMesh {
    let p = |x, y, z| Vec3::new(x, y, z);
    let mut triangles = vec![
        Triangle::new(Vec3::ONE, Vec3::ONE, Vec3::ONE),
        Triangle::new(Vec3::ZERO, Vec3::ONE, Vec3::splat(0.5)),
        Triangle::new(Vec3::ZERO, Vec3::ZERO, Vec3::X),
        Triangle::new(p(0.0, 0.0, 0.5), p(1.0, 0.0, 0.5), p(0.0, 1.0, 0.5)),
        Triangle::new(p(0.0, 0.0, 0.25), p(1.0, 0.0, 0.25), p(0.0, 1.0, 0.25)),
    ];
    for _ in 0..60 {
        triangles.push(triangles[3]);
        triangles.push(triangles[0]);
    }
    TriangleMesh::from_triangles(&triangles).unwrap()
}

/// Boxes that shrink by a third each, so that a tree over them is a chain.
pub fn shrinking(count: i32) -> TriangleMesh {
    let triangles: Vec<Triangle> = (0..count)
        .map(|i| {
            let s = 0.7_f32.powi(i);
            Triangle::new(Vec3::splat(s), Vec3::new(s, 0.9 * s, s), Vec3::new(0.9 * s, s, s))
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

/// Random rays through the unit cube, some with a limited range.
pub fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    (0..count)
        .map(|i| {
            let origin = random.point() * 2.0 - 0.5;
            let target = random.point();
            let ray = Ray::new(origin, (target - origin).normalize());
            match i % 4 {
                0 => ray.with_range(0.1, 0.6),
                1 => Ray { direction: ray.direction * 3.0, ..ray },
                _ => ray,
            }
        })
        .collect()
}

/// Every answer must be right, or wrong by no more than rounding excuses.
pub fn check_rays(what: &str, scene: &impl Intersector, mesh: &TriangleMesh, rays: &[Ray]) {
    let mut found = 0;
    for ray in rays {
        let truth = closest_in_mesh(ray, mesh);
        let hit = scene.closest_hit(ray);
        let expected = truth.as_ref().map_or(Hit::MISS, |closest| {
            let mut hit = Hit { prim_id: closest.ties[0].0, ..Hit::MISS };
            #[expect(clippy::cast_possible_truncation, reason = "as a kernel would report it")]
            {
                hit.t = closest.t as f32;
            }
            hit
        });
        let verdict = settle(ray, mesh, &expected, &hit);
        assert!(
            matches!(verdict, Verdict::Agree | Verdict::Tie | Verdict::Rounding),
            "{what}: {verdict:?} for {ray:?}: {hit:?}, exactly {truth:?}"
        );
        if hit.is_hit() {
            found += 1;
            check_weights(what, ray, &hit, &mesh.triangle(hit.prim_id as usize));
        }
        let verdict = settle_any(ray, mesh, truth.is_some(), scene.any_hit(ray));
        assert!(
            matches!(verdict, Verdict::Agree | Verdict::Tie | Verdict::Rounding),
            "{what}: any hit is {verdict:?} for {ray:?}"
        );
    }
    assert!(found * 10 > rays.len(), "{what}: only {found} hits make no test");
}

/// The weights of a hit must give the point that the distance gives.
fn check_weights(what: &str, ray: &Ray, hit: &Hit, t: &Triangle) {
    let by_weights = t.v0 * (1.0 - hit.u - hit.v) + t.v1 * hit.u + t.v2 * hit.v;
    let distance = by_weights.distance(ray.at(hit.t));
    // Slivers seen at a grazing angle lose digits: the bound is on the ratio of area and length.
    let normal = (t.v1 - t.v0).cross(t.v2 - t.v0);
    let grazing = normal.dot(ray.direction).abs() / ray.direction.length();
    assert!(
        distance < 1e-5 / grazing.max(1e-5),
        "{what}: {hit:?} of {ray:?} is {distance} from its point in {t:?}"
    );
}

/// Rays that hit nothing by definition, aimed at geometry.
pub fn check_void_rays(what: &str, scene: &impl Intersector) {
    let ray = Ray::new(Vec3::splat(0.3) - Vec3::Z * 5.0, Vec3::Z);
    let nan = Vec3::new(f32::NAN, 0.3, 0.3);
    let void = [
        Ray { origin: nan, ..ray },
        Ray { direction: nan, ..ray },
        Ray { direction: Vec3::ZERO, ..ray },
        ray.with_range(9.0, 1.0),
        ray.with_range(f32::NAN, 9.0),
        ray.with_range(0.0, f32::NAN),
    ];
    for ray in void {
        assert_eq!(scene.closest_hit(&ray), Hit::MISS, "{what}: {ray:?}");
        assert!(!scene.any_hit(&ray), "{what}: {ray:?}");
    }
}

/// Every Embree that can be found, each version once: the one of `EMBREE_LIBRARY`, the one that
/// `ci/setup-embree.sh` put in its default place, and the system's. Says on the terminal when
/// there is none, which is a failure if `NIWAKI_REQUIRE_EMBREE` is 1.
pub fn embrees() -> Vec<Embree> {
    let set_up = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../peers/embree/libembree4.so.4");
    let mut found: Vec<Embree> = Vec::new();
    let mut add = |embree: Embree| {
        if found.iter().all(|e| e.version() != embree.version()) {
            found.push(embree);
        }
    };
    // An unusable EMBREE_LIBRARY is a mistake that must not pass for absence.
    if std::env::var_os("EMBREE_LIBRARY").is_some_and(|value| !value.is_empty()) {
        add(Embree::load().unwrap());
    }
    for name in [set_up.as_path()].into_iter().chain(LIBRARY_NAMES.iter().map(Path::new)) {
        let settings =
            EmbreeSettings { library: Some(name.into()), threads: 2, ..Default::default() };
        if let Ok(embree) = Embree::with_settings(&settings) {
            add(embree);
        }
    }
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    let versions: Vec<String> = found.iter().map(|e| e.version().to_string()).collect();
    if found.is_empty() {
        assert!(
            std::env::var("NIWAKI_REQUIRE_EMBREE").as_deref() != Ok("1"),
            "NIWAKI_REQUIRE_EMBREE is 1, but there is no Embree; run ci/setup-embree.sh"
        );
        say(&format!("{test}: SKIPPED, as there is no Embree here; run ci/setup-embree.sh"));
    } else {
        say(&format!("{test}: with Embree {}", versions.join(" and ")));
    }
    found
}

/// Writes past the capture of the test harness.
fn say(line: &str) {
    // Nothing depends on the line being written.
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
