//! Builds linear BVHs on the GPU and prints how fast, stage by stage. Arguments are numbers of
//! triangles of a procedural scene, or files.
//!
//! `cargo run --release -p niwaki-trace-vulkan --example gpu_lbvh -- 1000000 scene.glb`

use niwaki_build_lbvh::Lbvh;
use niwaki_core::{Builder, TriangleMesh};
use niwaki_scene::LoadOptions;
use niwaki_trace_vulkan::{Device, GpuLbvh, LbvhConfig, LbvhTimes};
use std::time::Instant;

const ROUNDS: usize = 9;

fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

/// As many random triangles as the name says, a few times as large as the space between them; or
/// those of the file of that name.
fn mesh(name: &str) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    if let Ok(count) = name.parse::<usize>() {
        let size = 3.0 / (count as f32).cbrt();
        return Ok(niwaki_hard_cases::soup_mesh(count, size, 1));
    }
    Ok(niwaki_scene::load(name.as_ref(), &LoadOptions::default())?.mesh)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scenes: Vec<String> = std::env::args().skip(1).collect();
    if scenes.is_empty() {
        scenes = vec!["10000".into(), "100000".into()];
    }
    let device = Device::new()?;
    println!("{} ({})", device.name(), device.info().driver);
    let builder = GpuLbvh::new(&device)?;
    for name in scenes {
        let mesh = mesh(&name)?;
        let count = mesh.len();
        let positions = device.upload(mesh.positions())?;
        let indices = device.upload(mesh.indices())?;
        for config in [LbvhConfig::every_frame(), LbvhConfig::default()] {
            let workspace = builder.workspace(count, &config)?;
            workspace.set_count(count)?;
            let cpu = Lbvh { code_bits: config.code_bits, ..Lbvh::default() };
            let (mut rounds, mut walls, mut cpu_walls) = (Vec::new(), Vec::new(), Vec::new());
            // One more to begin with, in which drivers translate shaders.
            for round in 0..=ROUNDS {
                let start = Instant::now();
                let mut batch = device.batch()?;
                workspace.record_triangles(&mut batch, &positions, &indices)?;
                workspace.record(&mut batch)?;
                let timings = batch.submit()?;
                let wall = start.elapsed().as_secs_f64();
                let start = Instant::now();
                let bvh = cpu.build_mesh(&mesh)?;
                let cpu_wall = start.elapsed().as_secs_f64();
                if round == 0 {
                    assert_eq!(workspace.download()?, bvh, "the same tree");
                    continue;
                }
                rounds.push(LbvhTimes::of(&timings));
                walls.push(wall);
                cpu_walls.push(cpu_wall);
            }
            println!(
                "\n{name}: {count} triangles, codes of {} bits: median of {ROUNDS}",
                config.code_bits
            );
            println!("{:>10}  {:>9}  {:>12}", "stage", "ms", "Mtriangles/s");
            let line = |name: &str, seconds: f64| {
                let rate = count as f64 * 1e-6 / seconds;
                println!("{name:>10}  {:9.3}  {rate:12.1}", seconds * 1e3);
            };
            for (stage, (name, _)) in LbvhTimes::default().stages().iter().enumerate() {
                line(name, median(rounds.iter().map(|times| times.stages()[stage].1).collect()));
            }
            line("all", median(rounds.iter().map(LbvhTimes::total).collect()));
            line("host waits", median(walls));
            line("CPU build", median(cpu_walls));
        }
    }
    Ok(())
}
