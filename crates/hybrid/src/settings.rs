//! What to simulate and how finely.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Half the side of the cube around the camera within which rays meet triangles.
///
/// Ganestam and Doggett 2014, section 3.3: "the size of the BVH and cube map can be chosen
/// arbitrarily and as the BVH is increased in size ... our method converges towards a complete
/// Whitted ray tracer".
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum NearRegion {
    /// In units of length of the scene.
    HalfSize(f32),
    /// As a share of the longest side of the scene's bounds; 0.1 covers a fifth of it.
    ShareOfScene(f32),
    /// As large as it takes to hold the scene: the cube map stays empty and every ray is traced.
    WholeScene,
}

/// How many samples a linear march through a face takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum SampleRule {
    /// n = `n_min` + (1 − |r_z|)·(`n_max` − `n_min`), r being the unit direction of the ray in the
    /// face's normalised device coordinates: many samples for rays that cross many pixels, few
    /// for those that look into the face. Never more than the pixels that the ray crosses.
    Grazing,
    /// n = `n_min` + |r_z|·(`n_max` − `n_min`), the formula as section 3.4 prints it, for
    /// comparison: it spends most samples where the ray stays within a few pixels.
    AsPrinted,
}

/// How rays are followed through the depth of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum March {
    /// Samples at equal distances on the ray's line in the face (section 3.4). What lies between
    /// two samples is missed if the ray is in front of it at both.
    Linear {
        /// Fewest samples in a face, 1 to 4096.
        n_min: u32,
        /// Most samples in a face, `n_min` to 4096.
        n_max: u32,
        /// What lies between depends on the direction by this rule.
        rule: SampleRule,
    },
    /// Every pixel that the ray crosses is looked at, in order: nothing is missed. For comparison;
    /// [`March::Hierarchical`] finds the same sooner.
    Pixels,
    /// Every pixel that the ray crosses counts, but cells of a pyramid over the face, which hold
    /// the least and the greatest depth of their pixels, are passed at once where the ray meets
    /// nothing between the two. The pyramid is made with the face.
    Hierarchical,
}

impl March {
    /// 16 to 192 samples, most for rays that cross many pixels.
    pub const LINEAR: Self = Self::Linear { n_min: 16, n_max: 192, rule: SampleRule::Grazing };

    /// Whether it reads the pyramid of least and greatest depths.
    #[must_use]
    pub const fn needs_pyramid(&self) -> bool {
        matches!(self, Self::Hierarchical)
    }

    /// With samples in their range.
    fn sanitized(self) -> Self {
        match self {
            Self::Linear { n_min, n_max, rule } => {
                let n_min = n_min.clamp(1, MOST_SAMPLES);
                Self::Linear { n_min, n_max: n_max.clamp(n_min, MOST_SAMPLES), rule }
            }
            other => other,
        }
    }
}

/// Most samples that a linear march takes in a face.
const MOST_SAMPLES: u32 = 4096;

/// What becomes of a ray that passes behind a surface of the cube map, where the map knows
/// nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Behind {
    /// It goes to the environment, as in the paper.
    Sky,
    /// It goes on until it comes out in front again, meets another surface or leaves the map.
    GoOn,
}

/// How surfaces find out which lights they see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Shadows {
    /// Not at all: every light shines through everything.
    None,
    /// Shadow maps everywhere (section 3.5).
    Maps,
    /// Rays inside the near region, exact there; where such a ray leaves the region, and for
    /// surfaces outside of it, the shadow map says what stands between there and the light.
    Traced,
}

/// What the image shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum DebugView {
    /// The rendering.
    #[default]
    None,
    /// Where the first ray that left each pixel's surface ended: grey without such a ray, blue in
    /// the near region, red in the cube map (a shade a face), green in its second layer, light blue
    /// in the sky, magenta where it passed behind a surface of the map and nothing was known.
    HitSource,
    /// Shading normals of the primary view, as (n + 1) / 2.
    Normal,
    /// Pixels of the cube map and cells of its pyramid that each pixel's rays looked at, relative
    /// to 512.
    MarchSteps,
    /// The share of ambient light that arrives at the surface of each pixel.
    Occlusion,
}

