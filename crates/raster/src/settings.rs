//! The six algorithms and their settings.

use serde::{Deserialize, Serialize};

/// What is drawn how (Johnsson, Ganestam, Doggett and Akenine-Möller 2012, §3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Algorithm {
    /// FR: triangles are shaded with all lights as they are drawn; no shadows.
    Forward,
    /// ZR: depth first, then forward rendering of what is visible; no shadows.
    ZPrepass,
    /// DR: a G-buffer, then the volume of each light; no shadows.
    Deferred,
    /// SV: a G-buffer, then for each light its shadow volumes by z-fail and its volume.
    ShadowVolumes,
    /// SM: a G-buffer, then for each light its shadow map and its volume.
    ShadowMaps,
    /// VSM: a G-buffer, then for each light its variance shadow map with its levels and its volume.
    VarianceShadowMaps,
}

impl Algorithm {
    /// All six, in the order of the paper's tables.
    pub const ALL: [Self; 6] = [
        Self::Forward,
        Self::ZPrepass,
        Self::Deferred,
        Self::ShadowVolumes,
        Self::ShadowMaps,
        Self::VarianceShadowMaps,
    ];
    /// Those of primary rendering (§3.1).
    pub const PRIMARY: [Self; 3] = [Self::Forward, Self::ZPrepass, Self::Deferred];
    /// Those of shadows (§3.2).
    pub const SHADOWS: [Self; 3] =
        [Self::ShadowVolumes, Self::ShadowMaps, Self::VarianceShadowMaps];

    /// The paper's abbreviation.
    #[must_use]
    pub const fn short(self) -> &'static str {
        match self {
            Self::Forward => "FR",
            Self::ZPrepass => "ZR",
            Self::Deferred => "DR",
            Self::ShadowVolumes => "SV",
            Self::ShadowMaps => "SM",
            Self::VarianceShadowMaps => "VSM",
        }
    }

    /// A name in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Forward => "forward rendering",
            Self::ZPrepass => "Z-prepass rendering",
            Self::Deferred => "deferred rendering",
            Self::ShadowVolumes => "shadow volumes",
            Self::ShadowMaps => "shadow maps",
            Self::VarianceShadowMaps => "variance shadow maps",
        }
    }

    /// True if lights cast shadows.
    #[must_use]
    pub const fn has_shadows(self) -> bool {
        matches!(self, Self::ShadowVolumes | Self::ShadowMaps | Self::VarianceShadowMaps)
    }
}

impl std::fmt::Display for Algorithm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.short())
    }
}

impl std::str::FromStr for Algorithm {
    type Err = UnknownAlgorithm;

    fn from_str(text: &str) -> Result<Self, UnknownAlgorithm> {
        let found = Self::ALL
            .into_iter()
            .find(|a| a.short().eq_ignore_ascii_case(text) || a.name().eq_ignore_ascii_case(text));
        found.ok_or_else(|| UnknownAlgorithm(text.into()))
    }
}

/// A text names none of the six. Remedy: use FR, ZR, DR, SV, SM or VSM.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no algorithm: use FR, ZR, DR, SV, SM or VSM")]
pub struct UnknownAlgorithm(pub String);

/// How a shadow map is compared with a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Filter {
    /// With the nearest pixel.
    Nearest,
    /// The mean of comparisons in a square, percentage-closer filtering (Reeves, Salesin and Cook
    /// 1987): so many taps along a side, 1 to 15, each of which the sampler interpolates between
    /// the comparisons with four pixels.
    Closer(u32),
}

impl Filter {
    pub(crate) fn taps(self) -> u32 {
        match self {
            Self::Nearest => 0,
            Self::Closer(taps) => taps.clamp(1, 15),
        }
    }
}

/// How far a point is moved before it is compared with a map, in pixels that the map has where the
/// point is. Too little and surfaces shade themselves; too much and shadows come off what casts
/// them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bias {
    /// Towards the light.
    pub constant: f32,
    /// Towards the light, for each unit of the tangent of the angle between light and normal (at
    /// most 10 of them).
    pub slope: f32,
    /// Along the normal, times the sine of that angle.
    pub normal: f32,
}

impl Default for Bias {
    /// Half a pixel, and one along the slope, which is the most that a pixel's centre can be off
    /// with either filter of one tap.
    fn default() -> Self {
        Self { constant: 0.5, slope: 1.0, normal: 0.0 }
    }
}

impl Bias {
    /// No bias.
    pub const NONE: Self = Self { constant: 0.0, slope: 0.0, normal: 0.0 };
}

/// Settings of variance shadow maps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variance {
    /// The least width of the filter, in pixels of the map; from 1. More makes softer edges.
    pub least_filter: f32,
    /// The greatest width of the part of the map that a pixel of the image covers and the filter
    /// takes in; from 1, in pixels of the map. No limit, the default, is the paper's; with 1 only the finest level is read,
    /// and edges alias as those of shadow maps do.
    pub most_filter: f32,
    /// The least standard deviation of depth that the bound is computed with, in pixels that the
    /// map has where the point is; it hides self-shadowing that rounding makes.
    pub least_deviation: f32,
    /// Shares of light up to this one, 0 to less than 1, count as darkness, and those above are
    /// stretched: darkens light that bleeds, and shrinks penumbrae. 0, as in the paper, leaves the
    /// bound as it is.
    pub bleeding: f32,
    /// Bias of the depth that is compared.
    pub bias: Bias,
}

