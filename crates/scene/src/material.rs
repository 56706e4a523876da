//! Surface descriptions.

use glam::Vec3;

/// How the alpha channel of a surface is used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// The surface exists where alpha is at least the cutoff (0 to 1).
    Mask(f32),
    /// Alpha is the probability that a ray meets the surface.
    Blend,
}

/// A metallic-roughness surface with emission and thin or solid transmission, after the glTF 2.0
/// material model (Khronos 2021, §3.9) and its transmission, ior and volume extensions.
///
/// Normal and occlusion maps of files are not read: the first changes no visibility, the second
/// repeats what rays compute.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or one given by the loader.
    pub name: String,
    /// Albedo (dielectric) or specular colour (metal), linear RGB, 0 to 1; multiplied by the
    /// texture where there is one.
    pub base_color: Vec3,
    /// Index into the scene's textures: colour and alpha.
    pub base_color_texture: Option<usize>,
    /// 0 is a dielectric, 1 a metal; multiplied by the texture's blue channel.
    pub metallic: f32,
    /// Perceptual roughness, 0 a mirror, 1 fully rough (GGX α is its square); multiplied by the
    /// texture's green channel.
    pub roughness: f32,
    /// Index into the scene's textures: green is roughness, blue is metallic, not sRGB.
    pub metallic_roughness_texture: Option<usize>,
    /// Radiance that the surface gives off, linear RGB, not bounded by 1; multiplied by the
    /// texture where there is one.
    pub emission: Vec3,
    /// Index into the scene's textures.
    pub emission_texture: Option<usize>,
    /// Share of the light that is not reflected and goes through instead of into the diffuse
    /// lobe, 0 to 1.
    pub transmission: f32,
    /// Index of refraction, at least 1; glass is 1.5.
    pub ior: f32,
    /// Absorption coefficient of the inside per unit of length, linear RGB, 0 where the inside
    /// is clear.
    pub absorption: Vec3,
    /// What alpha does.
    pub alpha_mode: AlphaMode,
    /// Alpha of the surface, 0 to 1; multiplied by the base colour texture's alpha.
    pub alpha: f32,
    /// How deep what lies behind the surface is taken to be where a renderer knows only the depth
    /// of its front (the faces of a G-buffer cube map: Ganestam and Doggett 2015, §3.4), in units
    /// of the diagonal of the scene's bounds, 0 to 1. A ray that comes to lie at most this far
    /// behind the front has met the object; one further behind has passed it. 0 is perfectly
    /// thin, 1 has no end, as for walls. Of what transmits light it is how long rays are inside of
    /// it in the mean. Exact ray tracing has no use for it. Loaders and generators set it by [`Scene::derive_thickness`](crate::Scene::derive_thickness).
    pub thickness: f32,
    /// What transmits light are walls (panes, glasses, bottles) which rays pass without being bent in
    /// all, not bodies (balls, liquids). It matters where `thickness` does, and is derived with it.
    pub thin_walled: bool,
}

impl Default for Material {
    /// A white, rough dielectric.
    fn default() -> Self {
        Self {
            name: String::from("default"),
            base_color: Vec3::splat(0.8),
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            transmission: 0.0,
            ior: 1.5,
            absorption: Vec3::ZERO,
            alpha_mode: AlphaMode::Opaque,
            alpha: 1.0,
            thickness: 1.0,
            thin_walled: false,
        }
    }
}

impl Material {
    /// A rough dielectric of this colour (linear RGB).
    #[must_use]
    pub fn matte(name: &str, base_color: Vec3) -> Self {
        Self { name: name.into(), base_color, ..Self::default() }
    }

    /// A metal with this specular colour (linear RGB); roughness 0 is a mirror.
    #[must_use]
    pub fn metal(name: &str, base_color: Vec3, roughness: f32) -> Self {
        Self { metallic: 1.0, roughness, ..Self::matte(name, base_color) }
    }

    /// Clear glass with this index of refraction.
    #[must_use]
    pub fn glass(name: &str, ior: f32) -> Self {
        Self { transmission: 1.0, ior, roughness: 0.0, ..Self::matte(name, Vec3::ONE) }
    }

    /// A surface that gives off this radiance (linear RGB) and reflects little.
    #[must_use]
    pub fn emitter(name: &str, radiance: Vec3) -> Self {
        Self { emission: radiance, ..Self::matte(name, Vec3::splat(0.1)) }
    }

    /// The index of refraction as one can calculate with it: 1 to 10, 1.5 if it is no number.
    #[must_use]
    pub const fn index_of_refraction(&self) -> f32 {
        if self.ior.is_finite() { self.ior.clamp(1.0, 10.0) } else { 1.5 }
    }

    /// True if it gives off light.
    #[must_use]
    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}
