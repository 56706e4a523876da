//! FLIP: the error that a viewer notices when flipping between two images.
//!
//! The steps and constants are those of Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and
//! Fairchild 2020, "FLIP: A Difference Evaluator for Alternating Images", sections 4 and 5, with
//! the filters separated as the authors do in "Separated Convolutions" (2021).

use super::{ErrorMap, MetricError, check};
use crate::image::Image;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Exponent of the colour difference, q_c.
const COLOR_EXPONENT: f64 = 0.7;
/// Share of the largest colour difference, p_c, that maps to [`COMPRESSED`], p_t.
const COMPRESSION_START: f64 = 0.4;
const COMPRESSED: f64 = 0.95;
/// Width of edges and points in degrees, w.
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference, q_f.
const FEATURE_EXPONENT: f64 = 0.5;
/// Gaussians of the contrast sensitivity functions, (a, b) of a √(π/b) exp(−π² x²/b): achromatic,
/// red-green, and blue-yellow, which is the sum of two.
const SENSITIVITY: [(f64, f64); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];
/// Linear RGB (sRGB, D65) to XYZ, by columns.
const TO_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
    DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
    DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
);

/// How the images are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlipSettings {
    /// Pixels in one degree of the viewer's field of view; kept between 1 and 1,000.
    pub pixels_per_degree: f32,
}

impl Default for FlipSettings {
    /// A 4K display of 0.7 m width at a distance of 0.7 m: 67.02 pixels per degree.
    fn default() -> Self {
        Self::viewing(0.7, 0.7, 3840)
    }
}

impl FlipSettings {
    /// Someone at `distance` from a display of `width` (both in metres) with `pixels` in a row
    /// (eq. 1).
    #[must_use]
    pub fn viewing(distance: f32, width: f32, pixels: u32) -> Self {
        let pixels_per_degree = distance * (pixels as f32 / width) * (std::f32::consts::PI / 180.0);
        Self { pixels_per_degree }
    }

    fn pixels(self) -> f64 {
        let pixels = f64::from(self.pixels_per_degree);
        if pixels.is_nan() { 67.0 } else { pixels.clamp(1.0, 1e3) }
    }
}

/// The FLIP error of displayed images, 0 to 1 per pixel. Linear colours are clamped to 0 to 1.
///
/// ```
/// use niwaki_render::{Image, metrics::{FlipSettings, flip}};
/// let black = Image::black(8, 8);
/// assert_eq!(flip(&black, &black, &FlipSettings::default())?.mean(), 0.0);
/// # Ok::<(), niwaki_render::metrics::MetricError>(())
/// ```
///
/// # Errors
/// If the sizes differ or there are no pixels.
pub fn flip(
    image: &Image,
    reference: &Image,
    settings: &FlipSettings,
) -> Result<ErrorMap, MetricError> {
    check(image, reference, 1)?;
    let planes = |image: &Image| -> Vec<DVec3> {
        image.pixels().par_iter().map(|p| displayed(p.as_dvec3())).collect()
    };
    let values = errors(&planes(image), &planes(reference), image.width(), settings.pixels());
    Ok(ErrorMap { width: image.width(), height: image.height(), values })
}

/// The HDR-FLIP error of radiance, 0 to 1 per pixel: the largest FLIP error over a range of
/// exposures that shows everything from the reference's highlights to its median (Andersson et al.
/// 2021, "Visualizing Errors in Rendered High Dynamic Range Images", sections 3 and 4), each tone
/// mapped by the ACES curve.
///
/// # Errors
/// If the sizes differ or there are no pixels.
pub fn hdr_flip(
    image: &Image,
    reference: &Image,
    settings: &FlipSettings,
) -> Result<ErrorMap, MetricError> {
    check(image, reference, 1)?;
    let (start, stop) = exposures(reference);
    #[expect(clippy::cast_possible_truncation, reason = "the exponents of f32 span 277 stops")]
    #[expect(clippy::cast_sign_loss, reason = "at least 2")]
    let count = (stop - start).ceil().clamp(2.0, 300.0) as u32;
    let step = (stop - start) / f64::from(count - 1);
    let mut values = vec![0.0_f32; image.pixels().len()];
    for i in 0..count {
        let scale = (start + f64::from(i) * step).exp2();
        let planes = |image: &Image| -> Vec<DVec3> {
            let shown = |p: &glam::Vec3| {
                displayed(DVec3::from(p.as_dvec3().to_array().map(|x| aces(x * scale))))
            };
            image.pixels().par_iter().map(shown).collect()
        };
        let at_exposure =
            errors(&planes(image), &planes(reference), image.width(), settings.pixels());
        values.iter_mut().zip(at_exposure).for_each(|(most, e)| *most = most.max(e));
    }
    Ok(ErrorMap { width: image.width(), height: image.height(), values })
}

