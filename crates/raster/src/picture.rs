//! What comes back from the GPU.

use niwaki_render::Image;
use niwaki_scene::texture::srgb_to_linear;

/// A picture for the display: sRGB, 8 bits a channel, rows from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Picture {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Red, green, blue, and an alpha of 255.
    pub pixels: Vec<[u8; 4]>,
}

impl Picture {
    /// The greatest difference of a channel from another picture of the same size, and how many
    /// pixels differ; `None` for pictures of different sizes.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<(u8, usize)> {
        if (self.width, self.height) != (other.width, other.height) {
            return None;
        }
        let pairs = self.pixels.iter().zip(&other.pixels);
        let each = pairs.map(|(a, b)| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0));
        Some(each.fold((0, 0), |(most, n), d| (most.max(d), n + usize::from(d > 0))))
    }

    /// The picture as linear radiance from 0 to 1, to be saved or compared; an sRGB display shows
    /// it as it is with no exposure.
    #[must_use]
    pub fn to_image(&self) -> Image {
        let linear = |c: u8| srgb_to_linear(f32::from(c) / 255.0);
        let pixels = self.pixels.iter().map(|p| [p[0], p[1], p[2]].map(linear).into()).collect();
        Image::from_pixels(self.width, self.height, pixels).unwrap_or_else(|| Image::black(0, 0))
    }
}

/// What share of a light arrives at what pixels show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shares {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Distance of the near plane: a depth d of `depth` is `near` / d along the view.
    pub near: f32,
    /// From 0, shadow, to 1, and 0 where the light does not reach anyway; rows from the top.
    pub share: Vec<f32>,
    /// The triangle that each pixel shows, from 1; 0 is background.
    pub triangle: Vec<u32>,
    /// Depth, 1 at the near plane and 0 infinitely far.
    pub depth: Vec<f32>,
}

/// A number of 16 bits (IEEE 754 binary16), not negative.
pub(crate) fn half(bits: u16) -> f32 {
    let (exponent, fraction) = (bits >> 10 & 31, f32::from(bits & 1023));
    match exponent {
        0 => fraction * 2.0_f32.powi(-24),
        31 => f32::INFINITY,
        e => (1.0 + fraction / 1024.0) * 2.0_f32.powi(i32::from(e) - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_read() {
        for (bits, value) in [(0x3c00, 1.0), (0x3800, 0.5), (0, 0.0), (1, 5.960_464_5e-8)] {
            assert_eq!(half(bits), value);
        }
    }

    #[test]
    fn differences_count_pixels_and_the_worst_channel() {
        let a = Picture { width: 2, height: 1, pixels: vec![[1, 2, 3, 255]; 2] };
        let mut b = a.clone();
        b.pixels[1] = [1, 9, 2, 255];
        assert_eq!((a.difference(&b), a.difference(&a)), (Some((7, 1)), Some((0, 0))));
        assert_eq!(a.difference(&Picture::default()), None);
    }
}
