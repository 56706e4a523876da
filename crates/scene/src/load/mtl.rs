//! Material libraries of OBJ files.

use super::{LoadOptions, image, obj::without_comment, read};
use crate::{AlphaMode, Dropped, Material, Texture};
use glam::Vec3;
use niwaki_core::to_u32;
use std::{
    collections::{HashMap, HashSet},
    path::Path,
};

/// The materials of an OBJ file.
pub(super) struct Library {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    /// The material of each name in use.
    pub(super) ids: Vec<u32>,
    /// The material of faces without one.
    pub(super) default: u32,
}

impl Library {
    /// Reads the libraries (`(line, name)`) and finds the materials in use (`(line, name)`).
    /// Whatever is missing or broken is counted and replaced by the default material.
    pub(super) fn load(
        obj: &Path,
        libraries: &[(usize, String)],
        used: &[(usize, String)],
        options: &LoadOptions,
        dropped: &mut Dropped,
    ) -> Self {
        let mut seen = HashSet::new();
        let mut found: HashMap<String, tobj::Material> = HashMap::new();
        for (line, names) in libraries {
            for (name, bytes) in open(obj, names, &mut seen, options, *line, dropped) {
                let text = check(&name, &bytes, dropped);
                match tobj::load_mtl_buf(&mut text.as_bytes()) {
                    Ok((materials, _)) => {
                        found.extend(materials.into_iter().map(|m| (m.name.clone(), m)));
                    }
                    Err(error) => {
                        dropped.materials += 1;
                        dropped.note(|| format!("{name}: {error}"));
                    }
                }
            }
        }
        let mut out = Self {
            materials: vec![Material::default()],
            textures: Vec::new(),
            ids: Vec::with_capacity(used.len()),
            default: 0,
        };
        let mut texture_ids = HashMap::new();
        for (line, name) in used {
            let Some(source) = found.get(name) else {
                dropped.materials += 1;
                dropped.note(|| format!("line {line}: material `{name}` is not defined"));
                out.ids.push(out.default);
                continue;
            };
            let mut material = convert(source);
            if let Some(file) = source.diffuse_texture.as_ref().filter(|_| options.textures) {
                let file = texture_file(file);
                let id = *texture_ids.entry(file.to_owned()).or_insert_with(|| {
                    let texture = read::beside(obj, &file.replace('\\', "/"), options)
                        .map_err(|e| e.to_string())
                        .and_then(|bytes| image::decode(file, &bytes, true, options));
                    match texture {
                        Ok(texture) => {
                            out.textures.push(texture);
                            Some(out.textures.len() - 1)
                        }
                        Err(reason) => {
                            dropped.textures += 1;
                            dropped.note(|| format!("texture {file}: {reason}"));
                            None
                        }
                    }
                });
                material.base_color_texture = id;
                // A mask in the same image is the texture's own alpha.
                if id.is_some() && source.dissolve_texture.is_some() {
                    material.alpha_mode = AlphaMode::Mask(0.5);
                }
            }
            out.ids.push(to_u32(out.materials.len()));
            out.materials.push(material);
        }
        out
    }
}

/// The library of that name or, if there is none, those of the names between the spaces; each name
/// once, whatever the file repeats.
fn open<'a>(
    obj: &Path,
    names: &'a str,
    seen: &mut HashSet<&'a str>,
    options: &LoadOptions,
    line: usize,
    dropped: &mut Dropped,
) -> Vec<(String, Vec<u8>)> {
    let read = |name: &str| read::beside(obj, &name.replace('\\', "/"), options);
    if !seen.insert(names) {
        return Vec::new();
    }
    let whole = match read(names) {
        Ok(bytes) => return vec![(names.into(), bytes)],
        Err(error) => error,
    };
    let mut out = Vec::new();
    let list: Vec<&str> = names.split_whitespace().collect();
    for &name in list.iter().filter(|&&name| name != names && seen.insert(name)) {
        match read(name) {
            Ok(bytes) => out.push((name.into(), bytes)),
            Err(error) => {
                dropped.materials += 1;
                dropped.note(|| format!("line {line}: {error}"));
            }
        }
    }
    if list.len() < 2 {
        dropped.materials += 1;
        dropped.note(|| format!("line {line}: {whole}"));
    }
    out
}

/// The file name behind the options of a `map_` statement.
fn texture_file(text: &str) -> &str {
    if text.starts_with('-') { text.split_whitespace().next_back().unwrap_or("") } else { text }
}