impl Default for Variance {
    fn default() -> Self {
        Self {
            least_filter: 1.0,
            most_filter: 65_536.0,
            least_deviation: 0.5,
            bleeding: 0.0,
            bias: Bias { constant: 0.5, slope: 0.0, normal: 0.0 },
        }
    }
}

/// Settings of a [`Renderer`](crate::Renderer).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// What is drawn how.
    pub algorithm: Algorithm,
    /// Side of shadow maps in pixels, from 16 ([`shadow_resolution`]).
    pub shadow_resolution: u32,
    /// How shadow maps are compared.
    pub filter: Filter,
    /// Bias of shadow maps.
    pub bias: Bias,
    /// Settings of variance shadow maps.
    pub variance: Variance,
    /// Whether closed parts of the scene cast shadow volumes from one side only ([`Solids`]). The
    /// shadows are the same; without it every triangle casts, which takes twice the caps and walls.
    ///
    /// [`Solids`]: crate::Solids
    pub one_sided: bool,
    /// What radiance is multiplied by for the display.
    pub exposure: f32,
    /// The share of the environment's light that arrives everywhere.
    pub ambient: f32,
}

impl Settings {
    /// Defaults for an algorithm and an image of this size: maps by [`shadow_resolution`].
    #[must_use]
    pub fn new(algorithm: Algorithm, width: u32, height: u32) -> Self {
        Self {
            algorithm,
            shadow_resolution: shadow_resolution(width, height),
            filter: Filter::Closer(1),
            bias: Bias::default(),
            variance: Variance::default(),
            one_sided: true,
            exposure: 1.0,
            ambient: 0.15,
        }
    }

    /// The settings with every number in its range; what is not a number becomes the default.
    #[must_use]
    pub fn sanitized(mut self) -> Self {
        let within = |x: &mut f32, low: f32, high: f32, default: f32| {
            *x = if x.is_nan() { default } else { x.clamp(low, high) };
        };
        self.shadow_resolution = self.shadow_resolution.max(16);
        within(&mut self.exposure, 0.0, 1e6, 1.0);
        within(&mut self.ambient, 0.0, 1e6, 0.15);
        let variance = Variance::default();
        within(&mut self.variance.least_filter, 1.0, 1024.0, variance.least_filter);
        within(&mut self.variance.most_filter, 1.0, 65_536.0, variance.most_filter);
        within(&mut self.variance.least_deviation, 0.0, 1e6, variance.least_deviation);
        within(&mut self.variance.bleeding, 0.0, 0.99, variance.bleeding);
        for bias in [&mut self.bias, &mut self.variance.bias] {
            within(&mut bias.constant, -1e6, 1e6, 0.0);
            within(&mut bias.slope, -1e6, 1e6, 0.0);
            within(&mut bias.normal, -1e6, 1e6, 0.0);
        }
        self
    }
}

/// The paper's rule for the side of shadow maps (§4): 2560 for images of 2560 × 1440, scaled by the
/// square root of k = pixels / (2560 · 1440), so that a pixel of the image has as many of the map.
/// The paper's sides (2560, 1792 for 1600 × 1200, 1024 for 960 × 640) come out by rounding down to
/// a multiple of 256; below 256 it is a multiple of 16, at least 16.
///
/// ```
/// use niwaki_raster::shadow_resolution;
///
/// assert_eq!(shadow_resolution(2560, 1440), 2560);
/// assert_eq!(shadow_resolution(1600, 1200), 1792);
/// assert_eq!(shadow_resolution(960, 640), 1024);
/// ```
#[must_use]
pub fn shadow_resolution(width: u32, height: u32) -> u32 {
    let k = f64::from(width) * f64::from(height) / (2560.0 * 1440.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let side = (2560.0 * k.sqrt()) as u32;
    let step = if side >= 256 { 256 } else { 16 };
    (side / step * step).max(16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_of_maps_follow_the_image() {
        for (size, side) in [((320, 180), 256), ((160, 90), 160), ((0, 5), 16), ((64, 36), 64)] {
            assert_eq!(shadow_resolution(size.0, size.1), side);
        }
    }

    #[test]
    fn names_are_read_back() {
        for a in Algorithm::ALL {
            assert_eq!(a.short().to_lowercase().parse(), Ok(a));
            assert_eq!(a.name().parse(), Ok(a));
        }
        let error = "XR".parse::<Algorithm>().unwrap_err();
        assert!(error.to_string().contains("XR") && error.to_string().contains("VSM"));
    }

    #[test]
    fn settings_are_brought_into_range() {
        let wild = Settings {
            shadow_resolution: 0,
            exposure: f32::NAN,
            variance: Variance { bleeding: 7.0, least_filter: -1.0, ..Variance::default() },
            bias: Bias { constant: f32::NAN, ..Bias::default() },
            ..Settings::new(Algorithm::Forward, 1, 1)
        };
        let s = wild.sanitized();
        assert_eq!((s.shadow_resolution, s.exposure), (16, 1.0));
        assert_eq!((s.variance.bleeding, s.variance.least_filter), (0.99, 1.0));
        assert_eq!(s.bias.constant, 0.0);
    }
}
