//! `cargo xtask accuracy --suite model`: what sampling a view coarsely costs the prediction of its time, and what rays of
//! ambient occlusion and shadow are worth (thesis, paper I).

mod occlusion;
mod page;
mod sampling;

use super::conclude;
use crate::bench::pool;
use crate::bench::progress::Progress;
use crate::cli::AccuracyArgs;
use crate::machine;
use crate::render::Size;
use crate::results::{Failure, Run};
use crate::scenes::SceneSpec;
use crate::tune::device::{Real, tracer_model};
use crate::tune::fit::{Fit, fit};
use crate::tune::plant::Plant;
use crate::tune::stage::{Setting, Stage};
use anyhow::{Context, Result, bail};
use niwaki_frame_control::Ladder;
use niwaki_gpu_model::Device as DeviceTable;
use serde::Serialize;
use std::process::ExitCode;

/// Scenes after the paper's, and one of rooms.
const SCENES: [&str; 3] = ["fairy", "cabin", "atrium"];
/// What can be asked for.
const KNOBS: [&str; 4] = ["sampling", "directions", "radius", "shadows"];
/// Share of the diagonal of a scene within which occluders count, and most directions: as in `tune`.
const AO_RADIUS: f64 = 0.1;
const MOST_DIRECTIONS: u16 = 64;

/// A scene with its points.
#[derive(Clone, Debug, Serialize)]
struct SceneStudy {
    scene: String,
    triangles: usize,
    /// How the model was fitted; absent of simulated devices.
    fit: Option<Fit>,
    sampling: Option<sampling::Measured>,
    occlusion: Option<occlusion::Measured>,
}

/// Everything that a run found.
#[derive(Clone, Debug, Serialize)]
struct Study {
    /// Version of this file's layout.
    schema: u32,
    suite: &'static str,
    run: Run,
    device: String,
    is_simulated: bool,
    width: u32,
    height: u32,
    scenes: Vec<SceneStudy>,
    failures: Vec<Failure>,
}

/// What is measured of each scene.
struct Effort {
    size: [u32; 2],
    /// Frames of the path that is sampled, and of pictures.
    tour: u32,
    pictures: u32,
    ways: Vec<sampling::Way>,
    setups: Vec<occlusion::Setup>,
}

impl Effort {
    fn new(args: &AccuracyArgs) -> Result<Self> {
        if let Some(unknown) = args.families.iter().find(|knob| !KNOBS.contains(&knob.as_str())) {
            bail!("`{unknown}` is no knob of the suite `model`; there are {}", KNOBS.join(", "));
        }
        let quick = args.quick;
        let is_wanted =
            |knob: &&str| args.families.is_empty() || args.families.iter().any(|own| own == knob);
        let (width, height) = if quick { (64, 36) } else { (320, 180) };
        let Size { width, height } = args.size.unwrap_or(Size { width, height });
        let knobs: Vec<&str> = KNOBS.into_iter().filter(|knob| is_wanted(knob)).collect();
        let size = [width, height];
        Ok(Self {
            size,
            tour: if quick { 8 } else { 40 },
            pictures: args.frames.unwrap_or(if quick { 1 } else { 3 }),
            ways: if is_wanted(&"sampling") { sampling::ways(size, quick) } else { Vec::new() },
            setups: occlusion::setups(&knobs, quick),
        })
    }

    /// Steps of the progress bar for a scene.
    fn steps(&self) -> usize {
        1 + sampling::steps(&self.ways) + occlusion::steps(&self.setups, self.pictures)
    }
}

