//! Images of linear colour: storage, files and error metrics.

use crate::{metrics::Tile, tone::ToneCurve};
use glam::Vec3;
use niwaki_core::glam;
use std::path::{Path, PathBuf};

/// Why an image could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The PNG could not be encoded or written. Remedy: check that the folder exists, is writable
    /// and that the image has at least one pixel.
    #[error("cannot write {}", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// What the encoder or the system said.
        source: image::ImageError,
    },
    /// The EXR could not be encoded or written. Remedy: as for PNG.
    #[error("cannot write {}", path.display())]
    Exr {
        /// The file.
        path: PathBuf,
        /// What the encoder or the system said.
        source: exr::error::Error,
    },
    /// The image has no pixels, which neither format can say. Remedy: render at least one.
    #[error("cannot write {}: the image has no pixels", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// A picture in linear RGB with the primaries of sRGB, `f32`, not bounded by 1, rows from the
/// top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<Vec3>,
}

impl Image {
    /// A black image.
    #[must_use]
    pub fn black(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// An image of these pixels, rows from the top; `None` if their number is not `width` ×
    /// `height`.
    #[must_use]
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<Vec3>) -> Option<Self> {
        (pixels.len() as u64 == u64::from(width) * u64::from(height)).then_some(Self {
            width,
            height,
            pixels,
        })
    }

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

    /// All pixels, rows from the top.
    #[must_use]
    pub fn pixels(&self) -> &[Vec3] {
        &self.pixels
    }

    fn index(&self, x: u32, y: u32) -> usize {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside the image");
        y as usize * self.width as usize + x as usize
    }

    /// One pixel; (0, 0) is the top left.
    ///
    /// # Panics
    /// If the pixel is outside.
    #[must_use]
    pub fn get(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[self.index(x, y)]
    }

    /// Sets one pixel.
    ///
    /// # Panics
    /// If the pixel is outside.
    pub fn set(&mut self, x: u32, y: u32, color: Vec3) {
        let index = self.index(x, y);
        self.pixels[index] = color;
    }

    /// The part of the image that a tile covers; what lies outside is left out.
    #[must_use]
    pub fn crop(&self, tile: Tile) -> Self {
        let Tile { x, y, width, height } = tile.within(self.width, self.height);
        let row = |y: u32| {
            let start = y as usize * self.width as usize + x as usize;
            &self.pixels[start..start + width as usize]
        };
        Self { width, height, pixels: (y..y + height).flat_map(row).copied().collect() }
    }

    /// The image with each pixel as a square of `factor` × `factor`, for looking at single pixels.
    #[must_use]
    pub fn enlarged(&self, factor: u32) -> Self {
        let (width, height) = (self.width * factor, self.height * factor);
        let mut image = Self::black(width, height);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            let (x, y) = (i % width as usize, i / width as usize);
            let factor = factor as usize;
            *pixel = self.pixels[y / factor * self.width as usize + x / factor];
        }
        image
    }

    /// The mean of all pixels in `f64`, zero for an empty image.
    #[must_use]
    pub fn mean(&self) -> glam::DVec3 {
        let sum: glam::DVec3 = self.pixels.iter().map(|p| p.as_dvec3()).sum();
        sum / self.pixels.len().max(1) as f64
    }

    /// Writes 8-bit sRGB through a tone curve. Values that are not finite become black.
    ///
    /// # Errors
    /// [`ImageError`] with the path.
    pub fn save_png(&self, path: impl AsRef<Path>, tone: &ToneCurve) -> Result<(), ImageError> {
        let path = path.as_ref();
        self.refuse_empty(path)?;
        image::save_buffer_with_format(
            path,
            &tone.encode(self),
            self.width,
            self.height,
            image::ExtendedColorType::Rgb8,
            image::ImageFormat::Png,
        )
        .map_err(|source| ImageError::Png { path: path.into(), source })
    }

    /// Writes the linear values unchanged as 32-bit OpenEXR.
    ///
    /// # Errors
    /// [`ImageError`] with the path.
    pub fn save_exr(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        let path = path.as_ref();
        self.refuse_empty(path)?;
        exr::prelude::write_rgb_file(path, self.width as usize, self.height as usize, |x, y| {
            self.pixels[y * self.width as usize + x].into()
        })
        .map_err(|source| ImageError::Exr { path: path.into(), source })
    }

    fn refuse_empty(&self, path: &Path) -> Result<(), ImageError> {
        if self.pixels.is_empty() { Err(ImageError::Empty { path: path.into() }) } else { Ok(()) }
    }

    /// Root mean square error over all pixels and channels against `reference`; NaN if the sizes
    /// differ or there are no pixels.
    #[must_use]
    pub fn rmse(&self, reference: &Self) -> f64 {
        self.mean_error(reference, |a, b| (a - b) * (a - b)).sqrt()
    }

    /// Relative mean square error: the mean of (a − b)² / (b² + 0.01) over all pixels and
    /// channels, b being the reference (Rousselle, Knaus and Zwicker 2011, section 5); NaN if the
    /// sizes differ or there are no pixels.
    #[must_use]
    pub fn relative_mse(&self, reference: &Self) -> f64 {
        self.mean_error(reference, |a, b| (a - b) * (a - b) / (b * b + 0.01))
    }

    fn mean_error(&self, reference: &Self, error: impl Fn(f64, f64) -> f64) -> f64 {
        if (self.width, self.height) != (reference.width, reference.height) {
            return f64::NAN;
        }
        let pairs = self.pixels.iter().zip(&reference.pixels);
        let sum: f64 = pairs
            .flat_map(|(a, b)| a.to_array().into_iter().zip(b.to_array()))
            .map(|(a, b)| error(f64::from(a), f64::from(b)))
            .sum();
        sum / (3 * self.pixels.len()) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_of_the_formulas() {
        let reference = Image::from_pixels(2, 1, vec![Vec3::ONE, Vec3::ZERO]).unwrap();
        let other = Image::from_pixels(2, 1, vec![Vec3::ONE, Vec3::splat(0.3)]).unwrap();
        assert_eq!(reference.rmse(&reference), 0.0);
        assert!((other.rmse(&reference) - (0.09_f64 / 2.0).sqrt()).abs() < 1e-7);
        assert!((other.relative_mse(&reference) - 9.0 / 2.0).abs() < 1e-5);
        assert!(other.rmse(&Image::black(1, 2)).is_nan());
        assert!(Image::from_pixels(2, 2, vec![Vec3::ONE; 3]).is_none());
    }

    #[test]
    fn parts_are_cut_out_and_enlarged() {
        let pixels = (0..12).map(|i| Vec3::splat(i as f32)).collect();
        let image = Image::from_pixels(4, 3, pixels).unwrap();
        let part = image.crop(Tile { x: 2, y: 1, width: 9, height: 1 });
        assert_eq!((part.width(), part.height()), (2, 1));
        assert_eq!(part.pixels(), [Vec3::splat(6.0), Vec3::splat(7.0)]);
        let large = part.enlarged(2);
        assert_eq!((large.width(), large.height()), (4, 2));
        let row: Vec<f32> = large.pixels().iter().map(|p| p.x).collect();
        assert_eq!(row, [6.0, 6.0, 7.0, 7.0, 6.0, 6.0, 7.0, 7.0]);
        assert_eq!(image.enlarged(0), Image::black(0, 0));
        assert_eq!(image.crop(Tile { x: 4, y: 0, width: 1, height: 3 }).pixels().len(), 0);
    }
}
