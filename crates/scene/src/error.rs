//! Why a file could not be loaded.

use std::path::PathBuf;

/// Why a file could not be loaded. Every message says where, what and what helps.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The name ends in nothing known. Remedy: convert the file, or give it the right ending.
    #[error(
        "{}: unknown format; a name must end in .obj, .gltf or .glb, optionally followed by .zst",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file, or one that it refers to, could not be read. Remedy: as the system's message
    /// says; files that a scene refers to must lie where it says, relative to it.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The scene refers to a file outside its own folder. Remedy: put the file there and refer to
    /// it by a relative path, or set [`LoadOptions::outside`](crate::LoadOptions::outside) if you
    /// trust the scene.
    #[error(
        "{}: `{name}` is outside the scene's folder; copy it there, or set LoadOptions::outside",
        path.display()
    )]
    Outside {
        /// The scene.
        path: PathBuf,
        /// What it refers to.
        name: String,
    },
    /// The zstd stream is broken or of an unknown kind. Remedy: unpack and pack it again
    /// (`zstd -d`, `zstd`).
    #[error("{}: zstd: {reason}; test it with `zstd -t` and pack it again", path.display())]
    Compression {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file is larger than the options allow. Remedy: raise the limit in
    /// [`LoadOptions`](crate::LoadOptions), or divide the scene.
    #[error("{}: {what} exceed the limit of {limit}; raise LoadOptions::{option}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What there is too much of.
        what: &'static str,
        /// How much is allowed.
        limit: u64,
        /// The option that allows more.
        option: &'static str,
    },
    /// A line of an OBJ file says nothing that can be understood. Remedy: correct that line.
    #[error("{}:{line}: {reason}; {remedy}", path.display())]
    Obj {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
        /// What would be right.
        remedy: &'static str,
    },
    /// A part of a glTF file contradicts the format. Remedy: correct it, export it again, or run
    /// the Khronos glTF validator on it for the whole list.
    #[error("{}: {at}: {reason}; {remedy}", path.display())]
    Gltf {
        /// The file.
        path: PathBuf,
        /// Which part: a path such as `nodes[3]` or `meshes[2].primitives[0].attributes.POSITION`.
        at: String,
        /// What is wrong with it.
        reason: String,
        /// What would be right.
        remedy: &'static str,
    },
    /// The triangles that remained are refused by the core. Remedy: as its message says.
    #[error("{}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What the core said.
        source: niwaki_core::MeshError,
    },
}
