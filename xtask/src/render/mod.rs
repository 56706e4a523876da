//! `cargo xtask render`: pictures of a scene, and what each part of them took.

mod args;
mod frames;

pub(crate) use args::RenderArgs;

use crate::{
    bench::{pool, progress::Progress},
    machine, registry,
    report::slug,
    scenes::SceneSpec,
};
use anyhow::{Context, Result, bail};
use args::{Format, Mode};
use frames::{Count, Frame, Frames, Part};
use niwaki_core::Builder;
use niwaki_render::{
    Exposure, Image, PathSettings, PathTracer, RenderStats, ToneCurve, Whitted, WhittedSettings,
};
use niwaki_scene::{CameraPath, Scene, SceneFacts};
use niwaki_trace::AutoScene;
use std::{process::ExitCode, time::Instant};

/// Triangles of procedural scenes that are named without a number, as in `bench`.
const TRIANGLES: usize = 100_000;

/// Steps of the progress bar for the tiles of a frame.
const STEPS: usize = 100;

/// Runs the command.
pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode> {
    let builder = builder(&args.builder)?;
    let spec = SceneSpec::parse(&args.scene, TRIANGLES)?;
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    let pool = pool(threads)?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot create the folder {}", args.out.display()))?;
    let progress = Progress::new(args.frames as usize * STEPS);
    progress.message(&format!("load {}", spec.describe()));
    let scene = pool.install(|| spec.load(args.seed))?;
    if args.explain {
        progress.print(&pool.install(|| explain(&scene, args)));
    }
    let mut frames = Frames::new(&spec, &scene, args, threads);
    for number in 0..args.frames {
        let frame = pool.install(|| draw(&scene, builder.as_ref(), args, number, &progress))?;
        frames.frames.push(frame);
    }
    progress.finish();
    frames.save(&args.out)?;
    for table in frames.tables() {
        println!("{}", table.to_text());
    }
    println!("pictures and frames.json in {}", args.out.display());
    Ok(ExitCode::SUCCESS)
}

/// What the scene calls for.
fn explain(scene: &Scene, args: &RenderArgs) -> String {
    match args.mode {
        Mode::Whitted => Whitted::new(whitted(args)).plan(scene).to_string(),
        Mode::Path => SceneFacts::new(scene, SceneFacts::MIRROR_ROUGHNESS).to_string(),
    }
}

/// The one builder of a name.
fn builder(name: &str) -> Result<Box<dyn Builder>> {
    let mut builders = registry::select_ours(&[name.to_owned()])?;
    if builders.len() > 1 {
        let names: Vec<_> = builders.iter().map(|b| b.name().to_owned()).collect();
        bail!("--builder takes one, but `{name}` is {}", names.join(", "));
    }
    builders.pop().context("--builder names none")
}

/// Draws and saves a frame.
fn draw(
    scene: &Scene,
    builder: &dyn Builder,
    args: &RenderArgs,
    number: u32,
    progress: &Progress,
) -> Result<Frame> {
    let mut parts = Vec::new();
    progress.message(&format!("frame {number}: motion and tree"));
    let scene = timed(&mut parts, "motion", || at_frame(scene, args, number))?;
    let tree = timed(&mut parts, "tree", || -> Result<_> {
        let bvh = builder.build_mesh(&scene.mesh)?;
        Ok(AutoScene::new(&bvh, &scene.mesh)?)
    })?;
    progress.message(&format!("frame {number}: {}", args.mode.name()));
    let tiles = |finished: usize, all: usize| {
        // As many steps a frame, however many tiles it has.
        let steps = |tiles: usize| tiles * STEPS / all.max(1);
        progress.skip(steps(finished) - steps(finished.saturating_sub(1)));
    };
    let (image, stats) = timed(&mut parts, "rays", || image(&scene, &tree, args, number, tiles));
    let name = format!("{}-{}-{number:04}", slug(&scene.name), args.mode.name());
    let picture = timed(&mut parts, "file", || save(&image, args, &name))?;
    Ok(Frame { number, picture, parts, counts: counts(&stats) })
}

/// The scene at the time of a frame, seen from where the camera is then. Of a single frame, the
/// scene at rest from its first camera.
fn at_frame(scene: &Scene, args: &RenderArgs, number: u32) -> Result<Scene> {
    if args.frames == 1 {
        return Ok(scene.clone());
    }
    let duration = scene.animation.as_ref().map_or(0.0, |animation| animation.duration);
    let mut scene = scene
        .frozen(duration * f64::from(number) / f64::from(args.frames))
        .with_context(|| format!("frame {number}: motion takes the scene out of range"))?;
    let path = CameraPath { frames: args.frames, ..scene.camera_path() };
    scene.cameras = vec![path.frame(number)];
    Ok(scene)
}

fn image(
    scene: &Scene,
    tree: &AutoScene,
    args: &RenderArgs,
    number: u32,
    progress: impl Fn(usize, usize) + Sync,
) -> (Image, RenderStats) {
    match args.mode {
        Mode::Whitted => Whitted::new(whitted(args)).render_with(scene, tree, progress),
        Mode::Path => {
            let settings = PathSettings {
                width: args.size.width,
                height: args.size.height,
                samples: args.samples,
                max_depth: args.depth,
                seed: args.seed.wrapping_add(number.into()),
                ..PathSettings::default()
            };
            PathTracer::new(settings).render_with(scene, tree, progress)
        }
    }
}

fn whitted(args: &RenderArgs) -> WhittedSettings {
    WhittedSettings {
        width: args.size.width,
        height: args.size.height,
        grid: args.grid,
        max_depth: args.depth,
        ..WhittedSettings::default()
    }
}

/// What was counted, by the names of the table.
fn counts(stats: &RenderStats) -> Vec<Count> {
    [
        ("closest-hit rays", stats.closest_hit_rays),
        ("shadow rays", stats.shadow_rays),
        ("reflected rays", stats.reflected_rays),
        ("refracted rays", stats.refracted_rays),
        ("rays past alpha", stats.continued_rays),
        ("rays left out", stats.cut_rays),
        ("paths dropped", stats.dropped_paths),
    ]
    .map(|(name, count)| Count { name: name.to_owned(), count })
    .into()
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