/// Numerator and denominator of Narkowicz's fit of the ACES curve, its pre-exposure of 0.6 undone.
const ACES: [f64; 6] = [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14];

/// The curve; NaN and negative values read as 0.
fn aces(x: f64) -> f64 {
    let x = x.max(0.0);
    let [a, b, c, d, e, f] = ACES;
    // Beyond, squares lose nothing by being cut.
    let x = x.min(1e100);
    (a * x * x + b * x + c) / (d * x * x + e * x + f)
}

/// First and last exposure in stops: those that bring the brightest and the median luminance of
/// the reference to 0.85 after the curve.
fn exposures(reference: &Image) -> (f64, f64) {
    const SHOWN: f64 = 0.85;
    let [a, b, c] = std::array::from_fn(|k| ACES[k] - SHOWN * ACES[k + 3]);
    let half = -0.5 * b / a;
    let bright = half + (half * half - c / a).sqrt();
    let mut luminances: Vec<f64> = reference
        .pixels()
        .iter()
        .map(|p| p.as_dvec3().dot(DVec3::new(0.2126, 0.7152, 0.0722)))
        .filter(|l| l.is_finite())
        .collect();
    luminances.sort_by(f64::total_cmp);
    let Some(&most) = luminances.last() else { return (0.0, 0.0) };
    let middle = luminances.len() / 2;
    let median = 0.5 * (luminances[middle.saturating_sub(1)] + luminances[middle]);
    let stops = |luminance: f64| (bright / luminance).log2();
    match (most > 0.0, median > 0.0) {
        (true, true) => (stops(most), stops(median)),
        // More than half is black: what lies above it spans ten stops at most.
        (true, false) => (stops(most), stops(most) + 10.0),
        (false, _) => (0.0, 0.0),
    }
}

/// A displayed colour in YCxCz, which is linear in linear RGB (section 4.1): Y is lightness of 0
/// to 100, Cx red-green, Cz blue-yellow.
fn displayed(linear: DVec3) -> DVec3 {
    let cut = |x: f64| if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
    let xyz = TO_XYZ * DVec3::from(linear.to_array().map(cut)) / white();
    DVec3::new(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z))
}

/// XYZ of white.
fn white() -> DVec3 {
    TO_XYZ * DVec3::ONE
}

/// XYZ of a colour in YCxCz.
fn to_xyz(ycc: DVec3) -> DVec3 {
    let y = (ycc.x + 16.0) / 116.0;
    DVec3::new(y + ycc.y / 500.0, y, y - ycc.z / 200.0) * white()
}

