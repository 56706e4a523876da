//! The structural similarity index.

use super::{MetricError, check};
use crate::{image::Image, tone::linear_to_srgb};
use rayon::prelude::*;

/// Side of the window.
const WINDOW: usize = 11;
/// Standard deviation of the window's Gaussian in pixels.
const SIGMA: f64 = 1.5;
/// (K₁ L)² and (K₂ L)² for values between 0 and L = 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Mean structural similarity of luma, −1 to 1; 1 for equal images.
///
/// Wang, Bovik, Sheikh and Simoncelli 2004, eqs. 13 to 17: windows of 11 × 11 pixels weighted by a
/// Gaussian of standard deviation 1.5, K₁ = 0.01, K₂ = 0.03, over all windows that lie within the
/// image. Luma is 0.299 R + 0.587 G + 0.114 B of the sRGB-encoded colours, clamped to 0 to 1.
///
/// # Errors
/// If the sizes differ or a side is shorter than 11 pixels.
pub fn ssim(image: &Image, reference: &Image) -> Result<f64, MetricError> {
    check(image, reference, 11)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let (x, y) = (luma(image), luma(reference));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let planes = [product(&x, &x), product(&y, &y), product(&x, &y), x, y];
    let [xx, yy, xy, x, y] = planes.map(|plane| filter(&plane, width, height));
    let index = |i: usize| {
        let (mx, my) = (x[i], y[i]);
        let (vx, vy, covariance) = (xx[i] - mx * mx, yy[i] - my * my, xy[i] - mx * my);
        (2.0 * mx * my + C1) * (2.0 * covariance + C2) / ((mx * mx + my * my + C1) * (vx + vy + C2))
    };
    Ok((0..x.len()).map(index).sum::<f64>() / x.len() as f64)
}

fn luma(image: &Image) -> Vec<f64> {
    let luma = |p: &glam::Vec3| {
        let [r, g, b] = p.to_array().map(|c| f64::from(linear_to_srgb(c)));
        0.299 * r + 0.587 * g + 0.114 * b
    };
    image.pixels().iter().map(luma).collect()
}

/// The weighted means over all windows within the plane.
fn filter(plane: &[f64], width: usize, height: usize) -> Vec<f64> {
    let middle = (WINDOW / 2) as f64;
    let mut weights: [f64; WINDOW] =
        std::array::from_fn(|i| (-(i as f64 - middle).powi(2) / (2.0 * SIGMA * SIGMA)).exp());
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    let (columns, rows) = (width + 1 - WINDOW, height + 1 - WINDOW);
    let across: Vec<f64> = plane
        .par_chunks(width)
        .flat_map_iter(|row| {
            row.windows(WINDOW).map(|w| w.iter().zip(&weights).map(|(a, b)| a * b).sum::<f64>())
        })
        .collect();
    (0..rows * columns)
        .into_par_iter()
        .map(|i| weights.iter().enumerate().map(|(k, w)| w * across[i + k * columns]).sum())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use niwaki_scene::texture::srgb_to_linear;

    fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> Image {
        let pixels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| Vec3::splat(srgb_to_linear(value(x, y))))
            .collect();
        Image::from_pixels(width, height, pixels).unwrap()
    }

    #[test]
    fn flat_images_differ_by_luminance_alone() {
        let (a, b) = (grey(16, 12, |_, _| 0.25), grey(16, 12, |_, _| 0.75));
        let expected = (2.0 * 0.25 * 0.75 + C1) / (0.0625 + 0.5625 + C1);
        assert!((ssim(&a, &b).unwrap() - expected).abs() < 1e-6);
        assert_eq!(ssim(&a, &a).unwrap(), 1.0);
    }

    #[test]
    fn it_is_the_formula_over_each_window() {
        let value = |seed: u32| {
            move |x: u32, y: u32| (crate::rng::pcg4d([x, y, seed, 0])[0] >> 8) as f32 / 16_777_216.0
        };
        let (width, height) = (17, 13);
        let (a, b) = (grey(width, height, value(1)), grey(width, height, value(2)));
        let (la, lb) = (luma(&a), luma(&b));
        let mut sum = 0.0;
        for top in 0..height as usize - 10 {
            for left in 0..width as usize - 10 {
                let mut weighted = [0.0; 6];
                for dy in 0..11_usize {
                    for dx in 0..11_usize {
                        let r2 = (dx as f64 - 5.0).powi(2) + (dy as f64 - 5.0).powi(2);
                        let w = (-r2 / 4.5).exp();
                        let i = (top + dy) * width as usize + left + dx;
                        let (p, q) = (la[i], lb[i]);
                        for (s, v) in weighted.iter_mut().zip([1.0, p, q, p * p, q * q, p * q]) {
                            *s += w * v;
                        }
                    }
                }
                let [n, p, q, pp, qq, pq] = weighted;
                let (p, q, pp, qq, pq) = (p / n, q / n, pp / n, qq / n, pq / n);
                sum += (2.0 * p * q + C1) * (2.0 * (pq - p * q) + C2)
                    / ((p * p + q * q + C1) * (pp - p * p + qq - q * q + C2));
            }
        }
        let expected = sum / 21.0;
        assert!((ssim(&a, &b).unwrap() - expected).abs() < 1e-9, "{expected}");
        assert!(expected < 0.2, "noise has no common structure");
        let inverted = grey(width, height, |x, y| 1.0 - value(1)(x, y));
        assert!(ssim(&a, &inverted).unwrap() < -0.5);
    }

    #[test]
    fn sizes_that_do_not_fit_are_errors() {
        assert!(ssim(&Image::black(12, 12), &Image::black(12, 13)).is_err());
        let small = ssim(&Image::black(40, 10), &Image::black(40, 10)).unwrap_err();
        assert!(small.to_string().contains("at least 11"), "{small}");
    }
}
