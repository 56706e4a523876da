//! Shadow volumes where they are hard: open and non-manifold meshes, cameras and lights in awkward
//! places. Rays in double precision say what is right.

mod common;

use common::{SIZE, gpu, ground, scene, settings, square, volumes};
use niwaki_core::glam::Vec3;
use niwaki_raster::{Algorithm, Renderer, Settings, SpotLight};
use niwaki_scene::Camera;

fn camera(eye: Vec3, target: Vec3) -> Camera {
    Camera::look_at(eye, target, Vec3::Y, 1.0)
}

fn overview() -> Camera {
    camera(Vec3::new(3.1, 4.3, 6.2), Vec3::new(0.0, 0.6, 0.0))
}

fn lamp(position: Vec3) -> SpotLight {
    SpotLight::aimed(position, Vec3::new(0.1, 0.0, 0.05), 1.0, 30.0, Vec3::splat(50.0))
}

/// Asserts that shadow volumes are right but for silhouettes, and that there is something to see.
fn check(
    what: &str,
    (positions, indices): (Vec<Vec3>, Vec<[u32; 3]>),
    light: SpotLight,
    camera: &Camera,
) {
    let scene = scene(positions, indices);
    let Some((error, [shadowed, lit])) = volumes(&scene, &[light], camera) else { return };
    println!("{what}: {error:?}, {shadowed} in shadow, {lit} lit");
    assert!(shadowed > 50 && lit > 50, "{what}: {shadowed} in shadow, {lit} lit");
    assert_eq!(error.wrong_elsewhere + error.wrong_averted, 0, "{what}: {error:?}");
    assert!(error.wrong_at_silhouettes * 20 <= error.silhouettes.max(100), "{what}: {error:?}");
}

#[test]
fn open_meshes_cast_shadows_from_both_sides() {
    for turned in [false, true] {
        let (mut positions, mut indices) = ground();
        let axes = if turned { [Vec3::X, Vec3::Z] } else { [Vec3::Z, Vec3::X] };
        square(&mut positions, &mut indices, Vec3::new(0.3, 1.5, 0.1), axes);
        let light = lamp(Vec3::new(1.0, 5.0, 0.7));
        check("a square", (positions, indices), light, &overview());
    }
}

#[test]
fn edges_with_three_and_four_triangles_make_right_volumes() {
    for blades in [3, 4, 5] {
        let (mut positions, mut indices) = ground();
        let i = u32::try_from(positions.len()).unwrap();
        // Blades around one edge, wound in turn one way and the other.
        positions.extend([Vec3::new(0.0, 0.3, 0.0), Vec3::new(0.2, 2.3, 0.1)]);
        for k in 0..blades {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / blades as f32 + 0.3).sin_cos();
            positions.push(Vec3::new(1.3 * cos, 1.2, 1.3 * sin));
            let tip = i + 2 + k;
            indices.push(if k % 2 == 0 { [i, i + 1, tip] } else { [i + 1, i, tip] });
        }
        let light = lamp(Vec3::new(-1.7, 5.0, 2.0));
        check("blades", (positions, indices), light, &overview());
    }
}

#[test]
fn equal_opposite_and_degenerate_triangles_do_no_harm() {
    let (mut positions, mut indices) = ground();
    let from = positions.len();
    square(&mut positions, &mut indices, Vec3::new(0.3, 1.5, 0.1), [Vec3::Z, Vec3::X]);
    let i = u32::try_from(from).unwrap();
    // Twice the same, once the other way round, a point, a line, and a corner used twice.
    indices.extend([[i, i + 1, i + 2], [i, i + 2, i + 1], [i, i, i], [i, i + 1, i + 1]]);
    let far = u32::try_from(positions.len()).unwrap();
    positions.extend([
        Vec3::new(-2.0, 1.0, 0.0),
        Vec3::new(0.0, 1.5, 0.0),
        Vec3::new(2.0, 2.0, 0.0),
    ]);
    indices.push([far, far + 1, far + 2]);
    check("copies", (positions, indices), lamp(Vec3::new(1.0, 5.0, 0.7)), &overview());
}

#[test]
fn the_camera_may_stand_in_a_shadow_volume() {
    let (mut positions, mut indices) = ground();
    square(&mut positions, &mut indices, Vec3::new(0.0, 3.0, 0.0), [Vec3::Z * 1.5, Vec3::X * 1.5]);
    let camera = camera(Vec3::new(0.2, 1.2, 0.3), Vec3::new(2.4, 0.0, 3.2));
    check("below a roof", (positions, indices), lamp(Vec3::new(0.3, 6.0, 0.4)), &camera);
}

