//! The traversal kernels.

use crate::{Batch, Buffer, Device, GpuError, GpuScene, Kernel};
use niwaki_core::{Hit, Ray, to_u32};
use niwaki_trace::{Counts, Mode};
use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Invocations of a workgroup.
pub(crate) const WORKGROUP: u32 = 64;

/// Rays of a submission at most: few enough that none takes long, whatever the device, and many
/// enough to fill one.
pub(crate) const CHUNK: usize = 1 << 20;

/// Bytes of a ray.
pub(crate) const RAY_BYTES: u64 = 32;

/// A ray that has not begun, `FRESH` of `tracing.wgsl`.
const FRESH: u32 = u32::MAX;

/// What is asked of each ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Query {
    /// The nearest hit: 16 bytes, `niwaki_core::Hit`.
    Closest,
    /// Whether anything is hit: a word, 1 or 0.
    Any,
}

impl Query {
    /// Bytes of an answer.
    #[must_use]
    pub const fn answer_bytes(self) -> u64 {
        match self {
            Self::Closest => 16,
            Self::Any => 4,
        }
    }
}

/// Which invocation traces which ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Schedule {
    /// Each one ray, the default.
    #[default]
    RayAThread,
    /// A fixed number of workgroups of 64 take rays, 256 at a time, until there are none (Aila and
    /// Laine 2009). As many as run at once are best, which Vulkan does not tell: some eight for
    /// each multiprocessor.
    Persistent {
        /// How many.
        groups: u32,
    },
}

/// Rays to be traced as part of a [`Batch`].
#[derive(Clone, Copy, Debug)]
pub struct Trace<'a> {
    /// What they are traced in.
    pub scene: &'a GpuScene,
    /// The rays, 32 bytes each (`niwaki_core::Ray`).
    pub rays: &'a Buffer,
    /// How many; the first of the buffer.
    pub count: u32,
    /// What is asked.
    pub query: Query,
    /// Where the answers go, [`Query::answer_bytes`] each.
    pub answers: &'a Buffer,
    /// Where the work of each ray goes, if it is wanted: nodes, boxes, leaves and triangles, a word
    /// each.
    pub work: Option<&'a Buffer>,
    /// Which invocation traces which.
    pub schedule: Schedule,
}

/// What distinguishes pipelines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Variant {
    module: &'static str,
    entry: &'static str,
    mode: Mode,
    query: Query,
    is_counted: bool,
    is_deep: bool,
    is_in_pieces: bool,
    /// Steps of an invocation; 0 for no end.
    budget: u32,
}

/// How far rays are that run out of steps.
struct Progress {
    /// Two words a ray.
    places: Buffer,
    /// How many rays are not done.
    pending: Buffer,
}

/// Traces rays on a device.
///
/// Kernels are made when they are first needed. Clones share them.
#[derive(Clone, Debug)]
pub struct Tracer {
    device: Device,
    /// The device's multiply-add rounds once.
    is_fused: bool,
    /// Steps after which an invocation leaves the rest to another dispatch; 0 for no end.
    budget: u32,
    kernels: Arc<Mutex<HashMap<Variant, Kernel>>>,
    /// Bound where a kernel reads nothing.
    nothing: Buffer,
}

impl Tracer {
    /// A tracer without kernels. Finds out how the device rounds.
    ///
    /// # Errors
    /// As [`Device::buffer`] and [`Device::kernel`].
    pub fn new(device: &Device) -> Result<Self, GpuError> {
        let info = device.info();
        // A turn of a loop of a subgroup is a step of at least one of its invocations, and half of
        // the turns are left for the loops that are no steps.
        let budget = info.max_loop_turns.map_or(0, |turns| turns / (2 * info.subgroup_size.max(1)));
        Ok(Self {
            device: device.clone(),
            is_fused: is_fused(device)?,
            budget,
            kernels: Arc::default(),
            nothing: device.buffer(16)?,
        })
    }

    /// The device.
    #[must_use]
    pub const fn device(&self) -> &Device {
        &self.device
    }

    /// True if the device's multiply-add rounds once. If not, the triangle tests do without it, at
    /// some cost.
    #[must_use]
    pub const fn is_fused(&self) -> bool {
        self.is_fused
    }

