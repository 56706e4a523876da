//! Traversal on the device, beside the driver's own ray tracing.

use super::{Setup, builds::plain, rows::TraceRow};
use crate::bench::rays::{RaySet, blocks_of};
use crate::bench::timing::{in_turns, median};
use crate::judge::{Reference, any, closest};
use anyhow::{Context, Result, bail};
use niwaki_core::{Bvh, Hit, Ray, TriangleMesh, to_u32};
use niwaki_trace::{BinaryScene, Mode};
use niwaki_trace_vulkan::{
    Batch, Buffer, DriverBuild, DriverMethod, DriverScene, DriverTrace, DriverTracer, GpuError,
    GpuScene, Query, Schedule, Trace, TreeLayout,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Something that is timed.
struct Engine {
    row: TraceRow,
    /// Nothing where a row says why.
    kind: Option<Kind>,
}

enum Kind {
    Ours(Arc<GpuScene>, Schedule),
    /// With hits that are recomputed.
    Driver(Arc<DriverScene>, DriverTracer),
}

/// Rays on the device, and room for the answers.
struct OnDevice {
    rays: Buffer,
    count: u32,
    query: Query,
    answers: Buffer,
}

impl OnDevice {
    fn new(setup: &Setup, rays: &[Ray], query: Query) -> Result<Self, GpuError> {
        let answers = setup.device.buffer(query.answer_bytes() * rays.len() as u64)?;
        Ok(Self { rays: setup.device.upload(rays)?, count: to_u32(rays.len()), query, answers })
    }
}

/// Measures all kernels over all trees of a scene on its ray sets.
pub(super) fn measure(
    setup: &Setup,
    scene: &str,
    mesh: &TriangleMesh,
    recorded: &Bvh,
    sets: &[RaySet],
) -> Result<Vec<TraceRow>> {
    setup.progress.message(&format!("{scene}: build trees"));
    let engines = engines(setup, scene, mesh)?;
    let cpu = BinaryScene::new_in(Mode::Watertight, recorded, mesh)?;
    let mut rows = Vec::new();
    for set in sets {
        setup.progress.message(&format!("{scene}: {} rays", set.name));
        rows.extend(measure_set(setup, mesh, &cpu, &engines, set)?);
        setup.progress.step();
    }
    Ok(rows)
}

/// Everything that is compared. What does not fit the device is there with a note.
fn engines(setup: &Setup, scene: &str, mesh: &TriangleMesh) -> Result<Vec<Engine>> {
    let mut engines = Vec::new();
    for builder in &setup.trees {
        let bvh = builder.build_mesh(mesh)?;
        for layout in TreeLayout::ALL.into_iter().filter(|l| setup.layouts.contains(l)) {
            for &mode in &setup.modes {
                let made = GpuScene::upload_in(&setup.device, layout, mode, &bvh, mesh);
                let made = made.map(Arc::new);
                for &schedule in &setup.schedules {
                    let schedule_name = match schedule {
                        Schedule::RayAThread => "ray a thread",
                        Schedule::Persistent { .. } => "persistent",
                    };
                    let tree = builder.name();
                    let mut row = TraceRow {
                        scene: scene.to_owned(),
                        triangles: mesh.len(),
                        engine: format!("{tree}, {}, {mode}, {schedule_name}", layout.name()),
                        tree: tree.to_owned(),
                        layout: layout.name().to_owned(),
                        mode: mode.to_string(),
                        schedule: schedule_name.to_owned(),
                        ..TraceRow::default()
                    };
                    let kind = match &made {
                        Ok(scene) => {
                            row.bytes = Some(scene.bytes());
                            Some(Kind::Ours(scene.clone(), schedule))
                        }
                        Err(error) => {
                            row.note = Some(plain(error)?);
                            None
                        }
                    };
                    engines.push(Engine { row, kind });
                }
            }
        }
    }
    let offered = |method: &DriverMethod| method.is_offered(setup.device.info());
    let methods: Vec<_> = DriverMethod::ALL.into_iter().filter(offered).collect();
    if methods.is_empty() {
        return Ok(engines);
    }
    for preference in DriverBuild::ALL {
        let made = DriverScene::build(&setup.device, mesh, preference).map(Arc::new);
        for &method in &methods {
            let mut row = TraceRow {
                scene: scene.to_owned(),
                triangles: mesh.len(),
                engine: format!("{}, {}", preference.name(), method.name()),
                tree: preference.name().to_owned(),
                schedule: method.name().to_owned(),
                is_driver: true,
                ..TraceRow::default()
            };
            let kind = match &made {
                Ok(scene) => {
                    row.bytes = Some(scene.bytes());
                    let tracer = DriverTracer::new(&setup.device, method)?;
                    Some(Kind::Driver(scene.clone(), tracer))
                }
                Err(error) => {
                    row.note = Some(plain(error)?);
                    None
                }
            };
            engines.push(Engine { row, kind });
        }
    }
    Ok(engines)
}

/// Checks and then times all engines on a ray set.
fn measure_set(
    setup: &Setup,
    mesh: &TriangleMesh,
    cpu: &BinaryScene,
    engines: &[Engine],
    set: &RaySet,
) -> Result<Vec<TraceRow>> {
    let query = if set.any_hit { Query::Any } else { Query::Closest };
    let rows = engines.iter().map(|engine| TraceRow {
        rays: set.name.clone(),
        query: if set.any_hit { "any" } else { "closest" }.to_owned(),
        ray_count: set.rays.len(),
        ..engine.row.clone()
    });
    let mut rows: Vec<TraceRow> = rows.collect();
    check(setup, mesh, cpu, engines, (set, query), &mut rows)?;
    let on_device = OnDevice::new(setup, &set.rays, query)?;
    let mut seconds = vec![Vec::new(); engines.len()];
    let mut fault = None;
    in_turns(engines.len(), setup.effort, |i| {
        let kind = engines[i].kind.as_ref().filter(|_| rows[i].note.is_none())?;
        match kind.time(setup, &on_device) {
            Ok(time) => {
                seconds[i].push(time);
                Some(Duration::from_secs_f64(time))
            }
            Err(error) => {
                match plain(&error) {
                    Ok(note) => rows[i].note = Some(note),
                    Err(error) => fault = Some(error),
                }
                None
            }
        }
    });
    if let Some(fault) = fault {
        return Err(fault);
    }
    for (row, seconds) in rows.iter_mut().zip(&seconds) {
        row.repeats = seconds.len();
        if !seconds.is_empty() && row.note.is_none() {
            let seconds = median(seconds);
            row.ms = Some(seconds * 1e3);
            row.mrays_per_s = Some(row.ray_count as f64 * 1e-6 / seconds);
        }
    }
    Ok(rows)
}

/// Compares answers to some of the rays with the CPU's. What is checked is what is timed, compiled by
/// the driver meanwhile. An error if one of our kernels is wrong.
fn check(
    setup: &Setup,
    mesh: &TriangleMesh,
    cpu: &BinaryScene,
    engines: &[Engine],
    (set, query): (&RaySet, Query),
    rows: &mut [TraceRow],
) -> Result<()> {
    let rays = blocks_of(&set.rays, setup.checked);
    let on_device = OnDevice::new(setup, &rays, query)?;
    let hits = Reference::new(mesh, &rays, closest(cpu, &rays));
    let flags = Reference::new(mesh, &rays, any(cpu, &rays));
    for (engine, row) in engines.iter().zip(rows) {
        let Some(kind) = &engine.kind else { continue };
        let answered = match kind.answer(setup, &on_device) {
            Ok(answered) => answered,
            Err(error) => {
                row.note = Some(plain(&error)?);
                continue;
            }
        };
        let (tally, wrong) = match &answered {
            Answers::Hits(answers) => hits.compare(answers),
            Answers::Flags(answers) => flags.compare(answers),
        };
        row.checked = tally;
        if tally.ours_wrong > 0 && !row.is_driver {
            let first = wrong.first().cloned().unwrap_or_default();
            bail!("{} is wrong about {} rays: {first}", row.engine, tally.ours_wrong);
        }
        if let (Kind::Driver(scene, tracer), Answers::Hits(answers)) = (kind, &answered) {
            // What will be timed hits the same triangles.
            let plain = Kind::Driver(scene.clone(), tracer.clone().with_recomputed(false));
            let Answers::Hits(plain) = plain.answer(setup, &on_device)? else { continue };
            let other = answers.iter().zip(&plain).position(|(a, b)| a.prim_id != b.prim_id);
            if let Some(i) = other {
                bail!("{} hits other triangles when asked again: ray {:?}", row.engine, rays[i]);
            }
        }
    }
    Ok(())
}

enum Answers {
    Hits(Vec<Hit>),
    Flags(Vec<bool>),
}

impl Kind {
    fn record(
        &self,
        setup: &Setup,
        batch: &mut Batch,
        on_device: &OnDevice,
    ) -> Result<(), GpuError> {
        let OnDevice { rays, count, query, answers } = on_device;
        let (count, query) = (*count, *query);
        match self {
            Self::Ours(scene, schedule) => {
                let schedule = *schedule;
                let trace = Trace { scene, rays, count, query, answers, work: None, schedule };
                setup.tracer.record(batch, &trace)
            }
            Self::Driver(scene, tracer) => {
                tracer.record(batch, &DriverTrace { scene, rays, count, query, answers })
            }
        }
    }

    fn answer(&self, setup: &Setup, on_device: &OnDevice) -> Result<Answers, GpuError> {
        let mut batch = setup.device.batch()?;
        self.record(setup, &mut batch, on_device)?;
        batch.submit()?;
        Ok(match on_device.query {
            Query::Closest => Answers::Hits(on_device.answers.read()?),
            Query::Any => {
                let words: Vec<u32> = on_device.answers.read()?;
                Answers::Flags(words.into_iter().map(|word| word != 0).collect())
            }
        })
    }

    /// Seconds of one pass over all rays: the device's, or the host's where it has none.
    fn time(&self, setup: &Setup, on_device: &OnDevice) -> Result<f64, GpuError> {
        let mut batch = setup.device.batch()?;
        batch.mark("begin")?;
        match self {
            // Our numbers for its hits are no work of the driver's.
            Self::Driver(scene, tracer) => {
                let tracer = tracer.clone().with_recomputed(false);
                Self::Driver(scene.clone(), tracer).record(setup, &mut batch, on_device)?;
            }
            ours @ Self::Ours(..) => ours.record(setup, &mut batch, on_device)?,
        }
        batch.mark("end")?;
        let start = Instant::now();
        let timings = batch.submit()?;
        let wall = start.elapsed().as_secs_f64();
        Ok(timings.total().filter(|&seconds| seconds > 0.0).unwrap_or(wall))
    }
}

/// What the names on the command line mean.
pub(super) fn schedules(names: &[String], groups: u32) -> Vec<Schedule> {
    let mut schedules = Vec::new();
    for name in names {
        let schedule = match name.as_str() {
            "persistent" => Schedule::Persistent { groups },
            _ => Schedule::RayAThread,
        };
        if !schedules.contains(&schedule) {
            schedules.push(schedule);
        }
    }
    schedules
}

/// What the names on the command line mean.
pub(super) fn modes(names: &[String]) -> Result<Vec<Mode>> {
    let of = |name: &String| {
        let known = Mode::ALL.into_iter().find(|mode| mode.to_string() == *name);
        known.with_context(|| format!("there is no mode `{name}`"))
    };
    let mut modes = Vec::new();
    for name in names {
        let mode = of(name)?;
        if !modes.contains(&mode) {
            modes.push(mode);
        }
    }
    Ok(modes)
}
