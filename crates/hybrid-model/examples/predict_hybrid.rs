//! Fits the model to some frames of a scene and says what it makes of others, part by part:
//!
//! ```text
//! cargo run --release -p niwaki-hybrid-model --example predict_hybrid -- [NAME:TRIANGLES] [WIDTHxHEIGHT]
//! ```

use niwaki_build_binned::Binned;
use niwaki_core::Builder;
use niwaki_frame_control::{Ladder, kendall_tau_b};
use niwaki_hybrid::{Gpu, HybridError, HybridRenderer, Settings};
use niwaki_hybrid_model::{DrawnFrame, HybridModel, Part, ViewSampler, ViewSampling, settings};
use niwaki_scene::generate;
use niwaki_trace::QuantisedScene;
use std::{error::Error, sync::Arc, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let arg = |i: usize, default: &'static str| args.get(i).map_or(default, String::as_str);
    let (name, count) =
        arg(0, "gallery:5000").split_once(':').ok_or("a scene is NAME:TRIANGLES")?;
    let (width, height) = arg(1, "96x54").split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let full: [u32; 2] = [width.parse()?, height.parse()?];
    let scene = generate::generate(name, count.parse()?, 1).ok_or("no such scene")?;
    let scene = Arc::new(scene);
    let gpu = match Gpu::new() {
        Ok(gpu) => gpu,
        Err(error @ HybridError::NoAdapter(_)) => {
            println!("{error}");
            return Ok(());
        }
        Err(error) => return Err(error.into()),
    };

    let bvh = Binned::default().build(&scene.mesh.prim_refs())?;
    let traced = Arc::new(QuantisedScene::<8>::new(&bvh, &scene.mesh)?);
    let base = Settings { face_resolution: 256, shadow_resolution: 512, ..Settings::default() };
    let sampler = ViewSampler::new(&scene, traced, &base, ViewSampling::default())?;
    let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), base.clone())?;
    let ladder = Ladder::hybrid();
    let diagonal = scene.mesh.bounds().extent().length();
    let path = scene.camera_path();

    // Views at both ends of the path to fit to, one between them to predict.
    let mut drawn = [Vec::new(), Vec::new()];
    for (share, set, step) in [(0, 0, 4), (9, 0, 4), (5, 1, 3)] {
        let camera = path.frame(path.frames.saturating_sub(1) * share / 9);
        let begun = Instant::now();
        let work = Arc::new(sampler.sample(&camera));
        println!(
            "view {share}: {:.2} of the pixels show something, {:.3} rays a pixel at depth 1, {:.3} up to 4, sampled in {:.2} ms",
            work.visible,
            work.rays_up_to(1),
            work.rays_up_to(4),
            1e3 * begun.elapsed().as_secs_f64()
        );
        for rung in ladder.rungs().iter().step_by(step) {
            let settings = settings(&base, rung, diagonal);
            let size = rung.scaled(full);
            renderer.set_settings(settings.clone());
            // Kernels are compiled at the first frame that needs them.
            renderer.draw(&camera, size[0], size[1], 0.0)?;
            renderer.set_settings(settings.clone());
            let (_, report) = renderer.draw(&camera, size[0], size[1], 0.0)?;
            drawn[set].push(DrawnFrame { settings, size, work: work.clone(), report });
        }
    }
    let [seen, new] = drawn;
    let model = HybridModel::fit(&seen)?;
    println!("\nfitted to {} frames; {} of another view:\n", seen.len(), new.len());
    println!("milliseconds, predicted / measured");
    let names = Part::ALL.map(|part| format!("{:>15}", format!("{part:?}")));
    println!("{}{:>15}  error %", names.concat(), "frame");
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    for frame in &new {
        let made = model.predict(&frame.settings, frame.size, &frame.work);
        let took = frame.parts().ok_or("the device has no timestamps")?;
        let whole = (made.milliseconds(), took.iter().sum::<f64>());
        for (p, m) in made.parts.into_iter().zip(took).chain([whole]) {
            print!("{:>15}", format!("{p:.1} / {m:.1}"));
        }
        println!("  {:7.1}", 100.0 * (whole.0 / whole.1 - 1.0));
        predicted.push(whole.0);
        measured.push(whole.1);
    }
    let off = predicted.iter().zip(&measured).map(|(p, m)| (p / m - 1.0).abs()).sum::<f64>();
    println!("\nmean error {:.1} %", 100.0 * off / new.len().max(1) as f64);
    if let Some(tau) = kendall_tau_b(&predicted, &measured) {
        println!("Kendall's tau {tau:.3}");
    }
    Ok(())
}
