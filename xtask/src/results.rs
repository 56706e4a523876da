//! The results file: `schema: 1`, one row a measurement.

use anyhow::{Context, Result, bail};
use niwaki_core::SahConstants;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The version of the file's layout that this program writes and reads.
pub(crate) const SCHEMA: u32 = 1;

/// Everything that one or several runs measured.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub(crate) struct Results {
    /// [`SCHEMA`].
    pub(crate) schema: u32,
    /// The runs that rows refer to by position.
    pub(crate) runs: Vec<Run>,
    /// The scenes that rows refer to by name.
    pub(crate) scenes: Vec<SceneInfo>,
    /// The measurements.
    pub(crate) rows: Vec<Row>,
    /// What could not be measured, and why.
    #[serde(default)]
    pub(crate) failures: Vec<Failure>,
}

/// The header of a run: where and how it was measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq)]
pub(crate) struct Run {
    /// The computer.
    pub(crate) machine: Machine,
    /// Compiler version.
    pub(crate) rustc: String,
    /// Compiler flags (`RUSTFLAGS`), profile and optimisation level.
    pub(crate) flags: String,
    /// Start, UTC, ISO 8601.
    pub(crate) date: String,
    /// Git revision of the working tree, `+` appended where it has changes.
    pub(crate) revision: Option<String>,
    /// The numbers of threads of the matrix.
    pub(crate) threads: Vec<usize>,
    /// How binary trees became wide ones: `optimal` or `greedy`; empty where files do not say.
    #[serde(default)]
    pub(crate) collapse: String,
    /// The arguments.
    pub(crate) arguments: Vec<String>,
    /// Which part of the matrix, as `K/N`.
    pub(crate) shard: Option<String>,
    /// Versions of the peers that took part.
    pub(crate) peers: Vec<String>,
    /// At least so many seconds were spent on each trace measurement.
    pub(crate) seconds_per_measurement: f64,
}

/// A computer.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq)]
pub(crate) struct Machine {
    /// Name of the processor.
    pub(crate) cpu: String,
    /// Hardware threads that this process may use.
    pub(crate) cores: usize,
    /// Instruction set extensions that matter to the kernels.
    pub(crate) isa: Vec<String>,
    /// Operating system and architecture.
    pub(crate) os: String,
}

/// A scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq)]
pub(crate) struct SceneInfo {
    /// As rows name it.
    pub(crate) name: String,
    /// Triangles after loading.
    pub(crate) triangles: usize,
    /// File name, or `generated`.
    pub(crate) origin: String,
    /// Whose work it is and under which licence: shown under pictures.
    pub(crate) credit: Option<String>,
    /// What the loader left out, in words.
    #[serde(default)]
    pub(crate) dropped: Option<String>,
    /// A path-traced picture (PNG), relative to the results file.
    pub(crate) picture: Option<PathBuf>,
    /// A picture of traversal cost.
    pub(crate) heat_map: Option<HeatMap>,
}

/// A false-colour picture of how much work each camera ray took.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub(crate) struct HeatMap {
    /// The PNG, relative to the results file.
    pub(crate) picture: PathBuf,
    /// The builder of the traversed tree.
    pub(crate) builder: String,
    /// Boxes and triangles tested per ray: the mean over the picture.
    pub(crate) mean: f64,
    /// Boxes and triangles tested per ray at the bright end of the scale.
    pub(crate) top: f64,
}

/// A scene or measurement that failed.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub(crate) struct Failure {
    /// The scene, as given.
    pub(crate) scene: String,
    /// The reason.
    pub(crate) error: String,
}

/// Whose tree it is.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Source {
    /// Ours.
    Niwaki,
    /// obvhs.
    Obvhs,
    /// Embree.
    Embree,
}

impl Source {
    /// The name in files and tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Niwaki => "niwaki",
            Self::Obvhs => "obvhs",
            Self::Embree => "embree",
        }
    }
}

/// One measurement.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub(crate) enum Row {
    /// A tree was built.
    Build(BuildRow),
    /// Rays were traced.
    Trace(TraceRow),
}

