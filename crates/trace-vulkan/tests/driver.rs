//! The driver's own ray tracing gives the answers of our scalar kernels, as far as drivers can: exact
//! arithmetic says who is wrong where they differ, which we never are.
//!
//! Skipped on devices without it, unless `NIWAKI_REQUIRE_RAY_TRACING=1`.

#[path = "common/answers.rs"]
mod answers;
mod common;

use answers::{compare, rays};
use common::{assert_silent, device, device_with};
use niwaki_build_binned::Binned;
use niwaki_core::{Builder, Hit, Intersector, Ray, TriangleMesh, glam::Vec3};
use niwaki_exact::{Verdict, settle, settle_any};
use niwaki_trace::{BinaryScene, Mode};
use niwaki_trace_vulkan::{
    Device, DeviceOptions, DriverBuild, DriverMethod, DriverScene, DriverTrace, DriverTracer,
    GpuError, GpuScene, Query, Tracer, TreeLayout,
};

/// Rays of a scene.
const RAYS: usize = 30_000;

/// A device with ray tracing and the methods that it offers, or `None` where there is none and none is
/// required.
fn ray_tracing() -> Option<(Device, Vec<DriverMethod>)> {
    let device = device()?;
    let methods = DriverMethod::ALL.into_iter().filter(|m| m.is_offered(device.info()));
    let methods: Vec<_> = methods.collect();
    if methods.is_empty() {
        let is_required = std::env::var_os("NIWAKI_REQUIRE_RAY_TRACING").is_some_and(|x| x != "0");
        assert!(!is_required, "NIWAKI_REQUIRE_RAY_TRACING is set: {} has none", device.name());
        println!("skipped: {} has no ray tracing of its own", device.name());
        return None;
    }
    Some((device, methods))
}

fn scalar(mesh: &TriangleMesh) -> BinaryScene {
    let bvh = Binned::default().build_mesh(mesh).unwrap();
    BinaryScene::new_in(Mode::Watertight, &bvh, mesh).unwrap()
}

fn check(name: &str) {
    let Some((device, methods)) = ray_tracing() else { return };
    let mesh = niwaki_scene::generate::generate(name, 20_000, 1).unwrap().mesh;
    let rays = rays(&mesh, RAYS, 7);
    let cpu = scalar(&mesh);
    let mut ours = vec![Hit::MISS; rays.len()];
    cpu.closest_hits(&rays, &mut ours);
    for build in DriverBuild::ALL {
        let scene = DriverScene::build(&device, &mesh, build).unwrap();
        for &method in &methods {
            let tracer = DriverTracer::new(&device, method).unwrap();
            let theirs = tracer.closest_hits(&scene, &rays).unwrap();
            let (mut same, mut ties, mut wrong) = (0, 0, 0);
            for ((ray, our), their) in rays.iter().zip(&ours).zip(&theirs) {
                if our.prim_id == their.prim_id && our.t == their.t {
                    same += 1;
                    continue;
                }
                let verdict = settle(ray, &mesh, our, their);
                assert!(verdict != Verdict::OursWrong, "{ray:?}: {our:?}, not {their:?}");
                ties += usize::from(matches!(verdict, Verdict::Agree | Verdict::Tie));
                wrong += usize::from(verdict == Verdict::PeerWrong);
            }
            let flags = tracer.any_hits(&scene, &rays).unwrap();
            for ((ray, our), &flag) in rays.iter().zip(&ours).zip(&flags) {
                if our.is_hit() != flag {
                    let verdict = settle_any(ray, &mesh, our.is_hit(), flag);
                    assert!(verdict != Verdict::OursWrong, "{ray:?}: {our:?}, not {flag}");
                    wrong += usize::from(verdict == Verdict::PeerWrong);
                }
            }
            println!(
                "{name}, {}, {}: of {RAYS} rays {same} the same, {ties} ties, {wrong} answers of the driver wrong",
                build.name(),
                method.name()
            );
            // A third of the rays begin on a surface, where rounding decides whether it is hit. Drivers
            // promise closed edges only, and no precision; but a wrong launch would show.
            assert!(same * 100 >= RAYS * 97 && wrong * 1000 <= RAYS);
        }
    }
    assert_silent(&device);
}

#[test]
fn an_atrium() {
    check("atrium");
}

#[test]
fn a_city() {
    check("city");
}

#[test]
fn foliage() {
    check("foliage");
}

#[test]
fn hits_as_the_driver_gives_them_are_near_ours() {
    let Some((device, methods)) = ray_tracing() else { return };
    let mesh = niwaki_scene::generate::generate("city", 5_000, 1).unwrap().mesh;
    let rays = rays(&mesh, 5_000, 3);
    let scene = DriverScene::build(&device, &mesh, DriverBuild::FastTrace).unwrap();
    for method in methods {
        let tracer = DriverTracer::new(&device, method).unwrap();
        let ours = tracer.closest_hits(&scene, &rays).unwrap();
        let theirs = tracer.clone().with_recomputed(false).closest_hits(&scene, &rays).unwrap();
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert_eq!(ours.prim_id, theirs.prim_id);
            if ours.is_hit() {
                assert!((ours.t - theirs.t).abs() <= 1e-3 * ours.t.max(1.0), "{ours:?} {theirs:?}");
            }
            if ours.is_hit() && method == DriverMethod::Query {
                let error = (ours.u - theirs.u).abs().max((ours.v - theirs.v).abs());
                assert!(error <= 0.05, "{ours:?} {theirs:?}");
            }
        }
    }
    assert_silent(&device);
}

