//! All builders by name: ours, and those of peers.

use crate::results::Source;
use anyhow::{Context, Result, bail};
pub(crate) use niwaki_checks::builders as ours;
use niwaki_core::{Builder, Bvh, Intersector, TriangleMesh};
use niwaki_peers::{Embree, EmbreeScene, ObvhsKernel, ObvhsPreset, ObvhsScene, Quality};
use std::time::{Duration, Instant};

/// A builder of ours or of a peer.
pub(crate) enum TreeBuilder {
    /// One of ours.
    Ours(Box<dyn Builder>),
    /// A preset of obvhs.
    Obvhs(ObvhsPreset),
    /// A build quality of Embree.
    Embree(Quality),
}

/// A binary tree, and how long it took from the mesh.
pub(crate) struct TimedTree {
    /// The tree in our layout.
    pub(crate) bvh: Bvh,
    /// The builder's own time, without conversion to our layout.
    pub(crate) time: Duration,
}

/// A peer's own structure.
pub(crate) struct OwnScene {
    /// What answers rays.
    pub(crate) scene: Box<dyn Intersector + Send>,
    /// From the mesh to there.
    pub(crate) time: Duration,
    /// Bytes of its tree and triangles.
    pub(crate) bytes: usize,
}

impl TreeBuilder {
    /// All, in the order of tables.
    pub(crate) fn all() -> Vec<Self> {
        ours()
            .into_iter()
            .map(Self::Ours)
            .chain(ObvhsPreset::ALL.map(Self::Obvhs))
            .chain(Quality::ALL.map(Self::Embree))
            .collect()
    }

    /// Whose it is.
    pub(crate) const fn source(&self) -> Source {
        match self {
            Self::Ours(_) => Source::Niwaki,
            Self::Obvhs(_) => Source::Obvhs,
            Self::Embree(_) => Source::Embree,
        }
    }

    /// The builder's or preset's name.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Ours(builder) => builder.name(),
            Self::Obvhs(preset) => preset.name(),
            Self::Embree(quality) => quality.name(),
        }
    }

    /// The unambiguous name: `bonsai_p`, `embree:medium`.
    pub(crate) fn full_name(&self) -> String {
        match self {
            Self::Ours(builder) => builder.name().to_owned(),
            _ => format!("{}:{}", self.source().name(), self.name()),
        }
    }

    /// Builds a binary tree on the current rayon pool (Embree: on the threads of its device).
    pub(crate) fn build(&self, mesh: &TriangleMesh, embree: Option<&Embree>) -> Result<TimedTree> {
        match self {
            Self::Ours(builder) => {
                let start = Instant::now();
                let bvh = builder.build_mesh(mesh)?;
                Ok(TimedTree { bvh, time: start.elapsed() })
            }
            Self::Obvhs(preset) => {
                let build = preset.build(mesh)?;
                Ok(TimedTree { bvh: build.bvh, time: build.build })
            }
            Self::Embree(quality) => {
                let build = embree.context("Embree is not loaded")?.build_bvh(*quality, mesh)?;
                Ok(TimedTree { bvh: build.bvh, time: build.build })
            }
        }
    }

    /// A peer's own structure for its own kernel, Embree's for its robust mode if `robust`;
    /// nothing for a builder of ours.
    pub(crate) fn own_scene(
        &self,
        mesh: &TriangleMesh,
        embree: Option<&Embree>,
        robust: bool,
    ) -> Result<Option<OwnScene>> {
        match self {
            Self::Ours(_) => Ok(None),
            Self::Obvhs(preset) => {
                let scene = ObvhsScene::new(mesh, *preset, ObvhsKernel::CwBvh)?;
                let (time, bytes) = (scene.build_time(), scene.bytes());
                Ok(Some(OwnScene { scene: Box::new(scene), time, bytes }))
            }
            Self::Embree(quality) => {
                let embree = embree.context("Embree is not loaded")?;
                let scene = EmbreeScene::new(embree, mesh, *quality, robust)?;
                let (time, bytes) = (scene.commit_time(), scene.bytes());
                Ok(Some(OwnScene { scene: Box::new(scene), time, bytes }))
            }
        }
    }
}

