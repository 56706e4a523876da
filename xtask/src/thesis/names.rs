//! Which builders and scenes of ours stand for those of the papers.

use serde::Serialize;
use std::fmt;

/// The builders that may stand for a published one, best first; they are looked up in the
/// registry when the command runs. The first that was measured is what orderings are checked with.
pub(crate) const BUILDERS: &[(&str, &[&str])] = &[
    ("SweepSAH", &["sweep"]),
    ("binSAH", &["binned", "embree:medium"]),
    ("AAC HQ", &["aac_hq"]),
    ("AAC LQ", &["aac_lq"]),
    ("Bonsai", &["bonsai"]),
    ("Bonsai P", &["bonsai_p"]),
    ("Bonsai P*", &["bonsai_p_star"]),
    ("SWEEPSAH", &["sweep"]),
    // Paper V does not repeat the settings; its SAH costs are those of Bonsai with pruning.
    ("BONSAI", &["bonsai_p"]),
    ("BINNEDSAH", &["binned", "embree:medium"]),
    ("SWEEPPRE", &["sweep_pre"]),
    ("BONSAIS", &["bonsai_s"]),
    ("BINNEDPRE", &["binned_pre"]),
    ("BINNEDS", &["sbvh", "embree:high"]),
];

/// The builders of ours that may stand for a published one; none for an unknown name.
pub(crate) fn candidates(published: &str) -> &'static [&'static str] {
    BUILDERS.iter().find(|(name, _)| *name == published).map_or(&[], |(_, ours)| *ours)
}

/// How a scene of a paper is recognised, and what stands in for it.
#[derive(Debug)]
pub(crate) struct SceneName {
    /// As the papers call it.
    pub(crate) published: &'static str,
    /// Names of files that hold it, in lower case letters and digits only, best first.
    pub(crate) files: &'static [&'static str],
    /// Names of files that hold something of its kind.
    pub(crate) akin: &'static [&'static str],
    /// The procedural scene of its kind, and what is added to the seed, so that no two stand-ins
    /// are equal.
    pub(crate) stand_in: (&'static str, u64),
}

const fn named(
    published: &'static str,
    files: &'static [&'static str],
    akin: &'static [&'static str],
    stand_in: (&'static str, u64),
) -> SceneName {
    SceneName { published, files, akin, stand_in }
}

/// All scenes of papers IV and V.
pub(crate) const SCENES: &[SceneName] = &[
    named("Arabic City", &["arabiccity", "arabic"], &[], ("city", 0)),
    named("Battlefield", &["battlefield"], &[], ("stadium", 0)),
    named("Bentley", &["bentley"], &["bmwm6"], ("dragon", 1)),
    named("Conference", &["conference", "conferenceroom"], &[], ("atrium", 1)),
    named("Crown", &["crown"], &[], ("dragon", 2)),
    named(
        "Dragon",
        &["dragon", "xyzrgbdragon", "asiandragon", "stanforddragon"],
        &[],
        ("dragon", 0),
    ),
    named("Fairy Forest", &["fairyforest", "fairy"], &[], ("foliage", 0)),
    named("Hairball", &["hairball"], &[], ("hair", 0)),
    named("Italian City", &["italiancity", "italian"], &[], ("city", 1)),
    named("Kalabsha", &["kalabsha", "kalabshatemple"], &[], ("atrium", 2)),
    named("Sala", &["sala"], &[], ("atrium", 3)),
    named("San Miguel", &["sanmiguel", "sanmiguelpartial"], &[], ("foliage", 1)),
    named("Sibenik", &["sibenik", "sibenikcathedral"], &[], ("atrium", 4)),
    named("Sponza", &["sponza", "cryteksponza", "sponzacrytek"], &[], ("atrium", 0)),
    named("Mini", &["mini", "minicooper"], &["bmwm6"], ("dragon", 3)),
    named("Power Plant", &["powerplant"], &[], ("pipes", 0)),
];

/// A scene by its published name.
#[cfg(test)]
pub(crate) fn scene(published: &str) -> Option<&'static SceneName> {
    SCENES.iter().find(|scene| scene.published == published)
}

