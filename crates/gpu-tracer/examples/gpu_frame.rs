//! Draws a frame of a procedural scene, and says what ambient occlusion costs:
//! `cargo run --release -p niwaki-gpu-tracer --example gpu_frame -- fairy 174117 out.png [FRAME]`.

use niwaki_build_binned::Binned;
use niwaki_core::Builder;
use niwaki_gpu_tracer::{FrameSettings, FrameTracer, TracedScene};
use niwaki_render::ToneCurve;
use niwaki_trace_vulkan::{Device, GpuError};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "fairy".into());
    let triangles = arguments.next().map_or(Ok(10_000), |n| n.parse())?;
    let file = arguments.next();
    let number = arguments.next().map_or(Ok(0), |n| n.parse())?;
    let device = match Device::new() {
        Ok(device) => device,
        Err(error @ (GpuError::NoLoader(_) | GpuError::NoDevice(_))) => {
            println!("{error}");
            return Ok(());
        }
        Err(error) => return Err(error.into()),
    };
    let scene = niwaki_scene::generate::generate(&name, triangles, 1).ok_or("no such scene")?;
    let bvh = Binned::default().build(&scene.mesh.prim_refs())?;
    let traced = TracedScene::upload(&device, &bvh, &scene)?;
    let camera = scene.camera_path().frame(number);
    let mut tracer = FrameTracer::new(&device)?;
    println!("{name}, {} triangles, on {}", scene.mesh.len(), device.name());
    for ao_rays in [0, 1, 2, 4, 8, 16] {
        let settings =
            FrameSettings { width: 320, height: 200, ao_rays, ..FrameSettings::default() };
        let mut times: Vec<_> =
            (0..4).map(|_| tracer.draw(&traced, &camera, &settings)).collect::<Result<_, _>>()?;
        // The first may have compiled.
        times.remove(0);
        times.sort_by(|a, b| a.total().total_cmp(&b.total()));
        let counts = tracer.count(&traced, &camera, &settings)?;
        println!(
            "{ao_rays:3} directions: {:8.2} ms primary, {:8.2} ms shading, {:6.1} nodes a pixel",
            1e3 * times[1].primary,
            1e3 * times[1].shade,
            (counts.primary.nodes + counts.shade.nodes) as f64 / settings.pixels() as f64,
        );
    }
    if let Some(file) = file {
        tracer.image()?.save_png(file, &ToneCurve::automatic())?;
    }
    Ok(())
}
