//! Recorded rays lie where the path tracer put them.

mod common;

use common::{Parts, brute, camera, lambert};
use niwaki_core::{
    Aabb, Intersector, Ray,
    glam::{Vec2, Vec3},
};
use niwaki_render::{RayKind, RecordSettings, View, random_rays, record_rays};
use niwaki_scene::{Environment, Light, LightKind, Material, Scene};

const LAMP_HEIGHT: f32 = 3.0;

/// A closed room with a lamp under the ceiling, boxes, and a camera inside.
fn room() -> Scene {
    Parts::new()
        .cuboid(Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 3.5, 3.0), &lambert(0.7))
        .cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(0.0, 1.0, 0.0), &Material::default())
        .quad(
            Vec3::new(-0.5, LAMP_HEIGHT, -0.5),
            Vec3::X,
            Vec3::Z,
            &Material::emitter("lamp", Vec3::splat(5.0)),
        )
        .scene(camera(Vec3::new(2.0, 1.8, 2.5), Vec3::Y, 1.0), Environment::DARK)
}

fn record(scene: &Scene, max_rays: usize) -> niwaki_render::RaySets {
    let settings = RecordSettings { max_rays, seed: 3, depth: 3, ..RecordSettings::default() };
    record_rays(scene, &brute(&scene.mesh), &settings)
}

#[test]
fn sets_have_the_promised_names_kinds_and_sizes() {
    let scene = room();
    let sets = record(&scene, 1000);
    let found: Vec<_> = sets.sets.iter().map(|(n, k, _)| (n.as_str(), *k)).collect();
    assert_eq!(
        found,
        [
            ("camera", RayKind::ClosestHit),
            ("shadow", RayKind::AnyHit),
            ("ao", RayKind::AnyHit),
            ("bounce1", RayKind::ClosestHit),
            ("bounce2", RayKind::ClosestHit),
            ("bounce3", RayKind::ClosestHit),
        ]
    );
    for (name, _, rays) in &sets.sets {
        assert!(rays.len() <= 1000 && rays.len() > 900, "{name}: {}", rays.len());
        assert!(rays.iter().all(|r| (r.direction.length() - 1.0).abs() < 1e-5));
        assert!(rays.iter().all(|r| r.origin.is_finite() && r.t_min == 0.0));
    }
    assert!(sets.get("nothing").is_none());
    assert!(record(&scene, 0).sets.iter().all(|(.., rays)| rays.is_empty()));
    assert_eq!(record(&scene, 1).get("camera").unwrap().len(), 1);
}

#[test]
fn camera_rays_pass_through_their_pixels_over_the_whole_image() {
    let scene = room();
    let sets = record(&scene, 2000);
    let rays = sets.get("camera").unwrap();
    // The grid for 2000 rays at 16:9: 33 = ⌊√(2000 · 9 / 16)⌋ rows.
    let (width, height) = (60, 33);
    assert_eq!(rays.len(), width as usize * height as usize);
    let view = View::new(&scene.cameras[0], width, height);
    let mut same = 0;
    for (i, ray) in (0..).zip(rays) {
        let (x, y) = (i % width, i / width);
        let corner = |dx: u32, dy: u32| view.ray(x + dx, y + dy, Vec2::ZERO).direction;
        let centre = view.ray(x, y, Vec2::splat(0.5));
        let radius =
            corner(0, 0).distance(corner(1, 1)).max(corner(1, 0).distance(corner(0, 1))) * 0.5;
        assert_eq!(ray.origin, centre.origin);
        assert!(ray.direction.distance(centre.direction) <= 1.01 * radius, "pixel {x} {y}");
        // So they see what the pinhole sees, except where an edge crosses the pixel.
        same += usize::from(hit_prim(&scene, ray) == hit_prim(&scene, &centre));
    }
    assert!(same * 100 > rays.len() * 85, "{same} of {}", rays.len());
}

fn hit_prim(scene: &Scene, ray: &Ray) -> u32 {
    let hit = brute(&scene.mesh).closest_hit(ray);
    assert!(hit.is_hit(), "the room is closed");
    hit.prim_id
}

