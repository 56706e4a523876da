//! Materials and textures of glTF documents.

use super::{LoadOptions, accessor::Document, container::resolve, image};
use crate::{AlphaMode, Dropped, Material, Texture, Wrap};
use glam::{Mat2, Vec2, Vec3};
use gltf::json::{
    self, Index,
    material::AlphaMode as JsonAlpha,
    texture::{Info, WrappingMode},
    validation::Checked,
};
use niwaki_core::to_u32;
use rayon::prelude::*;
use std::{borrow::Cow, collections::HashMap};

/// How a material's base colour texture finds its coordinates.
#[derive(Clone, Copy)]
pub(super) struct UvMap {
    /// Which of the vertices' coordinates.
    pub(super) set: u32,
    matrix: Mat2,
    offset: Vec2,
}

impl Default for UvMap {
    fn default() -> Self {
        Self { set: 0, matrix: Mat2::IDENTITY, offset: Vec2::ZERO }
    }
}

impl UvMap {
    pub(super) fn apply(&self, uv: Vec2) -> Vec2 {
        self.matrix * uv + self.offset
    }

    /// The set and transform of a texture reference (`KHR_texture_transform`).
    fn of(info: &Info) -> Self {
        let set = info.tex_coord;
        let Some(t) = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()) else {
            return Self { set, ..Self::default() };
        };
        let (sin, cos) = t.rotation.0.sin_cos();
        let scale = Vec2::from(t.scale.0);
        let matrix = Mat2::from_cols(Vec2::new(cos, -sin) * scale.x, Vec2::new(sin, cos) * scale.y);
        Self { set: t.tex_coord.unwrap_or(set), matrix, offset: Vec2::from(t.offset.0) }
    }
}

/// What [`read`] found. The last material is the default one, if anything needs it.
pub(super) struct Materials {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) uv_maps: Vec<UvMap>,
}

impl Materials {
    /// The scene's material for a primitive's reference.
    pub(super) fn id(
        &self,
        index: Option<Index<json::Material>>,
        at: &str,
        dropped: &mut Dropped,
    ) -> u32 {
        let default = to_u32(self.uv_maps.len());
        let Some(index) = index else { return default };
        if index.value() < self.uv_maps.len() {
            return to_u32(index.value());
        }
        dropped.materials += 1;
        dropped.note(|| format!("{at}: materials[{}] does not exist", index.value()));
        default
    }
}

/// A texture of the document, or an image, and whether its colours are sRGB-encoded.
type Key = (usize, bool);

/// Reads all materials and the textures that they use.
pub(super) fn read(
    document: &Document<'_>,
    options: &LoadOptions,
    dropped: &mut Dropped,
) -> Materials {
    let root = document.root;
    let mut keys: Vec<Key> = root.materials.iter().flat_map(uses).collect();
    keys.sort_unstable();
    keys.dedup();
    if !options.textures {
        keys.clear();
    }
    // Each image once, however many textures show it.
    let image_of =
        |&(texture, srgb): &Key| Some((root.textures.get(texture)?.source.value(), srgb));
    let mut images: Vec<Key> = keys.iter().filter_map(image_of).collect();
    images.sort_unstable();
    images.dedup();
    let decode = |&(image, srgb): &Key| ((image, srgb), read_image(document, image, srgb, options));
    let images: HashMap<Key, Result<Texture, String>> = images.par_iter().map(decode).collect();
    let read_texture = |key: &Key| {
        let texture = root.textures.get(key.0).ok_or("it does not exist")?;
        let image =
            images.get(&(texture.source.value(), key.1)).ok_or("it has no image")?.clone()?;
        Ok(wrapped(document, texture, image))
    };
    let decoded: Vec<Result<Texture, String>> = keys.iter().map(read_texture).collect();
    let mut textures = Vec::new();
    let mut ids: HashMap<Key, usize> = HashMap::new();
    for (key, texture) in keys.into_iter().zip(decoded) {
        match texture {
            Ok(texture) => {
                ids.insert(key, textures.len());
                textures.push(texture);
            }
            Err(reason) => {
                dropped.textures += 1;
                dropped.note(|| format!("textures[{}]: {reason}", key.0));
            }
        }
    }
    let mut materials: Vec<Material> =
        root.materials.iter().enumerate().map(|(i, m)| convert(i, m, &ids)).collect();
    let uv_maps = root
        .materials
        .iter()
        .map(|m| m.pbr_metallic_roughness.base_color_texture.as_ref().map(UvMap::of))
        .map(Option::unwrap_or_default)
        .collect();
    let lacks =
        |p: &json::mesh::Primitive| p.material.is_none_or(|m| m.value() >= root.materials.len());
    if materials.is_empty() || root.meshes.iter().flat_map(|m| &m.primitives).any(lacks) {
        materials.push(Material::default());
    }
    Materials { materials, textures, uv_maps }
}