#[test]
fn bad_rays_and_empty_scenes_are_misses() {
    let Some((device, methods)) = ray_tracing() else { return };
    let mesh = niwaki_hard_cases::soup_mesh(200, 0.3, 5);
    let cpu = scalar(&mesh);
    let mut rays = niwaki_hard_cases::bad_rays(&mesh);
    rays.push(Ray::new(Vec3::splat(0.5), Vec3::X).with_range(3.0, 1.0));
    let mut ours = vec![Hit::MISS; rays.len()];
    cpu.closest_hits(&rays, &mut ours);
    let scene = DriverScene::build(&device, &mesh, DriverBuild::FastBuild).unwrap();
    let empty =
        DriverScene::build(&device, &TriangleMesh::default(), DriverBuild::FastTrace).unwrap();
    for method in methods {
        let tracer = DriverTracer::new(&device, method).unwrap();
        let theirs = tracer.closest_hits(&scene, &rays).unwrap();
        compare(method.name(), &mesh, &rays, &ours, &theirs);
        assert!(tracer.closest_hits(&empty, &rays).unwrap().iter().all(|hit| !hit.is_hit()));
        assert!(tracer.any_hits(&empty, &rays).unwrap().iter().all(|&hit| !hit));
        assert_eq!(tracer.closest_hits(&scene, &[]).unwrap(), []);
    }
    assert_eq!((empty.triangles(), scene.triangles()), (0, 200));
    assert_silent(&device);
}

#[test]
fn builds_and_rays_of_one_batch_come_in_order() {
    let Some((device, methods)) = ray_tracing() else { return };
    let mesh = niwaki_scene::generate::generate("atrium", 3_000, 1).unwrap().mesh;
    let rays = rays(&mesh, 2_000, 9);
    let scene = DriverScene::build(&device, &mesh, DriverBuild::FastTrace).unwrap();
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    let mode = Mode::Watertight;
    let ours = GpuScene::upload_in(&device, TreeLayout::Wide, mode, &bvh, &mesh).unwrap();
    let our_tracer = Tracer::new(&device).unwrap();
    let ray_buffer = device.upload(&rays).unwrap();
    let answers = [0; 2].map(|_| device.buffer(16 * rays.len() as u64).unwrap());
    for method in methods {
        let tracer = DriverTracer::new(&device, method).unwrap();
        let mut batch = device.batch().unwrap();
        batch.mark("begin").unwrap();
        // Built again before and after rays go through it, and with our kernels between.
        for _ in 0..2 {
            scene.record_build(&mut batch).unwrap();
            let count = niwaki_core::to_u32(rays.len());
            let query = Query::Closest;
            let trace = DriverTrace {
                scene: &scene,
                rays: &ray_buffer,
                count,
                query,
                answers: &answers[0],
            };
            tracer.record(&mut batch, &trace).unwrap();
            batch.mark("theirs").unwrap();
            let trace = niwaki_trace_vulkan::Trace {
                scene: &ours,
                rays: &ray_buffer,
                count,
                query,
                answers: &answers[1],
                work: None,
                schedule: Default::default(),
            };
            our_tracer.record(&mut batch, &trace).unwrap();
            batch.mark("ours").unwrap();
        }
        let timings = batch.submit().unwrap();
        if device.info().timestamp_ns > 0.0 {
            let times = niwaki_trace_vulkan::DriverTimes::of(&timings);
            assert!(times.bottom > 0.0 && times.top > 0.0);
            assert!(timings.passes().filter(|(label, _)| *label == "theirs").count() == 2);
        }
        let [theirs, ours] = answers.each_ref().map(|a| a.read::<Hit>().unwrap());
        assert!(theirs.iter().zip(&ours).filter(|(a, b)| a.prim_id == b.prim_id).count() > 1_990);
        assert!(ours.iter().filter(|hit| hit.is_hit()).count() > 500);
    }
    assert!(scene.bytes() > 0 && scene.scratch_bytes() > 0);
    assert_silent(&device);
}

#[test]
fn what_is_not_offered_is_a_plain_error() {
    let options = DeviceOptions { ray_tracing: false, ..DeviceOptions::checked() };
    let Some(device) = device_with(&options) else { return };
    let mesh = niwaki_hard_cases::soup_mesh(10, 0.3, 5);
    let error = DriverScene::build(&device, &mesh, DriverBuild::FastTrace).unwrap_err();
    assert!(matches!(error, GpuError::NotOffered { .. }), "{error}");
    for method in DriverMethod::ALL {
        assert!(!method.is_offered(device.info()));
        let error = DriverTracer::new(&device, method).unwrap_err();
        assert!(matches!(error, GpuError::NotOffered { .. }), "{error}");
        assert!(error.to_string().contains("Tracer"), "{error}");
    }
    assert_silent(&device);
}
