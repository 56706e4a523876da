//! Scenes by name: files, folders of files and procedural generators.

use crate::cli::parse_count;
use anyhow::{Context, Result, anyhow, bail};
use niwaki_scene::{LoadOptions, Scene, generate};
use std::path::{Path, PathBuf};

/// Where a scene comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// A file.
    File(PathBuf),
    /// A generator.
    Generated {
        /// Its name.
        name: String,
        /// About so many triangles.
        triangles: usize,
    },
}

/// A scene that can be loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SceneSpec {
    /// The name in tables.
    pub(crate) name: String,
    /// Where it comes from.
    pub(crate) origin: Origin,
}

/// The extensions that `niwaki_scene::load` reads; each may be followed by `.zst`.
const EXTENSIONS: [&str; 3] = [".obj", ".gltf", ".glb"];

impl SceneSpec {
    /// `FILE`, `NAME` or `NAME:TRIANGLES`.
    pub(crate) fn parse(text: &str, default_triangles: usize) -> Result<Self> {
        let (name, count) = match text.split_once(':') {
            Some((name, count)) => (name, Some(count)),
            None => (text, None),
        };
        if generate::NAMES.contains(&name) {
            let triangles = match count {
                Some(count) => parse_count(count)
                    .map_err(|error| anyhow!("bad size of the scene `{text}`: {error}"))?,
                None => default_triangles,
            };
            let name = name.to_owned();
            return Ok(Self { name: name.clone(), origin: Origin::Generated { name, triangles } });
        }
        let path = Path::new(text);
        if path.is_dir() {
            bail!("{text} is a folder; use --scenes {text} for all scenes below it");
        }
        if !path.is_file() {
            bail!(
                "`{text}` is neither a file nor a procedural scene; procedural are{}",
                procedural_help()
            );
        }
        Ok(Self::file(path.to_owned()))
    }

    fn file(path: PathBuf) -> Self {
        Self { name: stem(&path), origin: Origin::File(path) }
    }

    /// The procedural scenes for comparing builders and kernels.
    pub(crate) fn procedural(triangles: usize) -> Vec<Self> {
        Self::generated(generate::SHAPES, triangles)
    }

    /// Some of them.
    pub(crate) fn generated(names: &[&str], triangles: usize) -> Vec<Self> {
        let spec = |name: &&str| Self {
            name: (*name).to_owned(),
            origin: Origin::Generated { name: (*name).to_owned(), triangles },
        };
        names.iter().map(spec).collect()
    }

    /// The scenes that arguments name, each once and under a name of its own; `default` without any.
    pub(crate) fn select(
        scenes: &[String],
        folders: &[PathBuf],
        triangles: usize,
        default: impl FnOnce() -> Vec<Self>,
    ) -> Result<Vec<Self>> {
        let mut specs = Vec::new();
        for text in scenes {
            specs.push(Self::parse(text, triangles)?);
        }
        for folder in folders {
            specs.extend(Self::below(folder)?);
        }
        if specs.is_empty() {
            specs = default();
        }
        drop_repeated(&mut specs);
        make_names_unique(&mut specs);
        Ok(specs)
    }

    /// All loadable files below a folder, by path. Symbolic links to folders are not followed,
    /// since they may lead in circles.
    pub(crate) fn below(folder: &Path) -> Result<Vec<Self>> {
        let mut files = Vec::new();
        let mut folders = vec![folder.to_owned()];
        while let Some(folder) = folders.pop() {
            let context = || format!("cannot list the folder {}", folder.display());
            for entry in std::fs::read_dir(&folder).with_context(context)? {
                let entry = entry.with_context(context)?;
                let path = entry.path();
                if entry.file_type().with_context(context)?.is_dir() {
                    folders.push(path);
                } else if is_scene(&path) && path.is_file() {
                    files.push(path);
                }
            }
        }
        if files.is_empty() {
            bail!("no .obj, .gltf or .glb file lies below {}", folder.display());
        }
        files.sort();
        Ok(files.into_iter().map(Self::file).collect())
    }

    /// Loads or generates it. The scene is named like this specification.
    pub(crate) fn load(&self, seed: u64) -> Result<Scene> {
        self.load_moving(seed, 0)
    }

    /// Loads or generates it, moved by one of the file's animations.
    pub(crate) fn load_moving(&self, seed: u64, animation: usize) -> Result<Scene> {
        let options = LoadOptions { animation: Some(animation), ..LoadOptions::default() };
        let mut scene = match &self.origin {
            Origin::File(path) => niwaki_scene::load(path, &options)?,
            Origin::Generated { name, triangles } => generate::generate(name, *triangles, seed)
                .with_context(|| format!("there is no generator `{name}`"))?,
        };
        scene.name.clone_from(&self.name);
        Ok(scene)
    }

    /// File name or `generated`, for the report.
    pub(crate) fn origin_name(&self) -> String {
        match &self.origin {
            Origin::File(path) => {
                path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
            }
            Origin::Generated { .. } => "generated".into(),
        }
    }

    /// As it may be given on the command line again.
    pub(crate) fn describe(&self) -> String {
        match &self.origin {
            Origin::File(path) => path.display().to_string(),
            Origin::Generated { name, triangles } => format!("{name}:{triangles}"),
        }
    }

    /// Whose work it is: from `--credit`, or from a text file beside the scene.
    pub(crate) fn credit(&self, credits: &[String]) -> Option<String> {
        let given = |named: bool| {
            credits.iter().find_map(|credit| match credit.split_once('=') {
                Some((name, text)) if named && name == self.name => Some(text.to_owned()),
                None if !named => Some(credit.clone()),
                _ => None,
            })
        };
        given(true).or_else(|| given(false)).or_else(|| match &self.origin {
            Origin::File(path) => credit_beside(path),
            Origin::Generated { .. } => None,
        })
    }
}

