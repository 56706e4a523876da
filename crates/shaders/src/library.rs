//! Shader files and how they import each other.

use crate::ShaderError;
use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

/// The line that imports a file.
const IMPORT: &str = "//!import";

/// Every file of this crate.
macro_rules! embedded {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../wgsl/", $name, ".wgsl")))),*]
    };
}

const EMBEDDED: &[(&str, &str)] = embedded![
    "boxes",
    "clearance",
    "drive",
    "driver/common",
    "driver/enable_pipeline",
    "driver/enable_query",
    "driver/pipeline",
    "driver/query",
    "float",
    "frame/gbuffer",
    "frame/primitive_index",
    "frame/shading",
    "frame/surfaces",
    "hybrid/counters",
    "hybrid/cull",
    "hybrid/deform",
    "hybrid/depth",
    "hybrid/gbuffer",
    "hybrid/light",
    "hybrid/linear",
    "hybrid/map",
    "hybrid/march",
    "hybrid/occlusion",
    "hybrid/primary",
    "hybrid/pyramid",
    "hybrid/scene",
    "hybrid/shading",
    "hybrid/size",
    "hybrid/trace",
    "hybrid/tracing",
    "hybrid/visibility",
    "hybrid/walk",
    "lbvh/bounds",
    "lbvh/boxes",
    "lbvh/emit",
    "lbvh/float",
    "lbvh/karras",
    "lbvh/mark",
    "lbvh/morton",
    "lbvh/rank",
    "lbvh/scan",
    "lbvh/scene",
    "lbvh/sort",
    "lbvh/state",
    "lbvh/tree",
    "lbvh/triangles",
    "microbench/arithmetic",
    "microbench/chase",
    "microbench/loads",
    "normals",
    "probe",
    "random",
    "raster/forward",
    "raster/frame",
    "raster/light",
    "raster/mapped",
    "raster/mips",
    "raster/moments",
    "raster/screen",
    "raster/silhouettes",
    "raster/volumes",
    "ray",
    "trace_binary",
    "trace_wide",
    "tracer/binary",
    "tracer/frame",
    "tracer/wide",
    "tracing",
    "triangle",
];

/// A set of shader files by name.
///
/// ```
/// use niwaki_shaders::{Library, Options};
///
/// let mut library = Library::embedded();
/// library.insert("half", "fn half(x: f32) -> f32 { return 0.5 * x; }");
/// library.insert(
///     "halves",
///     "//!import half
///     @group(0) @binding(0) var<storage, read_write> data: array<f32>;
///     @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {
///         data[id.x] = half(data[id.x]);
///     }",
/// );
/// assert!(library.compile("halves", "main", &Options::default()).is_ok());
/// # Ok::<(), niwaki_shaders::ShaderError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Library {
    files: BTreeMap<Cow<'static, str>, Cow<'static, str>>,
}

/// A module with all that it imports, as one text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Composed {
    /// The text.
    pub text: String,
    /// The file and the line in it, from 1, of each line of the text.
    lines: Vec<(String, usize)>,
}

impl Composed {
    /// Where a line of the text, counted from 1, comes from: a file and a line in it, from 1.
    #[must_use]
    pub fn origin(&self, line: usize) -> Option<(&str, usize)> {
        let (file, line) = self.lines.get(line.checked_sub(1)?)?;
        Some((file, *line))
    }
}

/// A file on the way down.
struct Frame<'a> {
    name: &'a str,
    text: &'a str,
    /// Lines and names of its imports that have not been followed.
    imports: std::vec::IntoIter<(usize, &'a str)>,
    /// The line of the import that was followed last.
    line: usize,
}

impl Library {
    /// The files of this crate.
    #[must_use]
    pub fn embedded() -> Self {
        let files = EMBEDDED.iter().map(|&(name, text)| (name.into(), text.into()));
        Self { files: files.collect() }
    }

    /// Adds a file, or replaces the one of the same name.
    pub fn insert(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        text: impl Into<Cow<'static, str>>,
    ) {
        self.files.insert(name.into(), text.into());
    }

    /// All names, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.files.keys().map(AsRef::as_ref)
    }

    /// A module with all that it imports, each file once and after those that it imports.
    ///
    /// # Errors
    /// [`ShaderError::UnknownModule`], [`ShaderError::UnknownImport`] and [`ShaderError::Cycle`].
    pub fn compose(&self, module: &str) -> Result<Composed, ShaderError> {
        let mut composed = Composed { text: String::new(), lines: Vec::new() };
        let mut done = BTreeSet::new();
        let first = self.frame(module).ok_or_else(|| ShaderError::UnknownModule {
            name: module.to_owned(),
            known: self.names().collect::<Vec<_>>().join(", "),
        })?;
        let mut frames = vec![first];
        while let Some(frame) = frames.last_mut() {
            let Some((line, import)) = frame.imports.next() else {
                for (number, line) in frame.text.lines().enumerate() {
                    composed.text.push_str(line);
                    composed.text.push('\n');
                    composed.lines.push((frame.name.to_owned(), number + 1));
                }
                done.insert(frame.name);
                frames.pop();
                continue;
            };
            frame.line = line;
            if done.contains(import) {
                continue;
            }
            let (file, line) = (frame.name.to_owned(), frame.line);
            if let Some(start) = frames.iter().position(|frame| frame.name == import) {
                let names = frames[start..].iter().map(|frame| frame.name);
                let chain = names.chain([import]).collect::<Vec<_>>().join(" imports ");
                return Err(ShaderError::Cycle { file, line, chain });
            }
            let Some(next) = self.frame(import) else {
                return Err(ShaderError::UnknownImport { file, line, import: import.to_owned() });
            };
            frames.push(next);
        }
        Ok(composed)
    }

    fn frame(&self, name: &str) -> Option<Frame<'_>> {
        let (name, text) = self.files.get_key_value(name)?;
        let imports = text.lines().enumerate().filter_map(|(number, line)| {
            let rest = line.trim().strip_prefix(IMPORT)?;
            // Not a longer word that begins so.
            rest.starts_with(char::is_whitespace).then(|| (number + 1, rest.trim()))
        });
        let imports = imports.collect::<Vec<_>>().into_iter();
        Some(Frame { name, text, imports, line: 0 })
    }
}
