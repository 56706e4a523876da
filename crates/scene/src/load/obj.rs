//! Wavefront OBJ files.
//!
//! The `tobj` crate joins indices, triangulates and groups. It refuses a whole file for one bad
//! face, names no lines, and mixes up attributes where some faces have them and others not; so
//! every line is checked and written anew before it gets there: indices absolute and in range,
//! attributes complete (the first coordinate and the first normal are placeholders).

use super::{LoadOptions, mtl, part::RawPart, read};
use crate::{Dropped, Instance, InstancedScene, LoadError, Rig};
use glam::{DAffine3, Vec2, Vec3};
use niwaki_core::to_u32;
use std::{
    collections::HashMap,
    io::Write,
    path::{Path, PathBuf},
};

/// Statements of the format (Alias/Wavefront, version 3.0) that say nothing about polygons.
const IGNORED: &[&str] = &[
    "s",
    "vp",
    "cstype",
    "deg",
    "bmat",
    "step",
    "curv",
    "curv2",
    "surf",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "maplib",
    "usemap",
    "call",
    "csh",
];

/// Loads `.obj` bytes.
pub(super) fn load(
    path: &Path,
    name: &str,
    options: &LoadOptions,
) -> Result<InstancedScene, LoadError> {
    let bytes = read::bytes(path, options)?;
    let mut dropped = Dropped::default();
    let scan = Scan::run(path, &bytes, options, &mut dropped)?;
    drop(bytes);
    let library = mtl::Library::load(path, &scan.libraries, &scan.used, options, &mut dropped);
    let numbers: HashMap<String, usize> =
        (0..scan.used.len()).map(|i| (i.to_string(), i)).collect();
    let stand_ins = vec![tobj::Material::default(); scan.used.len()];
    let (models, _) = tobj::load_obj_buf(
        &mut scan.text.as_slice(),
        &tobj::LoadOptions {
            single_index: true,
            triangulate: true,
            ignore_points: true,
            ignore_lines: true,
        },
        |_| Ok((stand_ins.clone(), numbers.clone())),
    )
    .map_err(|error| LoadError::Obj {
        path: path.into(),
        line: scan.lines,
        reason: error.to_string(),
        remedy: "every line by itself is good: export the file again",
    })?;
    let mut parts = Vec::with_capacity(models.len());
    for model in models {
        let material = model.mesh.material_id.and_then(|i| library.ids.get(i)).copied();
        let mut raw = RawPart {
            name: model.name,
            positions: vectors(&model.mesh.positions),
            normals: if scan.normals { vectors(&model.mesh.normals) } else { Vec::new() },
            uvs: if scan.uvs { coordinates(&model.mesh.texcoords) } else { Vec::new() },
            influences: Vec::new(),
            targets: None,
            indices: model.mesh.indices.as_chunks::<3>().0.to_vec(),
            material: material.unwrap_or(library.default),
        };
        fill_normals(&mut raw);
        let mesh_error = |source| LoadError::Mesh { path: path.into(), source };
        parts.push(raw.check(&mut dropped).map_err(mesh_error)?);
    }
    let instances =
        (0..to_u32(parts.len())).map(|part| Instance::still(part, DAffine3::IDENTITY)).collect();
    Ok(InstancedScene {
        name: name.into(),
        parts,
        instances,
        materials: library.materials,
        textures: library.textures,
        cameras: Vec::new(),
        lights: Vec::new(),
        environment: None,
        rig: Rig::default(),
        duration: 0.0,
        dropped,
    })
}

fn vectors(flat: &[f32]) -> Vec<Vec3> {
    flat.as_chunks::<3>().0.iter().map(|&v| Vec3::from(v)).collect()
}

/// OBJ counts rows of an image from the bottom, textures here from the top.
fn coordinates(flat: &[f32]) -> Vec<Vec2> {
    flat.as_chunks::<2>().0.iter().map(|&[u, v]| Vec2::new(u, 1.0 - v)).collect()
}

/// Vertices that have no normal in a part where others have one get the mean of their triangles'
/// normals, weighted by area; a part without any gets none.
fn fill_normals(raw: &mut RawPart) {
    let missing = |n: &Vec3| *n == Vec3::ZERO;
    if raw.normals.iter().all(missing) {
        raw.normals.clear();
    }
    if raw.normals.len() != raw.positions.len() || !raw.normals.iter().any(missing) {
        return;
    }
    let mut sums = vec![Vec3::ZERO; raw.positions.len()];
    for t in &raw.indices {
        let [a, b, c] = t.map(|i| raw.positions[i as usize]);
        let normal = (b - a).cross(c - a);
        for &i in t {
            sums[i as usize] += normal;
        }
    }
    for (n, sum) in raw.normals.iter_mut().zip(sums).filter(|(n, _)| missing(n)) {
        *n = sum.try_normalize().unwrap_or(Vec3::Y);
    }
}

