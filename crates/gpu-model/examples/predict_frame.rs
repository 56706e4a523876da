//! Predicts frames before they are drawn, draws them on the Vulkan device at hand, and compares.
//!
//! Primary rays, ambient occlusion and shadows of a generated scene from several views, by the
//! kernels of `niwaki-trace-vulkan`. The device is measured first; then the model is fitted to half
//! of the frames, and judged by the other half.
//!
//! `predict_frame [triangles] [width] [height] [device.toml]`

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, Ray, TriangleMesh, glam::Vec3};
use niwaki_gpu_model::{
    Constants, Device, Form, FrameModel, KernelCounts, RaySettings,
    calibrate::{Observation, calibrate},
    hong_kim::Model,
    microbench,
    workload::{LightSample, Pattern, Sampling, View},
};
use niwaki_scene::generate::generate;
use niwaki_shaders::Options;
use niwaki_trace::{BinaryScene, Mode};
use niwaki_trace_vulkan::{self as gpu, GpuScene, Query, Schedule, Trace, Tracer, TreeLayout};
use std::error::Error;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u32| words.get(i).map_or(Ok(default), |word| word.parse());
    let (triangles, width, height) = (number(0, 20_000)?, number(1, 192)?, number(2, 108)?);
    let device = match gpu::Device::new() {
        Ok(device) => device,
        Err(error) => {
            println!("{error}");
            return Ok(());
        }
    };
    let parameters = match words.get(3) {
        Some(path) => Device::load(path)?,
        None => microbench::measure(&device, &microbench::Settings::default())?.device,
    };
    let mesh = generate("foliage", triangles as usize, 1).ok_or("no such scene")?.mesh;
    let bvh = Binned::default().build_mesh(&mesh)?;
    let cpu = BinaryScene::new(&bvh, &mesh)?;
    let scene = GpuScene::upload_in(&device, TreeLayout::Binary, Mode::Watertight, &bvh, &mesh)?;
    let constants = [("RARE", 0.0)];
    let options = Options { constants: &constants, ..Options::default() };
    let counts =
        KernelCounts::of_shader(&niwaki_shaders::compile("trace_binary", "main", &options)?)?;
    let model = FrameModel {
        constants: Constants::for_single_rays(&counts),
        form: Form::HongKim(Model::continuous()),
        ..FrameModel::new(parameters, counts, u64::from(width) * u64::from(height))
    };
    println!("{}: {} triangles, {width}×{height} pixels", device.name(), mesh.len());

    let bounds = mesh.bounds();
    let radius = 0.1 * bounds.extent().length();
    let sun = Vec3::new(0.4, -1.0, 0.3);
    let sampling = Sampling {
        ao_radius: radius,
        lights: vec![LightSample::Directional(sun)],
        pattern: Pattern::LowDiscrepancy,
        frame: [width, height],
        ..Sampling::default()
    };
    let tracer = Tracer::new(&device)?;
    let mut frames = Vec::new();
    for i in 0..6_u8 {
        // Around the scene, nearer and nearer, as in the paper.
        let angle = f32::from(i) * 0.7;
        let near = 0.65 - 0.09 * f32::from(i);
        let eye = bounds.center()
            + bounds.extent() * Vec3::new(near * angle.cos(), 0.3, near * angle.sin());
        let view = View::look_at(eye, bounds.center(), Vec3::Y, 0.9, width as f32 / height as f32);
        let workload = sampling.sample(&cpu, &mesh, &view);
        let rays = Rays::of(&cpu, &mesh, &view, [width, height], sun, radius);
        for (ao_rays, shadows) in
            [(0, false), (0, true), (1, false), (2, true), (4, false), (8, true)]
        {
            let seconds = rays.draw(&device, &tracer, &scene, ao_rays, shadows)?;
            let settings = RaySettings { ao_rays: f64::from(ao_rays), shadows };
            frames.push(Observation { workload, settings, seconds });
        }
    }
    let (fit_on, judged): (Vec<_>, Vec<_>) =
        frames.iter().enumerate().partition(|(i, _)| (i / 6) % 2 == 0);
    let [fit_on, judged] = [fit_on, judged]
        .map(|half| -> Vec<Observation> { half.into_iter().map(|(_, frame)| *frame).collect() });
    let fitted = calibrate(&model, &fit_on)?;
    println!(
        "{:>8} {:>8} {:>10} {:>12} {:>10}",
        "AO rays", "shadows", "drawn ms", "predicted ms", "fitted ms"
    );
    for frame in &judged {
        let of = |model: &FrameModel| model.predict(&frame.workload, &frame.settings);
        println!(
            "{:>8} {:>8} {:>10.3} {:>12.3} {:>10.3}",
            frame.settings.ao_rays,
            frame.settings.shadows,
            frame.seconds * 1e3,
            of(&model)?.seconds * 1e3,
            of(&fitted.model)?.seconds * 1e3
        );
    }
    for (name, model) in [("measured device", &model), ("fitted device", &fitted.model)] {
        let (error, order) = judge(model, &judged)?;
        println!("{name}: mean error {:.1} %, order (Kendall's τ) {order:.2}", 100.0 * error);
    }
    println!("\n{}", fitted.model.device.to_toml());
    Ok(())
}

