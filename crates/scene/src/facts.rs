//! What a scene contains, so that a renderer can leave out the effects that nothing calls for.
//!
//! Facts are conservative: they say what *may* happen at some point of a surface, textures
//! included. A renderer that skips what they exclude draws the same image as one that tries
//! everything.

use crate::{AlphaMode, LightKind, Material, Scene};
use niwaki_core::Aabb;
use rayon::prelude::*;
use std::fmt;

/// What a material may do to light at some point of the surfaces that wear it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialFacts {
    /// Triangles that wear the material.
    pub triangles: usize,
    /// The box around them; empty without any.
    pub bounds: Aabb,
    /// Scatters diffusely: not all metal, not all transmission, not black.
    pub diffuse: bool,
    /// Shows highlights of lights that are wider than a mirror's: metal or coat that is no
    /// perfect mirror.
    pub glossy: bool,
    /// Calls for reflected rays: smoother than the limit and more than half metal, a polished
    /// coat, or an interface between dielectrics. (Metallic is meant to be 0 or 1, but compressed
    /// textures are noisy; a trace of metal must not call for rays.)
    pub reflective: bool,
    /// A dielectric whose coat is smoother than the limit everywhere. Where a texture is smooth
    /// in places only, noise in it would call for rays all over a scene that carry a few per cent
    /// of the light, so that such coats show highlights alone.
    pub polished: bool,
    /// Calls for refracted rays.
    pub transmissive: bool,
    /// Its inside absorbs: the material has transmission (even where metallic leaves none) and an
    /// absorption coefficient.
    pub absorbing: bool,
    /// Gives off light.
    pub emissive: bool,
    /// Alpha cuts holes.
    pub masked: bool,
    /// Alpha mixes the surface with what lies behind.
    pub blended: bool,
    /// Looks up at least one texture that the scene has.
    pub textured: bool,
}

/// The one word that says most about a material. Ordered by what it asks of a renderer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MaterialClass {
    /// Direct light is all there is to compute.
    Diffuse,
    /// Direct light with highlights.
    Glossy,
    /// Reflected rays.
    Mirror,
    /// Reflected and refracted rays.
    Glass,
}

impl fmt::Display for MaterialClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Diffuse => "diffuse",
            Self::Glossy => "glossy",
            Self::Mirror => "mirror",
            Self::Glass => "glass",
        })
    }
}

impl MaterialFacts {
    /// The one word that says most.
    #[must_use]
    pub const fn class(&self) -> MaterialClass {
        if self.transmissive {
            MaterialClass::Glass
        } else if self.reflective {
            MaterialClass::Mirror
        } else if self.glossy {
            MaterialClass::Glossy
        } else {
            MaterialClass::Diffuse
        }
    }

    /// True if rays go on from here: reflected or refracted.
    #[must_use]
    pub const fn is_specular(&self) -> bool {
        self.reflective || self.transmissive
    }

    /// True if rays may pass the surface by its alpha.
    #[must_use]
    pub const fn has_alpha(&self) -> bool {
        self.masked || self.blended
    }
}

/// Lights that shine, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightFacts {
    /// Point lights.
    pub point: usize,
    /// Spot lights.
    pub spot: usize,
    /// Of the spot lights those whose cones reach farther than [`LightFacts::NARROW_SPOT`] from
    /// their axes.
    pub wide_spot: usize,
    /// Directional lights.
    pub directional: usize,
    /// Triangles whose material gives off light.
    pub emissive_triangles: usize,
    /// Some light comes from outside.
    pub environment: bool,
}

impl LightFacts {
    /// The outer angle, in radians, up to which one view shows the cone of a spot light well.
    pub const NARROW_SPOT: f32 = 1.1;

    /// Point, spot and directional lights: those that cast hard shadows.
    #[must_use]
    pub const fn punctual(&self) -> usize {
        self.point + self.spot + self.directional
    }

    /// True if nothing shines at all.
    #[must_use]
    pub const fn is_dark(&self) -> bool {
        self.punctual() == 0 && self.emissive_triangles == 0 && !self.environment
    }
}

