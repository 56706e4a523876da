//! Light is neither made nor lost: furnaces, where the right answer is known everywhere.

mod common;

use common::{Parts, camera, lambert, mean_and_error, render, settings};
use niwaki_core::glam::Vec3;
use niwaki_render::PathSettings;
use niwaki_scene::{Environment, Material};

const WHITE_SKY: Environment = Environment::Constant(Vec3::ONE);

/// Mean radiance of a sphere that fills the view under a white sky.
fn sphere_furnace(material: &Material, smooth: bool, depth: u32) -> (f64, f64) {
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 6, smooth, material)
        .scene(camera(Vec3::new(0.3, 0.4, 3.0), Vec3::ZERO, 0.4), WHITE_SKY);
    let settings = PathSettings { roulette_start: 8, ..settings(12, 20, depth) };
    mean_and_error(&render(&scene, &settings).0)
}

#[test]
fn a_white_diffuse_sphere_vanishes_under_a_white_sky() {
    // Both strategies draw from the integrand itself, so there is no noise at all.
    let (mean, _) = sphere_furnace(&lambert(1.0), false, 2);
    assert!((mean - 1.0).abs() < 1e-4, "{mean}");
}

#[test]
fn a_grey_diffuse_sphere_shows_its_albedo() {
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 6, false, &lambert(0.25))
        .scene(camera(Vec3::Z * 3.0, Vec3::ZERO, 0.3), WHITE_SKY);
    let (mean, _) = mean_and_error(&render(&scene, &settings(8, 4, 2)).0);
    assert!((mean - 0.25).abs() < 1e-4, "{mean}");
}

#[test]
fn coats_take_exactly_what_the_base_does_not_get() {
    for roughness in [0.0, 0.1, 0.3, 0.6, 1.0] {
        let material = Material { roughness, ..Material::matte("coat", Vec3::ONE) };
        let (mean, error) = sphere_furnace(&material, false, 2);
        // The table is interpolated: a few thousandths.
        assert!((mean - 1.0).abs() < 0.005 + 4.0 * error, "{roughness}: {mean} ± {error}");
    }
}

#[test]
fn light_bounces_between_white_walls_until_it_leaves() {
    // An open box seen from outside: every path leaves in the end, so every pixel is 1.
    let white = lambert(1.0);
    let scene = Parts::new()
        .quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, &white)
        .quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::Y * 2.0, Vec3::Z * 2.0, &white)
        .quad(Vec3::new(1.0, -1.0, -1.0), Vec3::Z * 2.0, Vec3::Y * 2.0, &white)
        .quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, &white)
        .quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, &white)
        .scene(camera(Vec3::Z * 4.0, Vec3::ZERO, 0.4), WHITE_SKY);
    for roulette_start in [2, u32::MAX] {
        let settings = PathSettings { roulette_start, ..settings(16, 16, 200) };
        let (mean, error) = mean_and_error(&render(&scene, &settings).0);
        assert!(error < 0.02 && (mean - 1.0).abs() < 4.0 * error + 1e-4, "{mean} ± {error}");
    }
}

#[test]
fn a_closed_glowing_box_is_as_bright_as_the_geometric_series() {
    // Radiance E from every wall of albedo a: E (1 + a + a² + …) = E / (1 − a), at every scale
    // and place: a leak or a false self-hit would show. The bright sky outside makes one leak in
    // ten thousand paths visible; where coordinates are 1/64 apart, origins near an edge do round
    // onto the next wall, so there the outside is dark and a loss of 2 % is granted.
    let wall = Material { emission: Vec3::splat(0.4), ..lambert(0.6) };
    for (scale, offset, outside, slack) in [
        (1e-3, Vec3::ZERO, 1000.0, 0.0),
        (1.0, Vec3::ZERO, 1000.0, 0.0),
        (1.0, Vec3::new(148_376.0, 1_234.0, -223_423.0), 0.0, 0.02),
        (1e3, Vec3::new(-7.0, 3e5, 1e6), 0.0, 0.02),
        (1e6, Vec3::ZERO, 1000.0, 0.0),
    ] {
        let half = Vec3::new(1.0, 2.0, 0.5) * scale;
        let eye = offset + half * 0.25;
        let scene = Parts::new().cuboid(offset - half, offset + half, &wall).scene(
            camera(eye, eye + Vec3::new(0.3, 0.2, -1.0) * scale, 1.5),
            Environment::Constant(Vec3::splat(outside)),
        );
        let settings = PathSettings { roulette_start: 4, ..settings(16, 24, 48) };
        let (mean, error) = mean_and_error(&render(&scene, &settings).0);
        assert!(error < 0.02, "{scale}: {error}");
        assert!((mean - 1.0).abs() < slack + 4.0 * error, "{scale} {offset}: {mean} ± {error}");
    }
}