/// What to simulate and how finely. Everything here trades time for accuracy; `docs/accuracy.md` has
/// the measured curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The region around the camera that is traced.
    pub near_region: NearRegion,
    /// By how much of its size the traced region reaches over the border of the map, so that no
    /// gap opens between them by rounding (section 3.3). 0 to 0.5, default 0.01.
    pub overlap: f32,
    /// Width and height of a face of the cube map in pixels, 1 to 16384.
    pub face_resolution: u32,
    /// How rays are followed through a face.
    pub march: March,
    /// Layers of the cube map, 1 (the default) or 2. The second holds what comes next behind the
    /// first and its thickness, so that rays that pass behind a surface may meet what it hides
    /// (Mara et al. 2014, "Fast global illumination approximations on deep G-buffers").
    pub layers: u32,
    /// What becomes of rays that pass behind the map's surfaces.
    pub behind: Behind,
    /// Rays look through surfaces of the map that light passes, glass and what is blended: they go
    /// straight on, or bent as by a ball where glass is no thin wall
    /// ([`Material::thin_walled`](niwaki_scene::Material::thin_walled)). What lies behind such surfaces, and behind those that alpha cuts out, is drawn
    /// into a second layer that has nothing else unless `layers` asks for it. Otherwise what is
    /// blended counts as opaque, and rays that have passed glass go to the environment, as in the
    /// paper. Default true.
    pub look_through: bool,
    /// Factor on [`Material::thickness`](niwaki_scene::Material::thickness), 0 and more: how far
    /// behind their fronts surfaces of the map still count as met. Default 1.
    pub thickness: f32,
    /// Surfaces of the map that stand still have no end, whatever their material and `thickness`
    /// say, as section 3.4 advises: rays pass behind moving objects only. A material that any still
    /// object wears counts as still; glass stays thin. Default false.
    pub endless_when_still: bool,
    /// Most surfaces at which a path may be reflected or refracted, 0 to 16. 0 shows no reflections.
    pub max_depth: u32,
    /// Rays that count less than this in every colour channel are not followed; 0 (the default)
    /// follows all that count at all.
    pub throughput_cutoff: f32,
    /// Most rays that follow from one pixel. Default 65,536, which no depth up to 15 reaches.
    pub max_rays: u32,
    /// Ambient light: the share of the environment that surfaces see on average, 0 to 1.
    pub ambient: f32,
    /// Rays from each surface in the near region that look for what holds ambient light back, 0
    /// (the default) to 1024. Where the region ends they fade out: what lies beyond is not known.
    pub occlusion_rays: u32,
    /// How far they look, in units of the diagonal of the scene's bounds, 0 to 1. Default 0.1, that
    /// of [`OcclusionSettings::for_scene`](niwaki_render::OcclusionSettings::for_scene).
    pub occlusion_radius: f32,
    /// Perceptual roughness up to which surfaces are mirrors.
    pub mirror_roughness: f32,
    /// How shadows are found.
    pub shadows: Shadows,
    /// Width and height of each shadow map in pixels, 1 to 16384.
    pub shadow_resolution: u32,
    /// Run every pass, also those that nothing calls for. For tests and measurements: the image
    /// is the same.
    pub force_all: bool,
    /// What the image shows.
    pub debug_view: DebugView,
}

