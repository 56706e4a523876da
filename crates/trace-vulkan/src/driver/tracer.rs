//! Rays through the driver's acceleration structures.

use super::{DriverMethod, DriverScene, pipeline::RayPipeline, structure::functions};
use crate::{
    Batch, Buffer, Device, GpuError, Kernel, Query,
    batch::Resource,
    tracer::{CHUNK, RAY_BYTES, WORKGROUP, is_fused},
};
use niwaki_core::{Hit, Ray, to_u32};
use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Rays to be traced by the driver as part of a [`Batch`].
#[derive(Clone, Copy, Debug)]
pub struct DriverTrace<'a> {
    /// What they are traced in.
    pub scene: &'a DriverScene,
    /// The rays, 32 bytes each (`niwaki_core::Ray`).
    pub rays: &'a Buffer,
    /// How many; the first of the buffer.
    pub count: u32,
    /// What is asked.
    pub query: Query,
    /// Where the answers go, [`Query::answer_bytes`] each.
    pub answers: &'a Buffer,
}

/// A pipeline of either kind.
#[derive(Clone, Debug)]
enum Program {
    Pipeline(Arc<RayPipeline>),
    Query(Kernel),
}

/// Traces rays by the driver's own ray tracing: [`crate::Tracer`]'s queries, another system's answers.
///
/// Which triangle is hit is the driver's choice; distance and barycentrics are then computed by our
/// watertight triangle test, so that a hit of the same triangle has the bits of our kernels
/// ([`DriverTracer::with_recomputed`]). Pipelines are made when they are first needed. Clones share them.
#[derive(Clone, Debug)]
pub struct DriverTracer {
    device: Device,
    method: DriverMethod,
    is_fused: bool,
    is_recomputed: bool,
    /// By query, and whether hits are recomputed.
    programs: Arc<Mutex<HashMap<(Query, bool), Program>>>,
}

impl DriverTracer {
    /// A tracer without pipelines.
    ///
    /// # Errors
    /// [`GpuError::NotOffered`] on a device that does not offer the method
    /// ([`DriverMethod::is_offered`]), and as [`crate::Tracer::new`].
    pub fn new(device: &Device, method: DriverMethod) -> Result<Self, GpuError> {
        method.check(device.info())?;
        Ok(Self {
            device: device.clone(),
            method,
            is_fused: is_fused(device)?,
            is_recomputed: true,
            programs: Arc::default(),
        })
    }

    /// The same tracer with hits that are recomputed by our triangle test, the default, or as the driver
    /// gives them, which spares it 48 bytes of vertices and indices a hit: what a comparison of speed is
    /// about. Ray queries then give the driver's distance and barycentrics; pipelines its distance, and
    /// barycentrics of 0, which are an attribute that the translator of shaders does not know.
    #[must_use]
    pub fn with_recomputed(self, is_recomputed: bool) -> Self {
        Self { is_recomputed, ..self }
    }

    /// The device.
    #[must_use]
    pub const fn device(&self) -> &Device {
        &self.device
    }

    /// How it traces.
    #[must_use]
    pub const fn method(&self) -> DriverMethod {
        self.method
    }

    /// The nearest hit of each ray, as the driver sees it.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] and [`GpuError::DeviceLost`]; [`GpuError::TooLarge`] if vertices or
    /// indices are more than the device can bind.
    pub fn closest_hits(&self, scene: &DriverScene, rays: &[Ray]) -> Result<Vec<Hit>, GpuError> {
        self.all(scene, rays, Query::Closest)
    }

    /// Whether each ray hits anything.
    ///
    /// # Errors
    /// As [`DriverTracer::closest_hits`].
    pub fn any_hits(&self, scene: &DriverScene, rays: &[Ray]) -> Result<Vec<bool>, GpuError> {
        let flags = self.all::<u32>(scene, rays, Query::Any)?;
        Ok(flags.into_iter().map(|flag| flag != 0).collect())
    }