/// A copy of a library in which every statement is one that `tobj` takes: it stops, or panics, at
/// colours of fewer than three numbers, which the format allows.
fn check(name: &str, bytes: &[u8], dropped: &mut Dropped) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut out = String::with_capacity(text.len());
    for (i, line) in text.lines().enumerate() {
        let line = without_comment(line);
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let numbers: Vec<f32> = rest
            .split_whitespace()
            .map_while(|w| w.parse().ok())
            .filter(|x: &f32| x.is_finite())
            .collect();
        let written = match keyword {
            "" => continue,
            "newmtl" if rest.is_empty() => None,
            "newmtl" => Some(format!("newmtl {rest}")),
            "Kd" | "Ks" | "Ke" | "Tf" => match numbers[..] {
                [r, g, b, ..] => Some(format!("{keyword} {r} {g} {b}")),
                [r, ..] => Some(format!("{keyword} {r} {r} {r}")),
                [] => None,
            },
            "Ns" | "Ni" | "Tr" | "Pr" | "Pm" => numbers.first().map(|x| format!("{keyword} {x}")),
            // "d -halo 0.5" fades towards the middle; the number is what matters.
            "d" => rest
                .split_whitespace()
                .next_back()
                .and_then(|w| w.parse::<f32>().ok())
                .filter(|x| x.is_finite())
                .map(|x| format!("d {x}")),
            "illum" => numbers
                .first()
                .filter(|x| (0.0..=10.0).contains(*x))
                .map(|x| format!("illum {}", x.trunc())),
            "map_Kd" | "map_d" if rest.is_empty() => None,
            "map_Kd" | "map_d" => Some(format!("{keyword} {rest}")),
            // Ambient terms, bumps and other maps change nothing that is read here.
            _ => continue,
        };
        if let Some(line) = written {
            out.push_str(&line);
            out.push('\n');
        } else {
            dropped.materials += 1;
            dropped.note(|| format!("{name}:{}: `{line}` says nothing usable", i + 1));
        }
    }
    out
}

/// A metallic-roughness material that looks like the old one.
fn convert(m: &tobj::Material) -> Material {
    let color = |c: Option<[f32; 3]>| c.map(|c| Vec3::from(c).max(Vec3::ZERO));
    let number = |key: &str| m.unknown_param.get(key).and_then(|v| v.parse::<f32>().ok());
    let diffuse = color(m.diffuse).unwrap_or(Vec3::splat(0.8)).min(Vec3::ONE);
    let specular = color(m.specular).unwrap_or(Vec3::ZERO).min(Vec3::ONE);
    let illum = m.illumination_model.unwrap_or(2);
    let opacity = m.dissolve.or_else(|| number("Tr").map(|t| 1.0 - t)).unwrap_or(1.0);
    let opacity = opacity.clamp(0.0, 1.0);
    // Models 4, 6, 7 and 9 are the ones with transparency by glass or refraction.
    let transmission = match illum {
        4 | 6 | 7 | 9 if opacity < 1.0 => 1.0 - opacity,
        4 | 6 | 7 | 9 => m.unknown_param.get("Tf").map_or(1.0, |filter| {
            let sum: f32 = filter.split_whitespace().filter_map(|w| w.parse::<f32>().ok()).sum();
            (sum / 3.0).clamp(0.0, 1.0)
        }),
        _ => 0.0,
    };
    // Models 3 and 5 are mirrors; one that is brighter than the diffuse colour is a metal.
    let mirror = matches!(illum, 3 | 5) && specular.element_sum() > diffuse.element_sum();
    let metallic = number("Pm").unwrap_or(if mirror { 1.0 } else { 0.0 }).clamp(0.0, 1.0);
    // Blinn-Phong exponent n and GGX α: n = 2/α² − 2, and α is the roughness squared.
    let from_exponent = |n: f32| (2.0 / (n.max(0.0) + 2.0)).sqrt().sqrt();
    let plain = if transmission > 0.0 || mirror { 0.0 } else { 1.0 };
    let roughness = number("Pr").or_else(|| m.shininess.map(from_exponent)).unwrap_or(plain);
    let alpha = if transmission > 0.0 { 1.0 } else { opacity };
    Material {
        name: m.name.clone(),
        base_color: if mirror { specular } else { diffuse },
        metallic,
        roughness: roughness.clamp(0.0, 1.0),
        emission: color(m.emissive).unwrap_or(Vec3::ZERO),
        transmission,
        ior: m.optical_density.filter(|n| n.is_finite()).unwrap_or(1.5).max(1.0),
        alpha_mode: if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
        alpha,
        ..Material::default()
    }
}
