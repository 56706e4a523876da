//! What is measured for which published scene.

use super::args::ThesisArgs;
use super::names::{SCENES, SceneName, Standing, find_file, plain};
use super::published::Published;
use crate::scenes::{Origin, SceneSpec, drop_repeated, stem};
use anyhow::{Error, Result, bail};

/// A scene to measure.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) spec: SceneSpec,
    pub(crate) seed: u64,
    /// The published scenes that it stands for; several only where one file is akin to them all.
    pub(crate) stands_for: Vec<(&'static SceneName, Standing)>,
}

/// What the arguments come to.
#[derive(Debug, Default)]
pub(crate) struct Plans {
    /// In the order of the papers.
    pub(crate) plans: Vec<Plan>,
    /// Given files that stand for no scene of the papers.
    pub(crate) unused: Vec<String>,
    /// What was asked for and cannot be found.
    pub(crate) failures: Vec<(String, Error)>,
}

/// The published scenes that `--only` selects; all without it.
fn selected(only: &[String]) -> Result<Vec<&'static SceneName>> {
    for name in only {
        if !SCENES.iter().any(|scene| plain(scene.published) == plain(name)) {
            let known: Vec<_> = SCENES.iter().map(|scene| scene.published).collect();
            bail!("`{name}` is no scene of papers IV and V; they have {}", known.join(", "));
        }
    }
    let is_asked = |scene: &&SceneName| {
        only.is_empty() || only.iter().any(|name| plain(name) == plain(scene.published))
    };
    Ok(SCENES.iter().filter(is_asked).collect())
}

/// Finds a file or a stand-in for each published scene.
pub(crate) fn plan(args: &ThesisArgs, published: &Published) -> Result<Plans> {
    let most = args.triangles();
    let mut plans = Plans::default();
    let mut given = Vec::new();
    for text in &args.scenes {
        match SceneSpec::parse(text, most) {
            Ok(spec) => given.push(spec),
            Err(error) => plans.failures.push((text.clone(), error)),
        }
    }
    for folder in &args.folders {
        match SceneSpec::below(folder) {
            Ok(found) => given.extend(found),
            Err(error) => plans.failures.push((folder.display().to_string(), error)),
        }
    }
    drop_repeated(&mut given);
    let (files, generated): (Vec<_>, Vec<_>) =
        given.into_iter().partition(|spec| matches!(spec.origin, Origin::File(_)));
    let stems: Vec<String> = files
        .iter()
        .map(|spec| match &spec.origin {
            Origin::File(path) => stem(path),
            Origin::Generated { name, .. } => name.clone(),
        })
        .collect();
    let mut used = vec![false; files.len()];
    for scene in SCENES {
        // Marked also where it is not selected, so that it is not called unknown.
        let found = find_file(scene, &stems);
        if let Some((at, _)) = found {
            used[at] = true;
        }
        if !selected(&args.only)?.iter().any(|asked| asked.published == scene.published) {
            continue;
        }
        if let Some((at, standing)) = found {
            add(&mut plans.plans, files[at].clone(), args.seed, scene, standing);
        } else if !args.no_stand_ins {
            let (generator, shift) = scene.stand_in;
            let size = published.sizes(scene.published).into_iter().max().unwrap_or(most);
            // A size that was asked for holds for all stand-ins of that kind.
            let asked = generated.iter().find_map(|spec| match &spec.origin {
                Origin::Generated { name, triangles } if name == generator => Some(*triangles),
                _ => None,
            });
            let triangles = asked.unwrap_or_else(|| size.min(most));
            let name = format!("{generator}/{shift}");
            let origin = Origin::Generated { name: generator.to_owned(), triangles };
            let seed = args.seed.wrapping_add(shift);
            add(&mut plans.plans, SceneSpec { name, origin }, seed, scene, Standing::StandIn);
        }
    }
    plans.unused =
        files.iter().zip(used).filter(|(_, used)| !used).map(|(f, _)| f.describe()).collect();
    Ok(plans)
}

fn add(
    plans: &mut Vec<Plan>,
    spec: SceneSpec,
    seed: u64,
    scene: &'static SceneName,
    standing: Standing,
) {
    match plans.iter_mut().find(|plan| plan.spec == spec) {
        Some(plan) => plan.stands_for.push((scene, standing)),
        None => plans.push(Plan { spec, seed, stands_for: vec![(scene, standing)] }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plans(args: &ThesisArgs) -> Plans {
        plan(args, &Published::read().unwrap()).unwrap()
    }

    #[test]
    fn without_files_every_scene_has_a_procedural_stand_in() {
        let plans = plans(&ThesisArgs::default());
        assert_eq!(plans.plans.len(), SCENES.len());
        let mut names: Vec<_> = plans.plans.iter().map(|p| p.spec.name.clone()).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), SCENES.len(), "rows must tell scenes apart");
        for plan in &plans.plans {
            assert_eq!(plan.stands_for.len(), 1);
            assert_eq!(plan.stands_for[0].1, Standing::StandIn);
            let Origin::Generated { triangles, .. } = plan.spec.origin else { panic!("a file") };
            // No more triangles than the scene itself has.
            let most =
                if plan.stands_for[0].0.published == "Battlefield" { 64_256 } else { 200_000 };
            assert!(triangles <= most, "{plan:?}");
        }
    }

    #[test]
    fn files_replace_stand_ins_and_unknown_ones_are_named() {
        let root = std::env::temp_dir().join(format!("niwaki-thesis-plan-{}", std::process::id()));
        std::fs::create_dir_all(&root).unwrap();
        for file in ["Sponza.obj", "bmw_m6.glb", "kitchen.glb"] {
            std::fs::write(root.join(file), "").unwrap();
        }
        let mut args = ThesisArgs {
            scenes: vec!["pipes:300".into(), "nothing.glb".into()],
            folders: vec![root.clone()],
            ..ThesisArgs::default()
        };
        let found = plans(&args);
        let of = |name: &str| {
            let stands = |p: &&Plan| p.stands_for.iter().any(|(s, _)| s.published == name);
            found.plans.iter().find(stands).unwrap()
        };
        assert_eq!(of("Sponza").spec.name, "Sponza");
        assert_eq!(of("Mini").stands_for.len(), 2, "one car stands for both");
        assert_eq!(of("Power Plant").spec.describe(), "pipes:300");
        assert_eq!(found.plans.len(), SCENES.len() - 1);
        assert!(found.unused.len() == 1 && found.unused[0].contains("kitchen"));
        assert!(found.failures.len() == 1 && found.failures[0].0 == "nothing.glb");
        args.no_stand_ins = true;
        assert_eq!(plans(&args).plans.len(), 2);
        args.only = vec!["sponza".into(), "SAN MIGUEL".into()];
        assert_eq!(plans(&args).plans.len(), 1);
        args.only = vec!["kitchen".into()];
        let error = plan(&args, &Published::read().unwrap()).unwrap_err().to_string();
        assert!(error.contains("kitchen") && error.contains("San Miguel"), "{error}");
        std::fs::remove_dir_all(root).unwrap();
    }
}
