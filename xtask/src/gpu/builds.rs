//! Builds on the device, beside the driver's and the CPU's.

use super::{
    Setup,
    rows::{BuildRow, Stage, note},
};
use crate::bench::timing::{in_turns, median};
use anyhow::{Result, bail};
use niwaki_build_lbvh::Lbvh;
use niwaki_core::{Builder, TriangleMesh};
use niwaki_trace_vulkan::{
    Buffer, DriverBuild, DriverMethod, DriverScene, DriverTimes, GpuError, LbvhConfig, LbvhError,
    LbvhTimes, LbvhWorkspace,
};
use std::time::{Duration, Instant};

/// What builds.
enum Engine {
    Lbvh(Box<LbvhWorkspace>),
    Driver(Box<DriverScene>),
    Cpu(Lbvh),
}

/// A builder with what it took so far.
struct Rival {
    row: BuildRow,
    engine: Option<Engine>,
    /// Seconds of each measurement, all stages.
    seconds: Vec<f64>,
    /// Seconds of each stage, by measurement.
    stages: Vec<Vec<(&'static str, f64)>>,
}

/// Measures all builders on a mesh.
pub(super) fn measure(setup: &Setup, scene: &str, mesh: &TriangleMesh) -> Result<Vec<BuildRow>> {
    let device = &setup.device;
    let inputs = || Ok((device.upload(mesh.positions())?, device.upload(mesh.indices())?));
    let inputs: Result<(Buffer, Buffer), GpuError> = inputs();
    let mut rivals = Vec::new();
    let row = |builder: String| BuildRow {
        scene: scene.to_owned(),
        triangles: mesh.len(),
        builder,
        ..BuildRow::default()
    };
    for config in [LbvhConfig::every_frame(), LbvhConfig::default()] {
        let mut row = row(format!("lbvh, {} bits", config.code_bits));
        let engine = match &inputs {
            Ok(inputs) => lbvh(setup, mesh, &config, inputs, &mut row)?,
            Err(error) => {
                row.note = Some(plain(error)?);
                None
            }
        };
        rivals.push(Rival::new(row, engine));
    }
    if DriverMethod::ALL.into_iter().any(|method| method.is_offered(device.info())) {
        for preference in DriverBuild::ALL {
            let mut row = row(preference.name().to_owned());
            let engine = match DriverScene::build(device, mesh, preference) {
                Ok(scene) => {
                    row.bytes = Some(scene.bytes());
                    Some(Engine::Driver(Box::new(scene)))
                }
                Err(error) => {
                    row.note = Some(plain(&error)?);
                    None
                }
            };
            rivals.push(Rival::new(row, engine));
        }
    }
    let row = row(format!("lbvh, 63 bits, CPU, {} threads", rayon::current_num_threads()));
    let engine = Some(Engine::Cpu(Lbvh::default()));
    rivals.push(Rival::new(row, engine));

    let mut fault = None;
    in_turns(rivals.len(), setup.effort, |i| {
        let rival = &mut rivals[i];
        match time(setup, rival.engine.as_ref()?, mesh, inputs.as_ref().ok()?) {
            Ok((seconds, stages)) => {
                rival.seconds.push(seconds);
                rival.stages.push(stages);
                Some(Duration::from_secs_f64(seconds))
            }
            Err(error) => {
                fault = Some(error);
                None
            }
        }
    });
    if let Some(fault) = fault {
        return Err(fault);
    }
    setup.progress.step();
    Ok(rivals.into_iter().map(Rival::finish).collect())
}

/// The text of an error that ends a row and not the run.
pub(super) fn plain(error: &GpuError) -> Result<String> {
    if let GpuError::DeviceLost { .. } = error {
        bail!("{error}");
    }
    Ok(note(error))
}

/// A workspace whose first tree was compared with the CPU's.
fn lbvh(
    setup: &Setup,
    mesh: &TriangleMesh,
    config: &LbvhConfig,
    inputs: &(Buffer, Buffer),
    row: &mut BuildRow,
) -> Result<Option<Engine>> {
    let workspace = match setup.lbvh.workspace(mesh.len(), config) {
        Ok(workspace) => workspace,
        Err(LbvhError::Gpu(error)) => {
            row.note = Some(plain(&error)?);
            return Ok(None);
        }
        Err(other) => return Err(other.into()),
    };
    workspace.set_count(mesh.len())?;
    build(setup, &workspace, inputs)?;
    let ours = workspace.download()?;
    let theirs = Lbvh { code_bits: config.code_bits, ..Lbvh::default() }.build_mesh(mesh)?;
    if ours != theirs {
        bail!("the tree of codes of {} bits is not the CPU's", config.code_bits);
    }
    row.bytes = Some((size_of_val(&ours.nodes[..]) + size_of_val(&ours.prim_ids[..])) as u64);
    Ok(Some(Engine::Lbvh(Box::new(workspace))))
}

/// Builds once; the device's own times, and the host's.
fn build(
    setup: &Setup,
    workspace: &LbvhWorkspace,
    (positions, indices): &(Buffer, Buffer),
) -> Result<(LbvhTimes, f64)> {
    let start = Instant::now();
    let mut batch = setup.device.batch()?;
    workspace.record_triangles(&mut batch, positions, indices)?;
    workspace.record(&mut batch)?;
    let times = LbvhTimes::of(&batch.submit()?);
    Ok((times, start.elapsed().as_secs_f64()))
}

/// Measures once: all seconds, and those of stages.
fn time(
    setup: &Setup,
    engine: &Engine,
    mesh: &TriangleMesh,
    inputs: &(Buffer, Buffer),
) -> Result<(f64, Vec<(&'static str, f64)>)> {
    // Without timestamps, all is 0 and the host's clock has to do.
    let or_wall = |seconds: f64, wall: f64| if seconds > 0.0 { seconds } else { wall };
    match engine {
        Engine::Lbvh(workspace) => {
            let (times, wall) = build(setup, workspace, inputs)?;
            Ok((or_wall(times.total(), wall), times.stages().to_vec()))
        }
        Engine::Driver(scene) => {
            let start = Instant::now();
            let times: DriverTimes = scene.rebuild()?;
            let wall = start.elapsed().as_secs_f64();
            let stages = vec![("bottom level", times.bottom), ("top level", times.top)];
            Ok((or_wall(times.total(), wall), stages))
        }
        Engine::Cpu(builder) => {
            let start = Instant::now();
            builder.build_mesh(mesh)?;
            Ok((start.elapsed().as_secs_f64(), Vec::new()))
        }
    }
}

impl Rival {
    fn new(row: BuildRow, engine: Option<Engine>) -> Self {
        Self { row, engine, seconds: Vec::new(), stages: Vec::new() }
    }

    fn finish(self) -> BuildRow {
        let mut row = self.row;
        row.repeats = self.seconds.len();
        if row.repeats == 0 {
            return row;
        }
        let seconds = median(&self.seconds);
        row.ms = Some(seconds * 1e3);
        row.mtriangles_per_s = Some(row.triangles as f64 * 1e-6 / seconds);
        let names = self.stages.first().map(|stages| stages.iter().map(|(name, _)| *name));
        for (i, name) in names.into_iter().flatten().enumerate() {
            let of_stage: Vec<f64> = self.stages.iter().map(|stages| stages[i].1).collect();
            row.stages.push(Stage { name: name.to_owned(), ms: median(&of_stage) * 1e3 });
        }
        row
    }
}
