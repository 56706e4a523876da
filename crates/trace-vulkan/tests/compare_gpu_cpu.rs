//! The GPU gives the answers of the scalar kernels of the CPU; where rounding tells them apart,
//! exact arithmetic says that neither is wrong.

#[path = "common/answers.rs"]
mod answers;
mod common;

use answers::{compare, rays};
use common::{assert_silent, device, device_with};
use niwaki_build_binned::Binned;
use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Builder, Bvh, Hit, Intersector, Ray, TriangleMesh, glam::Vec3};
use niwaki_exact::{Verdict, settle_any};
use niwaki_trace::{BinaryScene, Mode};
use niwaki_trace_vulkan::{
    DeviceOptions, DeviceTree, GpuError, GpuScene, Query, Schedule, Tracer, TreeLayout,
};

/// Rays of a scene.
const RAYS: usize = 100_000;

/// All modes and layouts, all queries.
fn check(tracer: &Tracer, name: &str, bvh: &Bvh, mesh: &TriangleMesh, rays: &[Ray]) {
    for mode in Mode::ALL {
        let cpu = BinaryScene::new_in(mode, bvh, mesh).unwrap();
        let mut theirs = vec![Hit::MISS; rays.len()];
        cpu.closest_hits(rays, &mut theirs);
        let their_flags: Vec<bool> = rays.iter().map(|ray| cpu.any_hit(ray)).collect();
        for layout in TreeLayout::ALL {
            let what = format!("{name}, {} {mode}", layout.name());
            let scene = GpuScene::upload_in(tracer.device(), layout, mode, bvh, mesh).unwrap();
            let ours = tracer.closest_hits(&scene, rays).unwrap();
            let (bits, excused) = compare(&what, mesh, rays, &ours, &theirs);
            let some = &rays[..rays.len().div_ceil(5)];
            let flags = tracer.any_hits(&scene, some).unwrap();
            let mut other_flags = 0;
            for (i, (&our, &their)) in flags.iter().zip(&their_flags).enumerate() {
                if our != their {
                    let verdict = settle_any(&rays[i], mesh, our, their);
                    assert!(verdict != Verdict::OursWrong, "{what}: {:?}: {our}", rays[i]);
                    other_flags += 1;
                }
            }
            println!(
                "{what}: of {} rays, {bits} with other bits, {excused} with other hits, {other_flags} other flags",
                rays.len()
            );
        }
    }
}

fn check_generated(name: &str) {
    let Some(device) = device() else { return };
    let tracer = Tracer::new(&device).unwrap();
    let mesh = niwaki_scene::generate::generate(name, 20_000, 1).unwrap().mesh;
    let rays = rays(&mesh, RAYS, 7);
    check(&tracer, name, &Binned::default().build_mesh(&mesh).unwrap(), &mesh, &rays);
    assert_silent(&device);
}

#[test]
fn an_atrium() {
    check_generated("atrium");
}

#[test]
fn a_city() {
    check_generated("city");
}

#[test]
fn hair() {
    check_generated("hair");
}

#[test]
fn split_references() {
    let Some(device) = device() else { return };
    let tracer = Tracer::new(&device).unwrap();
    let mesh = niwaki_scene::generate::generate("pipes", 3_000, 1).unwrap().mesh;
    let bvh = Sbvh::default().build_mesh(&mesh).unwrap();
    assert!(bvh.prim_ids.len() > mesh.len(), "nothing was split");
    check(&tracer, "pipes", &bvh, &mesh, &rays(&mesh, 20_000, 3));
    assert_silent(&device);
}

#[test]
fn hard_cases() {
    let Some(device) = device() else { return };
    let tracer = Tracer::new(&device).unwrap();
    for case in niwaki_hard_cases::meshes() {
        let bvh = niwaki_hard_cases::median_tree(&case.mesh, 4);
        // Every triangle may be tested.
        let count = if case.mesh.len() > 10_000 { 1 } else { 40 };
        let mut rays = niwaki_hard_cases::rays(&case.mesh, count, 5);
        rays.extend(niwaki_hard_cases::bad_rays(&case.mesh));
        check(&tracer, case.name, &bvh, &case.mesh, &rays);
    }
    assert_silent(&device);
}

#[test]
fn no_ray_leaves_a_closed_surface() {
    let Some(device) = device() else { return };
    let tracer = Tracer::new(&device).unwrap();
    for closed in niwaki_hard_cases::closed() {
        let bvh = niwaki_hard_cases::median_tree(&closed.mesh, 4);
        let rays = closed.rays_from_inside(1_000, 3);
        for layout in TreeLayout::ALL {
            let mode = Mode::Watertight;
            let scene = GpuScene::upload_in(&device, layout, mode, &bvh, &closed.mesh).unwrap();
            let hits = tracer.closest_hits(&scene, &rays).unwrap();
            let lost = hits.iter().zip(&rays).filter(|(hit, _)| !hit.is_hit());
            let lost: Vec<_> = lost.map(|(_, ray)| ray).collect();
            assert!(lost.is_empty(), "{} {layout:?}: {}, {:?}", closed.name, lost.len(), lost[0]);
        }
    }
    assert_silent(&device);
}

