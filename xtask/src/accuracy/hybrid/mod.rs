//! `cargo xtask accuracy --suite hybrid`: what the hybrid renderer's approximations save in time
//! and cost in error (thesis, paper III).

mod artifact;
mod measure;
mod page;
mod plots;
mod study;
mod sweep;

use super::conclude;
use crate::bench::pool;
use crate::bench::progress::Progress;
use crate::cli::AccuracyArgs;
use crate::machine;
use crate::render::Size;
use crate::report::slug;
use crate::results::Failure;
use crate::scenes::SceneSpec;
use anyhow::{Context, Result};
use artifact::{Artifact, remedies};
use measure::Effort;
use niwaki_hybrid::Gpu;
use std::process::ExitCode;
use std::sync::Arc;
use study::{SceneStudy, Study};
use sweep::Sweep;

/// Scenes that call for reflections and refractions in different ways.
const SCENES: [&str; 5] = ["chess", "gallery", "atrium", "courtyard", "one_mirror"];
/// Triangles of procedural scenes that are named without a number: all figures of `chess`.
const TRIANGLES: usize = 60_000;

/// Runs the suite.
pub(super) fn run(args: &AccuracyArgs) -> Result<ExitCode> {
    let quick = args.quick;
    let sweep = Sweep::select(&args.families, quick)?;
    let triangles = if quick { 2_000 } else { TRIANGLES };
    let specs = SceneSpec::select(&args.scenes, &args.folders, triangles, || {
        SceneSpec::generated(if quick { &SCENES[1..2] } else { &SCENES }, triangles)
    })?;
    let size = args.size.unwrap_or(if quick {
        Size { width: 96, height: 54 }
    } else {
        Size { width: 320, height: 180 }
    });
    let effort = Effort {
        size,
        frames: args.frames.unwrap_or(if quick { 1 } else { 3 }),
        draws: if quick { 1 } else { 3 },
        tile: (size.width.min(size.height) / 5).max(8),
    };
    let gpu = Gpu::new().context(
        "the suite `hybrid` draws on a Vulkan device (ci/setup-vulkan.sh installs a software one \
         on Debian)",
    )?;
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    let mut run = machine::describe();
    run.threads = vec![threads];
    run.arguments = std::env::args().skip(2).collect();
    let progress = Progress::new(specs.len() * effort.steps(&sweep));
    let pool = pool(threads)?;
    let (mut scenes, mut failures) = (Vec::new(), Vec::new());
    for spec in &specs {
        progress.message(&format!("{}: load", spec.name));
        let measured = pool.install(|| one(args, &gpu, spec, &sweep, effort, &progress));
        match measured {
            Ok((scene, failed)) => {
                scenes.push(scene);
                failures.extend(failed);
            }
            Err(error) => {
                failures.push(Failure { scene: spec.describe(), error: format!("{error:#}") });
            }
        }
    }
    progress.finish();
    let failed = !failures.is_empty();
    let device = (gpu.name().to_owned(), gpu.has_timestamps());
    let study = Study::of(run, device, size, scenes, failures);
    finish(args, &study, &sweep)?;
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Measures a scene and writes its pictures; also says which settings failed.
fn one(
    args: &AccuracyArgs,
    gpu: &Gpu,
    spec: &SceneSpec,
    sweep: &Sweep,
    effort: Effort,
    progress: &Progress,
) -> Result<(SceneStudy, Vec<Failure>)> {
    let scene = Arc::new(spec.load(args.seed)?);
    let measured = measure::scene(gpu, &scene, sweep, effort, progress)?;
    let points = study::points(sweep, &measured);
    let (at, tile) = measured.worst;
    let flip = points.first().and_then(|point| point.tile).context("the default failed")?;
    let (best, cheap) = remedies(&points, flip);
    let mut artifact = Artifact {
        frame: measured.frames[at],
        tile: [tile.x, tile.y, tile.width, tile.height],
        flip,
        best,
        cheap,
        pictures: Vec::new(),
    };
    artifact.save(&measured.panels, &slug(&scene.name), &args.out)?;
    let failure = |(setup, error): (usize, String)| Failure {
        scene: format!("{}, {}", spec.describe(), sweep.setups[setup].name),
        error,
    };
    let failures = measured.failures.into_iter().map(failure).collect();
    let study = SceneStudy {
        scene: scene.name.clone(),
        triangles: scene.mesh.len(),
        frames: measured.frames,
        points,
        artifact,
    };
    Ok((study, failures))
}

/// Prints and writes everything.
fn finish(args: &AccuracyArgs, study: &Study, sweep: &Sweep) -> Result<()> {
    for scene in &study.scenes {
        let triangles = scene.triangles;
        println!(
            "\n{}, {triangles} triangles: presets, and what nothing beats in both",
            scene.scene
        );
        println!("{}", scene.front_table().to_text());
    }
    let summary = study.summary_table(sweep);
    if !summary.is_empty() {
        println!(
            "\nSettings: geometric means over scenes; * is the default\n{}",
            summary.to_text()
        );
        println!("\nWorst artifacts at the default\n{}", study.artifact_table().to_text());
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    let page = page::write(study, sweep, &args.out)?;
    let note = format!("{}x{} pixels on {}", study.width, study.height, study.device);
    conclude(args, study, &study.failures, &page, &note)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;

    fn args(more: &[&str]) -> AccuracyArgs {
        let first = ["xtask", "accuracy", "--suite", "hybrid"];
        let cli = Cli::try_parse_from([&first, more].concat()).unwrap();
        let Command::Accuracy(args) = cli.command else { panic!("not accuracy") };
        args
    }

    #[test]
    fn a_small_run_leaves_a_report_with_pictures() {
        if !crate::testing::is_there(Gpu::new()) {
            return;
        }
        let out = std::env::temp_dir().join(format!("niwaki-hybrid-{}", std::process::id()));
        let folder = out.display().to_string();
        // A knob that needs no other kernels than the default, as compiling them takes seconds.
        let what = ["--quick", "--families", "thickness", "--size", "48x27", "--threads", "2"];
        run(&args(&[&what[..], &["--out", &folder]].concat())).unwrap();
        let json = std::fs::read_to_string(out.join("accuracy.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let scene = &json["scenes"][0];
        let points = scene["points"].as_array().unwrap();
        let setups: Vec<&str> = points.iter().map(|p| p["setup"].as_str().unwrap()).collect();
        assert_eq!(setups, ["default", "thickness 0", "thickness 4"]);
        for point in points {
            let (flip, ms) = (point["flip"].as_f64().unwrap(), point["ms"].as_f64().unwrap());
            assert!((0.0..0.5).contains(&flip) && ms > 0.0, "{point}");
            assert!(point["tile"].as_f64().unwrap() >= 0.0, "{point}");
        }
        assert_eq!(points[0]["relative"].as_f64(), Some(1.0));
        assert!(points.iter().any(|point| point["on_front"] == true));
        let pictures = scene["artifact"]["pictures"].as_array().unwrap();
        assert!(pictures.len() >= 5, "the frame and four crops at the default");
        for picture in pictures {
            assert!(out.join(picture["file"].as_str().unwrap()).is_file(), "{picture}");
        }
        let page = std::fs::read_to_string(out.join("accuracy.html")).unwrap();
        assert_eq!(page.matches("data:image/png;base64,").count(), pictures.len());
        assert!(out.join("csv/hybrid-settings.csv").is_file());
        std::fs::remove_dir_all(out).unwrap();
    }

    #[test]
    fn wrong_arguments_are_named_before_anything_is_drawn() {
        let refused = |more: &[&str]| format!("{:#}", run(&args(more)).unwrap_err());
        assert!(refused(&["--families", "regions"]).contains("`regions`"));
        assert!(refused(&["--scene", "no/such.glb"]).contains("no/such.glb"));
        let other = ["xtask", "accuracy", "--size", "64x36"];
        let Command::Accuracy(other) = Cli::try_parse_from(other).unwrap().command else {
            panic!("not accuracy")
        };
        let error = crate::accuracy::run(&other).unwrap_err().to_string();
        assert!(error.contains("--size") && error.contains("hybrid"), "{error}");
    }
}
