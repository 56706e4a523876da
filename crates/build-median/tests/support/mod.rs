//! Hard geometry (zero, one, equal, degenerate, huge, tiny, chained triangles) and the checks that
//! every builder has to pass on it. Shared by the tests of the simple builders.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part")]

use niwaki_core::glam::Vec3;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, Triangle, TriangleMesh};
use niwaki_metrics::validate;

pub use niwaki_hard_cases::counting;

/// SplitMix64 (Steele et al. 2014): small, seeded, good enough for test data.
pub struct Rng(pub u64);

impl Rng {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    /// Uniform in [-1, 1)³.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

pub fn mesh(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> TriangleMesh {
    let triangles: Vec<Triangle> =
        triangles.into_iter().map(|[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
    TriangleMesh::from_triangles(&triangles).expect("finite vertices")
}

/// Triangles of about the size of their distance to the next, of varied shape, in clusters.
pub fn soup(count: usize, seed: u64) -> TriangleMesh {
    let mut rng = Rng(seed);
    let size = 1.0 / (count.max(1) as f32).cbrt();
    let mut cluster = Vec3::ZERO;
    mesh((0..count).map(|i| {
        if i % 64 == 0 {
            cluster = rng.cube() * 4.0;
        }
        let center = cluster + rng.cube() * 0.5;
        let stretch = size * (0.2 + 4.0 * rng.unit().powi(4));
        [(); 3].map(|()| center + rng.cube() * stretch)
    }))
}

/// The soup moved and scaled.
fn transformed(count: usize, scale: f32, offset: Vec3) -> TriangleMesh {
    mesh(soup(count, 7).triangles().map(|t| [t.v0, t.v1, t.v2].map(|v| v * scale + offset)))
}

pub fn hard_cases() -> Vec<(&'static str, TriangleMesh)> {
    let one = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mut rng = Rng(3);
    let mut cases = vec![
        ("none", mesh([])),
        ("one", mesh([one])),
        ("two equal", mesh([one; 2])),
        ("100,000 equal", mesh(std::iter::repeat_n(one, 100_000))),
        (
            "one centroid, many sizes",
            mesh((0..30_000).map(|i| {
                let d = Vec3::new(1.0 + (i % 977) as f32, (i % 31) as f32, (i % 7) as f32);
                [-d, d, d * Vec3::new(-1.0, 1.0, 1.0)]
            })),
        ),
        ("points", mesh((0..1000).map(|_| [rng.cube(); 3]))),
        ("equal points", mesh([[Vec3::splat(0.1); 3]; 1000])),
        ("collinear", mesh((0..1000).map(|i| [0.0, 1.0, 2.0].map(|k| Vec3::splat(i as f32 + k))))),
        (
            "flat",
            mesh(soup(2000, 1).triangles().map(|t| [t.v0, t.v1, t.v2].map(|v| v.with_z(0.0)))),
        ),
        (
            "slivers",
            mesh((0..1000).map(|i| {
                let x = Vec3::X * i as f32 * 1e-6;
                [x, x + Vec3::Y * 1e3, x + Vec3::new(1e-6, 0.0, 0.0)]
            })),
        ),
        (
            "diagonals",
            mesh((0..1000).map(|i| {
                let a = i as f32;
                [Vec3::new(a, 0.0, 0.0), Vec3::new(1000.0 - a, 1000.0, 1000.0), Vec3::splat(a)]
            })),
        ),
        ("1e-30", transformed(2000, 1e-30, Vec3::ZERO)),
        ("1e-38", transformed(2000, 1e-38, Vec3::ZERO)),
        ("denormal", transformed(2000, 1e-43, Vec3::ZERO)),
        ("1e30", transformed(2000, 1e30, Vec3::ZERO)),
        // Twice a coordinate, and extents, overflow f32.
        ("5e37", transformed(2000, 5e37, Vec3::ZERO)),
        ("offset by 1e7", transformed(2000, 1.0, Vec3::splat(1e7))),
        (
            "scales from 1e-6 to 1e6",
            mesh((0..2000).map(|_| {
                let scale = 10.0_f32.powf(rng.unit() * 12.0 - 6.0);
                let center = rng.cube() * scale;
                [(); 3].map(|()| center + rng.cube() * scale)
            })),
        ),
        (
            "negative zeros",
            mesh((0..500).map(|i| {
                let zero = if i % 2 == 0 { 0.0 } else { -0.0 };
                [Vec3::splat(zero), Vec3::new(zero, 1.0, -zero), Vec3::new(1.0, zero, zero)]
            })),
        ),
        // Boxes that halve their size: each level of a spatial split peels off one or a few.
        (
            "shrinking chain",
            mesh((0..20_000).map(|i| {
                let x = 2.0_f32.powi(120 - i % 240);
                [Vec3::ZERO, Vec3::X * x, Vec3::new(x, x, 0.0)]
            })),
        ),
        // Boxes [0, i]: the middle of the bounds cuts off only the largest.
        (
            "nested boxes",
            mesh((0..20_000).map(|i| {
                let x = i as f32;
                [Vec3::ZERO, Vec3::X * x, Vec3::new(x, x * 1e-3, 0.0)]
            })),
        ),
        (
            "one far away",
            mesh(
                soup(5000, 9)
                    .triangles()
                    .map(|t| [t.v0, t.v1, t.v2])
                    .chain([[Vec3::splat(1e12); 3]]),
            ),
        ),
        (
            "Embree's split epsilon",
            mesh([
                [
                    Vec3::new(-6.400_002_4, 25.6, 34.0),
                    Vec3::new(-6.4, 57.600_002, 34.0),
                    Vec3::splat(25.6),
                ],
                [
                    Vec3::new(-6.400_002_4, 25.6, 57.600_002),
                    Vec3::splat(34.0),
                    Vec3::splat(57.600_002),
                ],
            ]),
        ),
    ];
    cases.push(("soup", soup(20_000, 11)));
    cases
}

pub fn on_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(f)
}

/// Builds every hard case on 1, 2, 3 and 8 threads: sound, equal, and no leaf over the limit.
pub fn check_hard_cases(builder: &dyn Builder, max_leaf_size: usize) {
    let pools = [1, 2, 3, 8]
        .map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool"));
    for (name, mesh) in hard_cases() {
        let built = pools.each_ref().map(|pool| {
            let result = pool.install(|| builder.build_mesh(&mesh));
            result.unwrap_or_else(|e| panic!("{} on {name}: {e}", builder.name()))
        });
        if let Err(faults) = validate(&built[0], &mesh) {
            panic!("{} on {name}: {}", builder.name(), faults[0]);
        }
        assert!(largest_leaf(&built[0]) <= max_leaf_size, "{} on {name}", builder.name());
        for other in &built[1..] {
            assert!(same_bytes(&built[0], other), "{} on {name}: threads show", builder.name());
        }
        let from_refs = builder.build(&mesh.prim_refs()).expect("finite");
        assert!(same_bytes(&built[0], &from_refs), "{} on {name}: build", builder.name());
    }
}

pub fn largest_leaf(bvh: &Bvh) -> usize {
    bvh.nodes.iter().map(|n| n.count as usize).max().unwrap_or(0)
}

/// Equality of bytes, which tells −0.0 from 0.0.
pub fn same_bytes(a: &Bvh, b: &Bvh) -> bool {
    bytemuck::cast_slice::<_, u8>(&a.nodes) == bytemuck::cast_slice::<_, u8>(&b.nodes)
        && a.prim_ids == b.prim_ids
}

/// A bad primitive is named, wherever it stands; leaves hold the ids that the references carry.
pub fn check_references(builder: &dyn Builder) {
    let mut prims = soup(9000, 5).prim_refs();
    for p in &mut prims {
        p.prim_id = p.prim_id * 7 + 3;
    }
    let bvh = builder.build(&prims).expect("finite");
    let mut ids = bvh.prim_ids.clone();
    ids.sort_unstable();
    assert!(ids.iter().copied().eq(prims.iter().map(|p| p.prim_id)));

    // Several references with one id and one centroid, as splitting makes them.
    let twice: Vec<PrimRef> = prims.iter().flat_map(|&p| [p, p]).collect();
    let bvh = builder.build(&twice).expect("finite");
    assert_eq!(bvh.prim_ids.len(), twice.len());

    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut prims = prims.clone();
        prims[5000].max.z = bad;
        let error = builder.build(&prims).expect_err("not finite");
        assert!(
            matches!(error, BuildError::NonFiniteBounds { index: 5000, prim_id: 35_003, .. }),
            "{error}"
        );
    }
}

/// The setting that a refusal names.
pub fn refused(builder: &dyn Builder) -> &'static str {
    match builder.build(&[]) {
        Err(BuildError::BadSetting { setting, .. }) => setting,
        other => panic!("{} accepts it: {other:?}", builder.name()),
    }
}

/// Peak memory stays within the bound for several sizes and shapes, on 1 and 4 threads.
pub fn check_memory_bound(builder: &dyn Builder) {
    let soups = [0, 1, 100, 10_000, 200_000].map(|n| soup(n, 2));
    // Both pools live to the end: the threads of one that is dropped free memory in their own time,
    // which would be taken off the peak of whatever is measured next.
    let pools = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        (threads, pool)
    });
    for (threads, pool) in &pools {
        let threads = *threads;
        let hard = if threads > 1 { hard_cases() } else { Vec::new() };
        for mesh in soups.iter().chain(hard.iter().map(|(_, mesh)| mesh)) {
            // Once for what the pool allocates on first use.
            pool.install(|| builder.build_mesh(mesh)).expect("finite");
            let (result, peak) = counting::peak(|| pool.install(|| builder.build_mesh(mesh)));
            let bound = pool.install(|| builder.memory_bound(mesh.len()));
            let kept = result.expect("finite").bytes();
            // Small trees drown in what the pool's threads allocate and free meanwhile.
            if mesh.len() >= 10_000 {
                assert!(kept <= peak, "the counter counts");
            }
            assert!(
                peak <= bound,
                "{} of {} triangles on {threads} threads: {peak} bytes, bound {bound}",
                builder.name(),
                mesh.len()
            );
            // A bound far above the use would be true and useless.
            if mesh.len() >= 100_000 {
                assert!(bound < 3 * peak, "{}: {peak} bytes, bound {bound}", builder.name());
            }
        }
    }
}
