//! How far an image is from a reference: FLIP for what a viewer notices, PSNR and SSIM because
//! everyone reports them.
//!
//! | function | compares | result |
//! |---|---|---|
//! | [`flip()`] | displayed colours, as seen at some distance (Andersson et al. 2020) | a map of 0 (same) to 1 |
//! | [`hdr_flip`] | radiance over all exposures that a viewer might choose (Andersson et al. 2021) | a map of 0 to 1 |
//! | [`psnr`] | encoded colours | decibels; ∞ for equal images |
//! | [`ssim`] | structure of encoded luma (Wang et al. 2004) | −1 to 1; 1 for equal images |
//!
//! All take linear images. Those that compare what is displayed clamp them to 0 to 1 and count NaN
//! as 0, as [`Image::save_png`] with the default tone curve does; bring high dynamic range into
//! that range by [`ToneCurve::apply`](crate::ToneCurve::apply), with the exposure of the reference
//! for both. [`ErrorMap::worst_tile`] finds where an image is worst.

mod flip;
mod ssim;
mod tile;

pub use flip::{FlipSettings, flip, hdr_flip};
pub use ssim::ssim;
pub use tile::Tile;

use crate::{heat_map::magma, image::Image, tone::linear_to_srgb};

/// Why two images cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricError {
    /// The images differ in size. Remedy: render both with the same width and height.
    #[error(
        "cannot compare {}×{} pixels with a reference of {}×{}: render both at one size",
        size.0, size.1, reference.0, reference.1
    )]
    Size {
        /// Width and height of the image.
        size: (u32, u32),
        /// Width and height of the reference.
        reference: (u32, u32),
    },
    /// The images have too few pixels for the metric. Remedy: render larger ones.
    #[error(
        "cannot compare images of {width}×{height} pixels: the metric needs at least {least} on each side"
    )]
    TooSmall {
        /// Their width.
        width: u32,
        /// Their height.
        height: u32,
        /// The fewest pixels on a side.
        least: u32,
    },
}

fn check(image: &Image, reference: &Image, least: u32) -> Result<(), MetricError> {
    let [size, other] = [image, reference].map(|i| (i.width(), i.height()));
    if size != other {
        return Err(MetricError::Size { size, reference: other });
    }
    if size.0.min(size.1) < least {
        return Err(MetricError::TooSmall { width: size.0, height: size.1, least });
    }
    Ok(())
}

/// An error per pixel, 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    width: u32,
    height: u32,
    values: Vec<f32>,
}

impl ErrorMap {
    /// Width in pixels.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The errors, rows from the top.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The mean: the one number that FLIP's authors recommend.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|&e| f64::from(e)).sum::<f64>() / self.values.len().max(1) as f64
    }

    /// The largest error.
    #[must_use]
    pub fn max(&self) -> f32 {
        self.values.iter().copied().fold(0.0, f32::max)
    }

    /// The error that this share (0 to 1) of the pixels does not exceed: the nearest rank.
    #[must_use]
    pub fn percentile(&self, share: f64) -> f32 {
        let mut sorted = self.values.clone();
        sorted.sort_by(f32::total_cmp);
        #[expect(clippy::cast_possible_truncation, reason = "clamped to the number of pixels")]
        #[expect(clippy::cast_sign_loss, reason = "clamped to 0 and above")]
        let rank = (share.clamp(0.0, 1.0) * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.max(1) - 1).copied().unwrap_or(0.0)
    }

    /// The map in the colours that FLIP uses: black is no error, bright yellow 1. Save with
    /// `ToneCurve::default()`.
    #[must_use]
    pub fn colorize(&self) -> Image {
        let pixels = self.values.iter().map(|&e| magma(e)).collect();
        Image::from_pixels(self.width, self.height, pixels)
            .unwrap_or_else(|| Image::black(self.width, self.height))
    }
}

/// Peak signal-to-noise ratio in decibels, 10 log₁₀(1 / MSE) over all channels of the sRGB-encoded
/// colours (clamped to 0 to 1, not rounded to 8 bits). 30 is visible, 40 hardly; ∞ for equal
/// images.
///
/// ```
/// use niwaki_core::glam::Vec3;
/// use niwaki_render::{Image, metrics::psnr};
/// let black = Image::black(4, 4);
/// let white = Image::from_pixels(4, 4, vec![Vec3::ONE; 16]).ok_or("16 pixels")?;
/// assert!(psnr(&black, &white)?.abs() < 1e-5);
/// assert_eq!(psnr(&white, &white)?, f64::INFINITY);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the sizes differ or there are no pixels.
pub fn psnr(image: &Image, reference: &Image) -> Result<f64, MetricError> {
    check(image, reference, 1)?;
    let encoded = |i: &Image| -> Vec<f64> {
        i.pixels().iter().flat_map(|p| p.to_array()).map(|x| f64::from(linear_to_srgb(x))).collect()
    };
    let (a, b) = (encoded(image), encoded(reference));
    let sum: f64 = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum();
    Ok(-10.0 * (sum / a.len() as f64).log10() + 0.0)
}
