//! Primitives of glTF meshes.

use super::{
    LoadOptions, accessor::Document, gltf_material::Materials, gltf_morph, gltf_skin, part::RawPart,
};
use crate::{Dropped, LoadError, Part};
use glam::{Vec2, Vec3};
use gltf::json::{
    Index,
    accessor::Accessor,
    mesh::{Mode, Primitive, Semantic},
    validation::Checked,
};
use niwaki_core::to_u32;
use std::{collections::HashMap, ops::Range};

/// All primitives, and which of them each mesh has.
pub(super) struct Meshes {
    pub(super) parts: Vec<Part>,
    pub(super) ranges: Vec<Range<u32>>,
}

/// Reads every primitive of every mesh.
pub(super) fn read(
    document: &Document<'_>,
    materials: &Materials,
    options: &LoadOptions,
    dropped: &mut Dropped,
) -> Result<Meshes, LoadError> {
    let mut parts = Vec::new();
    let mut ranges = Vec::with_capacity(document.root.meshes.len());
    let mut triangles = 0_u64;
    let mut users: HashMap<u32, u32> = HashMap::new();
    for primitive in document.root.meshes.iter().flat_map(|m| &m.primitives) {
        if let Some(index) = attribute(primitive, Semantic::Positions) {
            *users.entry(to_u32(index.value())).or_default() += 1;
        }
    }
    let mut morphs = gltf_morph::Reader::new(document, options);
    for (m, mesh) in document.root.meshes.iter().enumerate() {
        gltf_morph::check(document, mesh, m)?;
        let first = to_u32(parts.len());
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let at = format!("meshes[{m}].primitives[{p}]");
            let Some(mut raw) =
                read_primitive(document, primitive, materials, &mut morphs, &at, dropped)?
            else {
                continue;
            };
            triangles += raw.indices.len() as u64;
            if triangles > options.max_triangles {
                return Err(LoadError::TooLarge {
                    path: document.path.into(),
                    what: "its triangles",
                    limit: options.max_triangles,
                    option: "max_triangles",
                });
            }
            let shared = attribute(primitive, Semantic::Positions)
                .and_then(|i| users.get(&to_u32(i.value())))
                .is_some_and(|n| *n > 1);
            if shared {
                compact(&mut raw);
            }
            if let Some(name) = &mesh.name {
                raw.name = format!("{at} ({name})");
            } else {
                raw.name = at;
            }
            parts.push(
                raw.check(dropped)
                    .map_err(|source| LoadError::Mesh { path: document.path.into(), source })?,
            );
        }
        ranges.push(first..to_u32(parts.len()));
    }
    Ok(Meshes { parts, ranges })
}

fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

fn read_primitive(
    document: &Document<'_>,
    primitive: &Primitive,
    materials: &Materials,
    morphs: &mut gltf_morph::Reader<'_>,
    at: &str,
    dropped: &mut Dropped,
) -> Result<Option<RawPart>, LoadError> {
    let Checked::Valid(mode) = primitive.mode else {
        return Err(document.fail(at, "its mode is unknown", "use a mode from 0 to 6"));
    };
    let Some(position) = attribute(primitive, Semantic::Positions) else {
        dropped.attributes += 1;
        dropped.note(|| format!("{at}: it has no POSITION, so there is nothing to see"));
        return Ok(None);
    };
    let key = format!("{at}.attributes.POSITION");
    let order = match primitive.indices {
        Some(index) => document.indices(index, &format!("{at}.indices"))?,
        None => (0..to_u32(document.count(position, &key)?)).collect(),
    };
    let indices = triangles(mode, &order, at, dropped);
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(None);
    }
    let positions: Vec<Vec3> =
        document.vectors::<3>(position, &key)?.into_iter().map(Vec3::from).collect();
    let influences = gltf_skin::influences(document, primitive, positions.len(), at, dropped)?;
    let normals: Vec<Vec3> = match attribute(primitive, Semantic::Normals) {
        Some(i) => document.vectors::<3>(i, &format!("{at}.attributes.NORMAL"))?,
        None => Vec::new(),
    }
    .into_iter()
    .map(Vec3::from)
    .collect();
    let targets = morphs.read(primitive, positions.len(), &normals, at, dropped)?;
    let material = materials.id(primitive.material, at, dropped);
    let map = materials.uv_maps.get(material as usize).copied().unwrap_or_default();
    let uvs = match attribute(primitive, Semantic::TexCoords(map.set)) {
        Some(i) => {
            let key = format!("{at}.attributes.TEXCOORD_{}", map.set);
            document.vectors::<2>(i, &key)?
        }
        None => Vec::new(),
    };
    Ok(Some(RawPart {
        name: String::new(),
        positions,
        normals,
        uvs: uvs.into_iter().map(|uv| map.apply(Vec2::from(uv))).collect(),
        influences,
        targets,
        indices,
        material,
    }))
}

