//! Objects that morph: on the GPU they are where the CPU puts them, before joints bend them.

mod common;

use common::{SIZE, flip, gpu, show, small, sun, whitted};
use niwaki_core::{
    TriangleMesh,
    glam::{DAffine3, DVec3, Vec3},
};
use niwaki_hybrid::{Decision, Effect, HybridRenderer, Settings};
use niwaki_scene::{
    Camera, Environment, Instance, InstancedScene, LoadOptions, Material, Part, Rig, Scene,
    animation::{
        Difference, Influence, Interpolation, Joint, MorphWeights, Placement, RigNode, Skin,
        Targets, Track, WeightTrack,
    },
};
use std::sync::Arc;

fn part(name: &str, positions: Vec<Vec3>, indices: Vec<[u32; 3]>, material: u32) -> Part {
    Part {
        name: name.into(),
        mesh: TriangleMesh::new(positions, indices).unwrap(),
        normals: vec![],
        uvs: vec![],
        influences: vec![],
        targets: None,
        material,
    }
}

/// A ball that one target stretches and another bulges, with the normals that belong to it, on two
/// joints.
fn ball() -> Part {
    const N: u32 = 16;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..=N {
        for j in 0..=2 * N {
            let theta = std::f32::consts::PI * i as f32 / N as f32;
            let phi = std::f32::consts::PI * j as f32 / N as f32;
            let ring = theta.sin();
            positions.push(Vec3::new(ring * phi.cos(), theta.cos(), ring * phi.sin()).normalize());
        }
    }
    let at = |i, j| i * (2 * N + 1) + j;
    for i in 0..N {
        for j in 0..2 * N {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            indices.extend([[a, c, b], [a, d, c]]);
        }
    }
    let mut differences = Vec::new();
    for (v, p) in (0_u32..).zip(&positions) {
        // Half as long again along x; its normal is that of the ellipsoid.
        let normal = (*p * Vec3::new(1.0 / 1.5, 1.0, 1.0)).normalize() - *p;
        let position = Vec3::X * 0.5 * p.x;
        differences.push((v, Difference { position, target: 0, normal, pad: 0 }));
        if p.z > 0.0 {
            let position = Vec3::Z * (0.6 * p.z * p.z);
            let normal = Vec3::new(-0.3 * p.x, -0.3 * p.y, 0.0);
            differences.push((v, Difference { position, target: 1, normal, pad: 0 }));
        }
    }
    let influence = |p: &Vec3| {
        let t = (0.5 * p.y + 0.5).clamp(0.0, 1.0);
        Influence { joints: [0, 1, 0, 0], weights: [1.0 - t, t, 0.0, 0.0] }
    };
    let vertices = positions.len();
    Part {
        normals: positions.clone(),
        influences: positions.iter().map(influence).collect(),
        targets: Some(Targets::new(2, vertices, &differences).unwrap()),
        ..part("ball", positions, indices, 0)
    }
}

/// Without normals: those of its triangles are found where they are.
fn gem() -> Part {
    let positions =
        vec![Vec3::X, Vec3::NEG_X, Vec3::Y * 1.4, Vec3::NEG_Y * 1.4, Vec3::Z, Vec3::NEG_Z];
    let sides =
        [[0, 2, 4], [4, 2, 1], [1, 2, 5], [5, 2, 0], [4, 3, 0], [1, 3, 4], [5, 3, 1], [0, 3, 5]];
    let pull = |v, x: Vec3| (v, Difference { position: x, ..Difference::default() });
    let differences = [pull(2, Vec3::new(0.7, -0.6, 0.0)), pull(4, Vec3::new(0.0, 0.5, 0.4))];
    Part {
        targets: Some(Targets::new(1, 6, &differences).unwrap()),
        ..part("gem", positions, sides.to_vec(), 1)
    }
}

