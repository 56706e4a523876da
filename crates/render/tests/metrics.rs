//! Metrics against their authors' own programs.

use niwaki_core::glam::Vec3;
use niwaki_render::{
    Image,
    metrics::{ErrorMap, FlipSettings, MetricError, flip, hdr_flip, psnr, ssim},
};

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;

fn image(color: impl Fn(u32, u32) -> Vec3) -> Image {
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    Image::from_pixels(WIDTH, HEIGHT, pixels.map(|(x, y)| color(x, y)).collect()).unwrap()
}

/// A picture of eleven stops, and one with dots a quarter brighter and a red right half.
fn pictures() -> (Image, Image) {
    let value = |x: u32, y: u32, c: u32| {
        ((x * 7 + y * 13 + c * 5) % 29 + 1) as f32 / 29.0 * 2.0_f32.powi((x / 6 % 7) as i32 - 3)
    };
    let reference = move |x, y| Vec3::from([0, 1, 2].map(|c| value(x, y, c)));
    let other = move |x, y| {
        let dot = if (x + y) % 8 == 0 { 1.25 } else { 1.0 };
        let red = if x > 24 { Vec3::X * 0.05 } else { Vec3::ZERO };
        reference(x, y) * dot + red
    };
    (image(other), image(reference))
}

fn at(map: &ErrorMap, x: u32, y: u32) -> f32 {
    map.values()[(y * WIDTH + x) as usize]
}

fn degree(pixels: f32) -> FlipSettings {
    FlipSettings { pixels_per_degree: pixels }
}

/// A mean, three pixels and the largest error.
fn assert_map(map: &ErrorMap, mean: f64, pixels: [f32; 3], max: f32) {
    assert!((map.mean() - mean).abs() < 2e-5, "{} {mean}", map.mean());
    for ((x, y), expected) in [(0, 0), (24, 20), (40, 8)].into_iter().zip(pixels) {
        assert!((at(map, x, y) - expected).abs() < 2e-4, "{x} {y}: {} {expected}", at(map, x, y));
    }
    assert!((map.max() - max).abs() < 2e-4, "{} {max}", map.max());
}

#[test]
fn flip_is_what_its_authors_program_says() {
    // flip_evaluator 1.7 by the authors, on the same linear values clamped to 0 to 1.
    let (test, reference) = pictures();
    let map = flip(&test, &reference, &degree(67.0)).unwrap();
    assert_map(&map, 0.073_737_47, [0.067_052_13, 0.043_113_61, 0.069_231_2], 0.253_942_64);
    let map = flip(&test, &reference, &degree(30.0)).unwrap();
    assert_map(&map, 0.079_067_04, [0.113_111_94, 0.037_957_13, 0.037_013_73], 0.358_441_68);
}

#[test]
fn hdr_flip_is_what_its_authors_program_says() {
    // The same program on radiance: five exposures from −1.77 to 2.60.
    let (test, reference) = pictures();
    let map = hdr_flip(&test, &reference, &degree(67.0)).unwrap();
    assert_map(&map, 0.108_274_41, [0.152_320_37, 0.058_894_72, 0.108_708_21], 0.442_124_37);
    let map = hdr_flip(&test, &reference, &degree(30.0)).unwrap();
    assert_map(&map, 0.112_165_04, [0.242_410_4, 0.058_745_09, 0.154_793_53], 0.531_051_6);
}

#[test]
fn psnr_and_ssim_are_what_scikit_image_says() {
    // scikit-image 0.26.0: peak_signal_noise_ratio, and structural_similarity with Gaussian
    // weights and biased covariance, its mean over windows within the image.
    let (test, reference) = pictures();
    assert!((psnr(&test, &reference).unwrap() - 30.861_816).abs() < 1e-3);
    assert!((ssim(&test, &reference).unwrap() - 0.993_132_43).abs() < 1e-5);
}

