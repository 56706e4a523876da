//! Costs per pixel as colours.

use crate::{image::Image, view::View};
use glam::{Vec2, Vec3};
use niwaki_core::{Ray, glam};
use niwaki_scene::{Camera, texture::srgb_to_linear};
use rayon::prelude::*;

/// The viridis colour map (van der Walt and Smith 2015, CC0) at nine equal steps from 0 to 1, sRGB.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [40, 174, 128],
    [94, 201, 98],
    [173, 220, 48],
    [253, 231, 37],
];

/// The magma colour map (van der Walt and Smith 2015, CC0) at 17 equal steps from 0 to 1, sRGB.
const MAGMA: [[u8; 3]; 17] = [
    [0, 0, 4],
    [10, 8, 34],
    [29, 17, 71],
    [54, 16, 107],
    [81, 18, 124],
    [106, 28, 129],
    [131, 38, 129],
    [156, 46, 127],
    [183, 55, 121],
    [207, 64, 112],
    [229, 80, 100],
    [244, 105, 92],
    [251, 135, 97],
    [254, 165, 113],
    [254, 194, 135],
    [253, 224, 161],
    [252, 253, 191],
];

/// The colour for `x` in 0 to 1 (cut outside, NaN reads as 0), linear RGB: viridis, which is
/// perceptually uniform and can be read by people with red-green blindness.
#[must_use]
pub fn viridis(x: f32) -> Vec3 {
    interpolate(&VIRIDIS, x)
}

/// As [`viridis`], but from black: magma, in which FLIP shows errors.
#[must_use]
pub fn magma(x: f32) -> Vec3 {
    interpolate(&MAGMA, x)
}

/// A colour map at `x`.
fn interpolate(map: &[[u8; 3]], x: f32) -> Vec3 {
    let x = if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) } * (map.len() - 1) as f32;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the table"
    )]
    let i = (x as usize).min(map.len() - 2);
    let color = |i: usize| Vec3::from(map[i].map(f32::from)) / 255.0;
    let encoded = color(i).lerp(color(i + 1), x - i as f32);
    Vec3::from(encoded.to_array().map(srgb_to_linear))
}

/// A cost per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// What the cost function returned, rows from the top.
    pub costs: Vec<f32>,
}

impl HeatMap {
    /// Largest finite cost, at least 0.
    #[must_use]
    pub fn max(&self) -> f32 {
        self.costs.iter().copied().filter(|c| c.is_finite()).fold(0.0, f32::max)
    }

    /// Mean of the finite costs, 0 without any.
    #[must_use]
    pub fn mean(&self) -> f64 {
        let finite: Vec<f64> =
            self.costs.iter().filter(|c| c.is_finite()).map(|&c| f64::from(c)).collect();
        finite.iter().sum::<f64>() / finite.len().max(1) as f64
    }

    /// False colours: 0 is dark violet, `full` and above yellow. Give images that are compared the
    /// same `full`. Save with `ToneCurve::default()`.
    #[must_use]
    pub fn colorize(&self, full: f32) -> Image {
        let pixels = self.costs.iter().map(|&c| viridis(c / full)).collect();
        Image::from_pixels(self.width, self.height, pixels)
            .unwrap_or_else(|| Image::black(self.width, self.height))
    }
}

/// Evaluates `cost` (for example nodes visited plus triangles tested) for the ray through the
/// centre of each pixel, on the current rayon pool.
///
/// ```
/// use niwaki_core::glam::Vec3;
/// use niwaki_scene::Camera;
/// let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0);
/// let map = niwaki_render::traversal_heat_map(&camera, 32, 32, |ray| ray.direction.x.abs());
/// assert!(map.max() > 0.0 && map.max() < 1.0);
/// let _image = map.colorize(map.max());
/// ```
pub fn traversal_heat_map(
    camera: &Camera,
    width: u32,
    height: u32,
    cost: impl Fn(&Ray) -> f32 + Sync,
) -> HeatMap {
    let view = View::new(camera, width, height);
    let row = |y: u32| (0..width).map(move |x| view.ray(x, y, Vec2::splat(0.5)));
    let costs = (0..height)
        .into_par_iter()
        .flat_map_iter(|y| row(y).map(|ray| cost(&ray)).collect::<Vec<_>>())
        .collect();
    HeatMap { width, height, costs }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::luminance;

    #[test]
    fn colours_get_lighter_all_the_way() {
        for map in [viridis, magma] {
            let steps: Vec<f32> = (0..=256).map(|i| luminance(map(i as f32 / 256.0))).collect();
            assert!(steps.windows(2).all(|w| w[0] < w[1]));
        }
        assert_eq!(viridis(f32::NAN), viridis(0.0));
        assert_eq!(viridis(9.0), viridis(1.0));
    }

    #[test]
    fn costs_lie_where_their_rays_went() {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 1.0);
        let map = traversal_heat_map(&camera, 4, 2, |ray| ray.direction.x + 10.0 * ray.direction.y);
        assert_eq!(map.costs.len(), 8);
        assert!(map.costs[0] > map.costs[4], "the first row is the top");
        assert!(map.costs[0] < map.costs[3], "columns go to the right");
    }
}
