//! Objects and their motion.

use niwaki_core::glam::{Mat3, Vec3, Vec4};
use niwaki_scene::{
    Animation, Hop, Motion, ObjectPose, Rigid, Scene, Wave,
    generate::{NAMES, generate},
};
use proptest::prelude::*;

fn make(name: &str, triangles: usize) -> Scene {
    generate(name, triangles, 3).expect("the name is in the list")
}

#[test]
fn objects_hold_every_triangle_and_vertex_once() {
    for name in NAMES {
        let scene = make(name, 6000);
        let (mut triangle, mut vertex) = (0, 0);
        for object in &scene.objects {
            assert_eq!((object.triangles.start, object.vertices.start), (triangle, vertex));
            (triangle, vertex) = (object.triangles.end, object.vertices.end);
            for t in object.triangles.clone() {
                for i in scene.mesh.indices()[t as usize] {
                    assert!(object.vertices.contains(&i), "{name}: {}", object.name);
                    assert!(object.bounds.contains_point(scene.mesh.positions()[i as usize]));
                }
            }
        }
        assert_eq!(triangle as usize, scene.mesh.len(), "{name}");
        assert_eq!(vertex as usize, scene.mesh.positions().len(), "{name}");
    }
}

#[test]
fn dynamic_objects_are_those_that_move() {
    for name in NAMES {
        let scene = make(name, 4000);
        let mut moved = vec![false; scene.objects.len()];
        for k in 0..12 {
            for (moved, pose) in moved.iter_mut().zip(scene.poses(0.37 * f64::from(k))) {
                *moved |= !pose.is_rest();
            }
        }
        let dynamic: Vec<bool> = scene.objects.iter().map(|o| o.dynamic).collect();
        assert_eq!(dynamic, moved, "{name}");
        assert_eq!(scene.animation.is_some(), dynamic.contains(&true), "{name}");
    }
}

#[test]
fn animated_vertices_stay_within_the_bounds_of_their_pose() {
    for name in NAMES {
        let scene = make(name, 4000);
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for time in [0.0, 0.9, 3.3, -2.0, 1e9] {
            scene.animate(time, &mut positions, &mut normals);
            assert!(positions.iter().all(|p| p.is_finite()), "{name}");
            assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3), "{name}");
            for (object, pose) in scene.objects.iter().zip(scene.poses(time)) {
                let bounds = pose.bounds(object.bounds);
                let slack = Vec3::splat(1e-4 * (1.0 + bounds.extent().max_element()));
                for &p in &positions[object.vertices.start as usize..object.vertices.end as usize] {
                    let inside = p.cmpge(bounds.min - slack) & p.cmple(bounds.max + slack);
                    assert!(inside.all(), "{name}: {} at {time}", object.name);
                }
            }
            let frozen = scene.frozen(time).expect("finite");
            assert_eq!(frozen.mesh.positions(), positions);
            assert!(frozen.objects.iter().zip(&scene.objects).all(|(a, b)| a.name == b.name));
        }
    }
}

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    [-size..size, -size..size, -size..size].prop_map(Vec3::from)
}

fn pose_of(motion: Motion, time: f64) -> ObjectPose {
    Animation { motions: vec![motion], duration: 1.0, ..Animation::default() }.poses(time, 1)[0]
}

proptest! {
    /// A hop is a rotation and a translation: distances stay.
    #[test]
    fn hops_are_rigid(pivot in vector(5.0), axis in vector(1.0), jump in vector(3.0),
            sway in vector(1.0), turns in -2.5_f32..2.5, time in -20.0..20.0_f64,
            a in vector(4.0), b in vector(4.0)) {
        prop_assume!(axis.length() > 0.1);
        let hop = Hop { pivot, axis: axis.normalize(), jump, sway, turns, period: 1.7,
            airborne: 0.6, sway_period: 2.3, ..Hop::default() };
        let pose = pose_of(Motion { rigid: Rigid::Hop(hop), ..Motion::default() }, time);
        let (before, after) = (a.distance(b), pose.point(a).distance(pose.point(b)));
        prop_assert!((before - after).abs() < 1e-4, "{before} {after}");
        let [x, y, z] = pose.rows.map(Vec4::truncate);
        prop_assert!((Mat3::from_cols(x, y, z).determinant() - 1.0).abs() < 1e-5);
    }

    /// The normal of a bent surface is that of two small steps along it.
    #[test]
    fn normals_follow_the_bent_surface(p in vector(1.0), n in vector(1.0), d in vector(0.3),
            k in vector(0.5), h in vector(0.4), time in 0.0..5.0_f64) {
        prop_assume!(n.length() > 0.2);
        let wave = Wave { displacement: d, wave: k, frequency: 0.7, phase: 0.2, hold: h,
            hold_offset: 0.5 };
        let hop = Hop { turns: 0.3, jump: Vec3::Y, ..Hop::default() };
        let pose = pose_of(Motion { rigid: Rigid::Hop(hop), wave: Some(wave), ..Motion::default() }, time);
        // Away from where the weight begins and ends, and from surfaces bent over themselves.
        let s = h.dot(p) + 0.5;
        prop_assume!((0.01..0.99).contains(&s));
        let n = n.normalize();
        let u = n.any_orthonormal_vector();
        let v = n.cross(u);
        let step = |e: Vec3| (pose.point(p + e * 0.01) - pose.point(p - e * 0.01)) / 0.02;
        let expected = step(u).cross(step(v));
        prop_assume!(expected.length() > 0.2);
        let cosine = pose.normal(p, n).dot(expected.normalize());
        prop_assert!(cosine.abs() > 0.999, "{cosine}");
    }

    /// Nothing that a motion may say gives a pose that is not finite.
    #[test]
    fn no_motion_gives_a_pose_that_is_not_finite(v in prop::collection::vec(
            prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(0.0), Just(-1.0), Just(f32::MAX),
                Just(1e-40), -2.0_f32..2.0], 14), time in prop_oneof![Just(f64::NAN),
                Just(f64::INFINITY), Just(1e300), -1e3..1e3]) {
        let axis = Vec3::new(v[0], v[1], v[2]);
        let hop = Hop { pivot: Vec3::new(v[3], v[4], v[5]), axis, turns: v[6], jump: axis,
            period: v[7], phase: v[8], airborne: v[9], sway: axis, sway_period: v[10],
            sway_phase: v[11] };
        let wave = Wave { displacement: axis, wave: axis, frequency: v[12], phase: v[13],
            hold: axis, hold_offset: v[11] };
        let pose = pose_of(Motion { rigid: Rigid::Hop(hop), wave: Some(wave), ..Motion::default() }, time);
        let all = pose.rows.into_iter().chain([pose.displacement, pose.wave, pose.hold]);
        prop_assert!(all.into_iter().all(Vec4::is_finite));
    }
}

#[test]
fn a_hop_lands_where_it_stood() {
    let hop = Hop { jump: Vec3::Y, turns: 2.0, airborne: 0.5, ..Hop::default() };
    let motion = Motion { rigid: Rigid::Hop(hop), ..Motion::default() };
    for (time, height) in [(0.0, 0.0), (0.25, 1.0), (0.5, 0.0), (0.8, 0.0), (1.25, 1.0)] {
        let p = pose_of(motion.clone(), time).point(Vec3::X);
        assert!((p.y - height).abs() < 1e-6 && (p.x.hypot(p.z) - 1.0).abs() < 1e-6, "{time}: {p}");
    }
    assert!(pose_of(motion, 0.75).point(Vec3::X).distance(Vec3::X) < 1e-6);
}