    /// Adds the tracing of rays that are on the device to a batch.
    ///
    /// # Errors
    /// [`GpuError::OutOfRange`] if a buffer is too small for `count`, [`GpuError::TooLarge`] if one
    /// is larger than the device can bind or the rays are more than a launch may have, and as
    /// [`Device::kernel`].
    pub fn record(&self, batch: &mut Batch, trace: &DriverTrace<'_>) -> Result<(), GpuError> {
        let DriverTrace { scene, rays, count, query, answers } = *trace;
        let rays = rays.view(0, RAY_BYTES * u64::from(count))?;
        let answers = answers.view(0, query.answer_bytes() * u64::from(count))?;
        if count == 0 {
            return Ok(());
        }
        let program = self.program(query)?;
        let bindings = match &program {
            Program::Pipeline(pipeline) => &pipeline.pipeline.bindings,
            Program::Query(kernel) => kernel.bindings(),
        };
        let resources: Vec<Resource<'_>> = bindings
            .iter()
            .map(|binding| match binding.name.as_str() {
                "structure" => Resource::Structure(scene.top.handle),
                "rays" => Resource::Buffer(&rays),
                "positions" => Resource::Buffer(&scene.positions),
                "indices" => Resource::Buffer(&scene.indices),
                // Of the two answers, a pipeline uses one.
                _ => Resource::Buffer(&answers),
            })
            .collect();
        let mut words = scene.words;
        words.rays = count;
        match &program {
            Program::Pipeline(pipeline) => {
                let limits = functions(&self.device.inner)?.limits;
                let width = count.min(limits.max_width.max(1));
                let height = count.div_ceil(width);
                let wanted = u64::from(width) * u64::from(height);
                if wanted > u64::from(limits.max_invocations) {
                    return Err(GpuError::TooLarge {
                        what: "the number of rays of a launch".to_owned(),
                        wanted,
                        limit: limits.max_invocations.into(),
                        remedy: "trace fewer at once",
                    });
                }
                let words = bytemuck::bytes_of(&words);
                pipeline.record(batch, &resources, words, [width, height])?;
            }
            Program::Query(kernel) => {
                let groups = self.device.info().groups_for(u64::from(count), WORKGROUP);
                batch.dispatch_resources(kernel, &resources, &words, groups)?;
            }
        }
        scene.keep(batch);
        Ok(())
    }

    fn program(&self, query: Query) -> Result<Program, GpuError> {
        let mut programs = self.programs.lock().unwrap_or_else(PoisonError::into_inner);
        // Without a hit to be recomputed, both are the same.
        let is_recomputed = self.is_recomputed && query == Query::Closest;
        let key = (query, is_recomputed);
        if let Some(program) = programs.get(&key) {
            return Ok(program.clone());
        }
        let flag = |is: bool| f64::from(u8::from(is));
        let common = [
            ("FUSED", flag(self.is_fused)),
            ("ANY", flag(query == Query::Any)),
            ("RECOMPUTE", flag(is_recomputed)),
        ];
        let program = match self.method {
            DriverMethod::Pipeline => {
                Program::Pipeline(Arc::new(RayPipeline::new(&self.device, &common)?))
            }
            DriverMethod::Query => {
                let [fused, any, recompute] = common;
                let constants = [fused, any, recompute, ("WORKGROUP", f64::from(WORKGROUP))];
                Program::Query(self.device.kernel("driver/query", "main", &constants)?)
            }
        };
        programs.insert(key, program.clone());
        Ok(program)
    }

    /// The answers to all rays, chunk by chunk.
    fn all<A: bytemuck::Pod>(
        &self,
        scene: &DriverScene,
        rays: &[Ray],
        query: Query,
    ) -> Result<Vec<A>, GpuError> {
        let bound = usize::try_from(self.device.info().max_binding_bytes / RAY_BYTES);
        let chunk = CHUNK.min(bound.unwrap_or(CHUNK)).clamp(1, rays.len().max(1));
        let ray_buffer = self.device.buffer(RAY_BYTES * chunk as u64)?;
        let answer_buffer = self.device.buffer(query.answer_bytes() * chunk as u64)?;
        let mut answers = vec![A::zeroed(); rays.len()];
        for (rays, answers) in rays.chunks(chunk).zip(answers.chunks_mut(chunk)) {
            ray_buffer.write(0, rays)?;
            let mut batch = self.device.batch()?;
            let trace = DriverTrace {
                scene,
                rays: &ray_buffer,
                count: to_u32(rays.len()),
                query,
                answers: &answer_buffer,
            };
            self.record(&mut batch, &trace)?;
            batch.submit()?;
            answer_buffer.read_into(answers)?;
        }
        Ok(answers)
    }
}
