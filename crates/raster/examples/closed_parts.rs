//! What shadow volumes take when closed parts of the scene cast from one side, and from both: the two in
//! turns, medians of the times on the GPU.
//!
//! `cargo run --release -p niwaki-raster --example closed_parts -- TRIANGLES WIDTH HEIGHT`

use niwaki_raster::{Algorithm, FrameError, Gpu, Pass, Renderer, Settings, study};

const TURNS: usize = 7;
const LIGHTS: usize = 4;

fn main() -> Result<(), FrameError> {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse().unwrap_or(0));
    let mut number = |default: u32| numbers.next().filter(|n| *n > 0).unwrap_or(default);
    let (triangles, width, height) = (number(20_000), number(320), number(180));
    let gpu = match Gpu::new() {
        Err(error @ FrameError::NoAdapter(_)) => {
            println!("{error}");
            return Ok(());
        }
        other => other?,
    };
    println!("{}, {width}×{height}, {LIGHTS} lights", gpu.name());
    for study in [study::atrium(triangles as usize, 1), study::tessellated(triangles as usize, 1)] {
        println!("\n{}, {} triangles", study.scene.name, study.scene.mesh.len());
        let one = Settings::new(Algorithm::ShadowVolumes, width, height);
        let both = Settings { one_sided: false, ..one.clone() };
        let lights = study.shadow_lights(LIGHTS);
        let mut renderer = Renderer::new(&gpu, study.scene.clone(), lights, one.clone())?;
        for share in [0.1, 0.4, 0.7] {
            let camera = study.path.at(share);
            // Silhouettes, volumes, frame.
            let mut times = [[const { Vec::new() }; 3], [const { Vec::new() }; 3]];
            let mut counts = [None; 2];
            for turn in 0..=TURNS {
                for (which, settings) in [&one, &both].into_iter().enumerate() {
                    renderer.set_settings(settings.clone());
                    let report = renderer.draw(&camera, width, height)?;
                    counts[which] = renderer.volume_counts()?;
                    let of = |is: fn(&Pass) -> bool| -> f64 {
                        let passes = report.passes.iter().filter(|p| is(&p.pass));
                        passes.filter_map(|p| p.ms()).sum()
                    };
                    // Drivers compile at the first.
                    if turn > 0 {
                        times[which][0].push(of(|p| matches!(p, Pass::Silhouettes(_))));
                        times[which][1].push(of(|p| matches!(p, Pass::Volumes(_))));
                        times[which][2].push(of(|_| true));
                    }
                }
            }
            let median = |all: &Vec<f64>| {
                let mut all = all.clone();
                all.sort_by(f64::total_cmp);
                all[all.len() / 2]
            };
            let [a, b] = times.map(|all| all.each_ref().map(median));
            println!("at {share}, triangles that cast for the last light, their backs, walls:");
            println!("  one side {:?}, both {:?}", counts[0], counts[1]);
            for (what, (a, b)) in
                ["silhouettes", "volumes", "frame"].into_iter().zip(a.into_iter().zip(b))
            {
                println!("  {what:12} {a:8.2} ms, both {b:8.2} ms: {:.2} of it", a / b);
            }
        }
    }
    Ok(())
}
