//! Mirrors and refraction: known angles, endings, odd places.

mod common;

use common::{Parts, brute, camera, lambert, render, settings};
use niwaki_core::{
    Hit, Intersector, Ray,
    glam::{Vec2, Vec3},
};
use niwaki_render::{
    Image, PathSettings, PathTracer, View,
    fresnel::{conductor, dielectric, reflect, refract},
};
use niwaki_scene::{Environment, Material};
use proptest::prelude::*;

#[test]
fn fresnel_at_known_angles() {
    assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
    assert!((dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
    // Water: ((1.333 − 1) / (1.333 + 1))².
    assert!((dielectric(1.0, 1.333) - 0.020_37).abs() < 1e-4);
    // At Brewster's angle only perpendicular light is reflected: ½ ((n² − 1) / (n² + 1))².
    let brewster = 1.5_f32.atan().cos();
    assert!((dielectric(brewster, 1.5) - 0.5 * (1.25_f32 / 3.25).powi(2)).abs() < 1e-5);
    // 60° on glass: Rs = 0.1765, Rp = 0.0018 (Hecht, Optics, fig. 4.41).
    assert!((dielectric(0.5, 1.5) - 0.0892).abs() < 2e-4, "{}", dielectric(0.5, 1.5));
    assert_eq!(dielectric(0.0, 1.5), 1.0);
    assert_eq!(dielectric(0.0, 1.0), 0.0, "no interface, even at grazing angles");
    assert_eq!(conductor(1.0, Vec3::splat(0.7)), Vec3::splat(0.7));
    assert_eq!(conductor(0.0, Vec3::splat(0.7)), Vec3::ONE);
}

#[test]
fn refraction_ends_at_the_critical_angle() {
    let eta = 1.0 / 1.5_f32;
    let critical = eta.asin();
    let at = |angle: f32| Vec3::new(angle.sin(), 0.0, angle.cos());
    let below = refract(at(critical - 1e-3), Vec3::Z, eta).unwrap();
    assert!(below.z < 0.0 && below.z > -0.1, "almost along the surface: {below}");
    assert!(dielectric((critical - 1e-3).cos(), eta) < 1.0);
    for past in [1e-3, 0.1, 0.7] {
        assert!(refract(at(critical + past), Vec3::Z, eta).is_none());
        assert_eq!(dielectric((critical + past).cos(), eta), 1.0);
    }
    // At the angle itself, whatever rounding decides, the result is a number.
    assert!(dielectric(critical.cos(), eta).is_finite());
    assert!(refract(at(critical), Vec3::Z, eta).is_none_or(|d| d.is_finite()));
}

proptest! {
    #[test]
    fn refraction_obeys_snell_and_can_be_undone(angle in 0.0_f32..1.55, eta in 0.3_f32..3.0) {
        let wo = Vec3::new(angle.sin(), 0.0, angle.cos());
        if let Some(wi) = refract(wo, Vec3::Z, eta) {
            prop_assert!((wi.x * eta + wo.x).abs() < 1e-5);
            prop_assert!((wi.length() - 1.0).abs() < 1e-5 && wi.z <= 0.0);
            let back = refract(wi, Vec3::NEG_Z, 1.0 / eta);
            if wi.z < -0.05 {
                prop_assert!((back.unwrap() - wo).length() < 1e-3);
                // Stokes: the same share is reflected from either side.
                prop_assert!((dielectric(wo.z, eta) - dielectric(-wi.z, 1.0 / eta)).abs() < 1e-3);
            }
        }
        let mirrored = reflect(wo, Vec3::Z);
        prop_assert!((mirrored - Vec3::new(-wo.x, -wo.y, wo.z)).length() < 1e-6);
    }
}

#[test]
fn a_mirror_shows_the_sky_exactly() {
    let sky = Environment::DAYLIGHT;
    let mirror = Material::metal("mirror", Vec3::ONE, 0.0);
    let eye = Vec3::new(0.0, 2.0, 5.0);
    let scene = Parts::new()
        .quad(Vec3::new(-1e3, 0.0, -1e3), Vec3::Z * 2e3, Vec3::X * 2e3, &mirror)
        .scene(camera(eye, Vec3::ZERO, 0.3), sky);
    let size = 64;
    let image = render(&scene, &settings(size, 1, 4)).0;
    let view = View::new(&scene.cameras[0], size, size);
    for (x, y) in [(0, 0), (63, 63), (31, 7), (5, 40)] {
        let d = view.ray(x, y, Vec2::splat(0.5)).direction;
        let expected = sky.radiance(Vec3::new(d.x, -d.y, d.z));
        // Within the pixel the sky changes by less than a percent.
        assert!((image.get(x, y) - expected).abs().max_element() < 0.01, "{x} {y}");
    }
}

#[test]
fn a_closed_box_of_mirrors_ends_at_the_depth_and_leaks_nothing() {
    let mirror = Material::metal("mirror", Vec3::ONE, 0.0);
    let scene = Parts::new()
        .cuboid(Vec3::splat(-1.0), Vec3::ONE, &mirror)
        .scene(camera(Vec3::splat(0.1), Vec3::X, 1.2), Environment::Constant(Vec3::ONE));
    for max_depth in [0, 1, 7, 500] {
        let settings = PathSettings { roulette_start: u32::MAX, ..settings(4, 2, max_depth) };
        let (image, stats) = render(&scene, &settings);
        assert_eq!(stats.closest_hit_rays, 32 * (u64::from(max_depth) + 1));
        assert_eq!(image, Image::black(4, 4), "light came through a closed wall");
    }
}

#[test]
fn mirrors_facing_each_other_show_a_light_between_them() {
    let mirror = Material::metal("mirror", Vec3::splat(0.5), 0.0);
    let scene = Parts::new()
        .quad(Vec3::new(-9.0, -9.0, -1.0), Vec3::X * 18.0, Vec3::Y * 18.0, &mirror)
        .quad(Vec3::new(-9.0, -9.0, 1.0), Vec3::Y * 18.0, Vec3::X * 18.0, &mirror)
        .scene(camera(Vec3::ZERO, Vec3::NEG_Z, 1e-3), Environment::Constant(Vec3::ONE));
    // At right angles the path never leaves: black, after exactly the depth.
    let settings = PathSettings { roulette_start: u32::MAX, ..settings(1, 8, 100) };
    let (image, stats) = render(&scene, &settings);
    assert_eq!((image.get(0, 0), stats.closest_hit_rays), (Vec3::ZERO, 8 * 101));
}

#[test]
fn nested_dielectrics_end_and_make_no_light() {
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 8, true, &Material::glass("shell", 1.5))
        .sphere(Vec3::ZERO, 0.9, 8, true, &Material::glass("water", 1.33))
        .sphere(Vec3::ZERO, 0.5, 8, true, &Material::glass("diamond", 2.4))
        .cuboid(Vec3::splat(-0.2), Vec3::splat(0.2), &Material::glass("cube", 1.7))
        .scene(camera(Vec3::Z * 4.0, Vec3::ZERO, 0.6), Environment::Constant(Vec3::ONE));
    let settings = PathSettings { roulette_start: u32::MAX, ..settings(12, 8, 60) };
    let (image, stats) = render(&scene, &settings);
    assert!(stats.closest_hit_rays <= 12 * 12 * 8 * 61);
    assert!(stats.closest_hit_rays > 12 * 12 * 8 * 3, "paths enter and leave");
    let mean = image.mean().x;
    assert!(mean > 0.8 && mean < 1.001, "{mean}");
}

#[test]
fn inside_closed_opaque_geometry_it_is_dark() {
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 8, true, &lambert(1.0))
        .scene(camera(Vec3::splat(0.1), Vec3::ONE, 1.5), Environment::Constant(Vec3::splat(1e3)));
    let (image, stats) = render(&scene, &settings(8, 16, 30));
    assert!(stats.shadow_rays > 1000);
    assert_eq!(image, Image::black(8, 8));
}