fn scene() -> Scene {
    let corners = [[-5.0, 5.0], [5.0, 5.0], [5.0, -5.0], [-5.0, -5.0]];
    let floor = Part {
        normals: vec![Vec3::Y; 4],
        ..part(
            "floor",
            corners.map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec(),
            vec![[0, 1, 2], [0, 2, 3]],
            2,
        )
    };
    let keys = |values: Vec<f32>, targets| {
        let track = WeightTrack::new(Interpolation::Linear, vec![0.0, 1.0].into(), targets, values);
        MorphWeights { rest: vec![0.0; targets], track: Some(track.unwrap()) }
    };
    let slide =
        Track::new(Interpolation::Linear, vec![0.0, 1.0].into(), vec![[0.0; 3], [0.3, 0.2, 0.0]]);
    let mut node = RigNode::resting(None, DAffine3::IDENTITY, Placement::default());
    node.translation = Some(slide.unwrap());
    let up = DAffine3::from_translation(DVec3::new(-1.4, 1.0, 0.0));
    let joint = |node| Joint { node, from_bind: up };
    let mirrored = DAffine3::from_scale_rotation_translation(
        DVec3::new(-0.8, 0.8, 0.8),
        niwaki_core::glam::DQuat::IDENTITY,
        DVec3::new(1.6, 1.2, 0.5),
    );
    let still = |part| Instance::still(part, DAffine3::IDENTITY);
    let eye = Vec3::new(0.3, 2.4, 6.5);
    let instanced = InstancedScene {
        name: "morph".into(),
        parts: vec![ball(), gem(), floor],
        instances: vec![
            Instance { skin: Some(0), weights: Some(0), ..still(0) },
            Instance { transform: mirrored, weights: Some(1), ..still(1) },
            still(2),
        ],
        materials: vec![
            Material::metal("mirror", Vec3::splat(0.9), 0.0),
            Material::metal("brass", Vec3::new(0.9, 0.7, 0.3), 0.0),
            Material::matte("floor", Vec3::new(0.5, 0.45, 0.4)),
        ],
        textures: vec![],
        cameras: vec![Camera::look_at(eye, Vec3::new(0.2, 1.0, 0.0), Vec3::Y, 0.8)],
        lights: vec![sun()],
        environment: Some(Environment::DAYLIGHT),
        rig: Rig {
            nodes: vec![node],
            skins: vec![Skin { joints: vec![joint(None), joint(Some(0))] }],
            weights: vec![keys(vec![0.0, 0.0, 0.8, 1.0], 2), keys(vec![0.2, 1.0], 1)],
            ..Rig::default()
        },
        duration: 1.0,
        dropped: Default::default(),
    };
    instanced.flatten(&LoadOptions::default()).unwrap()
}

#[test]
fn morphs_are_those_of_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let scene = scene();
    let dynamic: Vec<bool> = scene.objects.iter().map(|o| o.dynamic).collect();
    assert_eq!(dynamic, [true, true, false]);
    // With all traced, and with what lies beyond a small region in the map.
    for (name, settings, most) in
        [("exact", small(Settings::exact()), 0.01), ("map", small(Settings::default()), 0.05)]
    {
        let mut renderer =
            HybridRenderer::new(&gpu, Arc::new(scene.clone()), settings.clone()).unwrap();
        let camera = scene.cameras[0];
        let mut images = Vec::new();
        for time in [0.0, 0.5, 1.0] {
            let frame = renderer.render(&camera, SIZE[0], SIZE[1], time).unwrap();
            let pass = frame.plan.pass(Effect::Deformation).unwrap();
            assert!(matches!(pass.decision, Decision::Run { .. }), "{}", frame.plan);
            assert_eq!(pass.reason, "2 objects morph, move or bend");
            let reference = whitted(&scene.frozen(time).unwrap(), &settings);
            show(&format!("morph-{name}-{time}"), &frame.image);
            show(&format!("morph-whitted-{time}"), &reference);
            let error = flip(&frame.image, &reference);
            println!("{name}, time {time}: FLIP {error:.5}");
            assert!(error <= most, "{name} {time}: {error}");
            images.push(frame.image);
        }
        assert!(flip(&images[0], &images[2]) > 0.04, "nothing morphed");
        let still = renderer.render(&camera, SIZE[0], SIZE[1], 1.0).unwrap();
        assert_eq!(still.plan.decision(Effect::Deformation), Decision::Keep, "{}", still.plan);
        assert_eq!(still.image, images[2]);
    }
}

/// Where only weights change, what is kept of the frame before is no longer right.
#[test]
fn weights_alone_make_a_frame_anew() {
    let Some(gpu) = gpu() else { return };
    let mut scene = scene();
    let animation = scene.animation.as_mut().unwrap();
    let mut rig = (*animation.rig).clone();
    rig.nodes[0].translation = None;
    animation.rig = Arc::new(rig);
    let settings = small(Settings::default());
    let camera = scene.cameras[0];
    let scene = Arc::new(scene);
    let fresh = |time| {
        let renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), settings.clone());
        renderer.unwrap().render(&camera, SIZE[0], SIZE[1], time).unwrap()
    };
    let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), settings.clone()).unwrap();
    for time in [0.0, 0.6, 0.6, 0.1] {
        let frame = renderer.render(&camera, SIZE[0], SIZE[1], time).unwrap();
        assert_eq!(frame.image, fresh(time).image, "{time}");
    }
}