    /// The same tracer whose invocations do at most so many steps (nodes, triangles, parents) in a
    /// dispatch; rays that are not done then go on in another. Keeps dispatches short where a
    /// driver stops long ones. `None` for no end; the default is what the driver needs
    /// ([`crate::DeviceInfo::max_loop_turns`]), which is none on GPUs.
    ///
    /// Holds for queries that return answers. What is [recorded](Tracer::record) is one dispatch.
    #[must_use]
    pub fn with_budget(self, steps: Option<u32>) -> Self {
        // Fewer would not always get a ray any further.
        Self { budget: steps.map_or(0, |steps| steps.max(16)), ..self }
    }

    /// The nearest hit of each ray.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] and [`GpuError::DeviceLost`].
    pub fn closest_hits(&self, scene: &GpuScene, rays: &[Ray]) -> Result<Vec<Hit>, GpuError> {
        Ok(self.all(scene, rays, Query::Closest, false, Schedule::default())?.0)
    }

    /// Whether each ray hits anything.
    ///
    /// # Errors
    /// As [`Tracer::closest_hits`].
    pub fn any_hits(&self, scene: &GpuScene, rays: &[Ray]) -> Result<Vec<bool>, GpuError> {
        let (flags, _) = self.all::<u32>(scene, rays, Query::Any, false, Schedule::default())?;
        Ok(flags.into_iter().map(|flag| flag != 0).collect())
    }

    /// [`Tracer::closest_hits`] with the work that each ray took.
    ///
    /// # Errors
    /// As [`Tracer::closest_hits`].
    pub fn closest_hits_counted(
        &self,
        scene: &GpuScene,
        rays: &[Ray],
    ) -> Result<(Vec<Hit>, Vec<Counts>), GpuError> {
        self.all(scene, rays, Query::Closest, true, Schedule::default())
    }

    /// [`Tracer::closest_hits`] by another schedule.
    ///
    /// # Errors
    /// As [`Tracer::closest_hits`].
    pub fn closest_hits_by(
        &self,
        schedule: Schedule,
        scene: &GpuScene,
        rays: &[Ray],
    ) -> Result<Vec<Hit>, GpuError> {
        Ok(self.all(scene, rays, Query::Closest, false, schedule)?.0)
    }

    /// Adds the tracing of rays that are on the device to a batch.
    ///
    /// On a driver that [limits loops](crate::DeviceInfo::max_loop_turns), a ray that takes tens of
    /// thousands of steps ends with what it has found until then.
    ///
    /// # Errors
    /// [`GpuError::OutOfRange`] if a buffer is too small for `count`, [`GpuError::TooLarge`] if one
    /// is larger than the device can bind, and as [`Device::kernel`].
    pub fn record(&self, batch: &mut Batch, trace: &Trace<'_>) -> Result<(), GpuError> {
        self.record_part(batch, trace, None)
    }

    /// [`Tracer::record`], of what is not done if there is progress.
    fn record_part(
        &self,
        batch: &mut Batch,
        trace: &Trace<'_>,
        progress: Option<&Progress>,
    ) -> Result<(), GpuError> {
        let Trace { scene, rays, count, query, answers, work, schedule } = *trace;
        let rays = rays.view(0, RAY_BYTES * u64::from(count))?;
        let answers = answers.view(0, query.answer_bytes() * u64::from(count))?;
        let work = work.map(|work| work.view(0, 16 * u64::from(count))).transpose()?;
        if count == 0 {
            return Ok(());
        }
        let is_persistent = schedule != Schedule::RayAThread;
        let kernel = self.kernel(Variant {
            module: scene.layout.module(),
            entry: if is_persistent { "persistent" } else { "main" },
            mode: scene.mode,
            query,
            is_counted: work.is_some(),
            is_deep: scene.is_deep || progress.is_some(),
            is_in_pieces: scene.is_in_pieces(),
            budget: progress.map_or(0, |_| self.budget),
        })?;
        let next = if is_persistent {
            let next = self.device.buffer(4)?;
            batch.fill(&next, 0);
            Some(next)
        } else {
            None
        };
        let own = |name: &str| match name {
            "rays" => Some(&rays),
            "hits" if query == Query::Closest => Some(&answers),
            "flags" if query == Query::Any => Some(&answers),
            "work" => work.as_ref(),
            "next_ray" => next.as_ref(),
            "progress" => progress.map(|progress| &progress.places),
            "pending" => progress.map(|progress| &progress.pending),
            _ => None,
        };
        let buffers = self.buffers(scene, &kernel, own);
        let groups = match schedule {
            Schedule::RayAThread => self.device.info().groups_for(u64::from(count), WORKGROUP),
            Schedule::Persistent { groups } => {
                [groups.clamp(1, self.device.info().max_groups[0]), 1, 1]
            }
        };
        batch.dispatch(&kernel, &buffers, &scene.words_for(count), groups)?;
        Ok(())
    }