/// The triangles that a list of vertices stands for (glTF 2.0 §3.7.2.1).
fn triangles(mode: Mode, order: &[u32], at: &str, dropped: &mut Dropped) -> Vec<[u32; 3]> {
    let mut lost = 0;
    let out = match mode {
        Mode::Triangles => {
            let (whole, rest) = order.as_chunks::<3>();
            lost = usize::from(!rest.is_empty());
            whole.to_vec()
        }
        Mode::TriangleStrip => order
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        Mode::TriangleFan => {
            let center = order.first().copied().unwrap_or(0);
            order.get(1..).unwrap_or(&[]).windows(2).map(|w| [w[0], w[1], center]).collect()
        }
        Mode::Points => {
            lost = order.len();
            Vec::new()
        }
        Mode::Lines => {
            lost = order.len() / 2;
            Vec::new()
        }
        Mode::LineStrip | Mode::LineLoop => {
            lost = order.len().saturating_sub(1);
            Vec::new()
        }
    };
    if lost > 0 {
        dropped.points_and_lines += lost;
        dropped.note(|| match mode {
            Mode::Triangles => {
                format!("{at}: {} indices are no whole number of triangles", order.len())
            }
            _ => format!("{at}: {lost} points or lines"),
        });
    }
    out
}

/// Leaves out vertices that no triangle uses: where primitives share one array of vertices, each
/// would otherwise copy all of it.
fn compact(raw: &mut RawPart) {
    let count = raw.positions.len();
    let mut used = vec![false; count];
    for &i in raw.indices.iter().flatten() {
        if let Some(flag) = used.get_mut(i as usize) {
            *flag = true;
        }
    }
    let mut next = 0;
    let new_index: Vec<u32> = used
        .iter()
        .map(|&u| {
            let index = next;
            next += u32::from(u);
            index
        })
        .collect();
    // Indices out of range stay so, to be counted by the check that follows.
    for i in raw.indices.iter_mut().flatten() {
        *i = new_index.get(*i as usize).copied().unwrap_or(u32::MAX);
    }
    fn keep<T>(values: &mut Vec<T>, used: &[bool]) {
        if values.len() == used.len() {
            let mut flags = used.iter();
            values.retain(|_| flags.next().is_some_and(|u| *u));
        }
    }
    keep(&mut raw.positions, &used);
    keep(&mut raw.normals, &used);
    keep(&mut raw.uvs, &used);
    keep(&mut raw.influences, &used);
    if let Some(targets) = raw.targets.take() {
        // Fewer vertices have no more differences.
        raw.targets = targets.gathered((0..count).filter(|&v| used[v]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_orientation() {
        let mut dropped = Dropped::default();
        let strip = triangles(Mode::TriangleStrip, &[0, 1, 2, 3, 4], "", &mut dropped);
        assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        let fan = triangles(Mode::TriangleFan, &[0, 1, 2, 3], "", &mut dropped);
        assert_eq!(fan, [[1, 2, 0], [2, 3, 0]]);
        assert!(dropped.is_empty());
        assert!(triangles(Mode::TriangleFan, &[], "", &mut dropped).is_empty());
        assert_eq!(triangles(Mode::Triangles, &[0, 1, 2, 3], "", &mut dropped), [[0, 1, 2]]);
        assert!(triangles(Mode::Lines, &[0, 1, 2, 3], "", &mut dropped).is_empty());
        assert_eq!(dropped.points_and_lines, 3);
    }
}
