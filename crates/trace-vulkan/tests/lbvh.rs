//! The LBVH of the device is that of the CPU, bit for bit.

mod common;

use common::{assert_silent, device};
use niwaki_build_lbvh::Lbvh;
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, BuildError, Builder, Bvh, Hit, PrimRef, SahConstants, TriangleMesh};
use niwaki_trace::Mode;
use niwaki_trace_vulkan::{GpuError, GpuLbvh, GpuScene, LbvhConfig, LbvhError, Tracer, TreeLayout};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// The CPU builder of the same settings.
fn cpu(config: &LbvhConfig) -> Lbvh {
    let LbvhConfig { code_bits, max_leaf_size, sah } = *config;
    Lbvh { code_bits, max_leaf_size, sah, ..Lbvh::default() }
}

/// Equal, zeros of different signs not counted as such.
fn same_bytes(a: &Bvh, b: &Bvh) -> bool {
    let bytes = |bvh: &Bvh| bytemuck::cast_slice::<_, u8>(&bvh.nodes).to_vec();
    a.prim_ids == b.prim_ids && bytes(a) == bytes(b)
}

fn configs() -> impl Iterator<Item = LbvhConfig> {
    [30, 63].into_iter().flat_map(|code_bits| {
        let config = move |max_leaf_size, sah| LbvhConfig { code_bits, max_leaf_size, sah };
        [
            config(1, SahConstants::THESIS_IV),
            LbvhConfig { code_bits, ..LbvhConfig::default() },
            config(usize::MAX, SahConstants { inner: 0.1, leaf: 0.3, triangle: 1.7 }),
        ]
    })
}

fn check(builder: &GpuLbvh, mesh: &TriangleMesh, name: &str) {
    // All settings for small meshes, the first and the last for large ones.
    let step = if mesh.len() < 1000 { 1 } else { 5 };
    for config in configs().step_by(step) {
        let expected = cpu(&config).build_mesh(mesh).unwrap();
        let found = builder.build_mesh(mesh, &config).unwrap();
        assert!(same_bytes(&found, &expected), "{name}, {config:?}");
    }
}

#[test]
fn hard_cases_give_the_tree_of_the_cpu() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    for case in niwaki_hard_cases::meshes() {
        check(&builder, &case.mesh, case.name);
    }
    assert_silent(&device);
}

/// Boxes around pairs of points.
fn boxes(points: Vec<[Vec3; 2]>) -> Vec<PrimRef> {
    let boxes = points.into_iter().map(|[a, b]| Aabb::new(a.min(b), a.max(b)));
    boxes.zip(0..).map(|(bounds, i)| PrimRef::new(bounds, 3 * i + 7)).collect()
}

/// Finite coordinates: moderate ones, few different ones, any at all, and those next to zero.
fn coordinate(kind: u8) -> BoxedStrategy<f32> {
    let any_bits =
        |mask: u32| any::<u32>().prop_map(move |bits| f32::from_bits(bits & mask)).boxed();
    match kind {
        0 => (-1.0_f32..1.0).boxed(),
        1 => prop::sample::select(vec![0.0_f32, -0.0, 1.0, 2.0]).boxed(),
        2 => any_bits(u32::MAX).prop_filter("finite", |x| x.is_finite()).boxed(),
        _ => any_bits(0x80ff_ffff),
    }
}

fn points() -> impl Strategy<Value = Vec<[Vec3; 2]>> {
    (0..4_u8, 0..4_u8, 0..4_u8, 0..5000_usize).prop_flat_map(|(x, y, z, count)| {
        let point = || (coordinate(x), coordinate(y), coordinate(z)).prop_map(Vec3::from);
        prop::collection::vec([point(), point()], 0..=count)
    })
}

#[test]
fn any_boxes_give_the_tree_of_the_cpu() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    let config = ProptestConfig { cases: 8, max_shrink_iters: 100, ..ProptestConfig::default() };
    TestRunner::new(config)
        .run(&points(), |points| {
            let prims = boxes(points);
            for config in configs() {
                let expected = cpu(&config).build(&prims).unwrap();
                let found = builder.build(&prims, &config).unwrap();
                prop_assert!(same_bytes(&found, &expected), "{:?}", config);
            }
            Ok(())
        })
        .unwrap();
    assert_silent(&device);
}

#[test]
fn few_primitives_and_the_borders_of_tiles() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    let mut random = fastrand::Rng::with_seed(3);
    let mut point = || Vec3::from([(); 3].map(|()| random.f32()));
    let points: Vec<[Vec3; 2]> = (0..4097).map(|_| [point(), point()]).collect();
    let all = boxes(points);
    for count in [0, 1, 2, 3, 4, 255, 256, 257, 2047, 2048, 2049, 4095, 4096, 4097] {
        for config in [LbvhConfig::default(), LbvhConfig::every_frame()] {
            let expected = cpu(&config).build(&all[..count]).unwrap();
            let found = builder.build(&all[..count], &config).unwrap();
            assert!(same_bytes(&found, &expected), "{count}");
        }
    }
    assert_silent(&device);
}

#[test]
fn large_scenes_give_the_tree_of_the_cpu() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    let soup = niwaki_hard_cases::soup_mesh(100_000, 0.02, 5);
    let config = LbvhConfig::default();
    let expected = cpu(&config).build_mesh(&soup).unwrap();
    assert!(same_bytes(&builder.build_mesh(&soup, &config).unwrap(), &expected));
    // A million equal boxes: codes say nothing, and everything is told apart by the order alone.
    let equal = vec![PrimRef::new(Aabb::new(Vec3::ONE, Vec3::splat(2.0)), 9); 1_000_000];
    let config = LbvhConfig::every_frame();
    let expected = cpu(&config).build(&equal).unwrap();
    assert!(same_bytes(&builder.build(&equal, &config).unwrap(), &expected));
    assert_silent(&device);
}

