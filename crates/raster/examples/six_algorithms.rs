//! Renders a frame by each of the six algorithms and saves the pictures.
//!
//! `cargo run --example six_algorithms [FOLDER] [TRIANGLES] [WIDTHxHEIGHT]`

use niwaki_raster::{Algorithm, FrameError, Gpu, Renderer, Settings, study};
use niwaki_render::ToneCurve;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = args.next().map_or_else(std::env::temp_dir, Into::into);
    let triangles = args.next().map_or(Ok(8_000), |text| text.parse())?;
    let size = args.next().unwrap_or_else(|| "240x135".into());
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let (width, height) = (width.parse()?, height.parse()?);
    let gpu = match Gpu::new() {
        Ok(gpu) => gpu,
        Err(error @ FrameError::NoAdapter(_)) => {
            println!("{error}");
            return Ok(());
        }
        Err(error) => return Err(error.into()),
    };
    std::fs::create_dir_all(&folder)?;
    for (name, study) in
        [("atrium", study::atrium(triangles, 1)), ("tessellated", study::tessellated(triangles, 1))]
    {
        println!("{name}: {} triangles on {}", study.scene.mesh.len(), gpu.name());
        for algorithm in Algorithm::ALL {
            let lights =
                if algorithm.has_shadows() { study.shadow_lights(4) } else { study.lights.clone() };
            let settings = Settings::new(algorithm, width, height);
            let mut renderer = Renderer::new(&gpu, study.scene.clone(), lights, settings)?;
            let camera = study.path.at(0.25);
            renderer.draw(&camera, width, height)?; // drivers compile at the first
            let report = renderer.draw(&camera, width, height)?;
            let file = folder.join(format!("{name}-{}.png", algorithm.short().to_lowercase()));
            renderer.picture()?.to_image().save_png(&file, &ToneCurve::default())?;
            println!(
                "{algorithm:4} {:8.2} ms  {}",
                report.gpu_ms().unwrap_or(f64::NAN),
                file.display()
            );
            for pass in report.passes.iter().filter(|p| p.pass.light().unwrap_or(0) == 0) {
                println!("     {:8.2} ms  {}", pass.ms().unwrap_or(f64::NAN), pass.pass);
            }
        }
    }
    Ok(())
}