#[test]
fn shadow_rays_end_at_the_lamp_without_touching_it() {
    let scene = room();
    let sets = record(&scene, 1500);
    let rays = sets.get("shadow").unwrap();
    let brute = brute(&scene.mesh);
    let mut occluded = 0;
    for ray in rays {
        let end = ray.at(ray.t_max);
        assert!((end.y - LAMP_HEIGHT).abs() < 1e-4, "{end}");
        assert!(end.x.abs() < 0.5001 && end.z.abs() < 0.5001, "{end}");
        occluded += usize::from(brute.any_hit(ray));
        // A little further and there is the lamp, or something before it.
        assert!(brute.any_hit(&ray.with_range(0.0, ray.t_max * 1.01)), "{ray:?}");
    }
    assert!(occluded > 0 && occluded < rays.len() / 2, "{occluded} of {}", rays.len());
}

#[test]
fn shadow_rays_to_punctual_lights_end_there_and_to_the_sky_nowhere() {
    let mut scene = room();
    scene.materials.iter_mut().for_each(|m| m.emission = Vec3::ZERO);
    let position = Vec3::new(0.3, 2.0, 0.2);
    scene.lights.push(Light {
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Y,
        intensity: Vec3::ONE,
    });
    let sets = record(&scene, 500);
    let rays = sets.get("shadow").unwrap();
    assert!(rays.len() > 400);
    assert!(rays.iter().all(|r| r.at(r.t_max).distance(position) < 1e-4));
    scene.lights.clear();
    assert!(record(&scene, 500).get("shadow").unwrap().is_empty(), "no light, no shadow ray");
    scene.environment = Environment::DAYLIGHT;
    let sets = record(&scene, 500);
    let rays = sets.get("shadow").unwrap();
    assert!(rays.len() > 400 && rays.iter().all(|r| r.t_max == f32::INFINITY));
}

#[test]
fn occlusion_and_bounce_rays_leave_surfaces() {
    let scene = room();
    let sets = record(&scene, 800);
    let diagonal = scene.mesh.bounds().extent().length();
    let brute = brute(&scene.mesh);
    for name in ["ao", "bounce1", "bounce2", "bounce3"] {
        let rays = sets.get(name).unwrap();
        for ray in rays {
            let length = if name == "ao" { 0.1 * diagonal } else { f32::INFINITY };
            assert_eq!(ray.t_max, length, "{name}");
            // Straight back there is a surface at once.
            let back = Ray::new(ray.origin, -ray.direction);
            let near = [back.direction, Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z]
                .map(|d| brute.closest_hit(&Ray::new(ray.origin, d)).t);
            assert!(near.iter().any(|&t| t < 1e-4), "{name}: {ray:?}");
        }
        // Cosine-distributed about many normals: no direction dominates.
        let mean: Vec3 = rays.iter().map(|r| r.direction).sum::<Vec3>() / rays.len() as f32;
        assert!(mean.length() < 0.6, "{name}: {mean}");
    }
    // From inside a closed room everything meets something.
    assert!(sets.get("bounce2").unwrap().iter().all(|r| brute.any_hit(r)));
}

#[test]
fn thinned_sets_still_cover_the_image() {
    let scene = room();
    let sets = record(&scene, 300);
    // Shadow rays come from up to three depths, so they are thinned; their first and last thirds
    // must come from different places, and the share that starts on the floor like in the whole.
    let many = record(&scene, 3000);
    let share =
        |rays: &[Ray]| rays.iter().filter(|r| r.origin.y < 1e-3).count() as f64 / rays.len() as f64;
    let (few, all) = (share(sets.get("shadow").unwrap()), share(many.get("shadow").unwrap()));
    assert!(all > 0.05 && (few - all).abs() < 0.1, "{few} {all}");
}

#[test]
fn random_rays_fill_the_box_and_its_surroundings() {
    let bounds = Aabb::new(Vec3::new(-1.0, 2.0, 1e3), Vec3::new(1.0, 3.0, 1.1e3));
    let rays = random_rays(&bounds, 20_000, 1);
    let inside = rays.iter().filter(|r| bounds.contains_point(r.origin)).count();
    // All of the first half and a 27th of the second.
    assert!((inside as f64 / 20_000.0 - (0.5 + 0.5 / 27.0)).abs() < 0.01, "{inside}");
    let mean: Vec3 = rays.iter().map(|r| r.direction).sum::<Vec3>() / 20_000.0;
    assert!(mean.length() < 0.03, "{mean}");
    assert!(random_rays(&Aabb::EMPTY, 10, 1).is_empty());
    let huge = Aabb::new(Vec3::splat(-3e38), Vec3::splat(3e38));
    assert_eq!(random_rays(&huge, 10, 1).len(), 10);
}