/// What a scene contains. Materials that no triangle wears do not count.
///
/// ```
/// use niwaki_scene::{SceneFacts, generate};
/// let scene = generate::generate("hair", 1_000, 1).ok_or("no such scene")?;
/// let facts = SceneFacts::new(&scene, SceneFacts::MIRROR_ROUGHNESS);
/// assert!(!facts.has_specular(), "hair calls for neither mirrors nor glass");
/// println!("{facts}");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFacts {
    /// Perceptual roughness from which a surface is no mirror any more; up to half of it, it is a
    /// perfect one.
    pub mirror_roughness: f32,
    /// Triangles in all.
    pub triangles: usize,
    /// What shines.
    pub lights: LightFacts,
    /// One for each material of the scene, in its order.
    pub materials: Vec<MaterialFacts>,
}

/// Least and greatest stored value of each channel of a texture, 0 to 1.
type Range = [(f32, f32); 4];

/// Of a texture that is not there: reads as ones.
const ONES: Range = [(1.0, 1.0); 4];

impl SceneFacts {
    /// The limit of perceptual roughness where nothing else is chosen. At half of it, GGX spreads
    /// a reflection over a few degrees; from it on, what is reflected cannot be made out.
    pub const MIRROR_ROUGHNESS: f32 = 0.3;

    /// Looks at all triangles, lights, materials and pixels of textures; `mirror_roughness` (0 to
    /// 1) is the perceptual roughness from which a surface is no mirror any more.
    #[must_use]
    pub fn new(scene: &Scene, mirror_roughness: f32) -> Self {
        let ranges: Vec<Range> = scene.textures.par_iter().map(|t| range(t.pixels())).collect();
        let mut materials: Vec<MaterialFacts> = scene
            .materials
            .iter()
            .map(|material| examine(material, &ranges, unit(mirror_roughness)))
            .collect();
        for triangle in 0..scene.mesh.len() {
            let id = scene.material_ids.get(triangle).map_or(0, |&id| id as usize);
            // As renderers do: what names no material wears the first one.
            let id = if id < materials.len() { id } else { 0 };
            if let Some(facts) = materials.get_mut(id) {
                facts.triangles += 1;
                facts.bounds = facts.bounds.union(scene.mesh.triangle(triangle).bounds());
            }
        }
        let mut lights =
            LightFacts { environment: !scene.environment.is_dark(), ..LightFacts::default() };
        for light in scene.lights.iter().filter(|l| l.intensity.max_element() > 0.0) {
            match light.kind {
                LightKind::Point => lights.point += 1,
                LightKind::Directional => lights.directional += 1,
                LightKind::Spot { outer, .. } => {
                    lights.spot += 1;
                    let narrow = outer <= LightFacts::NARROW_SPOT;
                    lights.wide_spot += usize::from(!narrow);
                }
            }
        }
        lights.emissive_triangles =
            materials.iter().filter(|m| m.emissive).map(|m| m.triangles).sum();
        Self { mirror_roughness, triangles: scene.mesh.len(), lights, materials }
    }

    /// The materials that some triangle wears.
    pub fn worn(&self) -> impl Iterator<Item = &MaterialFacts> {
        self.materials.iter().filter(|m| m.triangles > 0)
    }

    /// Some surface calls for reflected rays.
    #[must_use]
    pub fn has_reflective(&self) -> bool {
        self.worn().any(|m| m.reflective)
    }

    /// Some surface calls for refracted rays.
    #[must_use]
    pub fn has_transmissive(&self) -> bool {
        self.worn().any(|m| m.transmissive)
    }

    /// Some surface calls for reflected or refracted rays.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        self.worn().any(MaterialFacts::is_specular)
    }

    /// Some surface scatters the light of lamps: diffuse or glossy.
    #[must_use]
    pub fn has_lit(&self) -> bool {
        self.worn().any(|m| m.diffuse || m.glossy)
    }

    /// Some surface gives off light.
    #[must_use]
    pub fn has_emissive(&self) -> bool {
        self.lights.emissive_triangles > 0
    }

    /// Some surface lets rays pass by its alpha.
    #[must_use]
    pub fn has_alpha(&self) -> bool {
        self.worn().any(MaterialFacts::has_alpha)
    }

    /// Some surface looks up a texture.
    #[must_use]
    pub fn has_textures(&self) -> bool {
        self.worn().any(|m| m.textured)
    }

    /// The box around all triangles that call for reflected or refracted rays; empty without any.
    #[must_use]
    pub fn specular_bounds(&self) -> Aabb {
        self.worn()
            .filter(|m| m.is_specular())
            .fold(Aabb::EMPTY, |bounds, m| bounds.union(m.bounds))
    }
}

