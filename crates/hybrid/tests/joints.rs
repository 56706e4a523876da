//! Objects that joints bend: on the GPU they are where the CPU puts them.

mod common;

use common::{Parts, SIZE, flip, gpu, show, small, sun, whitted};
use niwaki_core::glam::{DAffine3, Vec3};
use niwaki_hybrid::{Decision, Effect, HybridRenderer, Settings};
use niwaki_scene::{
    Animation, Camera, Environment, Material, Motion, Rig,
    animation::{Influence, Interpolation, Joint, Placement, RigNode, Skin, Skinned, Track},
};
use std::sync::Arc;

/// A ball whose upper half hangs on a joint that moves aside, over a floor.
fn bent_ball() -> niwaki_scene::Scene {
    let mirror = Material::metal("mirror", Vec3::splat(0.9), 0.0);
    let floor = Material::matte("floor", Vec3::new(0.5, 0.45, 0.4));
    let parts = Parts::default()
        .quad(Vec3::new(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::Z * -8.0, &floor)
        .sphere(Vec3::Y, 1.0, &mirror);
    let eye = Vec3::new(0.5, 2.5, 6.0);
    let camera = Camera::look_at(eye, Vec3::new(0.5, 1.0, 0.0), Vec3::Y, 0.8);
    let mut scene = parts.build(camera, vec![sun()], Environment::DAYLIGHT);
    let ball = scene.objects[1].vertices.start as usize..scene.objects[1].vertices.end as usize;
    let positions = scene.mesh.positions()[ball.clone()].to_vec();
    let influence = |p: &Vec3| {
        let t = (p.y - 0.5).clamp(0.0, 1.0);
        Influence { joints: [0, 1, 0, 0], weights: [1.0 - t, t, 0.0, 0.0] }
    };
    let influences = positions.iter().map(influence).collect();
    let track =
        Track::new(Interpolation::Linear, vec![0.0, 1.0].into(), vec![[0.0; 3], [1.2, 0.5, 0.3]]);
    let mut node = RigNode::resting(None, DAffine3::IDENTITY, Placement::default());
    node.translation = Some(track.unwrap());
    let joint = |node| Joint { node, from_bind: DAffine3::IDENTITY };
    let normals = scene.normals[ball].to_vec();
    let rig = Rig {
        nodes: vec![node],
        skins: vec![Skin { joints: vec![joint(None), joint(Some(0))] }],
        skinned: vec![Skinned::new(0, 2, positions, normals, influences).unwrap()],
        ..Rig::default()
    };
    let motions = vec![Motion::default(), Motion { skinned: Some(0), ..Motion::default() }];
    scene.objects[1].dynamic = true;
    scene.animation = Some(Animation { motions, duration: 1.0, rig: Arc::new(rig) });
    scene
}

#[test]
fn joints_bend_objects_as_on_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let scene = bent_ball();
    let settings = small(Settings::exact());
    let mut renderer =
        HybridRenderer::new(&gpu, Arc::new(scene.clone()), settings.clone()).unwrap();
    let camera = scene.cameras[0];
    let mut images = Vec::new();
    for time in [0.0, 1.0] {
        let frame = renderer.render(&camera, SIZE[0], SIZE[1], time).unwrap();
        assert!(frame.plan.runs(Effect::Deformation), "{}", frame.plan);
        assert!(frame.plan.runs(Effect::NearRegion), "{}", frame.plan);
        let reference = whitted(&scene.frozen(time).unwrap(), &settings);
        show(&format!("bent-{time}"), &frame.image);
        let error = flip(&frame.image, &reference);
        println!("time {time}: FLIP {error:.5}");
        assert!(error <= 0.01, "{time}: {error}");
        images.push(frame.image);
    }
    assert!(flip(&images[0], &images[1]) > 0.02, "nothing bent");
    let still = renderer.render(&camera, SIZE[0], SIZE[1], 1.0).unwrap();
    assert_eq!(still.plan.decision(Effect::Deformation), Decision::Keep, "{}", still.plan);
    assert_eq!(still.plan.decision(Effect::NearRegion), Decision::Keep, "{}", still.plan);
    assert_eq!(still.image, images[1]);
}