#[test]
fn nothing_to_trace() {
    let Some(device) = device() else { return };
    let tracer = Tracer::new(&device).unwrap();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    for layout in TreeLayout::ALL {
        let (bvh, mesh) = (Bvh::default(), TriangleMesh::default());
        let empty = GpuScene::upload_in(&device, layout, Mode::Fast, &bvh, &mesh).unwrap();
        assert_eq!(tracer.closest_hits(&empty, &[ray]).unwrap(), [Hit::MISS]);
        assert_eq!(tracer.any_hits(&empty, &[ray, ray]).unwrap(), [false; 2]);
        assert_eq!(tracer.closest_hits(&empty, &[]).unwrap(), []);
        let many = Schedule::Persistent { groups: 3 };
        assert_eq!(tracer.closest_hits_by(many, &empty, &[]).unwrap(), []);
    }
    assert_silent(&device);
}

#[test]
fn schedules_and_counters_do_not_change_answers() {
    let Some(device) = device() else { return };
    let tracer = Tracer::new(&device).unwrap();
    let mesh = niwaki_scene::generate::generate("city", 5_000, 1).unwrap().mesh;
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    let rays = rays(&mesh, 10_001, 9);
    let cpu = BinaryScene::new(&bvh, &mesh).unwrap();
    for layout in TreeLayout::ALL {
        let scene = GpuScene::upload_in(&device, layout, Mode::Watertight, &bvh, &mesh).unwrap();
        let hits = tracer.closest_hits(&scene, &rays).unwrap();
        for groups in [1, 7, 1_000] {
            let schedule = Schedule::Persistent { groups };
            let same = tracer.closest_hits_by(schedule, &scene, &rays).unwrap() == hits;
            assert!(same, "{groups} groups, {layout:?}");
        }
        let (counted, counts) = tracer.closest_hits_counted(&scene, &rays).unwrap();
        assert!(counted == hits);
        let ours: niwaki_trace::Counts = counts.into_iter().sum();
        let theirs: niwaki_trace::Counts =
            rays.iter().map(|ray| cpu.closest_hit_counted(ray).1).sum();
        // The slabs of the two differ by rounding only, which decides about few boxes.
        let near = |a: u64, b: u64, share: f64| (a as f64 / b as f64 - 1.0).abs() <= share;
        match layout {
            TreeLayout::Binary => assert!(
                near(ours.nodes, theirs.nodes, 0.01)
                    && near(ours.boxes, theirs.boxes, 0.01)
                    && near(ours.leaves, theirs.leaves, 0.03)
                    && near(ours.triangles, theirs.triangles, 0.03),
                "{ours:?}, {theirs:?}"
            ),
            // A wide node stands for up to seven binary ones.
            TreeLayout::Wide => assert!(
                ours.nodes * 2 < theirs.nodes && ours.nodes * 14 > theirs.nodes,
                "{ours:?}, {theirs:?}"
            ),
        }
    }
    assert_silent(&device);
    assert_eq!(Query::Any.answer_bytes(), 4);
}

#[test]
fn no_depth_loses_a_hit() {
    let Some(device) = device() else { return };
    // A node that is ten thousand deep, and one whose loops outlast the software driver's.
    for (count, rays) in [(1_000, 200), (10_000, 50), (60_000, 4)] {
        let triangles = niwaki_hard_cases::deep_chain(count);
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        let bvh = chain(&mesh);
        let rays = niwaki_hard_cases::aimed_at_borders(&mesh, rays, 5);
        let mut theirs = vec![Hit::MISS; rays.len()];
        BinaryScene::new(&bvh, &mesh).unwrap().closest_hits(&rays, &mut theirs);
        for layout in TreeLayout::ALL {
            let tracer = Tracer::new(&device).unwrap();
            let mode = Mode::Watertight;
            let scene = GpuScene::upload_in(&device, layout, mode, &bvh, &mesh).unwrap();
            let ours = tracer.closest_hits(&scene, &rays).unwrap();
            compare(&format!("{count} deep, {layout:?}"), &mesh, &rays, &ours, &theirs);
        }
    }
    assert_silent(&device);
}

