//! The WGSL kernels of Niwaki: files, their imports, validation and SPIR-V.
//!
//! ```
//! // For wgpu: one text with all imports.
//! let text = niwaki_shaders::source("probe")?;
//! assert!(text.contains("fn main"));
//!
//! // For Vulkan: validated SPIR-V, and what a pipeline layout has to bind.
//! let shader = niwaki_shaders::compile("probe", "main", &niwaki_shaders::Options::default())?;
//! assert_eq!(shader.words[0], 0x0723_0203);
//! assert_eq!(shader.workgroup_size, [64, 1, 1]);
//! # Ok::<(), niwaki_shaders::ShaderError>(())
//! ```
//!
//! # Imports
//!
//! A line `//!import NAME` puts the file `NAME.wgsl` before the file that has the line, once
//! however often it is imported, so that a file may rely on all names of what it imports and on
//! nothing else. Names are global; by custom those of a shared file begin with its name. Unknown
//! names and cycles are errors that say in which file and line, and errors of the language are
//! reported at the line of the file they are in, not of the text that imports make.
//!
//! # Constants
//!
//! What varies from pipeline to pipeline (a mode, the size of a workgroup) is an `override`
//! constant, given by name in [`Options::constants`]. wgpu takes the same names in its pipeline's
//! `constants`.
//!
//! # Arithmetic
//!
//! Kernels that must give the bits of their CPU twins rely on IEEE operations being carried out as
//! written. Vulkan promises correctly rounded sums and products, but lets a driver fuse and
//! rearrange them unless told otherwise; [`Options::exact`], which is the default, tells it. WGSL
//! has no such promise, so the same text run through wgpu may round differently.
//!
//! There are no feature flags.

mod compile;
mod error;
mod library;
mod spirv;

pub use compile::{Binding, BindingKind, Options, Shader, Stage};
pub use error::ShaderError;
pub use library::{Composed, Library};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// The names of all files that come with this crate, sorted.
#[must_use]
pub fn names() -> Vec<String> {
    Library::embedded().names().map(str::to_owned).collect()
}

/// The text of a module of this crate with all that it imports: what wgpu takes.
///
/// # Errors
/// [`ShaderError::UnknownModule`] for a name that does not exist.
pub fn source(module: &str) -> Result<String, ShaderError> {
    Ok(Library::embedded().compose(module)?.text)
}

/// The SPIR-V words of an entry point of a module of this crate, with default [`Options`].
///
/// # Errors
/// [`ShaderError`] names the module, file and line.
pub fn spirv(module: &str, entry: &str) -> Result<Vec<u32>, ShaderError> {
    Ok(compile(module, entry, &Options::default())?.words)
}

/// An entry point of a module of this crate, validated and translated to SPIR-V.
///
/// # Errors
/// [`ShaderError`] names the module, file and line.
pub fn compile(module: &str, entry: &str, options: &Options<'_>) -> Result<Shader, ShaderError> {
    Library::embedded().compile(module, entry, options)
}