/// Runs the suite.
pub(super) fn run(args: &AccuracyArgs) -> Result<ExitCode> {
    let effort = Effort::new(args)?;
    let triangles = if args.quick { 3_000 } else { 100_000 };
    let specs = SceneSpec::select(&args.scenes, &args.folders, triangles, || {
        SceneSpec::generated(if args.quick { &SCENES[..1] } else { &SCENES }, triangles)
    })?;
    let device = args.device.as_deref().unwrap_or("vulkan");
    let real = match device {
        "vulkan" => Some(Real::open(None, args.quick, &args.out).context(
            "the suite `model` draws on a Vulkan device (ci/setup-vulkan.sh installs a software one on \
             Debian), or on a simulated one: --device geforce-580",
        )?),
        _ => None,
    };
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    let mut run = machine::describe();
    run.threads = vec![threads];
    run.arguments = std::env::args().skip(2).collect();
    let progress = Progress::new(specs.len() * effort.steps());
    let pool = pool(threads)?;
    let (mut scenes, mut failures) = (Vec::new(), Vec::new());
    for spec in &specs {
        progress.message(&format!("{}: load", spec.name));
        match pool.install(|| one(args, spec, device, real.as_ref(), &effort, &progress)) {
            Ok(scene) => scenes.push(scene),
            Err(error) => {
                let error = format!("{error:#}");
                progress.warn(&format!("error: {}: {error}", spec.describe()));
                failures.push(Failure { scene: spec.describe(), error });
            }
        }
    }
    progress.finish();
    let study = Study {
        schema: 1,
        suite: "model",
        run,
        device: real
            .as_ref()
            .map_or_else(|| format!("simulated {device}"), |r| r.table.name.clone()),
        is_simulated: real.is_none(),
        width: effort.size[0],
        height: effort.size[1],
        scenes,
        failures,
    };
    finish(args, &study)?;
    Ok(if study.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Measures a scene.
fn one(
    args: &AccuracyArgs,
    spec: &SceneSpec,
    device: &str,
    real: Option<&Real>,
    effort: &Effort,
    progress: &Progress,
) -> Result<SceneStudy> {
    let setting = Setting {
        builder: "bonsai_p",
        frames: effort.tour,
        turn: false,
        size: effort.size,
        ao_radius: AO_RADIUS,
        sampling: Size { width: 32, height: 18 },
        seed: args.seed,
    };
    let stage = Stage::new(spec, &setting, real.is_none())?;
    if stage.scene.mesh.is_empty() {
        bail!("it has no triangles");
    }
    let mut plant = match real {
        Some(real) => Plant::vulkan(&real.device, &stage)?,
        None => Plant::simulated(device, &stage, 1, args.seed)?,
    };
    let table = match real {
        Some(real) => real.table.clone(),
        None => DeviceTable::load(device)?,
    };
    let model = tracer_model(table, real.map(|real| &real.device), effort.size)?;
    let (mut sampled, mut fitted) = (None, None);
    if !effort.ways.is_empty() {
        let ladder = Ladder::ray_tracing(MOST_DIRECTIONS, AO_RADIUS)?;
        // Kernels are compiled at the first frame.
        plant.probe(&stage, 0, &ladder.rungs()[ladder.top().min(2)])?;
        let model = match real {
            Some(_) => {
                progress.message(&format!("{}: fitting the model", spec.name));
                let (model, fit) = fit(&mut plant, &stage, &ladder, &model)?;
                fitted = Some(fit);
                model
            }
            None => model,
        };
        let ways = &effort.ways;
        sampled = Some(sampling::measure(&mut plant, &stage, &model, ways, progress)?);
    }
    progress.step();
    let setups = &effort.setups;
    let occlusion = if setups.is_empty() {
        None
    } else {
        let made =
            occlusion::measure(&mut plant, &stage, setups, effort.pictures, &args.out, progress);
        Some(made?)
    };
    Ok(SceneStudy {
        scene: spec.name.clone(),
        triangles: stage.scene.mesh.len(),
        fit: fitted,
        sampling: sampled,
        occlusion,
    })
}

/// Prints and writes everything.
fn finish(args: &AccuracyArgs, study: &Study) -> Result<()> {
    for scene in &study.scenes {
        println!("\n{}, {} triangles", scene.scene, scene.triangles);
        if let Some(fit) = &scene.fit {
            println!("{}", fit.line(&scene.scene));
        }
        if let Some(sampling) = &scene.sampling {
            println!("{}", page::sampling_table(&scene.scene, sampling).to_text());
            println!("{}", page::divergence_table(&scene.scene, sampling).to_text());
        }
        if let Some(occlusion) = &scene.occlusion {
            println!("{}", page::occlusion_table(&scene.scene, occlusion).to_text());
        }
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create {}", args.out.display()))?;
    let page = page::write(study, &args.out)?;
    let note = format!("{}x{} pixels on {}", study.width, study.height, study.device);
    conclude(args, study, &study.failures, &page, &note)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;
    use std::path::{Path, PathBuf};

    fn args(more: &[&str]) -> AccuracyArgs {
        let first = ["xtask", "accuracy", "--suite", "model", "--quick", "--threads", "2"];
        let cli = Cli::try_parse_from([&first, more].concat()).unwrap();
        let Command::Accuracy(args) = cli.command else { panic!("not accuracy") };
        args
    }

    fn folder(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("niwaki-{name}-{}", std::process::id()))
    }

    fn json(out: &Path) -> serde_json::Value {
        let text = std::fs::read_to_string(out.join("accuracy.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }

    /// What is true of every run: finer sampling scatters less and takes longer, and more directions
    /// are nearer to the reference.
    fn check(study: &serde_json::Value) {
        let scene = &study["scenes"][0];
        let number = |x: &serde_json::Value| x.as_f64().unwrap();
        let points = scene["sampling"]["points"].as_array().unwrap();
        let of = |size: [u32; 2]| {
            let own = serde_json::json!(size);
            let mut all = points.iter().filter(|p| p["family"] == "low discrepancy");
            all.find(|p| p["size"] == own).unwrap()
        };
        let (coarse, fine) = (of([8, 5]), of([32, 18]));
        assert!(number(&fine["scatter"]) < number(&coarse["scatter"]), "{coarse} {fine}");
        assert!(number(&fine["counters"]["p_t"]) < number(&coarse["counters"]["p_t"]));
        assert!(number(&fine["frame_ms"]) > number(&coarse["frame_ms"]));
        assert_eq!(fine["is_default"], true);
        assert!(points.iter().any(|p| p["on_front"] == true));
        let points = scene["occlusion"]["points"].as_array().unwrap();
        let flip = |value: &str| {
            let mut all = points.iter().filter(|p| p["knob"] == "directions");
            number(&all.find(|p| p["value"] == value).unwrap()["flip"])
        };
        assert!(flip("16") < flip("1") && flip("1") < 0.5, "{points:?}");
    }

    #[test]
    fn a_small_run_leaves_a_report_with_pictures() {
        if !crate::testing::is_there(niwaki_trace_vulkan::Device::new()) {
            return;
        }
        let out = folder("model");
        run(&args(&["--out", &out.display().to_string()])).unwrap();
        let study = json(&out);
        check(&study);
        let scene = &study["scenes"][0];
        assert!(scene["fit"]["frames"].as_array().unwrap().len() >= 30);
        assert!(scene["fit"]["error_after"].as_f64() <= scene["fit"]["error_before"].as_f64());
        // The device traverses the tree that the sampler does.
        for count in scene["sampling"]["device_counts"].as_object().unwrap().values() {
            assert!((0.7..1.4).contains(&count.as_f64().unwrap()), "{count}");
        }
        assert!(scene["occlusion"]["rounding"].as_f64().unwrap() < 0.01);
        let pictures = scene["occlusion"]["pictures"].as_array().unwrap();
        assert!(pictures.len() >= 6);
        let page = std::fs::read_to_string(out.join("accuracy.html")).unwrap();
        assert_eq!(page.matches("data:image/png;base64,").count(), pictures.len());
        assert!(out.join("csv/model-sampling-fairy.csv").is_file());
        std::fs::remove_dir_all(out).unwrap();
    }

    /// Without a Vulkan device there are simulated ones.
    #[test]
    fn a_simulated_device_will_do() {
        let out = folder("model-simulated");
        let more = ["--device", "geforce-580", "--size", "48x27", "--scene", "fairy:2000"];
        run(&args(&[&more[..], &["--out", &out.display().to_string()]].concat())).unwrap();
        let study = json(&out);
        assert_eq!(study["is_simulated"], true);
        check(&study);
        std::fs::remove_dir_all(out).unwrap();
    }

    #[test]
    fn wrong_arguments_are_named_before_anything_is_drawn() {
        let refused = |more: &[&str]| format!("{:#}", run(&args(more)).unwrap_err());
        assert!(refused(&["--families", "samples"]).contains("`samples`"));
        assert!(refused(&["--scene", "no/such.glb"]).contains("no/such.glb"));
        let other = ["xtask", "accuracy", "--suite", "kernels", "--device", "vulkan"];
        let Command::Accuracy(other) = Cli::try_parse_from(other).unwrap().command else {
            panic!("not accuracy")
        };
        let error = crate::accuracy::run(&other).unwrap_err().to_string();
        assert!(error.contains("--device") && error.contains("model"), "{error}");
    }
}