/// A checked copy of the file for `tobj`, and what was found on the way.
struct Scan {
    text: Vec<u8>,
    lines: usize,
    /// The names behind `mtllib`, with their lines.
    libraries: Vec<(usize, String)>,
    /// Materials in the order of their first use, with that line.
    used: Vec<(usize, String)>,
    used_ids: HashMap<String, usize>,
    counts: [usize; 3],
    uvs: bool,
    normals: bool,
    triangles: u64,
}

/// Where an error is.
struct Place {
    path: PathBuf,
    line: usize,
}

impl Place {
    fn fail(&self, reason: String, remedy: &'static str) -> LoadError {
        LoadError::Obj { path: self.path.clone(), line: self.line, reason, remedy }
    }
}

impl Scan {
    fn run(
        path: &Path,
        bytes: &[u8],
        options: &LoadOptions,
        dropped: &mut Dropped,
    ) -> Result<Self, LoadError> {
        let mut scan = Self {
            text: Vec::with_capacity(bytes.len() + bytes.len() / 8),
            lines: 0,
            libraries: Vec::new(),
            used: Vec::new(),
            used_ids: HashMap::new(),
            counts: [0, 1, 1],
            uvs: false,
            normals: false,
            triangles: 0,
        };
        scan.text.extend_from_slice(b"mtllib m\nvt 0 0\nvn 0 0 0\n");
        let mut place = Place { path: path.into(), line: 0 };
        let mut unknown = None;
        let mut joined = Vec::new();
        for raw in bytes.split(|&b| b == b'\n') {
            scan.lines += 1;
            let raw = raw.strip_suffix(b"\r").unwrap_or(raw);
            // A backslash at the end joins a line with the next.
            if let Some(start) = raw.strip_suffix(b"\\") {
                if joined.is_empty() {
                    place.line = scan.lines;
                }
                joined.extend_from_slice(start);
                joined.push(b' ');
                continue;
            }
            let line = if joined.is_empty() {
                place.line = scan.lines;
                String::from_utf8_lossy(raw)
            } else {
                joined.extend_from_slice(raw);
                String::from_utf8_lossy(&joined).into_owned().into()
            };
            if !scan.statement(&line, &place, dropped)? && unknown.is_none() {
                unknown = Some((place.line, line.trim().chars().take(40).collect::<String>()));
            }
            if scan.triangles > options.max_triangles {
                return Err(LoadError::TooLarge {
                    path: path.into(),
                    what: "its triangles",
                    limit: options.max_triangles,
                    option: "max_triangles",
                });
            }
            joined.clear();
        }
        if let Some((line, text)) = unknown {
            if scan.counts == [0, 1, 1] {
                place.line = line;
                let reason = format!("`{text}` is no statement of an OBJ file, nor is any other");
                return Err(place.fail(reason, "check that this is an OBJ file"));
            }
            dropped.note(|| format!("line {line}: unknown statement `{text}`"));
        }
        Ok(scan)
    }

    /// Checks one statement and writes it anew; false for an unknown one.
    fn statement(
        &mut self,
        line: &str,
        place: &Place,
        dropped: &mut Dropped,
    ) -> Result<bool, LoadError> {
        let line = without_comment(line);
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match keyword {
            "v" => {
                self.numbers("v", rest, 3, 3, place)?;
                self.counts[0] += 1;
            }
            "vt" => {
                self.numbers("vt", rest, 1, 2, place)?;
                self.counts[1] += 1;
            }
            "vn" => {
                self.numbers("vn", rest, 3, 3, place)?;
                self.counts[2] += 1;
            }
            "f" | "fo" => self.face(rest, place, dropped)?,
            "l" | "p" => {
                dropped.points_and_lines += 1;
                dropped.note(|| format!("line {}: points or lines have no surface", place.line));
            }
            "o" | "g" => self.line(&[keyword, " ", rest]),
            "mtllib" => self.libraries.push((place.line, rest.into())),
            "usemtl" => {
                let next = self.used.len();
                let id = *self.used_ids.entry(rest.into()).or_insert(next);
                if id == next {
                    self.used.push((place.line, rest.into()));
                }
                self.line(&["usemtl ", &id.to_string()]);
            }
            "" => {}
            other => return Ok(IGNORED.contains(&other)),
        }
        Ok(true)
    }

    fn line(&mut self, words: &[&str]) {
        for word in words {
            self.text.extend_from_slice(word.as_bytes());
        }
        self.text.push(b'\n');
    }

