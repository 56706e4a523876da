//! `cargo xtask accuracy --suite shadows`: error of shadows against exact ones by rays, over map
//! resolution, filter and bias, with the time on the GPU.

mod measure;
mod page;
mod sweep;

use crate::bench::pool;
use crate::bench::progress::Progress;
use crate::cli::AccuracyArgs;
use crate::machine;
use crate::render::Size;
use crate::report::pareto_front;
use crate::results::{Failure, Run};
use crate::scenes::SceneSpec;
use anyhow::{Context, Result};
use measure::{LIGHTS, Measured, Point, RADIUS};
use niwaki_raster::{Algorithm, Gpu};
use niwaki_render::{Image, ToneCurve};
use serde::Serialize;
use std::process::ExitCode;

/// The two of the case studies.
const SCENES: [&str; 2] = ["serpents", "tessellated"];

/// A scene with its points and pictures.
#[derive(Clone, Debug, Serialize)]
struct SceneStudy {
    scene: String,
    triangles: usize,
    points: Vec<Point>,
    /// Files of the first view by each algorithm, in the output folder.
    pictures: Vec<(String, String)>,
}

/// Everything that a run found.
#[derive(Clone, Debug, Serialize)]
struct Study {
    /// Version of this file's layout.
    schema: u32,
    suite: &'static str,
    run: Run,
    device: String,
    /// Times are the device's own; else the host's.
    device_times: bool,
    width: u32,
    height: u32,
    frames: u32,
    lights: usize,
    /// Radius of silhouette pixels, in pixels.
    silhouette_radius: f64,
    scenes: Vec<SceneStudy>,
    failures: Vec<Failure>,
}

/// Runs the suite.
pub(super) fn run(args: &AccuracyArgs) -> Result<ExitCode> {
    let quick = args.quick;
    let triangles = if quick { 5_000 } else { 100_000 };
    let specs = SceneSpec::select(&args.scenes, &args.folders, triangles, || {
        SceneSpec::generated(if quick { &SCENES[1..] } else { &SCENES }, triangles)
    })?;
    let (width, height) = if quick { (96, 54) } else { (320, 180) };
    let size = args.size.unwrap_or(Size { width, height });
    let frames = args.frames.unwrap_or(if quick { 1 } else { 3 });
    let setups = sweep::setups(&args.families, [size.width, size.height], quick)?;
    let gpu = Gpu::new().context(
        "the suite `shadows` draws on a Vulkan device (ci/setup-vulkan.sh installs a software one \
         on Debian)",
    )?;
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    let mut run = machine::describe();
    run.threads = vec![threads];
    run.arguments = std::env::args().skip(2).collect();
    let progress = Progress::new(specs.len() * measure::steps(setups.len(), frames));
    let pool = pool(threads)?;
    let (mut scenes, mut failures) = (Vec::new(), Vec::new());
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    for spec in &specs {
        progress.message(&format!("{}: load", spec.name));
        let measured = pool.install(|| {
            let scene = spec.load(args.seed)?;
            measure::scene(&gpu, scene, &setups, size, frames, &progress)
        });
        match measured.and_then(|m| gather(args, &spec.name, m)) {
            Ok((scene, errors)) => {
                scenes.push(scene);
                failures.extend(errors);
            }
            Err(error) => {
                failures.push(Failure { scene: spec.describe(), error: format!("{error:#}") });
            }
        }
    }
    progress.finish();
    let study = Study {
        schema: 1,
        suite: "shadows",
        run,
        device: gpu.name().to_owned(),
        device_times: gpu.has_timestamps(),
        width: size.width,
        height: size.height,
        frames,
        lights: LIGHTS,
        silhouette_radius: RADIUS,
        scenes,
        failures,
    };
    finish(args, &study)?;
    Ok(if study.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Points with the front, pictures as files, and what failed.
fn gather(
    args: &AccuracyArgs,
    name: &str,
    measured: Measured,
) -> Result<(SceneStudy, Vec<Failure>)> {
    let Measured { points, pictures, triangles } = measured;
    let (mut found, mut failures) = (Vec::new(), Vec::new());
    for point in points {
        match point {
            Ok(point) => found.push(point),
            Err(error) => failures.push(Failure { scene: name.to_owned(), error }),
        }
    }
    let costs: Vec<(f64, f64)> = found.iter().map(|p| (p.mean, p.ms)).collect();
    for (point, on_front) in found.iter_mut().zip(pareto_front(&costs)) {
        point.on_front = on_front;
    }
    let save = |(algorithm, image): &(Algorithm, Image)| -> Result<(String, String)> {
        let short = algorithm.short().to_lowercase();
        let file = format!("pictures/{}-{short}.png", crate::report::slug(name));
        let path = args.out.join(&file);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot create {}", folder.display()))?;
        }
        image.save_png(&path, &ToneCurve::default())?;
        Ok((algorithm.name().to_owned(), file))
    };
    let pictures = pictures.iter().map(save).collect::<Result<_>>()?;
    let scene = SceneStudy { scene: name.to_owned(), triangles, points: found, pictures };
    Ok((scene, failures))
}

/// Prints and writes everything.
fn finish(args: &AccuracyArgs, study: &Study) -> Result<()> {
    for scene in &study.scenes {
        println!("\n{}, {} triangles", scene.scene, scene.triangles);
        println!("{}", page::table(scene).to_text());
    }
    let page = page::write(study, &args.out)?;
    let json = args.out.join("accuracy.json");
    let mut text = serde_json::to_string_pretty(study)?;
    text.push('\n');
    std::fs::write(&json, text).with_context(|| format!("cannot write {}", json.display()))?;
    for failure in &study.failures {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    println!("{}x{} pixels on {}", study.width, study.height, study.device);
    println!("results {}\nreport  {}", json.display(), page.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;

    #[test]
    fn a_small_run_leaves_a_report_in_which_shadow_volumes_are_exact() {
        if let Err(error) = Gpu::new() {
            let required = std::env::var("NIWAKI_REQUIRE_VULKAN").is_ok_and(|v| v == "1");
            assert!(!required, "{error}");
            eprintln!("skipped: {error}");
            return;
        }
        let out = std::env::temp_dir().join(format!("niwaki-shadows-{}", std::process::id()));
        let folder = out.display().to_string();
        let what = ["xtask", "accuracy", "--suite", "shadows", "--quick", "--threads", "2"];
        let more = ["--families", "resolution", "--scene", "tessellated:3000", "--out", &folder];
        let cli = Cli::try_parse_from([&what[..], &more].concat()).unwrap();
        let Command::Accuracy(args) = cli.command else { panic!("not accuracy") };
        run(&args).unwrap();
        let json = std::fs::read_to_string(out.join("accuracy.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let points = json["scenes"][0]["points"].as_array().unwrap();
        let mean = |algorithm: &str| -> Vec<f64> {
            let of = points.iter().filter(|p| p["algorithm"] == algorithm);
            of.map(|p| p["mean"].as_f64().unwrap()).collect()
        };
        assert_eq!(mean("SV").len(), 1);
        assert!(points[0]["error"]["wrong_elsewhere"] == 0, "{}", points[0]);
        let maps = mean("SM");
        assert!(maps.len() == 3 && mean("VSM").len() == 3, "{maps:?}");
        assert!(maps[2] < maps[0] && mean("SV")[0] < maps[2], "{maps:?}");
        assert!(out.join("csv/shadows-tessellated.csv").is_file());
        let page = std::fs::read_to_string(out.join("accuracy.html")).unwrap();
        assert_eq!(page.matches("data:image/png;base64,").count(), 3);
        std::fs::remove_dir_all(out).unwrap();
    }
}