impl fmt::Display for SceneFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let LightFacts { point, spot, directional, emissive_triangles, environment, .. } =
            self.lights;
        writeln!(f, "{} triangles", self.triangles)?;
        writeln!(
            f,
            "lights: {point} point, {spot} spot, {directional} directional, {emissive_triangles} \
             emissive triangles, {} environment",
            if environment { "an" } else { "no" }
        )?;
        for class in [
            MaterialClass::Diffuse,
            MaterialClass::Glossy,
            MaterialClass::Mirror,
            MaterialClass::Glass,
        ] {
            let of_class = || self.worn().filter(|m| m.class() == class);
            let triangles: usize = of_class().map(|m| m.triangles).sum();
            writeln!(f, "{class}: {} materials on {triangles} triangles", of_class().count())?;
        }
        let count = |has: fn(&MaterialFacts) -> bool| self.worn().filter(|m| has(m)).count();
        write!(
            f,
            "of them {} masked, {} blended, {} absorbing, {} textured; mirrors up to roughness {}",
            count(|m| m.masked),
            count(|m| m.blended),
            count(|m| m.absorbing),
            count(|m| m.textured),
            self.mirror_roughness
        )
    }
}

/// NaN becomes 0.
const fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

/// Filtered values lie between the least and the greatest pixel, up to rounding, and are exact
/// where all pixels are equal.
fn range(pixels: &[[u8; 4]]) -> Range {
    let (mut low, mut high) = ([u8::MAX; 4], [0_u8; 4]);
    for pixel in pixels {
        for k in 0..4 {
            low[k] = low[k].min(pixel[k]);
            high[k] = high[k].max(pixel[k]);
        }
    }
    std::array::from_fn(|k| {
        let rounding = if low[k] < high[k] { 1e-6 } else { 0.0 };
        let value = |x: u8| f32::from(x) / 255.0;
        ((value(low[k]) - rounding).max(0.0), (value(high[k]) + rounding).min(1.0))
    })
}

/// All but what the triangles say.
fn examine(m: &Material, ranges: &[Range], mirror_roughness: f32) -> MaterialFacts {
    let look_up = |texture: Option<usize>| texture.and_then(|t| ranges.get(t));
    let of = |texture| look_up(texture).unwrap_or(&ONES);
    let (color, surface) = (of(m.base_color_texture), of(m.metallic_roughness_texture));
    let glow = of(m.emission_texture);
    let scaled = |factor: f32, (low, high): (f32, f32)| (unit(factor * low), unit(factor * high));
    let metallic = scaled(m.metallic, surface[2]);
    let roughness = scaled(m.roughness, surface[1]);
    let alpha = scaled(m.alpha, color[3]);
    let transmission = unit(m.transmission);
    let dielectric = metallic.0 < 1.0;
    let coat = dielectric && m.index_of_refraction() > 1.0;
    let transmissive = dielectric && transmission > 0.0;
    // So that a limit of 0 leaves perfect mirrors.
    let limit = mirror_roughness.max(f32::MIN_POSITIVE);
    let polished = coat && transmission < 1.0 && roughness.1 < limit;
    let textures = [m.base_color_texture, m.metallic_roughness_texture, m.emission_texture];
    MaterialFacts {
        triangles: 0,
        bounds: Aabb::EMPTY,
        diffuse: dielectric
            && transmission < 1.0
            && (0..3).any(|k| m.base_color[k] > 0.0 && color[k].1 > 0.0),
        glossy: metallic.1 > 0.0 && (roughness.1 > 0.5 * limit || metallic.0 < 0.75)
            || coat && transmission < 1.0 && !(polished && roughness.1 <= 0.5 * limit),
        reflective: metallic.1 > 0.5 && roughness.0 < limit || polished || transmissive && coat,
        polished,
        transmissive,
        absorbing: transmission > 0.0 && m.absorption.max_element() > 0.0,
        emissive: (0..3).any(|k| m.emission[k] > 0.0 && glow[k].1 > 0.0),
        masked: matches!(m.alpha_mode, AlphaMode::Mask(cutoff) if alpha.0 < cutoff),
        blended: m.alpha_mode == AlphaMode::Blend && alpha.0 < 1.0,
        textured: textures.into_iter().any(|t| look_up(t).is_some()),
    }
}