/// How long a tree took to build, and how good it is.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub(crate) struct BuildRow {
    /// Position in [`Results::runs`].
    pub(crate) run: usize,
    /// The scene's name.
    pub(crate) scene: String,
    /// Triangles of the scene.
    pub(crate) triangles: usize,
    /// Whose builder.
    pub(crate) source: Source,
    /// The builder or preset.
    pub(crate) builder: String,
    /// Threads it ran on.
    pub(crate) threads: usize,
    /// How often it was timed.
    pub(crate) repeats: usize,
    /// From the mesh to the binary tree, median of the repeats, milliseconds.
    pub(crate) ms_median: f64,
    /// The fastest repeat.
    pub(crate) ms_min: f64,
    /// From the mesh to what our 8-wide kernel traverses, median.
    pub(crate) ms_wide_median: Option<f64>,
    /// From the mesh to the peer's own traversable structure, median.
    pub(crate) ms_commit_median: Option<f64>,
    /// Primitive references in the leaves.
    pub(crate) references: usize,
    /// Nodes of the binary tree.
    pub(crate) nodes: usize,
    /// Bytes of the binary tree.
    pub(crate) bytes: usize,
    /// Bytes allocated at the peak of a build beyond what was there before, result included, mesh
    /// not; only where the builder allocates through Rust.
    pub(crate) peak_bytes: Option<usize>,
    /// SAH cost; absent where it is not finite.
    pub(crate) sah: Option<f64>,
    /// The constants of `sah`.
    pub(crate) sah_constants: Constants,
    /// End-point overlap with the same constants; absent where it is not finite.
    pub(crate) epo: Option<f64>,
    /// Standard error of `epo`, which is estimated on large scenes; 0 where all triangles count.
    pub(crate) epo_standard_error: Option<f64>,
    /// Depth of the deepest leaf; the root has 0.
    pub(crate) depth: usize,
}

/// SAH constants.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq)]
pub(crate) struct Constants {
    /// C_I.
    pub(crate) inner: f32,
    /// C_L.
    pub(crate) leaf: f32,
    /// C_T.
    pub(crate) triangle: f32,
}

impl From<SahConstants> for Constants {
    fn from(c: SahConstants) -> Self {
        Self { inner: c.inner, leaf: c.leaf, triangle: c.triangle }
    }
}

/// How fast rays were answered.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub(crate) struct TraceRow {
    /// Position in [`Results::runs`].
    pub(crate) run: usize,
    /// The scene's name.
    pub(crate) scene: String,
    /// Triangles of the scene.
    pub(crate) triangles: usize,
    /// Whose tree.
    pub(crate) source: Source,
    /// The builder or preset of the tree.
    pub(crate) builder: String,
    /// Ours by name, or `embree` or `obvhs` where the peer traced its own structure.
    pub(crate) kernel: String,
    /// Children a node of the tree traced; absent for a peer's own structure.
    #[serde(default)]
    pub(crate) width: Option<usize>,
    /// Rays of each call: 1 where rays were asked for one by one, more for a `_batch` kernel.
    #[serde(default = "one")]
    pub(crate) rays_per_call: usize,
    /// The ray set.
    pub(crate) rays: String,
    /// `closest` or `any`.
    pub(crate) query: String,
    /// Threads.
    pub(crate) threads: usize,
    /// Rays of the set.
    pub(crate) ray_count: usize,
    /// How many of them each timed pass traced.
    pub(crate) timed_rays: usize,
    /// Timed passes.
    pub(crate) repeats: usize,
    /// Rows of a group with the same number were measured in turns. There is more than one where
    /// not all structures fit into memory at once. (Nothing to do with batches of rays.)
    pub(crate) batch: usize,
    /// Median over the passes, million rays per second.
    pub(crate) mrays_per_s: f64,
    /// Bytes of what was traced, nodes and triangles, where it is known.
    #[serde(default)]
    pub(crate) bytes: Option<usize>,
    /// Rays of the whole set that hit.
    pub(crate) hits: usize,
    /// Child boxes tested per ray, where the kernel counts.
    pub(crate) boxes_per_ray: Option<f64>,
    /// Triangles tested per ray, where the kernel counts.
    pub(crate) triangles_per_ray: Option<f64>,
}

const fn one() -> usize {
    1
}

/// Writes a file of JSON as a whole or not at all, so that an interrupt leaves the last one.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let context = || format!("cannot write {}", path.display());
    let mut json = serde_json::to_string_pretty(value)?;
    json.push('\n');
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".part");
    std::fs::write(&temporary, json).with_context(context)?;
    std::fs::rename(&temporary, path).with_context(context)
}

/// `x` unless it is NaN or infinite, which JSON has no words for.
pub(crate) fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

