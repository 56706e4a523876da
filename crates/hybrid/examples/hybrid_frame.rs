//! Renders one frame and prints its plan and what it took:
//!
//! ```text
//! cargo run --release -p niwaki-hybrid --example hybrid_frame -- \
//!     [NAME:TRIANGLES | FILE] [WIDTHxHEIGHT] [PRESET] [OUT.png] [VIEW]
//! ```
//!
//! PRESET is `default`, `fast`, `fine`, `exact` or `paper`; after a comma may follow `linear`,
//! `pixels` or `hierarchical` for the march, and `two` for two layers (`default,hierarchical,two`).
//! VIEW is `hits`, `normals` or `steps`; `whitted` renders the reference on the CPU instead, and
//! `compare` says how far from it the frame is.

use niwaki_build_binned::Binned;
use niwaki_core::Builder;
use niwaki_hybrid::{DebugView, Gpu, HybridRenderer, March, Settings};
use niwaki_render::{
    Image, ToneCurve, Whitted, WhittedSettings,
    metrics::{FlipSettings, flip},
};
use niwaki_scene::{LoadOptions, Scene, generate, load};
use niwaki_trace::WideScene;
use std::{error::Error, sync::Arc};

fn scene(name: &str) -> Result<Scene, Box<dyn Error>> {
    match name.split_once(':') {
        Some((name, count)) => {
            generate::generate(name, count.parse()?, 1).ok_or_else(|| "no such scene".into())
        }
        None => Ok(load(name.as_ref(), &LoadOptions::default())?),
    }
}

fn settings(words: &str) -> Result<Settings, Box<dyn Error>> {
    words.split(',').try_fold(Settings::default(), |settings, word| {
        Ok(match word {
            "default" => Settings::default(),
            "fast" => Settings::fast(),
            "fine" => Settings::fine(),
            "exact" => Settings::exact(),
            "paper" => Settings::paper(),
            "linear" => Settings { march: March::LINEAR, ..settings },
            "pixels" => Settings { march: March::Pixels, ..settings },
            "hierarchical" => Settings { march: March::Hierarchical, ..settings },
            "two" => Settings { layers: 2, ..settings },
            other => return Err(format!("no such preset or setting: {other}").into()),
        })
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let arg = |i: usize, default: &'static str| args.get(i).map_or(default, String::as_str);
    let scene = Arc::new(scene(arg(0, "atrium:100000"))?);
    let (width, height) = arg(1, "320x180").split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let (width, height) = (width.parse()?, height.parse()?);
    let settings = settings(arg(2, "default"))?;
    let camera = scene.cameras[0];
    let reference = || -> Result<Image, Box<dyn Error>> {
        let whitted = WhittedSettings {
            width,
            height,
            max_depth: settings.max_depth,
            cutoff: settings.throughput_cutoff,
            ..WhittedSettings::default()
        };
        let frozen = scene.frozen(0.0)?;
        let tree = Binned::default().build_mesh(&frozen.mesh)?;
        Ok(Whitted::new(whitted).render(&frozen, &WideScene::new(&tree, &frozen.mesh)?))
    };
    let image = if arg(4, "") == "whitted" {
        reference()?
    } else {
        let wanted = if arg(4, "") == "compare" { Some(reference()?) } else { None };
        let debug_view = match arg(4, "") {
            "hits" => DebugView::HitSource,
            "normals" => DebugView::Normal,
            "steps" => DebugView::MarchSteps,
            _ => DebugView::None,
        };
        let gpu = Gpu::new()?;
        println!("{}, {} triangles on {}", scene.name, scene.mesh.len(), gpu.name());
        let mut renderer = HybridRenderer::new(
            &gpu,
            Arc::clone(&scene),
            Settings { debug_view, ..settings.clone() },
        )?;
        let mut frame = renderer.render(&camera, width, height, 0.0)?;
        println!("{}\n", frame.plan);
        // The first frame compiles kernels. Forgetting what it left makes the second do all again.
        renderer.set_settings(renderer.settings().clone());
        frame = renderer.render(&camera, width, height, 0.0)?;
        for stage in &frame.report.stages {
            let time =
                stage.gpu_time.map_or("-".into(), |t| format!("{:.2} ms", 1e3 * t.as_secs_f64()));
            println!(
                "{:<18} {time:>12}  {} draws, {} dispatches",
                stage.stage, stage.draws, stage.dispatches
            );
        }
        println!("total {:.1} ms", 1e3 * frame.report.total.as_secs_f64());
        println!("{} triangles in the near region", frame.report.region_triangles);
        println!("{:#?}", frame.report.counters);
        if let Some(wanted) = wanted {
            let map = flip(&frame.image, &wanted, &FlipSettings::default())?;
            println!("mean FLIP against the Whitted integrator: {:.4}", map.mean());
        }
        frame.image
    };
    if let Some(path) = args.get(3) {
        image.save_png(path, &ToneCurve::default())?;
        println!("wrote {path}");
    }
    Ok(())
}