/// The three textures that are read, where a material has them.
fn slots(m: &json::Material) -> [Option<Key>; 3] {
    let pbr = &m.pbr_metallic_roughness;
    let key = |info: &Option<Info>, srgb| info.as_ref().map(|t| (t.index.value(), srgb));
    [
        key(&pbr.base_color_texture, true),
        key(&pbr.metallic_roughness_texture, false),
        key(&m.emissive_texture, true),
    ]
}

fn uses(m: &json::Material) -> impl Iterator<Item = Key> {
    slots(m).into_iter().flatten()
}

fn read_image(
    document: &Document<'_>,
    source: usize,
    srgb: bool,
    options: &LoadOptions,
) -> Result<Texture, String> {
    let root = document.root;
    let image = root.images.get(source).ok_or("it has no PNG or JPEG image")?;
    let at = format!("images[{source}]");
    let (bytes, file) = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => {
            let bytes = resolve(document.path, &at, uri, options).map_err(|e| e.to_string())?;
            let name = if uri.starts_with("data:") { None } else { Some(uri.as_str()) };
            (Cow::Owned(bytes), name)
        }
        (None, Some(view)) => {
            (Cow::Borrowed(document.view(view, &at).map_err(|e| e.to_string())?.0), None)
        }
        (None, None) => return Err(format!("{at} has neither uri nor bufferView")),
    };
    let name = file.or(image.name.as_deref()).unwrap_or(&at);
    image::decode(name, &bytes, srgb, options).map_err(|e| format!("{at} ({name}): {e}"))
}

/// An image as a texture shows it.
fn wrapped(document: &Document<'_>, texture: &json::Texture, image: Texture) -> Texture {
    let sampler = texture.sampler.and_then(|s| document.root.samplers.get(s.value()));
    let wrap = |mode: Option<Checked<WrappingMode>>| match mode {
        Some(Checked::Valid(WrappingMode::ClampToEdge)) => Wrap::Clamp,
        Some(Checked::Valid(WrappingMode::MirroredRepeat)) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    image.with_wrap(wrap(sampler.map(|s| s.wrap_s)), wrap(sampler.map(|s| s.wrap_t)))
}

/// A factor between 0 and 1; anything else, NaN included, is put there.
fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

/// A radiance that is finite and not negative.
fn radiance(v: Vec3) -> Vec3 {
    if v.is_finite() { v.max(Vec3::ZERO) } else { Vec3::ZERO }
}

fn convert(index: usize, m: &json::Material, ids: &HashMap<Key, usize>) -> Material {
    let pbr = &m.pbr_metallic_roughness;
    let [r, g, b, alpha] = pbr.base_color_factor.0.map(unit);
    let extensions = m.extensions.as_ref();
    let strength = extensions
        .and_then(|e| e.emissive_strength.as_ref())
        .map_or(1.0, |s| s.emissive_strength.0);
    let ior = extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |i| i.ior.0);
    let transmission =
        extensions.and_then(|e| e.transmission.as_ref()).map_or(0.0, |t| t.transmission_factor.0);
    // σ = −ln(colour) / distance (KHR_materials_volume); a colour of zero would absorb at once.
    let absorption = extensions.and_then(|e| e.volume.as_ref()).map_or(Vec3::ZERO, |v| {
        let color = Vec3::from(v.attenuation_color.0).max(Vec3::splat(1e-4));
        radiance(color.map(|c| -c.ln()) / v.attenuation_distance.0)
    });
    let alpha_mode = match m.alpha_mode {
        Checked::Valid(JsonAlpha::Mask) => {
            AlphaMode::Mask(unit(m.alpha_cutoff.map_or(0.5, |c| c.0)))
        }
        Checked::Valid(JsonAlpha::Blend) => AlphaMode::Blend,
        _ => AlphaMode::Opaque,
    };
    let [base_color_texture, metallic_roughness_texture, emission_texture] =
        slots(m).map(|key| key.and_then(|k| ids.get(&k).copied()));
    Material {
        name: m.name.clone().unwrap_or_else(|| format!("materials[{index}]")),
        base_color: Vec3::new(r, g, b),
        base_color_texture,
        metallic: unit(pbr.metallic_factor.0),
        roughness: unit(pbr.roughness_factor.0),
        metallic_roughness_texture,
        emission: radiance(Vec3::from(m.emissive_factor.0) * strength),
        emission_texture,
        transmission: unit(transmission),
        ior: if ior.is_finite() { ior.max(1.0) } else { 1.5 },
        absorption,
        alpha_mode,
        alpha,
        ..Material::default()
    }
}
