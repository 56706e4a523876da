//! `cargo xtask accuracy --suite shadows`: error of shadows against exact ones by rays, over map
//! resolution, filter and bias, with the time on the GPU.

mod measure;
mod page;
mod sweep;

use super::conclude;
use crate::bench::pool;
use crate::bench::progress::Progress;
use crate::cli::AccuracyArgs;
use crate::power::source::{Opened, Session};
use crate::power::study::Metered;
use crate::render::Size;
use crate::report::pareto_front;
use crate::results::{Failure, Run};
use crate::scenes::SceneSpec;
use crate::{machine, power};
use anyhow::{Context, Result, bail};
use measure::{LIGHTS, Measured, Method, Point, RADIUS};
use niwaki_power::AnalysisOptions;
use niwaki_raster::{Algorithm, Gpu};
use niwaki_render::{Image, ToneCurve};
use serde::Serialize;
use std::process::ExitCode;

/// The two of the case studies.
const SCENES: [&str; 2] = ["serpents", "tessellated"];

/// Readings a second of a meter.
const METER_RATE_HZ: f64 = 1000.0;

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
    /// The meter, none without one; and what has to be said of it.
    meter: Option<String>,
    meter_notes: Vec<String>,
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
    let (mut session, mut meter_notes) = (None, Vec::new());
    match args.source.open(gpu.name(), power::study::kind(&gpu))? {
        Opened::Nothing(reason) => meter_notes.push(format!("no meter: {reason}")),
        Opened::Meters(meters, notes) => {
            session = Some(Session::start(meters, notes, METER_RATE_HZ)?);
        }
        Opened::File(_) => bail!(
            "--source: the suite measures setup by setup with a meter of this machine; with the trace \
             of an instrument use: cargo xtask power study --source csv:FILE"
        ),
    }
    let analysis = AnalysisOptions::default();
    let steps = measure::steps(setups.len(), frames, session.is_some());
    let progress = Progress::new(specs.len() * steps);
    let method = Method {
        setups: &setups,
        size,
        frames,
        meter: session.as_ref().map(|session| Metered { session, options: &analysis }),
        progress: &progress,
    };
    let pool = pool(threads)?;
    let (mut scenes, mut failures) = (Vec::new(), Vec::new());
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    for spec in &specs {
        progress.message(&format!("{}: load", spec.name));
        let measured = pool.install(|| {
            let scene = spec.load(args.seed)?;
            measure::scene(&gpu, scene, &method)
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
        meter: session.as_ref().map(|s| s.info().sensor.name.clone()),
        meter_notes: session.as_ref().map_or(meter_notes, |s| s.notes().to_vec()),
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
    let note = format!("{}x{} pixels on {}", study.width, study.height, study.device);
    conclude(args, study, &study.failures, &page, &note)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use crate::power::simulated::{Folder, Ticker, WATTS, counter};
    use clap::Parser;

    #[test]
    fn a_small_run_leaves_a_report_in_which_shadow_volumes_are_exact() {
        if !crate::testing::is_there(Gpu::new()) {
            return;
        }
        let out = std::env::temp_dir().join(format!("niwaki-shadows-{}", std::process::id()));
        let folder = out.display().to_string();
        let what = ["xtask", "accuracy", "--suite", "shadows", "--quick", "--threads", "2"];
        let more = ["--families", "resolution", "--scene", "tessellated:3000", "--out", &folder];
        let counters = Folder::new("shadows-rapl");
        let mut tick = counter(&counters.0);
        tick();
        let ticker = Ticker::new(tick);
        let source = format!("--source=rapl:{}", counters.0.display());
        let cli = Cli::try_parse_from([&what[..], &more, &[&source]].concat()).unwrap();
        let Command::Accuracy(args) = cli.command else { panic!("not accuracy") };
        run(&args).unwrap();
        drop(ticker);
        let json = std::fs::read_to_string(out.join("accuracy.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let points = json["scenes"][0]["points"].as_array().unwrap();
        let mean = |algorithm: &str| -> Vec<f64> {
            let of = points.iter().filter(|p| p["algorithm"] == algorithm);
            of.map(|p| p["mean"].as_f64().unwrap()).collect()
        };
        assert!(points.iter().all(|p| p["nj_per_pixel"].as_f64().is_some_and(|nj| nj > 0.0)));
        // The median: on a busy machine the thread that plays the meter may sleep through a setup.
        let mut watts: Vec<f64> = points.iter().filter_map(|p| p["mean_w"].as_f64()).collect();
        watts.sort_by(f64::total_cmp);
        let median = watts[watts.len() / 2];
        assert!((median / WATTS - 1.0).abs() < 0.1, "{watts:?}");
        assert_eq!(json["meter"], "RAPL");
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