/// CIELab with chroma weighted by lightness (Hunt's effect, section 4.1).
fn hunt_lab(linear: DVec3) -> DVec3 {
    let f = |t: f64| {
        let delta = 6.0_f64 / 29.0;
        if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let [x, y, z] = (TO_XYZ * linear / white()).to_array().map(f);
    let lightness = 116.0 * y - 16.0;
    let weight = 0.01 * lightness;
    DVec3::new(lightness, 500.0 * (x - y) * weight, 200.0 * (y - z) * weight)
}

/// The HyAB distance (Abasi, Amani Tehran and Fairchild 2020).
fn hyab(a: DVec3, b: DVec3) -> f64 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// FLIP of two images in YCxCz.
fn errors(image: &[DVec3], reference: &[DVec3], width: u32, ppd: f64) -> Vec<f32> {
    let width = width as usize;
    let colors = [image, reference].map(|i| seen_colors(i, width, ppd));
    let features = [image, reference].map(|i| features(i, width, ppd));
    let largest = hyab(hunt_lab(DVec3::Y), hunt_lab(DVec3::Z)).powf(COLOR_EXPONENT);
    let start = COMPRESSION_START * largest;
    (0..image.len())
        .into_par_iter()
        .map(|i| {
            let difference = hyab(colors[0][i], colors[1][i]).powf(COLOR_EXPONENT);
            let color = if difference < start {
                difference * COMPRESSED / start
            } else {
                let rest = (difference - start) / (largest - start);
                COMPRESSED + rest * (1.0 - COMPRESSED)
            };
            let ((edge_a, point_a), (edge_b, point_b)) = (features[0][i], features[1][i]);
            let most = (edge_a - edge_b).abs().max((point_a - point_b).abs());
            let feature = (most * std::f64::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
            #[expect(clippy::cast_possible_truncation, reason = "an error between 0 and 1")]
            let error = color.clamp(0.0, 1.0).powf((1.0 - feature).max(0.0)) as f32;
            error
        })
        .collect()
}

/// What the eye makes of colours at this distance: filtered by contrast sensitivity (section
/// 4.1.1), clamped to what can be displayed, in Hunt-adjusted CIELab.
fn seen_colors(image: &[DVec3], width: usize, ppd: f64) -> Vec<DVec3> {
    let widest = SENSITIVITY.iter().map(|s| s.1).fold(0.0, f64::max);
    let radius = radius(3.0 * (widest / (2.0 * PI * PI)).sqrt() * ppd);
    let kernel = |(a, b): (f64, f64)| {
        let value = |i: usize| {
            let x = (i as f64 - radius as f64) / ppd;
            // The root of the amplitude: two passes multiply it.
            (a * (PI / b).sqrt()).sqrt() * (-PI * PI * x * x / b).exp()
        };
        (0..=2 * radius).map(value).collect::<Vec<f64>>()
    };
    let kernels = SENSITIVITY.map(kernel);
    let totals = kernels.each_ref().map(|k| k.iter().sum::<f64>().powi(2));
    let channel = |c: usize| image.iter().map(|p| p[c]).collect::<Vec<f64>>();
    let apply = |k: usize, c: usize| {
        let across = convolve(&channel(c), width, &kernels[k], Axis::X);
        convolve(&across, width, &kernels[k], Axis::Y)
    };
    let [y, x, z1, z2] = [apply(0, 0), apply(1, 1), apply(2, 2), apply(3, 2)];
    let to_linear = TO_XYZ.inverse();
    (0..image.len())
        .into_par_iter()
        .map(|i| {
            let z = (z1[i] + z2[i]) / (totals[2] + totals[3]);
            let filtered = DVec3::new(y[i] / totals[0], x[i] / totals[1], z);
            hunt_lab((to_linear * to_xyz(filtered)).clamp(DVec3::ZERO, DVec3::ONE))
        })
        .collect()
}

/// Strength of edges and points in lightness (section 4.2): first and second derivatives of a
/// Gaussian half as wide as a feature, positive and negative weights normalised to 1.
fn features(image: &[DVec3], width: usize, ppd: f64) -> Vec<(f64, f64)> {
    let deviation = 0.5 * FEATURE_WIDTH * ppd;
    let radius = radius(3.0 * deviation);
    let place = |i: usize| i as f64 - radius as f64;
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let kernel = |f: &dyn Fn(f64) -> f64| {
        let mut values: Vec<f64> = (0..=2 * radius).map(|i| f(place(i))).collect();
        let positive: f64 = values.iter().filter(|v| **v > 0.0).sum();
        let negative: f64 = -values.iter().filter(|v| **v < 0.0).sum::<f64>();
        for v in &mut values {
            *v /= if *v > 0.0 { positive } else { negative.max(f64::MIN_POSITIVE) };
        }
        values
    };
    let smooth = kernel(&gaussian);
    let first = kernel(&|x| -x * gaussian(x));
    let second = kernel(&|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x));
    let lightness: Vec<f64> = image.iter().map(|p| (p.x + 16.0) / 116.0).collect();
    let apply = |across: &[f64], down: &[f64]| {
        convolve(&convolve(&lightness, width, across, Axis::X), width, down, Axis::Y)
    };
    let (dx, ddx) = (apply(&first, &smooth), apply(&second, &smooth));
    let (dy, ddy) = (apply(&smooth, &first), apply(&smooth, &second));
    (0..image.len()).map(|i| (dx[i].hypot(dy[i]), ddx[i].hypot(ddy[i]))).collect()
}

/// A radius in whole pixels.
#[expect(clippy::cast_possible_truncation, reason = "pixels per degree are at most 1,000")]
#[expect(clippy::cast_sign_loss, reason = "not negative")]
fn radius(pixels: f64) -> usize {
    pixels.ceil() as usize
}

/// Direction of a convolution.
#[derive(Clone, Copy, PartialEq)]
enum Axis {
    X,
    Y,
}

/// Weighs each pixel's neighbours along an axis; border pixels go on for ever.
fn convolve(plane: &[f64], width: usize, kernel: &[f64], axis: Axis) -> Vec<f64> {
    let radius = kernel.len() / 2;
    let height = plane.len() / width;
    (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let row = &plane[y * width..][..width];
            (0..width).map(move |x| {
                let at = |k: usize| match axis {
                    Axis::X => row[(x + k).saturating_sub(radius).min(width - 1)],
                    Axis::Y => plane[(y + k).saturating_sub(radius).min(height - 1) * width + x],
                };
                kernel.iter().enumerate().map(|(k, w)| w * at(k)).sum::<f64>()
            })
        })
        .collect()
}
