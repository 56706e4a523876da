//! Loading by file name.

mod accessor;
mod container;
mod gltf;
mod gltf_animation;
mod gltf_material;
mod gltf_mesh;
mod gltf_morph;
mod gltf_skin;
mod image;
mod mtl;
mod obj;
mod part;
mod read;

use crate::{InstancedScene, LoadError, Scene, instanced::FlattenError};
use std::path::Path;

/// What a loader may do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Decode textures. Without them scenes load faster and materials keep their plain colours.
    /// Default true.
    pub textures: bool,
    /// The most triangles that a scene may have, stored and once flattened. Default 2³⁰.
    pub max_triangles: u64,
    /// The most bytes that one file may have, unpacked; images as pixels, of which 2²⁹ bytes are
    /// the most in any case. Default 2³⁵.
    pub max_bytes: u64,
    /// Read what a scene refers to outside its own folder: absolute paths, and those that lead out
    /// of it by `..`. Default false, so that a scene from elsewhere does not choose what is read.
    /// Links in the folder are followed, wherever they lead.
    pub outside: bool,
    /// Which of a glTF file's animations moves the scene, from 0, or none. Default 0, which a file
    /// without animations need not have.
    pub animation: Option<usize>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            textures: true,
            max_triangles: 1 << 30,
            max_bytes: 1 << 35,
            outside: false,
            animation: Some(0),
        }
    }
}

/// Loads a scene: `.obj`, `.gltf` or `.glb`, each also packed with zstd (`.obj.zst` and so on),
/// with every instance of a mesh as triangles of its own.
///
/// What can be kept is kept, degenerate triangles included; [`Scene::dropped`] counts and names
/// what cannot. A scene stands as the file says that it rests; [`Scene::animation`] moves nodes,
/// skins and the weights of morph targets by the animation that the options name.
///
/// # Errors
/// [`LoadError`] says what in which file is wrong and what helps.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, LoadError> {
    load_instanced(path, options)?.flatten(options).map_err(|error| match error {
        FlattenError::Skin { part, source } => LoadError::Gltf {
            path: path.into(),
            at: part,
            reason: source.to_string(),
            remedy: "correct the joints, or bind the mesh to its skin again",
        },
        FlattenError::Morph { part, source } => LoadError::Gltf {
            path: path.into(),
            at: part,
            reason: source.to_string(),
            remedy: "give every vertex its differences, and every target its weight",
        },
        FlattenError::TooManyDifferences { limit, .. } => LoadError::TooLarge {
            path: path.into(),
            what: "its morph targets, one of each for every node that morphs,",
            limit,
            option: "max_bytes",
        },
        FlattenError::Mesh(source) => LoadError::Mesh { path: path.into(), source },
        FlattenError::TooLarge { limit, .. } => LoadError::TooLarge {
            path: path.into(),
            what: "its triangles or vertices",
            limit,
            option: "max_triangles",
        },
    })
}

/// Loads a scene as [`load`] does, but with meshes stored once and the places where they stand.
///
/// # Errors
/// As [`load`].
pub fn load_instanced(path: &Path, options: &LoadOptions) -> Result<InstancedScene, LoadError> {
    let unknown = || LoadError::UnknownFormat { path: path.into() };
    let file = path.file_name().ok_or_else(unknown)?.to_string_lossy().into_owned();
    let lower = file.to_ascii_lowercase();
    let plain = lower.strip_suffix(".zst").unwrap_or(&lower);
    let (stem, extension) = plain.rsplit_once('.').ok_or_else(unknown)?;
    let name = file.get(..stem.len()).unwrap_or(stem);
    match extension {
        "obj" => obj::load(path, name, options),
        "gltf" | "glb" => gltf::load(path, name, options),
        _ => Err(unknown()),
    }
}