    /// Writes `wanted` numbers, at least `least` of them from the line and the others zero. More
    /// than that (weights of rational curves, vertex colours) do not matter for polygons.
    fn numbers(
        &mut self,
        keyword: &str,
        rest: &str,
        least: usize,
        wanted: usize,
        place: &Place,
    ) -> Result<(), LoadError> {
        self.text.extend_from_slice(keyword.as_bytes());
        let mut words = rest.split_whitespace();
        for i in 0..wanted {
            let text = match words.next() {
                Some(word) if word.parse::<f32>().is_ok() => word,
                // What C libraries print for numbers that are none.
                Some(word) if is_non_finite(word) => "nan",
                None if i >= least => "0",
                other => {
                    let reason = match other {
                        Some(word) => format!("`{word}` is not a number"),
                        None => format!("`{keyword}` has {i} numbers, not {least}"),
                    };
                    return Err(place.fail(reason, "correct that line"));
                }
            };
            self.text.push(b' ');
            self.text.extend_from_slice(text.as_bytes());
        }
        self.text.push(b'\n');
        Ok(())
    }

    /// Writes a face with absolute indices, or counts why not.
    fn face(&mut self, rest: &str, place: &Place, dropped: &mut Dropped) -> Result<(), LoadError> {
        const FORM: &str = "write corners as v, v/vt, v//vn or v/vt/vn";
        let mut corners: Vec<[Option<usize>; 3]> = Vec::with_capacity(4);
        let mut attributes_good = [true; 3];
        for word in rest.split_whitespace() {
            let mut corner = [None; 3];
            for (k, field) in word.split('/').enumerate() {
                if k > 2 || (k == 0 && field.is_empty()) {
                    return Err(place.fail(format!("`{word}` is no corner of a face"), FORM));
                }
                if field.is_empty() {
                    continue;
                }
                let Ok(index) = field.parse::<i64>() else {
                    return Err(place.fail(format!("`{field}` in `{word}` is no index"), FORM));
                };
                // Coordinates and normals are one further on, behind their placeholders.
                let (count, first) = (self.counts[k] as i64, i64::from(k > 0));
                let absolute = match index {
                    0 => -1,
                    i if i > 0 => i.saturating_add(first),
                    i => count + 1 + i.max(-count - 1),
                };
                let in_range = absolute > first && absolute <= count;
                corner[k] = in_range.then(|| usize::try_from(absolute).unwrap_or(0));
                attributes_good[k] &= in_range;
            }
            corners.push(corner);
        }
        if !attributes_good[0] {
            let triangles = corners.len().saturating_sub(2).max(1);
            dropped.index_out_of_range += triangles;
            let count = self.counts[0];
            dropped.note(|| {
                format!("line {}: a vertex index is not among the {count} before it", place.line)
            });
            return Ok(());
        }
        if !(attributes_good[1] && attributes_good[2]) {
            dropped.attributes += 1;
            dropped.note(|| format!("line {}: a vt or vn index is out of range", place.line));
        }
        if corners.len() < 3 {
            dropped.points_and_lines += 1;
            dropped.note(|| format!("line {}: a face of fewer than 3 corners", place.line));
            return Ok(());
        }
        self.triangles += corners.len() as u64 - 2;
        // An attribute that a corner lacks is of no use to the others.
        let all = |k: usize| corners.iter().all(|c| c[k].is_some());
        let (uvs, normals) = (all(1), all(2));
        self.uvs |= uvs;
        self.normals |= normals;
        self.text.push(b'f');
        for corner in &corners {
            let index = |k: usize, use_it: bool| corner[k].filter(|_| use_it).unwrap_or(1);
            let (v, vt, vn) = (index(0, true), index(1, uvs), index(2, normals));
            write!(self.text, " {v}/{vt}/{vn}").expect("writing to memory cannot fail");
        }
        self.text.push(b'\n');
        Ok(())
    }
}

/// A line up to a `#` that begins a word (others are part of one, as in `1.#INF`), trimmed.
pub(super) fn without_comment(line: &str) -> &str {
    let mut previous = ' ';
    let end = line.char_indices().find(|&(_, c)| {
        let begins = c == '#' && previous.is_whitespace();
        previous = c;
        begins
    });
    line[..end.map_or(line.len(), |(at, _)| at)].trim()
}

/// True for `nan`, `-nan(ind)`, `1.#QNAN`, `1.#INF` and their like.
fn is_non_finite(word: &str) -> bool {
    let lower = word.to_ascii_lowercase();
    ["nan", "inf", "#ind", "#qnan", "#snan"].iter().any(|mark| lower.contains(mark))
}