/// Mean error, and the share of pairs in the right order less those in the wrong one.
fn judge(model: &FrameModel, frames: &[Observation]) -> Result<(f64, f64)> {
    let mut pairs = Vec::new();
    for frame in frames {
        pairs.push((model.predict(&frame.workload, &frame.settings)?.seconds, frame.seconds));
    }
    let error = pairs.iter().map(|(made, drawn)| (made - drawn).abs() / drawn).sum::<f64>();
    let (mut order, mut all) = (0.0, 0.0);
    for (i, a) in pairs.iter().enumerate() {
        for b in &pairs[..i] {
            order += ((a.0 - b.0) * (a.1 - b.1)).signum();
            all += 1.0;
        }
    }
    Ok((error / pairs.len() as f64, order / all))
}

/// The rays of a view.
struct Rays {
    primary: Vec<Ray>,
    /// Eight of each visible point.
    occlusion: Vec<[Ray; 8]>,
    shadow: Vec<Ray>,
}

impl Rays {
    fn of(
        scene: &BinaryScene,
        mesh: &TriangleMesh,
        view: &View,
        [width, height]: [u32; 2],
        sun: Vec3,
        radius: f32,
    ) -> Self {
        let mut random = fastrand::Rng::with_seed(1);
        let mut rays = Self { primary: vec![], occlusion: vec![], shadow: vec![] };
        for y in 0..height {
            for x in 0..width {
                let ray =
                    view.ray((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                rays.primary.push(ray);
                let (hit, _) = scene.closest_hit_counted(&ray);
                if !hit.is_hit() {
                    continue;
                }
                let triangle = mesh.triangle(hit.prim_id as usize);
                let normal = (triangle.v1 - triangle.v0)
                    .cross(triangle.v2 - triangle.v0)
                    .normalize_or(Vec3::Y);
                let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
                let origin = ray.at(hit.t) + normal * (1e-4 * radius);
                rays.occlusion.push(std::array::from_fn(|_| {
                    // Twice around a sphere's point: by the cosine.
                    let (z, angle) =
                        (2.0 * random.f32() - 1.0, std::f32::consts::TAU * random.f32());
                    let r = (1.0 - z * z).max(0.0).sqrt();
                    let on_sphere = Vec3::new(r * angle.cos(), r * angle.sin(), z);
                    let direction = (normal + on_sphere).normalize_or(normal);
                    Ray::new(origin, direction).with_range(0.0, radius)
                }));
                if normal.dot(-sun) > 0.0 {
                    rays.shadow.push(Ray::new(origin, -sun));
                }
            }
        }
        rays
    }

    /// Seconds of a frame by the device's clock, the least of several.
    fn draw(
        &self,
        device: &gpu::Device,
        tracer: &Tracer,
        scene: &GpuScene,
        ao_rays: u32,
        shadows: bool,
    ) -> Result<f64> {
        let occlusion: Vec<Ray> =
            self.occlusion.iter().flat_map(|rays| &rays[..ao_rays as usize]).copied().collect();
        let none = Vec::new();
        let shadow = if shadows { &self.shadow } else { &none };
        let mut passes = Vec::new();
        for (rays, query) in
            [(&self.primary, Query::Closest), (&occlusion, Query::Any), (shadow, Query::Any)]
        {
            let answers = device.buffer(query.answer_bytes() * rays.len() as u64)?;
            passes.push((device.upload(rays)?, u32::try_from(rays.len())?, query, answers));
        }
        let mut least = f64::INFINITY;
        // Drivers compile at the first dispatch.
        for _ in 0..5 {
            let mut batch = device.batch()?;
            batch.mark("begin")?;
            for (rays, count, query, answers) in &passes {
                let trace = Trace {
                    scene,
                    rays,
                    count: *count,
                    query: *query,
                    answers,
                    work: None,
                    schedule: Schedule::RayAThread,
                };
                tracer.record(&mut batch, &trace)?;
            }
            batch.mark("end")?;
            least = least.min(batch.submit()?.total().ok_or("no timestamps")?);
        }
        Ok(least)
    }
}