/// How a measured scene stands for a published one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Standing {
    /// Its name, and its number of triangles within one percent of that of either paper.
    Same,
    /// Its name, but another number of triangles.
    Version,
    /// A file of another scene of its kind.
    Akin,
    /// A procedural scene of its kind.
    StandIn,
}

impl Standing {
    /// True where the scene itself was measured, if perhaps in another version.
    pub(crate) const fn is_had(self) -> bool {
        matches!(self, Self::Same | Self::Version)
    }

    /// With the number of triangles that was found; a name alone may be of any version.
    pub(crate) fn with_triangles(self, found: usize, published: &[usize]) -> Self {
        let near = |&count: &usize| found.abs_diff(count) * 100 <= count;
        if self == Self::Same && !published.iter().any(near) { Self::Version } else { self }
    }
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Same => "same",
            Self::Version => "version",
            Self::Akin => "akin",
            Self::StandIn => "stand-in",
        })
    }
}

/// A name in lower case letters and digits only.
pub(crate) fn plain(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

/// Which of some file names (without extensions) stands for a scene: its position. The scene
/// itself goes before one that is akin, and a better name before a worse.
pub(crate) fn find_file(scene: &SceneName, stems: &[String]) -> Option<(usize, Standing)> {
    let plain: Vec<_> = stems.iter().map(|stem| plain(stem)).collect();
    let among = |names: &[&str]| {
        names.iter().find_map(|name| plain.iter().position(|stem| stem.as_str() == *name))
    };
    among(scene.files)
        .map(|at| (at, Standing::Same))
        .or_else(|| among(scene.akin).map(|at| (at, Standing::Akin)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::published::Published;
    use niwaki_scene::generate;

    #[test]
    fn every_published_scene_has_a_stand_in_of_its_own() {
        let published = Published::read().unwrap();
        let names = published.all_scenes();
        assert_eq!(names.len(), SCENES.len());
        let mut stand_ins = Vec::new();
        for name in names {
            let scene = scene(name).unwrap();
            assert!(generate::NAMES.contains(&scene.stand_in.0), "{name}");
            stand_ins.push(scene.stand_in);
            for file in scene.files.iter().chain(scene.akin) {
                assert_eq!(*file, plain(file), "{name}: never matched");
            }
        }
        stand_ins.sort_unstable();
        stand_ins.dedup();
        assert_eq!(stand_ins.len(), SCENES.len());
        assert!(generate::SHAPES.iter().all(|name| stand_ins.iter().any(|s| s.0 == *name)));
    }

    #[test]
    fn files_are_recognised_by_name_and_size() {
        let stems = ["BMW_M6", "crytek-sponza", "San_Miguel (partial)", "kitchen"]
            .map(String::from)
            .to_vec();
        let find = |name: &str| find_file(scene(name).unwrap(), &stems);
        assert_eq!(find("Sponza"), Some((1, Standing::Same)));
        assert_eq!(find("San Miguel"), Some((2, Standing::Same)));
        assert_eq!(find("Mini"), Some((0, Standing::Akin)));
        assert_eq!(find("Sibenik"), None);
        let both = ["bmw_m6".to_owned(), "mini".to_owned()];
        assert_eq!(find_file(scene("Mini").unwrap(), &both), Some((1, Standing::Same)));
        assert_eq!(Standing::Same.with_triangles(262_267, &[262_266]), Standing::Same);
        assert_eq!(
            Standing::Same.with_triangles(871_414, &[7_349_988, 7_349_978]),
            Standing::Version
        );
        assert_eq!(Standing::Akin.with_triangles(10, &[10]), Standing::Akin);
    }

    #[test]
    fn builders_of_today_are_named_as_the_registry_names_them() {
        let known: Vec<_> =
            crate::registry::TreeBuilder::all().iter().map(|b| b.full_name()).collect();
        for name in ["sweep", "binned", "bonsai", "bonsai_p", "bonsai_p_star", "embree:high"] {
            assert!(known.iter().any(|k| k == name));
            assert!(BUILDERS.iter().any(|(_, ours)| ours.contains(&name)), "{name}");
        }
    }
}
