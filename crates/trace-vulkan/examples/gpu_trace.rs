//! Million rays a second of camera rays on the GPU, by its own clock.
//!
//! `gpu_trace [triangles] [width] [height]`

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, Ray, glam::Vec3};
use niwaki_scene::generate::generate;
use niwaki_trace::Mode;
use niwaki_trace_vulkan::{Device, GpuScene, Query, Schedule, Trace, Tracer, TreeLayout};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut numbers = std::env::args().skip(1).map(|word| word.parse::<u32>());
    let mut next = |default| numbers.next().unwrap_or(Ok(default));
    let (triangles, width, height) = (next(20_000)?, next(256)?, next(144)?);
    let device = match Device::new() {
        Ok(device) => device,
        Err(error) => {
            println!("{error}");
            return Ok(());
        }
    };
    let mesh = generate("city", triangles as usize, 1).ok_or("no such scene")?.mesh;
    let bvh = Binned::default().build_mesh(&mesh)?;
    let bounds = mesh.bounds();
    let eye = bounds.center() + bounds.extent() * Vec3::new(0.7, 0.9, 0.8);
    let forward = (bounds.center() - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let pixel = |x: u32, y: u32| {
        let (u, v) = (x as f32 / width as f32 - 0.5, 0.5 - y as f32 / height as f32);
        let aspect = width as f32 / height as f32;
        Ray::new(eye, (forward + right * u * aspect + up * v).normalize())
    };
    let rays: Vec<Ray> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| pixel(x, y))
        .collect();
    println!("{}, {} triangles, {width}×{height} rays", device.name(), mesh.len());

    let tracer = Tracer::new(&device)?;
    let count = u32::try_from(rays.len())?;
    let ray_buffer = device.upload(&rays)?;
    let answers = device.buffer(16 * rays.len() as u64)?;
    for layout in TreeLayout::ALL {
        for mode in Mode::ALL {
            let scene = GpuScene::upload_in(&device, layout, mode, &bvh, &mesh)?;
            for schedule in [Schedule::RayAThread, Schedule::Persistent { groups: 1024 }] {
                for query in [Query::Closest, Query::Any] {
                    let trace = Trace {
                        scene: &scene,
                        rays: &ray_buffer,
                        count,
                        query,
                        answers: &answers,
                        work: None,
                        schedule,
                    };
                    let mut seconds = Vec::new();
                    // Drivers compile at the first dispatch.
                    for _ in 0..4 {
                        let mut batch = device.batch()?;
                        batch.mark("begin")?;
                        tracer.record(&mut batch, &trace)?;
                        batch.mark("trace")?;
                        seconds.extend(batch.submit()?.total());
                    }
                    let least = seconds.into_iter().fold(f64::INFINITY, f64::min);
                    let rate = f64::from(count) / least * 1e-6;
                    println!(
                        "{} {mode}, {schedule:?}, {query:?}: {rate:.2} million rays/s",
                        layout.name()
                    );
                }
            }
        }
    }
    Ok(())
}
