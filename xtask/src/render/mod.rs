//! `cargo xtask render`: pictures of a scene, and what each part of them took.

mod args;
mod cpu;
mod frames;
mod gpu;
#[cfg(any(test, feature = "window"))]
#[cfg_attr(
    not(feature = "window"),
    allow(dead_code, unused_imports, reason = "tests need no window")
)]
mod steer;
#[cfg(feature = "window")]
mod window;

pub(crate) use args::{Preset, RenderArgs, Size};
pub(crate) use gpu::passes;

use crate::{
    bench::{pool, progress::Progress},
    machine, registry,
    report::slug,
    scenes::SceneSpec,
};
use anyhow::{Context, Result};
use args::{Format, Mode};
use cpu::OnCpu;
use frames::{Count, Frame, Frames, Part};
use gpu::OnGpu;
use niwaki_render::{Exposure, Image, ToneCurve};
use niwaki_scene::{Camera, CameraPath, Scene};
use std::{process::ExitCode, sync::Arc, time::Instant};

/// Triangles of procedural scenes that are named without a number, as in `bench`.
const TRIANGLES: usize = 100_000;

/// Steps of the progress bar for a frame.
const STEPS: usize = 100;

/// What draws frames.
trait Draw {
    /// Draws what the camera sees at a time, in seconds, and calls `progress(finished, all)`
    /// where the work has parts that finish one by one.
    fn draw(&mut self, camera: &Camera, time: f64, progress: &Steps<'_>) -> Result<Drawn>;

    /// What runs for a frame, what does not, and why.
    fn explain(&self, camera: &Camera, time: f64) -> String;
}

/// Called with the number of parts that are finished and the number of all.
type Steps<'a> = dyn Fn(usize, usize) + Sync + 'a;

/// A frame before it is saved.
struct Drawn {
    image: Image,
    parts: Vec<Part>,
    counts: Vec<Count>,
}

/// Runs the command.
pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode> {
    let spec = SceneSpec::parse(&args.scene, TRIANGLES)?;
    if args.window {
        return in_window(args, &spec);
    }
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    pool(threads)?.install(|| draw_all(args, &spec, threads))
}

/// Shows the scene in a window. Not within a pool of threads: windows belong to the main thread.
#[cfg(feature = "window")]
fn in_window(args: &RenderArgs, spec: &SceneSpec) -> Result<ExitCode> {
    window::run(args, spec)
}

#[cfg(not(feature = "window"))]
fn in_window(_: &RenderArgs, _: &SceneSpec) -> Result<ExitCode> {
    anyhow::bail!(
        "windows are not part of this program, so that it needs no display to be built: \
         say `cargo xtask-window` instead of `cargo xtask`, or leave --window out for pictures \
         in files"
    )
}

fn draw_all(args: &RenderArgs, spec: &SceneSpec, threads: usize) -> Result<ExitCode> {
    // What is wrong with the arguments is said before anything takes time.
    let builder = registry::one_of_ours("--builder", &args.builder)?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create the folder {}", args.out.display()))?;
    let progress = Progress::new(args.frames as usize * STEPS);
    progress.message(&format!("load {}", spec.describe()));
    let scene = load(args, spec)?;
    if let Some(why) = black(&scene, args.mode) {
        progress.print(&format!("note: {why}"));
    }
    let scene = Arc::new(scene);
    let mut frames = Frames::new(spec, &scene, args, threads);
    let mut drawer: Box<dyn Draw> = match args.mode {
        Mode::Hybrid | Mode::FullBvh => {
            progress.message("compile kernels");
            let gpu = OnGpu::new(&scene, args)?;
            frames.device = Some(gpu.device());
            Box::new(gpu)
        }
        Mode::Whitted | Mode::Path => Box::new(OnCpu::new(&scene, builder, args)),
    };
    let moments = moments(&scene, args.frames)?;
    for (number, moment) in (0..).zip(&moments) {
        frames.frames.push(draw(&mut *drawer, &scene.name, args, number, moment, &progress)?);
    }
    progress.finish();
    frames.save(&args.out)?;
    for table in frames.tables() {
        println!("{}", table.to_text());
    }
    println!("pictures and frames.json in {}", args.out.display());
    Ok(ExitCode::SUCCESS)
}

/// The scene, under the sky that the arguments ask for.
fn load(args: &RenderArgs, spec: &SceneSpec) -> Result<Scene> {
    let mut scene = spec.load_moving(args.seed, args.animation)?;
    if let Some(sky) = args.sky {
        scene.environment = sky.0;
    }
    Ok(scene)
}

/// Why pictures will be black, or most of them.
fn black(scene: &Scene, mode: Mode) -> Option<String> {
    if !scene.lights.is_empty() || !scene.environment.is_dark() {
        return None;
    }
    let emitters = scene.emissive_triangles().len();
    match (mode, emitters) {
        (_, 0) => Some("nothing lights this scene. --sky daylight does.".to_owned()),
        (Mode::Path, _) => None,
        (Mode::Hybrid | Mode::FullBvh | Mode::Whitted, _) => Some(format!(
            "{emitters} emissive triangles are all that lights this scene, and {} follows no light from \
             such: all but they and their reflections stays black. --mode path follows it; --sky \
             daylight lights the scene from around.",
            mode.name()
        )),
    }
}

/// Draws and saves a frame.
fn draw(
    drawer: &mut dyn Draw,
    scene: &str,
    args: &RenderArgs,
    number: u32,
    (camera, time): &(Camera, f64),
    progress: &Progress,
) -> Result<Frame> {
    progress.message(&format!("frame {number}: {}", args.mode.name()));
    if args.explain {
        progress.print(&format!("frame {number}\n{}", drawer.explain(camera, *time)));
    }
    let steps = |finished: usize, all: usize| {
        // As many steps a frame, however many parts it has.
        let steps = |parts: usize| parts * STEPS / all.max(1);
        progress.skip(steps(finished) - steps(finished.saturating_sub(1)));
    };
    let Drawn { image, mut parts, counts } = drawer
        .draw(camera, *time, &steps)
        .with_context(|| format!("frame {number} could not be drawn"))?;
    let name = format!("{}-{}-{number:04}", slug(scene), args.mode.name());
    let picture = timed(&mut parts, "file", || save(&image, args, &name))?;
    Ok(Frame { number, picture, parts, counts })
}

/// Where the camera of each frame stands, and when, in seconds. A single frame shows the scene at
/// rest from its first camera.
pub(crate) fn moments(scene: &Scene, frames: u32) -> Result<Vec<(Camera, f64)>> {
    if frames == 1 {
        let camera = scene.cameras.first().context("the scene has no camera")?;
        return Ok(vec![(*camera, 0.0)]);
    }
    // Once: without a path of its own, one is found by looking at the whole mesh.
    let path = CameraPath { frames, ..scene.camera_path() };
    let duration = scene.animation.as_ref().map_or(0.0, |animation| animation.duration);
    let time = |number: u32| duration * f64::from(number) / f64::from(frames);
    Ok((0..frames).map(|number| (path.frame(number), time(number))).collect())
}

fn save(image: &Image, args: &RenderArgs, name: &str) -> Result<String> {
    let (extension, tone) = match (args.format, args.exposure) {
        (Format::Exr, _) => ("exr", None),
        (Format::Png, None) => ("png", Some(ToneCurve::automatic())),
        (Format::Png, Some(stops)) => {
            ("png", Some(ToneCurve { exposure: Exposure::Stops(stops), shoulder: true }))
        }
    };
    let file = format!("{name}.{extension}");
    let path = args.out.join(&file);
    match tone {
        Some(tone) => image.save_png(&path, &tone)?,
        None => image.save_exr(&path)?,
    }
    Ok(file)
}

/// Does something and notes how long it took.
fn timed<T>(parts: &mut Vec<Part>, name: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    parts.push(Part { name: name.to_owned(), ms: start.elapsed().as_secs_f64() * 1e3 });
    result
}

/// Counts by the names of the table.
fn counted<const N: usize>(counts: [(&str, u64); N]) -> Vec<Count> {
    counts.map(|(name, count)| Count { name: name.to_owned(), count }).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;

    fn args(arguments: &[&str]) -> RenderArgs {
        let cli = Cli::try_parse_from([&["xtask", "render"], arguments].concat()).unwrap();
        let Command::Render(args) = cli.command else { panic!("not a rendering") };
        *args
    }

    #[test]
    fn every_mode_and_format_gives_a_picture_a_frame() {
        let folder = std::env::temp_dir().join(format!("niwaki-render-{}", std::process::id()));
        let out = folder.display().to_string();
        for mode in ["whitted", "path"] {
            for format in ["png", "exr"] {
                let more = ["--frames", "2", "--size", "16x9", "--samples", "1", "--threads", "2"];
                let which = ["--scene", "atrium:1000", "--mode", mode, "--format", format];
                run(&args(&[&which[..], &more, &["--out", &out, "--explain"]].concat())).unwrap();
                for number in 0..2 {
                    let name = format!("atrium-{mode}-{number:04}.{format}");
                    assert!(folder.join(&name).is_file(), "{name}");
                }
            }
            let json = std::fs::read_to_string(folder.join("frames.json")).unwrap();
            let json: serde_json::Value = serde_json::from_str(&json).unwrap();
            let frames = json["frames"].as_array().unwrap();
            assert_eq!((json["mode"].as_str(), frames.len()), (Some(mode), 2));
            let rays = |frame: &serde_json::Value| frame["counts"][0]["count"].as_u64().unwrap();
            assert!(rays(&frames[0]) >= 16 * 9, "{json}");
            assert!(folder.join("frames.svg").is_file());
        }
        let picture =
            |number| std::fs::read(folder.join(format!("atrium-path-000{number}.exr"))).unwrap();
        assert_ne!(picture(0), picture(1));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn black_pictures_are_announced() {
        let spec = SceneSpec::parse("gallery:2000", TRIANGLES).unwrap();
        let mut scene = spec.load(1).unwrap();
        assert_eq!(black(&scene, Mode::Whitted), None);
        scene.lights.clear();
        scene.environment = niwaki_scene::Environment::DARK;
        for material in &mut scene.materials {
            material.emission = niwaki_core::glam::Vec3::ZERO;
        }
        let nothing = black(&scene, Mode::Path).unwrap();
        assert!(nothing.contains("nothing lights"), "{nothing}");
        scene.materials[0].emission = niwaki_core::glam::Vec3::ONE;
        assert_eq!(black(&scene, Mode::Path), None);
        let emitters = black(&scene, Mode::Hybrid).unwrap();
        assert!(emitters.contains("hybrid") && emitters.contains("--mode path"), "{emitters}");
    }

    #[test]
    fn wrong_arguments_are_named_before_anything_is_drawn() {
        let refused = |more: &[&str]| format!("{:#}", run(&args(more)).unwrap_err());
        let error = refused(&["--scene", "no/such.glb"]);
        assert!(error.contains("no/such.glb"), "{error}");
        let error = refused(&["--scene", "hair", "--builder", "bonzai"]);
        assert!(error.contains("bonzai"), "{error}");
        let error = refused(&["--scene", "hair", "--builder", "niwaki"]);
        assert!(error.contains("takes one"), "{error}");
    }
}