#[test]
fn lights_may_shine_at_the_camera_or_from_behind_it() {
    let build = || {
        let (mut positions, mut indices) = ground();
        let up = [Vec3::X * 0.8, Vec3::Y * 0.8];
        square(&mut positions, &mut indices, Vec3::new(0.2, 0.9, 0.5), up);
        (positions, indices)
    };
    let eye = Vec3::new(0.4, 2.2, 5.0);
    let camera = camera(eye, Vec3::new(0.0, 0.3, 0.0));
    for (what, position) in [
        ("at the camera", Vec3::new(-0.5, 3.0, -4.5)),
        ("from behind", eye + Vec3::new(-4.5, 0.3, 1.0)),
        ("from the camera's plane", eye + Vec3::new(2.0, 0.5, 0.0)),
    ] {
        check(what, build(), lamp(position), &camera);
    }
}

#[test]
fn lights_within_closed_meshes_light_only_their_inside() {
    // A room of six walls, one of them with a hole in the middle.
    let (mut positions, mut indices) = ground();
    let middle = Vec3::new(0.0, 1.2, 0.0);
    for axis in [Vec3::X, Vec3::Z] {
        let other = Vec3::Y.cross(axis);
        for side in [-1.0, 1.0] {
            let at = middle + axis * side * 1.5;
            if axis == Vec3::X && side > 0.0 {
                // Left and right of a gap.
                for edge in [-1.0, 1.0] {
                    let part = [other * 0.6, Vec3::Y * 1.2];
                    square(&mut positions, &mut indices, at + other * (0.9 * edge), part);
                }
            } else {
                square(&mut positions, &mut indices, at, [other * 1.5, Vec3::Y * 1.2]);
            }
        }
    }
    square(&mut positions, &mut indices, Vec3::new(0.0, 2.4, 0.0), [Vec3::Z * 1.5, Vec3::X * 1.5]);
    let light = SpotLight::aimed(
        Vec3::new(-0.9, 1.7, 0.1),
        Vec3::new(4.0, 0.0, 0.1),
        1.0,
        20.0,
        Vec3::splat(20.0),
    );
    let camera = camera(Vec3::new(6.5, 2.8, 2.0), Vec3::new(1.5, 0.7, 0.0));
    check("a room with a gap", (positions, indices), light, &camera);
}

#[test]
fn heaps_of_triangles_of_any_winding_cast_right_shadows() {
    // A small generator, as tests need no other.
    let mut state = 0x9e37_79b9_u32;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        (state >> 8) as f32 / (1 << 24) as f32
    };
    for round in 0..3 {
        let (mut positions, mut indices) = ground();
        for _ in 0..60 {
            let i = u32::try_from(positions.len()).unwrap();
            let middle =
                Vec3::new(4.0 * random() - 2.0, 0.3 + 2.0 * random(), 4.0 * random() - 2.0);
            for _ in 0..3 {
                positions.push(middle + Vec3::new(random(), random(), random()) - 0.5);
            }
            indices.push([i, i + 1, i + 2]);
        }
        let light = lamp(Vec3::new(2.0 * random(), 4.5, 2.0 * random()));
        check(&format!("heap {round}"), (positions, indices), light, &overview());
    }
}

#[test]
fn scale_and_place_of_a_scene_do_not_matter() {
    for (scale, offset) in
        [(1e-3, Vec3::ZERO), (1e4, Vec3::ZERO), (1.0, Vec3::new(900.0, -500.0, 700.0))]
    {
        let place = |p: Vec3| p * scale + offset;
        let (mut positions, mut indices) = ground();
        square(&mut positions, &mut indices, Vec3::new(0.3, 1.5, 0.1), [Vec3::Z, Vec3::X]);
        positions.iter_mut().for_each(|p| *p = place(*p));
        let light = SpotLight::aimed(
            place(Vec3::new(1.0, 5.0, 0.7)),
            place(Vec3::new(0.1, 0.0, 0.05)),
            1.0,
            30.0 * scale,
            Vec3::splat(50.0 * scale * scale),
        );
        let camera = camera(place(Vec3::new(3.1, 4.3, 6.2)), place(Vec3::new(0.0, 0.6, 0.0)));
        check(&format!("times {scale}"), (positions, indices), light, &camera);
    }
}

/// A tube around a closed curve, wound outward; `wild` curves cross themselves and have tighter turns
/// than the tube is wide, which turns parts of it inside out.
fn tube(positions: &mut Vec<Vec3>, indices: &mut Vec<[u32; 3]>, at: Vec3, radius: f32, wild: f32) {
    const AROUND: u32 = 28;
    const SIDES: u32 = 10;
    let first = u32::try_from(positions.len()).unwrap();
    let turn = |i: u32, n: u32| std::f32::consts::TAU * (i % n) as f32 / n as f32;
    for i in 0..AROUND {
        let (sin, cos) = turn(i, AROUND).sin_cos();
        let (sin2, cos2) = (2.0 * turn(i, AROUND)).sin_cos();
        let middle = Vec3::new(cos + 0.6 * wild * cos2, 0.3 * wild * sin2, sin - 0.6 * wild * sin2);
        let out = Vec3::new(cos, 0.0, sin);
        for k in 0..SIDES {
            let (s, c) = turn(k, SIDES).sin_cos();
            positions.push(at + middle + (out * c + Vec3::Y * s) * radius);
        }
    }
    for i in 0..AROUND {
        for k in 0..SIDES {
            let v = |i: u32, k: u32| first + i % AROUND * SIDES + k % SIDES;
            let quad = [v(i, k), v(i, k + 1), v(i + 1, k + 1), v(i + 1, k)];
            indices.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
        }
    }
}

