//! What can be wrong with a shader.

/// Why a shader could not be composed or compiled.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShaderError {
    /// No file has the name. Remedy: one of those that are listed.
    #[error("there is no shader file {name:?}; there are: {known}")]
    UnknownModule {
        /// What was asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// An import names no file. Remedy: correct the name, or add the file to the library.
    #[error("{file}.wgsl:{line}: there is no shader file {import:?} to import")]
    UnknownImport {
        /// The file with the import.
        file: String,
        /// The line of the import, from 1.
        line: usize,
        /// What it names.
        import: String,
    },
    /// A file imports itself, perhaps by way of others. Remedy: move what both need to a third.
    #[error("{file}.wgsl:{line}: imports go round in a circle: {chain}")]
    Cycle {
        /// The file whose import closes the circle.
        file: String,
        /// The line of that import, from 1.
        line: usize,
        /// The files of the circle in order.
        chain: String,
    },
    /// The text is no valid WGSL. Remedy: correct the line.
    #[error("{file}.wgsl:{line}:{column}: {message}")]
    Invalid {
        /// The file, or the module if the place is unknown.
        file: String,
        /// The line in it, from 1; 0 if unknown.
        line: usize,
        /// The column in it, from 1; 0 if unknown.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// The module has no entry point of the name that can be translated: of a compute shader, or of
    /// ray generation, miss or closest hit. Remedy: one of those that are listed.
    #[error(
        "{module}.wgsl has no entry point {entry:?} for compute or ray tracing; it has: {known}"
    )]
    UnknownEntry {
        /// The module.
        module: String,
        /// What was asked for.
        entry: String,
        /// All that it has.
        known: String,
    },
    /// A constant is missing, unknown, or has a value that its type or place does not allow.
    /// Remedy: as the message says.
    #[error("constants of {module}.wgsl: {message}")]
    Constant {
        /// The module.
        module: String,
        /// What is wrong.
        message: String,
    },
    /// The module uses something that SPIR-V cannot express. Remedy: as the message says.
    #[error("{module}.wgsl cannot be translated to SPIR-V: {message}")]
    Untranslatable {
        /// The module.
        module: String,
        /// What is wrong.
        message: String,
    },
}