#[test]
fn extremes_are_at_the_ends_of_the_scale() {
    let flat = |color: Vec3| image(|_, _| color);
    let settings = FlipSettings::default();
    assert!((settings.pixels_per_degree - 67.02).abs() < 0.01, "the paper's default");
    let mean = |a, b| flip(&flat(a), &flat(b), &settings).unwrap().mean();
    assert_eq!(mean(Vec3::ONE, Vec3::ONE), 0.0);
    // Green and blue are the furthest apart (section 4.1.3).
    assert!((mean(Vec3::Y, Vec3::Z) - 1.0).abs() < 1e-5);
    assert!(mean(Vec3::ZERO, Vec3::ONE) > 0.9 && mean(Vec3::ZERO, Vec3::ONE) < 1.0);
    assert_eq!(mean(Vec3::splat(f32::NAN), Vec3::ZERO), 0.0);
    assert_eq!(mean(Vec3::splat(7.0), Vec3::ONE), 0.0, "both are displayed white");
    // One ten-thousandth brighter cannot be seen.
    assert!(mean(Vec3::splat(0.5), Vec3::splat(0.500_05)) < 0.01);
}

#[test]
fn hdr_flip_sees_what_the_display_cuts_and_takes_any_image() {
    let flat = |color: Vec3| image(|_, _| color);
    let settings = FlipSettings::default();
    let hdr = |a, b| hdr_flip(&flat(a), &flat(b), &settings).unwrap();
    assert!(hdr(Vec3::splat(7.0), Vec3::ONE).mean() > 0.1);
    for broken in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::splat(-1.0), Vec3::splat(1e30)] {
        for other in [Vec3::ZERO, Vec3::ONE, Vec3::splat(1e-30)] {
            let (there, back) = (hdr(broken, other), hdr(other, broken));
            assert!(there.values().iter().chain(back.values()).all(|e| (0.0..=1.0).contains(e)));
        }
    }
    // Mostly black with a spark.
    let spark = image(|x, y| if (x, y) == (9, 9) { Vec3::splat(50.0) } else { Vec3::ZERO });
    assert_eq!(hdr_flip(&spark, &spark, &settings).unwrap().max(), 0.0);
    let map = hdr_flip(&flat(Vec3::ZERO), &spark, &settings).unwrap();
    assert!(at(&map, 9, 9) > 0.5 && at(&map, 40, 25) < 1e-3);
}

#[test]
fn maps_pool_and_show_their_errors() {
    let (test, reference) = pictures();
    let map = flip(&test, &reference, &FlipSettings::default()).unwrap();
    assert!(
        map.percentile(0.0) <= map.percentile(0.5) && map.percentile(0.5) < map.percentile(1.0)
    );
    assert_eq!(map.percentile(1.0), map.max());
    let shown = map.colorize();
    assert_eq!((shown.width(), shown.height()), (map.width(), map.height()));
    let brightest =
        (0..map.values().len()).max_by(|&a, &b| map.values()[a].total_cmp(&map.values()[b]));
    let sums: Vec<f32> = shown.pixels().iter().map(|p| p.element_sum()).collect();
    assert_eq!(brightest, (0..sums.len()).max_by(|&a, &b| sums[a].total_cmp(&sums[b])));
}

#[test]
fn sizes_that_differ_are_errors_with_both_sizes() {
    let (a, b) = (Image::black(3, 4), Image::black(4, 3));
    let settings = FlipSettings::default();
    let error = flip(&a, &b, &settings).unwrap_err();
    assert_eq!(error, MetricError::Size { size: (3, 4), reference: (4, 3) });
    assert!(error.to_string().contains("3×4") && error.to_string().contains("4×3"));
    assert!(hdr_flip(&a, &b, &settings).is_err() && psnr(&a, &b).is_err() && ssim(&a, &b).is_err());
    let empty = Image::black(0, 5);
    assert!(flip(&empty, &empty, &settings).is_err() && psnr(&empty, &empty).is_err());
    for broken in [f32::NAN, 0.0, -3.0, f32::INFINITY] {
        assert_eq!(flip(&a, &a, &degree(broken)).unwrap().max(), 0.0);
    }
}
