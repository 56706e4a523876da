//! `cargo xtask verify`: every builder × kernel against brute force and peers, with an exact
//! arbiter.

mod full;
mod hard;
mod ledger;
mod print;
mod trees;

use crate::{cli::VerifyArgs, registry, scenes::SceneSpec};
use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use ledger::Ledger;
use niwaki_peers::{Embree, ObvhsPreset};
use std::process::ExitCode;

/// Sizes of a run.
struct Options {
    rays: usize,
    hard_rays: usize,
    /// Triangle tests that brute force may spend on a hard case; a tree over triangles that are all in
    /// one place spends as many, for every builder and kernel.
    hard_tests: usize,
    /// Numbers of threads on which every builder has to give the same bytes.
    threads: &'static [usize],
    seed: u64,
    quick: bool,
}

impl Options {
    /// The presets of obvhs whose trees are checked: those that take minutes only when asked for
    /// a full run.
    fn obvhs_presets(&self) -> &'static [ObvhsPreset] {
        if self.quick {
            &[ObvhsPreset::Medium]
        } else {
            &[ObvhsPreset::Fastest, ObvhsPreset::Medium]
        }
    }
}

/// Runs the command.
///
/// # Errors
/// If a scene cannot be loaded, a file cannot be written, or anything counts against us.
pub(crate) fn run(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let builders = registry::select_ours(&args.builders)?;
    let options = Options {
        rays: args.rays.unwrap_or(if args.quick { 50_000 } else { 1_000_000 }),
        hard_rays: if args.quick { 40 } else { 400 },
        hard_tests: if args.quick { 8_000_000 } else { 40_000_000 },
        threads: if args.quick { &[1, 3] } else { &[1, 2, 3, 8] },
        seed: args.seed,
        quick: args.quick,
    };
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    let embree = match Embree::load() {
        Ok(embree) => {
            println!("Embree {} from {}", embree.version(), embree.library());
            Some(embree)
        }
        Err(error) if std::env::var_os("NIWAKI_REQUIRE_EMBREE").is_some() => {
            return Err(error).context("NIWAKI_REQUIRE_EMBREE is set, but there is no Embree");
        }
        Err(error) => {
            println!("Without Embree: {error}");
            None
        }
    };
    let mut ledger = Ledger { schema: 1, ..Ledger::default() };
    let bar = ProgressBar::new_spinner().with_style(
        ProgressStyle::with_template("{spinner} {elapsed_precise} {prefix}: {msg}")
            .context("progress style")?,
    );
    bar.enable_steady_tick(std::time::Duration::from_millis(200));

    if !args.no_hard_cases {
        bar.set_prefix("hard cases");
        hard::run(&options, &builders, &mut ledger, |what| bar.set_message(what.to_owned()))?;
    }
    let sources = scenes(args)?;
    let mut unloadable = Vec::new();
    for source in &sources {
        bar.set_prefix(source.name.clone());
        bar.set_message("loading");
        let scene = match source.load(args.seed) {
            Ok(scene) if scene.mesh.is_empty() => {
                let what = &scene.dropped;
                bar.suspend(|| eprintln!("{}: no triangles to verify. {what}", source.name));
                unloadable.push(source.name.clone());
                continue;
            }
            Ok(scene) => {
                if !scene.dropped.is_empty() {
                    bar.suspend(|| println!("{}: {}", source.name, scene.dropped));
                }
                scene
            }
            Err(error) => {
                bar.suspend(|| eprintln!("{}: {error:#}", source.name.as_str()));
                unloadable.push(source.name.clone());
                continue;
            }
        };
        full::run(
            &source.name,
            &scene,
            &options,
            &builders,
            embree.as_ref(),
            &mut ledger,
            |what| bar.set_message(what.to_owned()),
        )?;
    }
    bar.finish_and_clear();

    print::tables(&ledger);
    let path = args.out.join("verify.json");
    std::fs::write(&path, serde_json::to_vec_pretty(&ledger)?)
        .with_context(|| format!("cannot write {}", path.display()))?;
    println!("\nEvery row: {}", path.display());
    if !unloadable.is_empty() {
        eprintln!("could not load: {}", unloadable.join(", "));
    }
    if !ledger.culprits.is_empty() {
        println!("{} findings count against us.", ledger.culprits.len());
        return Ok(ExitCode::FAILURE);
    }
    println!("Nothing counts against us.");
    Ok(if unloadable.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The scenes that the arguments select; the procedural ones without.
fn scenes(args: &VerifyArgs) -> anyhow::Result<Vec<SceneSpec>> {
    // Over 262,144, builders partition in parallel; a quick run leaves that to their own tests.
    let triangles = if args.quick { 20_000 } else { 300_000 };
    SceneSpec::select(&args.scenes, &args.folders, triangles, || SceneSpec::procedural(triangles))
}
