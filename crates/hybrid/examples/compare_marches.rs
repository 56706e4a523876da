//! Compares ways to follow rays through the cube map: how far each image is from the Whitted
//! integrator's, and what it takes on the GPU (medians of alternating frames, in milliseconds).
//!
//! ```text
//! cargo run --release -p niwaki-hybrid --example compare_marches -- [WIDTHxHEIGHT] [ROUNDS] [NAME:TRIANGLES...]
//! ```

use niwaki_build_binned::Binned;
use niwaki_core::Builder;
use niwaki_hybrid::{Effect, Gpu, HybridRenderer, March, Settings, Stage};
use niwaki_render::{
    Image, Whitted, WhittedSettings,
    metrics::{FlipSettings, flip},
};
use niwaki_scene::{Scene, generate};
use niwaki_trace::WideScene;
use std::{error::Error, sync::Arc};

/// What is compared.
fn candidates() -> Vec<(String, Settings)> {
    let each = [
        ("linear", March::LINEAR, 1),
        ("pixels", March::Pixels, 1),
        ("hierarchical", March::Hierarchical, 1),
        ("linear", March::LINEAR, 2),
        ("hierarchical", March::Hierarchical, 2),
    ];
    each.map(|(name, march, layers)| {
        (format!("{name} {layers}"), Settings { march, layers, ..Settings::default() })
    })
    .into()
}

fn reference(scene: &Scene, width: u32, height: u32) -> Result<Image, Box<dyn Error>> {
    let max_depth = Settings::default().max_depth;
    let whitted = WhittedSettings { width, height, max_depth, ..WhittedSettings::default() };
    let frozen = scene.frozen(0.0)?;
    let tree = Binned::default().build_mesh(&frozen.mesh)?;
    Ok(Whitted::new(whitted).render(&frozen, &WideScene::new(&tree, &frozen.mesh)?))
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(0.0)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let arg = |i: usize, default: &'static str| args.get(i).map_or(default, String::as_str);
    let (width, height) = arg(0, "320x180").split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let (width, height) = (width.parse()?, height.parse()?);
    let rounds: usize = arg(1, "3").parse()?;
    let mut scenes: Vec<&str> = args.iter().skip(2).map(String::as_str).collect();
    if scenes.is_empty() {
        scenes.extend(["gallery:40000", "atrium:40000", "chess:60000", "courtyard:40000"]);
    }
    let gpu = Gpu::new()?;
    println!("{width} x {height} on {}", gpu.name());
    println!("march, layers      FLIP    rays  pyramid  layer 2   pixels    cells  second");
    for name in scenes {
        let (kind, count) = name.split_once(':').ok_or("a scene is NAME:TRIANGLES")?;
        let scene = generate::generate(kind, count.parse()?, 1).ok_or("no such scene")?;
        let scene = Arc::new(scene);
        let wanted = reference(&scene, width, height)?;
        println!("{name}");
        let list = candidates();
        let first = list.first().ok_or("nothing to compare")?.1.clone();
        let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), first)?;
        let mut times = vec![[vec![], vec![], vec![]]; list.len()];
        let mut rows = vec![String::new(); list.len()];
        // The first round compiles kernels.
        for round in 0..=rounds {
            for (k, (label, settings)) in list.iter().enumerate() {
                renderer.set_settings(settings.clone());
                let frame = renderer.render(&scene.cameras[0], width, height, 0.0)?;
                let stages = [
                    Stage::RayTraversal,
                    Stage::Effect(Effect::DepthPyramid),
                    Stage::Effect(Effect::SecondLayer),
                ];
                for (times, stage) in times[k].iter_mut().zip(stages) {
                    let time = frame.report.stage(stage).and_then(|s| s.gpu_time);
                    if round > 0 {
                        times.push(1e3 * time.unwrap_or_default().as_secs_f64());
                    }
                }
                let map = flip(&frame.image, &wanted, &FlipSettings::default())?;
                let c = frame.report.counters;
                let [rays, pyramid, second] = times[k].clone().map(median);
                rows[k] = format!(
                    "  {label:<14} {:.4} {rays:7.1} {pyramid:8.1} {second:8.1} {:8} {:8} {:7}",
                    map.mean(),
                    c.march_samples,
                    c.pyramid_cells,
                    c.second_layer_hits
                );
            }
        }
        println!("{}", rows.join("\n"));
    }
    Ok(())
}