/// The procedural scenes, a line each.
fn procedural_help() -> String {
    let line =
        |name: &&str| format!("\n  {name:<10} {}", generate::describe(name).unwrap_or_default());
    generate::NAMES.iter().map(line).collect()
}

/// Keeps the first of scenes that were asked for more than once.
pub(crate) fn drop_repeated(scenes: &mut Vec<SceneSpec>) {
    let mut kept: Vec<SceneSpec> = Vec::with_capacity(scenes.len());
    for scene in scenes.drain(..) {
        if !kept.contains(&scene) {
            kept.push(scene);
        }
    }
    *scenes = kept;
}

/// Gives scenes of the same name longer ones, so that rows tell them apart. Procedural scenes of
/// several sizes are told apart by their numbers of triangles.
pub(crate) fn make_names_unique(scenes: &mut [SceneSpec]) {
    for longer in [|path: &Path| with_folder(path), |path: &Path| path.display().to_string()] {
        let names: Vec<String> = scenes.iter().map(|scene| scene.name.clone()).collect();
        for scene in scenes.iter_mut() {
            if let Origin::File(path) = &scene.origin
                && names.iter().filter(|name| **name == scene.name).count() > 1
            {
                scene.name = longer(path);
            }
        }
    }
}

fn with_folder(path: &Path) -> String {
    let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
    format!("{}/{}", folder.to_string_lossy(), stem(path))
}

/// The file name in lower case without `.zst`.
fn plain_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    name.strip_suffix(".zst").unwrap_or(&name).to_owned()
}

fn is_scene(path: &Path) -> bool {
    let name = plain_name(path);
    EXTENSIONS.iter().any(|extension| name.len() > extension.len() && name.ends_with(extension))
}

/// The file name without the extensions of scenes.
pub(crate) fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plain = plain_name(path);
    let known = EXTENSIONS.iter().find_map(|extension| plain.strip_suffix(extension));
    // Lower case has the same length for the extensions that are cut off at the end, but perhaps
    // not for what comes before.
    known.and_then(|known| name.get(..known.len())).unwrap_or(&name).to_owned()
}

/// The first line of a text beside the scene that tells its author.
fn credit_beside(path: &Path) -> Option<String> {
    let folder = path.parent()?;
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let stem = stem(path);
    let mut names = vec![format!("{stem}.credit.txt"), format!("{stem}.txt")];
    // A licence of the folder tells about one scene only if there is no other.
    let scenes = std::fs::read_dir(folder)
        .map(|entries| entries.flatten().filter(|entry| is_scene(&entry.path())).count());
    if scenes.is_ok_and(|count| count == 1) {
        names.extend(["CREDIT.txt", "CREDITS.txt", "LICENSE.txt", "LICENSE"].map(String::from));
    }
    let text = names.iter().find_map(|name| std::fs::read_to_string(folder.join(name)).ok())?;
    let line = text.lines().map(str::trim).find(|line| !line.is_empty())?;
    Some(line.chars().take(300).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("niwaki-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    #[test]
    fn procedural_scenes_have_sizes() {
        let name = generate::NAMES[0];
        let spec = SceneSpec::parse(&format!("{name}:25k"), 7).unwrap();
        assert_eq!(spec.origin, Origin::Generated { name: name.into(), triangles: 25_000 });
        let spec = SceneSpec::parse(name, 7).unwrap();
        assert_eq!(spec.origin, Origin::Generated { name: name.into(), triangles: 7 });
        assert!(SceneSpec::parse(&format!("{name}:x"), 7).is_err());
    }

    #[test]
    fn what_is_no_scene_is_named() {
        let error = SceneSpec::parse("no/such.glb", 7).unwrap_err().to_string();
        assert!(error.contains("no/such.glb") && error.contains(generate::NAMES[0]), "{error}");
        let folder = folder("empty");
        let error = SceneSpec::parse(&folder.display().to_string(), 7).unwrap_err().to_string();
        assert!(error.contains("--scenes"), "{error}");
        let error = SceneSpec::below(&folder).unwrap_err().to_string();
        assert!(error.contains("no .obj"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn folders_are_searched_and_names_made_unique() {
        let root = folder("tree");
        for file in ["a/scene.gltf", "b/scene.glb", "c.OBJ", "d.glb.zst", "e.png", "f/deep/g.obj"] {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let mut scenes = SceneSpec::below(&root).unwrap();
        make_names_unique(&mut scenes);
        let names: Vec<_> = scenes.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["a/scene", "b/scene", "c", "d", "g"]);
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn credits_come_from_the_command_line_or_a_text() {
        let root = folder("credit");
        let scene = root.join("a.glb");
        std::fs::write(&scene, "").unwrap();
        let spec = SceneSpec::file(scene);
        assert_eq!(spec.credit(&[]), None);
        std::fs::write(root.join("LICENSE.txt"), "\n A. Person, CC BY 4.0 \nmore").unwrap();
        assert_eq!(spec.credit(&[]).as_deref(), Some("A. Person, CC BY 4.0"));
        let credits = ["all of us".to_owned(), "b=them".into(), "a=her".into()];
        assert_eq!(spec.credit(&credits).as_deref(), Some("her"));
        assert_eq!(spec.credit(&credits[..2]).as_deref(), Some("all of us"));
        // With a second scene the folder's licence may be of either.
        std::fs::write(root.join("b.glb"), "").unwrap();
        assert_eq!(spec.credit(&[]), None);
        std::fs::remove_dir_all(root).unwrap();
    }
}