/// The builders that a list of names and groups selects, each once, in the order of tables.
pub(crate) fn select(names: &[String]) -> Result<Vec<TreeBuilder>> {
    const DEFAULT: [&str; 8] = [
        "sweep",
        "binned",
        "lbvh",
        "bonsai",
        "bonsai_p",
        "bonsai_p_star",
        "embree:medium",
        "obvhs:medium",
    ];
    let names: Vec<&str> = if names.is_empty() {
        DEFAULT.to_vec()
    } else {
        names.iter().map(|name| name.trim()).filter(|name| !name.is_empty()).collect()
    };
    let selects = |name: &str, builder: &TreeBuilder| {
        name == "all"
            || name == builder.source().name()
            || name == builder.full_name()
            || name == format!("{}:{}", builder.source().name(), builder.name())
            || name == builder.name()
    };
    let all = TreeBuilder::all();
    for name in &names {
        if !all.iter().any(|builder| selects(name, builder)) {
            let known: Vec<_> = all.iter().map(TreeBuilder::full_name).collect();
            bail!(
                "`{name}` is no builder; known are {}, and the groups niwaki, embree, obvhs, all",
                known.join(", ")
            );
        }
    }
    Ok(all.into_iter().filter(|builder| names.iter().any(|name| selects(name, builder))).collect())
}

/// The one builder that a name means, as `option` of the command line has it: where a name is ours
/// and a peer's, ours.
pub(crate) fn one(option: &str, name: &str) -> Result<TreeBuilder> {
    let mut builders = select(&[name.to_owned()])?;
    if builders.len() > 1 {
        let is_ours = |b: &TreeBuilder| b.source() == Source::Niwaki && b.name() == name;
        match builders.iter().position(is_ours) {
            Some(ours) => return Ok(builders.swap_remove(ours)),
            None => {
                let names: Vec<_> = builders.iter().map(TreeBuilder::full_name).collect();
                bail!("{option} takes one, but `{name}` is {}", names.join(", "));
            }
        }
    }
    builders.pop().with_context(|| format!("{option} names none"))
}

/// [`one`] of ours.
pub(crate) fn one_of_ours(option: &str, name: &str) -> Result<Box<dyn Builder>> {
    match one(option, name)? {
        TreeBuilder::Ours(builder) => Ok(builder),
        peer => bail!("{option} takes one of ours, but {} is a peer's", peer.full_name()),
    }
}

/// The builders of ours that the names select; all without names.
pub(crate) fn select_ours(names: &[String]) -> Result<Vec<Box<dyn Builder>>> {
    if names.is_empty() {
        return Ok(ours());
    }
    let selected: Vec<_> = select(names)?
        .into_iter()
        .filter_map(|builder| match builder {
            TreeBuilder::Ours(builder) => Some(builder),
            _ => None,
        })
        .collect();
    if selected.is_empty() {
        bail!("none of {} is a builder of ours; peers take part by themselves", names.join(", "));
    }
    Ok(selected)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        let list: Vec<_> = list.iter().map(ToString::to_string).collect();
        select(&list).unwrap().iter().map(TreeBuilder::full_name).collect()
    }

    #[test]
    fn our_builders_have_their_published_names() {
        let names: Vec<_> = ours().iter().map(|b| b.name().to_owned()).collect();
        let expected = [
            "sweep",
            "binned",
            "lbvh",
            "hlbvh",
            "ploc",
            "aac_lq",
            "aac_hq",
            "median_object",
            "median_spatial",
            "bonsai",
            "bonsai_p",
            "bonsai_p_star",
            "bonsai_s",
            "sweep_pre",
            "binned_pre",
            "sweep_esc",
            "sweep_evh",
            "sweep_ka",
            "sbvh",
            "sbvh_sweep",
            "fastest",
            "fast",
            "balanced",
            "high",
            "best",
        ];
        assert_eq!(names, expected);
    }

    #[test]
    fn names_and_groups_select() {
        assert_eq!(names(&["bonsai_p", "sweep"]), ["sweep", "bonsai_p"]);
        assert_eq!(names(&["embree"]), ["embree:low", "embree:medium", "embree:high"]);
        assert_eq!(names(&["medium"]), ["obvhs:medium", "embree:medium"]);
        assert_eq!(names(&["embree:medium", "embree:medium"]), ["embree:medium"]);
        assert_eq!(names(&["niwaki:high", "niwaki:fastest"]), ["fastest", "high"]);
        assert_eq!(names(&["all"]).len(), ours().len() + 6 + 3);
        assert_eq!(names(&[]).len(), 6 + 2);
        let one =
            |name: &str| one("--builder", name).map(|b| b.full_name()).map_err(|e| e.to_string());
        assert_eq!(one("fast").unwrap(), "fast");
        assert_eq!(one("obvhs:fast").unwrap(), "obvhs:fast");
        assert!(one("medium").unwrap_err().contains("takes one"));
        assert!(one_of_ours("--builder", "fast").is_ok());
        let error = one_of_ours("--builder", "obvhs:fast").err().unwrap().to_string();
        assert!(error.contains("one of ours") && error.contains("obvhs:fast"), "{error}");
        let error = select(&["bonzai".into()]).err().unwrap().to_string();
        assert!(error.contains("bonzai") && error.contains("bonsai_p_star"), "{error}");
    }
}