/// Each inner node has one triangle and the rest.
fn chain(mesh: &TriangleMesh) -> Bvh {
    use niwaki_core::{Aabb, BvhNode, to_u32};
    let bounds: Vec<Aabb> = mesh.triangles().map(|t| t.bounds()).collect();
    let mut rest = bounds.clone();
    for i in (0..rest.len() - 1).rev() {
        rest[i] = rest[i].union(rest[i + 1]);
    }
    let last = mesh.len() - 1;
    let mut nodes = vec![BvhNode::inner(rest[0], 1)];
    for i in 0..last {
        nodes.push(BvhNode::leaf(bounds[i], to_u32(i), 1));
        nodes.push(if i + 1 == last {
            BvhNode::leaf(bounds[last], to_u32(last), 1)
        } else {
            BvhNode::inner(rest[i + 1], to_u32(2 * i + 3))
        });
    }
    Bvh { nodes, prim_ids: (0..to_u32(mesh.len())).collect() }
}

#[test]
fn budgets_and_parts_do_not_change_answers() {
    let options = DeviceOptions { max_binding_bytes: Some(1 << 17), ..DeviceOptions::checked() };
    let (Some(device), Some(small)) = (device(), device_with(&options)) else { return };
    let mesh = niwaki_scene::generate::generate("atrium", 6_000, 1).unwrap().mesh;
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    let rays = rays(&mesh, 1_000, 11);
    for layout in TreeLayout::ALL {
        let mode = Mode::Watertight;
        let scene = GpuScene::upload_in(&device, layout, mode, &bvh, &mesh).unwrap();
        assert!(!scene.is_in_pieces());
        let tracer = Tracer::new(&device).unwrap();
        let hits = tracer.clone().with_budget(None).closest_hits(&scene, &rays).unwrap();
        let flags = tracer.clone().with_budget(None).any_hits(&scene, &rays).unwrap();
        assert!(hits.iter().zip(&flags).all(|(hit, &flag)| hit.is_hit() == flag));
        for steps in [16, 1_000] {
            let tracer = tracer.clone().with_budget(Some(steps));
            assert!(tracer.closest_hits(&scene, &rays).unwrap() == hits, "{steps}");
            assert!(tracer.any_hits(&scene, &rays).unwrap() == flags, "{steps}");
            let some = Schedule::Persistent { groups: 8 };
            assert!(tracer.closest_hits_by(some, &scene, &rays).unwrap() == hits, "{steps}");
        }
        let scene = GpuScene::upload_in(&small, layout, mode, &bvh, &mesh).unwrap();
        assert!(scene.is_in_pieces(), "{} bytes", scene.bytes());
        let tracer = Tracer::new(&small).unwrap();
        assert!(tracer.closest_hits(&scene, &rays).unwrap() == hits, "in parts");
    }
    // More than four parts.
    let options = DeviceOptions { max_binding_bytes: Some(1 << 14), ..DeviceOptions::checked() };
    let Some(tiny) = device_with(&options) else { return };
    let error = GpuScene::upload(&tiny, &bvh, &mesh).unwrap_err();
    assert!(matches!(error, GpuError::TooLarge { .. }), "{error}");
    for device in [&device, &small, &tiny] {
        assert_silent(device);
    }
}

#[test]
fn a_tree_of_another_mesh_is_refused() {
    let Some(device) = device() else { return };
    let mesh = niwaki_hard_cases::soup_mesh(100, 1.0, 1);
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    let other = niwaki_hard_cases::soup_mesh(50, 1.0, 1);
    let mut cyclic = bvh.clone();
    cyclic.nodes[1] = niwaki_core::BvhNode::inner(bvh.bounds(), 0);
    for layout in TreeLayout::ALL {
        let upload = |bvh: &Bvh, mesh| {
            GpuScene::upload_in(&device, layout, Mode::Fast, bvh, mesh).unwrap_err()
        };
        assert!(matches!(upload(&bvh, &other), GpuError::Scene(_)));
        assert!(matches!(upload(&cyclic, &mesh), GpuError::Scene(_)));
    }
}

#[test]
fn a_tree_that_is_on_the_device_is_traced_there() {
    let Some(device) = device() else { return };
    let mesh = niwaki_hard_cases::soup_mesh(2_000, 0.1, 4);
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    let rays = rays(&mesh, 2_000, 2);
    let tracer = Tracer::new(&device).unwrap();
    let mode = Mode::Watertight;
    let uploaded = GpuScene::upload_in(&device, TreeLayout::Binary, mode, &bvh, &mesh).unwrap();
    let rows: Vec<[[u32; 4]; 3]> = bvh
        .prim_ids
        .iter()
        .map(|&id| {
            mesh.triangle(id as usize).vertices().map(|v| {
                let [x, y, z] = v.to_array().map(f32::to_bits);
                [x, y, z, id]
            })
        })
        .collect();
    let tree = DeviceTree {
        nodes: device.upload(&bvh.nodes).unwrap(),
        parents: None,
        triangles: device.upload(&rows).unwrap(),
        mode,
        bounds: bvh.bounds(),
    };
    let adopted = GpuScene::adopt(tree).unwrap();
    let hits = tracer.closest_hits(&adopted, &rays).unwrap();
    assert!(hits == tracer.closest_hits(&uploaded, &rays).unwrap());
    assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 200);
    assert_silent(&device);
}
