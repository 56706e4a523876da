//! Loading by file name.

use crate::{LoadError, Scene};
use std::path::Path;

/// What a loader may do.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Decode textures. Without them scenes load faster and materials keep their plain colours.
    /// Default true.
    pub textures: bool,
    /// The most triangles a scene may have once its instances are flattened. Default 2³⁰.
    pub max_triangles: u64,
    /// The most bytes that one file may unpack to. Default 2³⁵.
    pub max_bytes: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { textures: true, max_triangles: 1 << 30, max_bytes: 1 << 35 }
    }
}

/// Loads a scene: `.obj`, `.gltf` or `.glb`, each also packed with zstd (`.obj.zst` and so on).
///
/// # Errors
/// [`LoadError`] says what in which file is wrong and what helps.
pub fn load(path: &Path, _options: &LoadOptions) -> Result<Scene, LoadError> {
    Err(LoadError::UnknownFormat { path: path.into() })
}