impl Default for Settings {
    /// Half a region of 0.15 of the scene, faces of 1024² that are marched through by their
    /// pyramid, one layer, depth 4, traced shadows with maps of 2048² beyond.
    fn default() -> Self {
        Self {
            near_region: NearRegion::ShareOfScene(0.15),
            overlap: 0.01,
            face_resolution: 1024,
            march: March::Hierarchical,
            layers: 1,
            behind: Behind::GoOn,
            look_through: true,
            thickness: 1.0,
            endless_when_still: false,
            max_depth: 4,
            throughput_cutoff: 0.0,
            max_rays: 1 << 16,
            ambient: 0.5,
            occlusion_rays: 0,
            occlusion_radius: 0.1,
            mirror_roughness: niwaki_scene::SceneFacts::MIRROR_ROUGHNESS,
            shadows: Shadows::Traced,
            shadow_resolution: 2048,
            force_all: false,
            debug_view: DebugView::None,
        }
    }
}

impl Settings {
    /// A small region, small maps, shadow maps only.
    #[must_use]
    pub fn fast() -> Self {
        Self {
            near_region: NearRegion::ShareOfScene(0.05),
            face_resolution: 512,
            max_depth: 2,
            shadows: Shadows::Maps,
            shadow_resolution: 1024,
            ..Self::default()
        }
    }

    /// A large region and large maps.
    #[must_use]
    pub fn fine() -> Self {
        Self {
            near_region: NearRegion::ShareOfScene(0.3),
            face_resolution: 2048,
            max_depth: 8,
            shadow_resolution: 4096,
            ..Self::default()
        }
    }

    /// No approximation: the region holds the scene, and the image is that of the Whitted
    /// integrator of `niwaki-render` at the same depth.
    #[must_use]
    pub fn exact() -> Self {
        Self { near_region: NearRegion::WholeScene, ..Self::fine() }
    }

    /// As the paper describes it: rays march in steps, those that pass behind and those that pass
    /// glass in the map go to the sky, static surfaces are thick, shadows come from maps.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            march: March::LINEAR,
            behind: Behind::Sky,
            look_through: false,
            endless_when_still: true,
            shadows: Shadows::Maps,
            ..Self::default()
        }
    }

    /// The settings with every value brought into its range; what is not a number becomes the
    /// default.
    #[must_use]
    pub fn sanitized(&self) -> Self {
        let standard = Self::default();
        let within = |x: f32, low: f32, high: f32, or: f32| {
            if x.is_nan() { or } else { x.clamp(low, high) }
        };
        let near_region = match self.near_region {
            NearRegion::HalfSize(x) if x.is_finite() => NearRegion::HalfSize(x.max(0.0)),
            NearRegion::ShareOfScene(x) if x.is_finite() => NearRegion::ShareOfScene(x.max(0.0)),
            NearRegion::HalfSize(x) | NearRegion::ShareOfScene(x) if x.is_nan() => {
                standard.near_region
            }
            _ => NearRegion::WholeScene,
        };
        Self {
            near_region,
            overlap: within(self.overlap, 0.0, 0.5, standard.overlap),
            march: self.march.sanitized(),
            layers: self.layers.clamp(1, 2),
            thickness: within(self.thickness, 0.0, f32::MAX, standard.thickness),
            max_depth: self.max_depth.min(MAX_DEPTH),
            throughput_cutoff: within(self.throughput_cutoff, 0.0, 1.0, 0.0),
            ambient: within(self.ambient, 0.0, 1.0, standard.ambient),
            occlusion_rays: self.occlusion_rays.min(1024),
            occlusion_radius: within(self.occlusion_radius, 0.0, 1.0, standard.occlusion_radius),
            mirror_roughness: within(self.mirror_roughness, 0.0, 1.0, standard.mirror_roughness),
            ..self.clone()
        }
    }
}

/// The deepest recursion: the size of the stack of pending rays in the tracing kernel.
pub const MAX_DEPTH: u32 = 16;

impl fmt::Display for NearRegion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HalfSize(x) => write!(f, "half size {x}"),
            Self::ShareOfScene(x) => write!(f, "{x} of the scene"),
            Self::WholeScene => f.write_str("the whole scene"),
        }
    }
}