    /// What a kernel binds, in order: `own` buffers by name, or else the scene's, or else nothing.
    fn buffers<'a>(
        &'a self,
        scene: &'a GpuScene,
        kernel: &Kernel,
        own: impl Fn(&str) -> Option<&'a Buffer>,
    ) -> Vec<&'a Buffer> {
        let bindings = kernel.bindings().iter();
        let found = bindings.map(|binding| {
            let name = binding.name.as_str();
            own(name).or_else(|| scene.buffer(name)).unwrap_or(&self.nothing)
        });
        found.collect()
    }

    /// The pipeline of a kernel of one's own that calls `traverse` in this scene: an entry point of a
    /// module of `niwaki-shaders` that imports `trace_binary` or `trace_wide`, whichever is the
    /// scene's [layout](GpuScene::layout). Rays end at their nearest hit or, for [`Query::Any`], at
    /// any. With `is_counted` the work of rays adds up in `counts`.
    ///
    /// Kernels are kept, so asking again costs nothing.
    ///
    /// # Errors
    /// As [`Device::kernel`].
    pub fn program(
        &self,
        scene: &GpuScene,
        (module, entry): (&'static str, &'static str),
        query: Query,
        is_counted: bool,
    ) -> Result<Kernel, GpuError> {
        self.kernel(Variant {
            module,
            entry,
            mode: scene.mode,
            query,
            is_counted,
            is_deep: scene.is_deep,
            is_in_pieces: scene.is_in_pieces(),
            budget: 0,
        })
    }

    /// Adds a [`Tracer::program`] to a batch, `count` invocations of it, which it finds in `scene.rays`. `own` are
    /// its buffers by name; those of the scene are bound for it.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if a buffer is larger than the device can bind,
    /// [`GpuError::Mismatch`] if one is missing, and [`GpuError::OutOfMemory`].
    pub fn record_program(
        &self,
        batch: &mut Batch,
        scene: &GpuScene,
        kernel: &Kernel,
        own: &[(&str, &Buffer)],
        count: u32,
    ) -> Result<(), GpuError> {
        let named =
            |name: &str| own.iter().find(|(own, _)| *own == name).map(|&(_, buffer)| buffer);
        let missing = kernel.bindings().iter().find(|binding| {
            named(&binding.name).is_none()
                && scene.buffer(&binding.name).is_none()
                && !GpuScene::is_optional(&binding.name)
        });
        if let Some(binding) = missing {
            return Err(GpuError::Mismatch {
                kernel: kernel.inner.pipeline.label.clone(),
                message: format!("no buffer is given for `{}`", binding.name),
            });
        }
        let buffers = self.buffers(scene, kernel, named);
        let groups = self.device.info().groups_for(u64::from(count), WORKGROUP);
        batch.dispatch(kernel, &buffers, &scene.words_for(count), groups)?;
        Ok(())
    }

    /// The pipeline of a variant, made if it is new.
    fn kernel(&self, variant: Variant) -> Result<Kernel, GpuError> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(&variant) {
            return Ok(kernel.clone());
        }
        let flag = |is: bool| f64::from(u8::from(is));
        let constants = [
            ("FUSED", flag(self.is_fused)),
            ("MODE", flag(variant.mode == Mode::Watertight)),
            ("ANY", flag(variant.query == Query::Any)),
            ("COUNT", flag(variant.is_counted)),
            ("BUDGET", f64::from(variant.budget)),
            ("DEEP", flag(variant.is_deep)),
            ("PIECES", if variant.is_in_pieces { 4.0 } else { 1.0 }),
            ("WORKGROUP", f64::from(WORKGROUP)),
        ];
        let kernel = self.device.kernel(variant.module, variant.entry, &constants)?;
        kernels.insert(variant, kernel.clone());
        Ok(kernel)
    }

    /// The answers to all rays, chunk by chunk, and the work of each if it is counted.
    fn all<A: bytemuck::Pod>(
        &self,
        scene: &GpuScene,
        rays: &[Ray],
        query: Query,
        is_counted: bool,
        schedule: Schedule,
    ) -> Result<(Vec<A>, Vec<Counts>), GpuError> {
        let bound = usize::try_from(self.device.info().max_binding_bytes / RAY_BYTES);
        let chunk = CHUNK.min(bound.unwrap_or(CHUNK)).clamp(1, rays.len().max(1));
        let device = &self.device;
        let mut answers = vec![A::zeroed(); rays.len()];
        let mut counts = Vec::new();
        let ray_buffer = device.buffer(RAY_BYTES * chunk as u64)?;
        let answer_buffer = device.buffer(query.answer_bytes() * chunk as u64)?;
        let work_buffer = is_counted.then(|| device.buffer(16 * chunk as u64)).transpose()?;
        // Without parents, rays cannot go on.
        let progress = if self.budget > 0 && scene.parents.is_some() {
            Some(Progress { places: device.buffer(8 * chunk as u64)?, pending: device.buffer(4)? })
        } else {
            None
        };
        for (rays, answers) in rays.chunks(chunk).zip(answers.chunks_mut(chunk)) {
            ray_buffer.write(0, rays)?;
            let trace = Trace {
                scene,
                rays: &ray_buffer,
                count: to_u32(rays.len()),
                query,
                answers: &answer_buffer,
                work: work_buffer.as_ref(),
                schedule,
            };
            let mut is_first = true;
            loop {
                let mut batch = device.batch()?;
                if let Some(Progress { places, pending }) = &progress {
                    if is_first {
                        batch.fill(places, FRESH);
                    }
                    batch.fill(pending, 0);
                }
                self.record_part(&mut batch, &trace, progress.as_ref())?;
                batch.submit()?;
                is_first = false;
                let mut pending = [0_u32];
                if let Some(progress) = &progress {
                    progress.pending.read_into(&mut pending)?;
                }
                if pending == [0] {
                    break;
                }
            }
            answer_buffer.read_into(answers)?;
            if let Some(work) = &work_buffer {
                let mut words = vec![[0_u32; 4]; rays.len()];
                work.read_into(&mut words)?;
                counts.extend(words.iter().map(|words| {
                    let [nodes, boxes, leaves, triangles] = words.map(u64::from);
                    Counts { nodes, boxes, leaves, triangles }
                }));
            }
        }
        Ok((answers, counts))
    }
}

/// Whether `fma` rounds once, by example: Vulkan leaves it open.
pub(crate) fn is_fused(device: &Device) -> Result<bool, GpuError> {
    let kernel = device.kernel("probe", "main", &[])?;
    // Products whose lower halves count, as the sum takes the upper ones away.
    let operands: Vec<[f32; 4]> = (1..=256_u16)
        .map(|i| {
            let (a, b) = (1.0 + f32::from(i) * 1.7e-5, 1.0 - f32::from(i) * 2.3e-5);
            [a, b, -(a * b), 0.0]
        })
        .collect();
    let (input, output) =
        (device.upload(&operands)?, device.buffer(size_of_val(&operands[..]) as u64)?);
    let mut batch = device.batch()?;
    let groups = device.info().groups_for(operands.len() as u64, kernel.workgroup_size()[0]);
    batch.dispatch(&kernel, &[&input, &output], &(), groups)?;
    batch.submit()?;
    let results = output.read::<[f32; 4]>()?;
    Ok(operands.iter().zip(&results).all(|(x, result)| x[0].mul_add(x[1], x[2]) == result[0]))
}