#[test]
fn a_workspace_builds_one_tree_after_the_other() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    let config = LbvhConfig::default();
    let workspace = builder.workspace(6000, &config).unwrap();
    let mut random = fastrand::Rng::with_seed(4);
    for count in [6000, 17, 0, 3000, 1] {
        let mut point = || Vec3::from([(); 3].map(|()| random.f32()));
        let prims = boxes((0..count).map(|_| [point(), point()]).collect());
        workspace.upload(&prims).unwrap();
        let times = workspace.build().unwrap();
        assert!(times.total() >= 0.0);
        let expected = cpu(&config).build(&prims).unwrap();
        assert_eq!(workspace.check().unwrap(), (count, expected.nodes.len()));
        assert!(same_bytes(&workspace.download().unwrap(), &expected), "{count}");
    }
    // More than fit, said by the host and by a kernel.
    let is_over = |error: &LbvhError| {
        matches!(error, LbvhError::OverCapacity { count: 6001, capacity: 6000 })
    };
    assert!(is_over(&workspace.set_count(6001).unwrap_err()));
    workspace.count().write(0, &[6001_u32]).unwrap();
    assert!(is_over(&workspace.build().unwrap_err()));
    assert_silent(&device);
}

#[test]
fn a_tree_that_stays_on_the_device_is_traced_there() {
    let Some(device) = device() else { return };
    let (builder, tracer) = (GpuLbvh::new(&device).unwrap(), Tracer::new(&device).unwrap());
    for mesh in [niwaki_hard_cases::soup_mesh(3000, 0.2, 5), TriangleMesh::default()] {
        let config = LbvhConfig::default();
        let bvh = cpu(&config).build_mesh(&mesh).unwrap();
        let (layout, mode) = (TreeLayout::Binary, Mode::Watertight);
        let uploaded = GpuScene::upload_in(&device, layout, mode, &bvh, &mesh).unwrap();
        let built = builder.build_scene(&mesh, &config).unwrap();
        let rays = niwaki_hard_cases::rays(&mesh, 2000, 1);
        let found = tracer.closest_hits(&built, &rays).unwrap();
        assert_eq!(found, tracer.closest_hits(&uploaded, &rays).unwrap());
        assert_eq!(found.iter().any(Hit::is_hit), !mesh.is_empty());
    }
    assert_silent(&device);
}

#[test]
fn the_first_bad_primitive_is_named() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    let config = LbvhConfig::default();
    let good = PrimRef::new(Aabb::new(Vec3::NEG_ONE, Vec3::ONE), 5);
    for bad in [f32::NAN, f32::INFINITY, -2.0] {
        let mut prims = vec![good; 10_000];
        for place in [4321, 4322, 9000] {
            prims[place].max.y = bad;
            prims[place].prim_id = 3;
        }
        let error = builder.build(&prims, &config).unwrap_err();
        let expected = cpu(&config).build(&prims).unwrap_err();
        let LbvhError::Build(error) = error else { panic!("{error}") };
        assert_eq!(error.to_string(), expected.to_string());
        assert!(matches!(error, BuildError::NonFiniteBounds { index: 4321, prim_id: 3, .. }));
    }
    // Triangles on the device that a mesh would refuse.
    let workspace = builder.workspace(2, &config).unwrap();
    let positions = device.upload(&[[0.0_f32; 3], [f32::NAN; 3]]).unwrap();
    for last in [[0_u32, 0, 1], [0, 0, 2]] {
        let indices = device.upload(&[[0_u32; 3], last]).unwrap();
        workspace.set_count(2).unwrap();
        let mut batch = device.batch().unwrap();
        workspace.record_triangles(&mut batch, &positions, &indices).unwrap();
        workspace.record(&mut batch).unwrap();
        batch.submit().unwrap();
        let error = workspace.download().unwrap_err();
        let is_second = matches!(
            error,
            LbvhError::Build(BuildError::NonFiniteBounds { index: 1, prim_id: 1, .. })
        );
        assert!(is_second, "{error}");
    }
    assert_silent(&device);
}

#[test]
fn settings_and_sizes_are_refused_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let builder = GpuLbvh::new(&device).unwrap();
    let good = LbvhConfig::default();
    let sah = SahConstants { inner: f32::NAN, ..SahConstants::THESIS_IV };
    for bad in [
        LbvhConfig { code_bits: 31, ..good },
        LbvhConfig { max_leaf_size: 0, ..good },
        LbvhConfig { sah, ..good },
    ] {
        let error = builder.build(&[], &bad).unwrap_err();
        assert_eq!(error.to_string(), cpu(&bad).build(&[]).unwrap_err().to_string());
    }
    let error = builder.workspace(1 << 31, &good).unwrap_err();
    assert!(matches!(error, LbvhError::Build(BuildError::TooManyPrimitives { .. })), "{error}");
    if device.info().max_binding_bytes < 64 << 30 {
        let error = builder.workspace(1 << 30, &good).unwrap_err();
        assert!(matches!(error, LbvhError::Gpu(GpuError::TooLarge { .. })), "{error}");
    }
    assert_silent(&device);
}
