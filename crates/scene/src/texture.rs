//! Images that materials look up.

use glam::{Vec2, Vec4};
use std::sync::Arc;

/// What happens to texture coordinates outside 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, every other one mirrored.
    Mirror,
    /// The border pixel goes on for ever.
    Clamp,
}

impl Wrap {
    /// The pixel that a possibly outside pixel index stands for; `size` is at least 1.
    fn apply(self, index: i64, size: i64) -> i64 {
        match self {
            Self::Repeat => index.rem_euclid(size),
            Self::Mirror => {
                let i = index.rem_euclid(2 * size);
                if i < size { i } else { 2 * size - 1 - i }
            }
            Self::Clamp => index.clamp(0, size - 1),
        }
    }
}

/// An RGBA image of 8 bits a channel, rows from the top, and how to sample it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    name: String,
    width: u32,
    height: u32,
    /// Shared, as many textures may show one image.
    pixels: Arc<Vec<[u8; 4]>>,
    srgb: bool,
    wrap: [Wrap; 2],
}

impl Texture {
    /// A texture of `width` × `height` pixels, rows from the top. `srgb` says that the colour
    /// channels (never alpha) hold sRGB-encoded values. `None` if a side is 0 or the number of
    /// pixels does not fit.
    #[must_use]
    pub fn new(
        name: &str,
        width: u32,
        height: u32,
        pixels: Vec<[u8; 4]>,
        srgb: bool,
    ) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        (count > 0 && count == pixels.len() as u64).then(|| Self {
            name: name.into(),
            width,
            height,
            pixels: Arc::new(pixels),
            srgb,
            wrap: [Wrap::Repeat; 2],
        })
    }

    /// The same image with other wrapping in u and in v.
    #[must_use]
    pub fn with_wrap(mut self, u: Wrap, v: Wrap) -> Self {
        self.wrap = [u, v];
        self
    }

    /// Name in the file, or its path.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Width in pixels, at least 1.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels, at least 1.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The stored values, rows from the top.
    #[must_use]
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }

    /// True if the colour channels hold sRGB-encoded values.
    #[must_use]
    pub const fn is_srgb(&self) -> bool {
        self.srgb
    }

    /// Wrapping in u and in v.
    #[must_use]
    pub const fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }

    /// The mean of all pixels, linear RGB and alpha; zero without any.
    #[must_use]
    pub fn mean(&self) -> Vec4 {
        let levels = |c: u8| {
            if self.srgb { srgb_to_linear(f32::from(c) / 255.0) } else { f32::from(c) / 255.0 }
        };
        let table: Vec<f64> = (0..=255).map(|c| f64::from(levels(c))).collect();
        let mut sum = [0.0_f64; 4];
        for &[r, g, b, a] in self.pixels.iter() {
            for (sum, c) in sum.iter_mut().zip([r, g, b]) {
                *sum += table[usize::from(c)];
            }
            sum[3] += f64::from(a) / 255.0;
        }
        let count = self.pixels.len().max(1) as f64;
        #[expect(clippy::cast_possible_truncation, reason = "means of numbers from 0 to 1")]
        Vec4::from(sum.map(|sum| (sum / count) as f32))
    }

    /// One pixel, linear.
    fn texel(&self, x: i64, y: i64) -> Vec4 {
        let x = self.wrap[0].apply(x, i64::from(self.width));
        let y = self.wrap[1].apply(y, i64::from(self.height));
        let index = y * i64::from(self.width) + x;
        let [r, g, b, a] =
            usize::try_from(index).ok().and_then(|i| self.pixels.get(i)).copied().unwrap_or([0; 4]);
        let linear = |c: u8| {
            if self.srgb { srgb_to_linear(f32::from(c) / 255.0) } else { f32::from(c) / 255.0 }
        };
        Vec4::new(linear(r), linear(g), linear(b), f32::from(a) / 255.0)
    }

    /// The bilinearly filtered value at `uv`, linear RGB and alpha. (0, 0) is the top left corner
    /// of the image, (1, 1) the bottom right; pixel centres are at half-integers. Coordinates
    /// that are not finite read as 0.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        let place = |t: f32, size: u32| {
            let t = if t.is_finite() { f64::from(t) } else { 0.0 };
            // Beyond 2³⁰ neither the fraction nor the repeat means anything in `f32`.
            let x = t.clamp(-1e9, 1e9) * f64::from(size) - 0.5;
            let floor = x.floor();
            #[expect(clippy::cast_possible_truncation, reason = "bounded by the clamp above")]
            let pair = (floor as i64, (x - floor) as f32);
            pair
        };
        let (x, fx) = place(uv.x, self.width);
        let (y, fy) = place(uv.y, self.height);
        // In this form the mean of equal values is that value, so that an opaque texture is opaque.
        let lerp = |a: Vec4, b: Vec4, t: f32| a + (b - a) * t;
        let top = lerp(self.texel(x, y), self.texel(x + 1, y), fx);
        let bottom = lerp(self.texel(x, y + 1), self.texel(x + 1, y + 1), fx);
        lerp(top, bottom, fy)
    }
}

/// The sRGB transfer function (IEC 61966-2-1) from encoded to linear, both 0 to 1.
#[must_use]
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> Texture {
        let pixels = vec![[0, 0, 0, 255], [255, 255, 255, 255], [255; 4], [0, 0, 0, 0]];
        Texture::new("checker", 2, 2, pixels, false).unwrap()
    }

    #[test]
    fn pixel_centres_give_pixels_and_corners_their_mean() {
        let t = checker();
        assert_eq!(t.sample(Vec2::new(0.25, 0.25)), Vec4::new(0.0, 0.0, 0.0, 1.0));
        assert_eq!(t.sample(Vec2::new(0.75, 0.25)), Vec4::ONE);
        assert_eq!(t.sample(Vec2::new(0.5, 0.5)), Vec4::new(0.5, 0.5, 0.5, 0.75));
    }

    #[test]
    fn wrapping_reads_where_the_mode_says() {
        let inside = Vec2::new(0.25, 0.25);
        let far = Vec2::new(1.25, 0.25);
        let repeat = checker();
        assert_eq!(repeat.sample(far), repeat.sample(inside));
        assert_eq!(repeat.sample(far - Vec2::new(4.0, 0.0)), repeat.sample(inside));
        let mirror = checker().with_wrap(Wrap::Mirror, Wrap::Clamp);
        assert_eq!(mirror.sample(far), mirror.sample(Vec2::new(0.75, 0.25)));
        let clamp = checker().with_wrap(Wrap::Clamp, Wrap::Clamp);
        assert_eq!(clamp.sample(Vec2::new(9.0, 0.25)), Vec4::ONE);
    }

    #[test]
    fn no_coordinate_panics_and_results_stay_in_range() {
        let t = checker();
        for u in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, -1e9, 1e-40] {
            let c = t.sample(Vec2::new(u, -u));
            assert!(c.cmpge(Vec4::ZERO).all() && c.cmple(Vec4::ONE).all(), "{u}: {c}");
        }
    }

    #[test]
    fn srgb_is_decoded_for_colour_but_not_alpha() {
        let t = Texture::new("grey", 1, 1, vec![[188, 188, 188, 188]], true).unwrap();
        let c = t.sample(Vec2::ZERO);
        // 188 / 255 encodes half the light to within half a step.
        assert!((c.x - 0.5).abs() < 3e-3, "{c}");
        assert_eq!(c.w, 188.0 / 255.0);
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        assert!(Texture::new("none", 0, 4, vec![], false).is_none());
        assert!(Texture::new("short", 2, 2, vec![[0; 4]; 3], false).is_none());
    }
}
