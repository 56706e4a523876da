//! Seeded procedural scenes, scalable from a thousand to ten million triangles.
//!
//! The same name, size and seed give the same bytes on every platform and at any number of
//! threads: random numbers, sines and noise are computed here, from IEEE additions,
//! multiplications, divisions and square roots alone.

mod atrium;
mod bunny;
mod cabin;
mod chess;
mod city;
mod courtyard;
mod curve;
mod dragon;
mod fairy;
mod foliage;
mod gallery;
mod glassware;
mod hair;
mod lathe;
pub(crate) mod math;
mod piece;
mod pipes;
mod random;
mod rooms;
mod shade;
mod stadium;
mod study;

use crate::Scene;

/// The scenes that [`generate`] makes: [`SHAPES`], then [`EFFECTS`], [`TOURS`] and [`STUDIES`].
pub const NAMES: &[&str] = &[
    "dragon",
    "hair",
    "atrium",
    "city",
    "pipes",
    "foliage",
    "stadium",
    "chess",
    "gallery",
    "courtyard",
    "plain",
    "one_mirror",
    "fairy",
    "cabin",
    "serpents",
    "tessellated",
];

/// Scenes that differ in how their triangles lie, for comparing builders. Nothing moves, and there
/// are no shading normals.
pub const SHAPES: &[&str] = NAMES.split_at(7).0;

/// Scenes that differ in which effects they call for, for renderers: with shading normals, moving
/// objects and a camera path of 200 frames.
pub const EFFECTS: &[&str] = NAMES.split_at(7).1.split_at(5).0;

/// Scenes for renderers that keep a frame time, after those of Ganestam and Doggett 2012: with shading
/// normals and a camera path of 100 frames, along which cost changes. Nothing moves.
pub const TOURS: &[&str] = NAMES.split_at(12).1.split_at(2).0;

/// The scenes of the raster case studies: with shading normals and a camera path of 200 frames, and
/// nothing moves, reflects or refracts.
pub const STUDIES: &[&str] = NAMES.split_at(14).1;

/// What a scene holds, in a line for a help text; `None` for an unknown name.
#[must_use]
pub fn describe(name: &str) -> Option<&'static str> {
    Some(match name {
        "dragon" => "one closed, evenly tessellated serpent",
        "hair" => "many thin curved tubes",
        "atrium" => "a court with columns, arches and drapery",
        "city" => "rotated houses and domes",
        "pipes" => "long thin pipes and beams",
        "foliage" => "trees with leaves in a walled yard",
        "stadium" => "a teapot in a stadium",
        "chess" => "nine boards, 288 reflecting figures and nine mirror balls, all moving",
        "gallery" => "the atrium with a mirror statue and a glass one",
        "courtyard" => "a court with laid tables: glassware, wine, water",
        "plain" => "a room in which nothing reflects",
        "one_mirror" => "the plain room with one small mirror",
        "fairy" => "winged figures and toadstools on a forest floor",
        "cabin" => "a log cabin beside a large, detailed tree",
        "serpents" => "the atrium with five dragons (724,337 triangles in the paper)",
        "tessellated" => "hills with balls, rings and a knot (396,000 triangles in the paper)",
        _ => return None,
    })
}

/// Makes a scene of about `triangles` triangles (within 5 % from 1,000 on), or `None` for an
/// unknown name.
///
/// `serpents` keeps to it from 1,500 on: its building and dragons have 1,250 at least.
///
/// Scenes of many figures have fewer of them where the request is small: `chess` has all 288 from
/// 60,000 triangles on.
#[must_use]
pub fn generate(name: &str, triangles: usize, seed: u64) -> Option<Scene> {
    // Fewer could not show the shape; more could not be numbered.
    let triangles = triangles.clamp(256, 1 << 30);
    let plan = match name {
        "dragon" => dragon::plan(triangles, seed),
        "hair" => hair::plan(triangles, seed),
        "atrium" => atrium::plan(triangles, seed),
        "city" => city::plan(triangles, seed),
        "pipes" => pipes::plan(triangles, seed),
        "foliage" => foliage::plan(triangles, seed),
        "stadium" => stadium::plan(triangles, seed),
        "chess" => chess::plan(triangles, seed),
        "gallery" => gallery::plan(triangles, seed),
        "courtyard" => courtyard::plan(triangles, seed),
        "plain" => rooms::plan(triangles, seed, false),
        "one_mirror" => rooms::plan(triangles, seed, true),
        "fairy" => fairy::plan(triangles, seed),
        "cabin" => cabin::plan(triangles, seed),
        "serpents" => study::serpents(triangles, seed),
        "tessellated" => study::tessellated(triangles, seed),
        _ => return None,
    };
    Some(plan.into_scene(name))
}