/// Closed meshes cast from one side. Which one follows from where the eye and the light are: outside,
/// within, wound either way, crossing themselves, one in the other.
#[test]
fn closed_meshes_cast_from_one_side_wherever_eye_and_light_are() {
    let at = Vec3::new(0.0, 1.3, 0.0);
    let out = Vec3::new(1.4, 4.6, 0.8);
    let eye = Vec3::new(3.1, 4.3, 6.2);
    for (radius, wild) in [(0.45, 0.0), (0.5, 1.0)] {
        // In the tube where it begins, and a bit along it.
        let middle = at + Vec3::X * (1.0 + 0.6 * wild);
        let [within, below] = [Vec3::new(0.0, 0.15, 0.05), Vec3::new(0.1, -0.05, -0.1)];
        let [within, below] = [middle + within, middle + below];
        let along = middle + Vec3::new(-0.2, 0.6 * wild, 1.0 - 1.2 * wild);
        let ground = Vec3::new(0.1, 0.0, 0.05);
        for turned in [false, true] {
            for (what, eye, target, [lamp_at, aim]) in [
                ("outside", eye, at, [out, ground]),
                ("light within", eye, at, [within, ground]),
                ("eye within", below, along, [out, ground]),
                ("both within", below, along, [within, along]),
            ] {
                let (mut positions, mut indices) = common::ground();
                let from = indices.len();
                tube(&mut positions, &mut indices, at, radius, wild);
                // A smaller one within, wound the other way.
                let inner = indices.len();
                tube(&mut positions, &mut indices, at, 0.2 * radius, wild);
                indices[inner..].iter_mut().for_each(|t| t.swap(1, 2));
                if turned {
                    indices[from..].iter_mut().for_each(|t| t.swap(1, 2));
                }
                let scene = scene(positions, indices);
                let light = SpotLight::aimed(lamp_at, aim, 1.0, 30.0, Vec3::splat(9.0));
                let Some((error, counts)) = volumes(&scene, &[light], &camera(eye, target)) else {
                    return;
                };
                let what = format!("{what}, radius {radius}, turned: {turned}");
                println!("{what}: {error:?}, {counts:?}");
                assert!(error.reached > 300, "{what}: {error:?}");
                assert_eq!(error.wrong_elsewhere + error.wrong_averted, 0, "{what}: {error:?}");
            }
        }
    }
}

/// The stencil counts to 255 and wraps: 300 volumes are still told from none. (256 are not.)
#[test]
fn hundreds_of_layers_are_counted() {
    let (mut positions, mut indices) = ground();
    for _ in 0..300 {
        square(&mut positions, &mut indices, Vec3::new(0.3, 1.5, 0.1), [Vec3::Z, Vec3::X]);
    }
    check("layers", (positions, indices), lamp(Vec3::new(1.0, 5.0, 0.7)), &overview());
}

/// Extraction on the GPU counts what it should: a closed box casts from the six triangles that face
/// the light, with a wall at each of the six edges of its outline. From both sides it casts twice.
#[test]
fn a_box_has_the_walls_of_its_outline() {
    let Some(gpu) = gpu() else { return };
    let corner = |i: u8| {
        let pick = |bit: u8| if i & bit == 0 { -0.5 } else { 0.5 };
        Vec3::new(pick(1), pick(2) + 1.0, pick(4))
    };
    let positions: Vec<Vec3> = (0..8).map(corner).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    let scene = scene(positions, indices.collect());
    let light = SpotLight::aimed(Vec3::new(3.0, 4.0, 5.0), Vec3::Y, 0.8, 30.0, Vec3::ONE);
    let mut renderer =
        Renderer::new(&gpu, scene.clone(), vec![light], settings(Algorithm::ShadowVolumes))
            .unwrap();
    renderer.draw(&overview(), SIZE[0], SIZE[1]).unwrap();
    // From over a corner three sides are seen, and the outline has six edges.
    assert_eq!(renderer.volume_counts().unwrap(), Some([6, 0, 6]));
    let both = Settings { one_sided: false, ..renderer.settings().clone() };
    renderer.set_settings(both);
    renderer.draw(&overview(), SIZE[0], SIZE[1]).unwrap();
    assert_eq!(renderer.volume_counts().unwrap(), Some([6, 6, 12]));
    // A light that points away reaches nothing.
    let away = SpotLight { direction: -light.direction, ..light };
    renderer.set_lights(vec![away]);
    renderer.draw(&overview(), SIZE[0], SIZE[1]).unwrap();
    assert_eq!(renderer.volume_counts().unwrap(), Some([0, 0, 0]));
}