#[test]
fn clear_glass_vanishes_under_a_white_sky() {
    for ior in [1.0, 1.3, 1.5, 2.4] {
        for smooth in [false, true] {
            // Smooth normals that disagree with the facets lose some paths; facets lose none.
            let (mean, error) = sphere_furnace(&Material::glass("glass", ior), smooth, 200);
            let slack = if smooth { 0.03 } else { 1e-3 };
            assert!((mean - 1.0).abs() < slack + 4.0 * error, "{ior} {smooth}: {mean} ± {error}");
        }
    }
}

#[test]
fn frosted_glass_makes_no_light_and_loses_little() {
    for (roughness, least) in [(0.1, 0.98), (0.3, 0.94), (0.6, 0.75)] {
        let material = Material { roughness, ..Material::glass("frosted", 1.5) };
        let (mean, error) = sphere_furnace(&material, false, 100);
        assert!(mean < 1.0 + 4.0 * error, "{roughness}: {mean} ± {error}");
        assert!(mean > least - 4.0 * error, "{roughness}: {mean} ± {error}");
    }
}

#[test]
fn rough_metal_makes_no_light() {
    // A single scattering model loses what scatters twice between facets: nothing for a mirror; at
    // roughness 1 and normal incidence 1 − ln 2 = 0.307 is left (∫ (2 − 1/s) ds over s = cos² of
    // the facet's angle from 1/2 to 1), and more at an angle.
    for (roughness, least) in [(0.0, 0.999_9), (0.2, 0.985), (0.5, 0.9), (1.0, 0.306)] {
        let material = Material::metal("metal", Vec3::ONE, roughness);
        let (mean, error) = sphere_furnace(&material, false, 3);
        assert!(mean <= 1.0 + 1e-4 + 4.0 * error, "{roughness}: {mean} ± {error}");
        assert!(mean >= least - 4.0 * error, "{roughness}: {mean} ± {error}");
    }
}

#[test]
fn inside_glass_radiance_is_compressed_by_the_square_of_the_index() {
    let scene = Parts::new()
        .sphere(Vec3::ZERO, 1.0, 12, true, &Material::glass("glass", 1.5))
        .scene(camera(Vec3::ZERO, Vec3::NEG_Z, 1.0), WHITE_SKY);
    let (mean, error) = mean_and_error(&render(&scene, &settings(8, 64, 100)).0);
    assert!((mean - 2.25).abs() < 0.02 + 4.0 * error, "{mean} ± {error}");
}

#[test]
fn coloured_glass_absorbs_by_thickness() {
    // No step in the index: straight through 0.7 units.
    let absorption = Vec3::new(0.5, 1.0, 3.0);
    let slab = Material { absorption, ..Material::glass("filter", 1.0) };
    let scene = Parts::new()
        .cuboid(Vec3::new(-9.0, -9.0, -0.7), Vec3::new(9.0, 9.0, 0.0), &slab)
        .scene(camera(Vec3::Z * 3.0, Vec3::ZERO, 0.001), WHITE_SKY);
    let color = render(&scene, &settings(2, 4, 10)).0.get(0, 0);
    let expected = (-absorption * 0.7).exp();
    assert!((color - expected).abs().max_element() < 1e-4, "{color} {expected}");
}
