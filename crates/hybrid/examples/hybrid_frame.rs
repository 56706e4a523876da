//! Renders one frame and prints its plan and what it took:
//!
//! ```text
//! cargo run --release -p niwaki-hybrid --example hybrid_frame -- \
//!     [NAME:TRIANGLES | FILE] [WIDTHxHEIGHT] [default|fast|fine|exact|paper] [OUT.png] [VIEW]
//! ```
//!
//! VIEW is `hits`, `normals`, `steps` or `whitted`, which renders the reference on the CPU.

use niwaki_build_binned::Binned;
use niwaki_core::Builder;
use niwaki_hybrid::{DebugView, Gpu, HybridRenderer, Settings};
use niwaki_render::{ToneCurve, Whitted, WhittedSettings};
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

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let arg = |i: usize, default: &'static str| args.get(i).map_or(default, String::as_str);
    let scene = Arc::new(scene(arg(0, "atrium:100000"))?);
    let (width, height) = arg(1, "320x180").split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let (width, height) = (width.parse()?, height.parse()?);
    let mut settings = match arg(2, "default") {
        "fast" => Settings::fast(),
        "fine" => Settings::fine(),
        "exact" => Settings::exact(),
        "paper" => Settings::paper(),
        _ => Settings::default(),
    };
    let camera = scene.cameras[0];
    let image = if arg(4, "") == "whitted" {
        let whitted = WhittedSettings {
            width,
            height,
            max_depth: settings.max_depth,
            cutoff: settings.throughput_cutoff,
            ..WhittedSettings::default()
        };
        let tree = Binned::default().build_mesh(&scene.mesh)?;
        Whitted::new(whitted).render(&scene, &WideScene::new(&tree, &scene.mesh)?)
    } else {
        settings.debug_view = match arg(4, "") {
            "hits" => DebugView::HitSource,
            "normals" => DebugView::Normal,
            "steps" => DebugView::MarchSteps,
            _ => DebugView::None,
        };
        let gpu = Gpu::new()?;
        println!("{}, {} triangles on {}", scene.name, scene.mesh.len(), gpu.name());
        let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), settings)?;
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
        frame.image
    };
    if let Some(path) = args.get(3) {
        image.save_png(path, &ToneCurve::default())?;
        println!("wrote {path}");
    }
    Ok(())
}