impl Default for Results {
    fn default() -> Self {
        Self {
            schema: SCHEMA,
            runs: Vec::new(),
            scenes: Vec::new(),
            rows: Vec::new(),
            failures: Vec::new(),
        }
    }
}

impl Results {
    /// Reads a results file; the paths of its pictures become relative to the working directory.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read results from {}", path.display()))?;
        let mut results = Self::parse(&text)
            .with_context(|| format!("{} is not a results file", path.display()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        results.map_pictures(|picture| folder.join(picture));
        Ok(results)
    }

    /// Reads results from JSON.
    pub(crate) fn parse(text: &str) -> Result<Self> {
        // The schema first, so that a file of another version is named as such rather than by
        // the first field that it lacks.
        let value: serde_json::Value = serde_json::from_str(text).context("not JSON")?;
        match value.get("schema").and_then(serde_json::Value::as_u64) {
            Some(schema) if schema == u64::from(SCHEMA) => {}
            Some(other) => bail!("its schema is {other}, but this program reads schema {SCHEMA}"),
            None => bail!("it has no `schema` number"),
        }
        let results: Self = serde_json::from_value(value)?;
        if let Some(run) = results.rows.iter().map(Row::run).find(|&r| r >= results.runs.len()) {
            bail!("a row refers to run {run}, but there are {} runs", results.runs.len());
        }
        Ok(results)
    }

    /// Writes the file and its folder, with pictures relative to it.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        let context = || format!("cannot write results to {}", path.display());
        let folder = path.parent().unwrap_or(Path::new(""));
        if !folder.as_os_str().is_empty() {
            std::fs::create_dir_all(folder).with_context(context)?;
        }
        let mut relative = self.clone();
        relative.map_pictures(|picture| relative_to(folder, picture));
        write_json(path, &relative)
    }

    /// Puts the results of several files together, in the order given.
    pub(crate) fn merge(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut whole = Self::default();
        for part in parts {
            let offset = whole.runs.len();
            whole.runs.extend(part.runs);
            whole.failures.extend(part.failures);
            whole.rows.extend(part.rows.into_iter().map(|row| row.shifted(offset)));
            for scene in part.scenes {
                whole.add_scene(scene);
            }
        }
        whole
    }

    /// Adds a scene, or completes the one of that name and size.
    pub(crate) fn add_scene(&mut self, scene: SceneInfo) {
        let known = self
            .scenes
            .iter_mut()
            .find(|known| known.name == scene.name && known.triangles == scene.triangles);
        match known {
            Some(known) => {
                known.picture = known.picture.take().or(scene.picture);
                known.heat_map = known.heat_map.take().or(scene.heat_map);
                known.credit = known.credit.take().or(scene.credit);
            }
            None => self.scenes.push(scene),
        }
    }

    /// The build rows.
    pub(crate) fn builds(&self) -> impl Iterator<Item = &BuildRow> {
        self.rows.iter().filter_map(|row| match row {
            Row::Build(row) => Some(row),
            Row::Trace(_) => None,
        })
    }

    /// The trace rows.
    pub(crate) fn traces(&self) -> impl Iterator<Item = &TraceRow> {
        self.rows.iter().filter_map(|row| match row {
            Row::Trace(row) => Some(row),
            Row::Build(_) => None,
        })
    }

    fn map_pictures(&mut self, map: impl Fn(&Path) -> PathBuf) {
        for scene in &mut self.scenes {
            if let Some(picture) = &mut scene.picture {
                *picture = map(picture);
            }
            if let Some(heat_map) = &mut scene.heat_map {
                heat_map.picture = map(&heat_map.picture);
            }
        }
    }
}

impl Row {
    /// Position in [`Results::runs`].
    pub(crate) const fn run(&self) -> usize {
        match self {
            Self::Build(row) => row.run,
            Self::Trace(row) => row.run,
        }
    }

    fn shifted(mut self, offset: usize) -> Self {
        match &mut self {
            Self::Build(row) => row.run += offset,
            Self::Trace(row) => row.run += offset,
        }
        self
    }
}

/// `path` as seen from `folder`, or absolute where it lies elsewhere.
fn relative_to(folder: &Path, path: &Path) -> PathBuf {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_path_buf());
    // An empty path is the working directory, but has no absolute form of its own.
    let folder = absolute(&Path::new(".").join(folder));
    let path = absolute(path);
    path.strip_prefix(&folder).map_or(path.clone(), Path::to_path_buf)
}

#[cfg(test)]
pub(crate) mod tests;