#[test]
fn without_light_all_is_black_and_no_shadow_ray_is_traced() {
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 6, true, &Material::metal("metal", Vec3::ONE, 0.3))
        .sphere(Vec3::X * 2.0, 1.0, 6, true, &Material::glass("glass", 1.5))
        .sphere(Vec3::NEG_X * 2.0, 1.0, 6, true, &Material::default())
        .scene(camera(Vec3::Z * 5.0, Vec3::ZERO, 1.0), Environment::DARK);
    let (image, stats) = render(&scene, &settings(16, 4, 8));
    assert_eq!((image, stats.shadow_rays), (Image::black(16, 16), 0));
}

/// Hits that a correct tracer never returns.
struct Broken(Hit);
impl Intersector for Broken {
    fn closest_hit(&self, _: &Ray) -> Hit {
        self.0
    }
    fn any_hit(&self, _: &Ray) -> bool {
        false
    }
}

#[test]
fn broken_input_neither_panics_nor_spreads() {
    let mut scene = Parts::new()
        .quad(Vec3::ZERO, Vec3::X, Vec3::X, &Material::default()) // no area
        .scene(camera(Vec3::Z, Vec3::ZERO, 1.0), Environment::DAYLIGHT);
    scene.material_ids = vec![7];
    scene.normals.truncate(1);
    scene.uvs.clear();
    let tracer = PathTracer::new(settings(4, 2, 3));
    for hit in [
        Hit { prim_id: 12345, t: 1.0, u: 0.1, v: 0.1 },
        Hit { prim_id: 1, t: f32::NAN, u: f32::NAN, v: f32::NAN },
        Hit { prim_id: 0, t: 1.0, u: -3.0, v: 8.0 },
    ] {
        let image = tracer.render(&scene, &Broken(hit));
        assert!(image.pixels().iter().all(|p| p.is_finite()));
    }
    scene.materials[0] = Material {
        base_color: Vec3::NAN,
        ior: f32::NAN,
        roughness: f32::NAN,
        metallic: f32::NAN,
        emission: Vec3::splat(f32::INFINITY),
        ..Material::default()
    };
    let image = tracer.render(&scene, &brute(&scene.mesh));
    assert!(image.pixels().iter().all(|p| p.is_finite()));
    scene.cameras.clear();
    assert_eq!(tracer.render(&scene, &brute(&scene.mesh)), Image::black(4, 4));
    assert!(tracer.render(&scene, &brute(&scene.mesh)).save_png("", &Default::default()).is_err());
}
