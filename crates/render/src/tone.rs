//! From linear radiance to what a screen shows.

use crate::{image::Image, sampling::luminance};
use glam::Vec3;
use niwaki_core::glam;

/// How bright an image is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// Multiplies by 2 to this power; 0 shows radiance 1 as white.
    Stops(f32),
    /// Brings the log-average luminance of the pixels that are not black to this value, usually
    /// 0.18, middle grey (Reinhard et al. 2002, eqs. 1 and 2), but never brightens or darkens by
    /// more than 2²⁰. A black image is left as it is.
    Automatic(f32),
}

/// The tone curve of [`Image::save_png`]: exposure, then a shoulder for highlights if asked, then
/// the sRGB transfer function (IEC 61966-2-1) and rounding to 8 bits. Values above 1 are cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneCurve {
    /// How bright.
    pub exposure: Exposure,
    /// Compress highlights instead of cutting them: luminance L becomes L (1 + L/w²) / (1 + L)
    /// with w = 4, so that 4 is white (Reinhard et al. 2002, eq. 4). Colours keep their hue.
    pub shoulder: bool,
}

impl Default for ToneCurve {
    /// As it is: no exposure change, no shoulder.
    fn default() -> Self {
        Self { exposure: Exposure::Stops(0.0), shoulder: false }
    }
}

impl ToneCurve {
    /// Automatic exposure to middle grey with a shoulder: for looking at a scene of unknown
    /// brightness.
    #[must_use]
    pub const fn automatic() -> Self {
        Self { exposure: Exposure::Automatic(0.18), shoulder: true }
    }

    /// The factor that the exposure stands for on this image.
    #[must_use]
    pub fn scale(&self, image: &Image) -> f32 {
        match self.exposure {
            Exposure::Stops(stops) => stops.exp2(),
            Exposure::Automatic(key) => {
                let logarithms: Vec<f64> = image
                    .pixels()
                    .iter()
                    .map(|&p| luminance(p))
                    .filter(|&l| l > 0.0 && l.is_finite())
                    .map(|l| f64::from(l).ln())
                    .collect();
                if logarithms.is_empty() {
                    return 1.0;
                }
                let average = (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp();
                let limit = f64::from(1_u32 << 20);
                #[expect(clippy::cast_possible_truncation, reason = "clamped to 2^±20")]
                let scale = (f64::from(key) / average).clamp(limit.recip(), limit) as f32;
                scale
            }
        }
    }

    /// This curve with the exposure that it has on `reference`, so that images shown beside it
    /// are as bright.
    #[must_use]
    pub fn exposed_as(&self, reference: &Image) -> Self {
        Self { exposure: Exposure::Stops(self.scale(reference).log2()), ..*self }
    }

    /// What is displayed: exposure and shoulder applied, cut to 0 to 1, values that are not finite
    /// black; still linear. Saved with the default curve it gives the bytes that this curve gives.
    #[must_use]
    pub fn apply(&self, image: &Image) -> Image {
        let scale = self.scale(image);
        let cut = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
        let shown = |&p: &Vec3| Vec3::from(self.shown(p, scale).to_array().map(cut));
        let pixels = image.pixels().iter().map(shown).collect();
        Image::from_pixels(image.width(), image.height(), pixels)
            .unwrap_or_else(|| Image::black(image.width(), image.height()))
    }

    /// Exposure and shoulder.
    fn shown(&self, color: Vec3, scale: f32) -> Vec3 {
        let color = color * scale;
        if !self.shoulder {
            return color;
        }
        let l = luminance(color);
        color * ((1.0 + l / 16.0) / (1.0 + l))
    }

    /// 8-bit sRGB triples, rows from the top.
    #[must_use]
    pub fn encode(&self, image: &Image) -> Vec<u8> {
        let scale = self.scale(image);
        let bytes =
            |&p: &Vec3| self.shown(p, scale).to_array().map(|x| quantize(linear_to_srgb(x)));
        image.pixels().iter().flat_map(bytes).collect()
    }
}

/// The sRGB transfer function from linear to encoded, both 0 to 1; cut outside, NaN becomes 0.
#[must_use]
pub fn linear_to_srgb(linear: f32) -> f32 {
    let x = if linear.is_finite() { linear.clamp(0.0, 1.0) } else { 0.0 };
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "encoded values are in 0 to 1"
)]
fn quantize(encoded: f32) -> u8 {
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_encode_as_the_standard_says() {
        let pixels = vec![
            Vec3::new(0.0, 0.5, 1.0),
            Vec3::new(f32::NAN, 7.0, -1.0),
            Vec3::new(0.002, 0.214_041_14, f32::INFINITY),
        ];
        let image = Image::from_pixels(3, 1, pixels).unwrap();
        let bytes = ToneCurve::default().encode(&image);
        // sRGB 0.5 is linear 0.2140; linear 0.5 is 188; 0.002 · 12.92 · 255 = 6.6.
        assert_eq!(bytes, [0, 188, 255, 0, 255, 0, 7, 128, 0]);
    }

    #[test]
    fn automatic_exposure_brings_the_log_average_to_the_key() {
        for level in [1e-4, 0.18, 3e3] {
            let pixels = vec![Vec3::splat(level * 4.0), Vec3::splat(level / 4.0), Vec3::ZERO];
            let image = Image::from_pixels(3, 1, pixels).unwrap();
            let tone = ToneCurve { exposure: Exposure::Automatic(0.18), shoulder: false };
            assert!((tone.scale(&image) * level - 0.18).abs() < 1e-4);
        }
        assert_eq!(ToneCurve::automatic().scale(&Image::black(4, 4)), 1.0);
        // What is shown beside a reference is as bright, and applying first changes nothing.
        let reference = Image::from_pixels(1, 1, vec![Vec3::splat(5.0)]).unwrap();
        let other = Image::from_pixels(1, 1, vec![Vec3::new(1.0, 4.0, f32::NAN)]).unwrap();
        let tone = ToneCurve::automatic().exposed_as(&reference);
        assert!((tone.scale(&other) * 5.0 - 0.18).abs() < 1e-6);
        let other = Image::from_pixels(1, 1, vec![Vec3::new(1.0, 4.0, 70.0)]).unwrap();
        assert_eq!(ToneCurve::default().encode(&tone.apply(&other)), tone.encode(&other));
    }

    #[test]
    fn the_shoulder_keeps_order_and_reaches_white_at_four() {
        let tone = ToneCurve { exposure: Exposure::Stops(0.0), shoulder: true };
        let pixels: Vec<Vec3> = (0..=40).map(|i| Vec3::splat(i as f32 * 0.1)).collect();
        let bytes = tone.encode(&Image::from_pixels(41, 1, pixels).unwrap());
        assert!(bytes.windows(2).all(|w| w[0] <= w[1]));
        assert_eq!((bytes[0], bytes[122]), (0, 255));
        assert!(bytes[30] < 255, "radiance 1 is not yet white");
    }
}
