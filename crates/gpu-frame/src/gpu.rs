//! The device: its choice, its limits and its faults.

mod make;

use crate::FrameError;
use std::{
    any::{Any, TypeId},
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Environment variable that picks a device by number or by a part of its name.
pub const DEVICE_VARIABLE: &str = "NIWAKI_VULKAN_DEVICE";

/// An open Vulkan device.
///
/// A discrete GPU is preferred to an integrated one and either to a software driver;
/// `NIWAKI_VULKAN_DEVICE` picks another by its number or a part of its name.
#[derive(Clone, Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    limits: wgpu::Limits,
    adapter: wgpu::Adapter,
    name: String,
    timestamps: bool,
    fault: Arc<Mutex<Option<FrameError>>>,
    compiled: Arc<Mutex<Compiled>>,
}

/// What kind of device it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DeviceKind {
    /// A card with memory of its own.
    Discrete,
    /// Part of a processor.
    Integrated,
    /// A driver that computes on the processor.
    Software,
    /// A part of a device that is shared, or unknown.
    Other,
}

/// What is compiled once a device, however many renderers use it, by its type.
#[derive(Default)]
struct Compiled(HashMap<TypeId, Arc<dyn Any + Send + Sync>>);

impl std::fmt::Debug for Compiled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Compiled").finish_non_exhaustive()
    }
}

impl Gpu {
    /// What is turned on where the device has it; renderers that cannot do without ask
    /// [`Gpu::require`].
    pub const OPTIONAL: wgpu::Features = wgpu::Features::DEPTH32FLOAT_STENCIL8
        .union(wgpu::Features::FLOAT32_FILTERABLE)
        .union(wgpu::Features::FLOAT32_BLENDABLE);

    /// Opens the device.
    ///
    /// # Errors
    /// [`FrameError::NoAdapter`], [`FrameError::UnknownAdapter`], [`FrameError::Unsupported`]
    /// and [`FrameError::Open`].
    pub fn new() -> Result<Self, FrameError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        Self::open(choose(&wgpu::Instance::new(descriptor), None)?)
    }

    /// Opens a device of an instance that can draw on a surface of its own: for programs that show
    /// frames in a window. Devices that cannot are passed over.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn with_surface(
        instance: &wgpu::Instance,
        surface: &wgpu::Surface<'_>,
    ) -> Result<Self, FrameError> {
        Self::open(choose(instance, Some(surface))?)
    }

    fn open(adapter: wgpu::Adapter) -> Result<Self, FrameError> {
        let name = adapter.get_info().name;
        let needed = wgpu::Features::PRIMITIVE_INDEX;
        let timers =
            wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
        let offered = adapter.features();
        if !offered.contains(needed) {
            let missing = String::from("the number of a triangle in fragment shaders");
            return Err(FrameError::Unsupported { device: name, missing });
        }
        let limits = adapter.limits();
        for (what, has, least) in [
            ("storage buffers per stage", limits.max_storage_buffers_per_shader_stage, 12),
            ("colour bytes per sample", limits.max_color_attachment_bytes_per_sample, 20),
        ] {
            if has < least {
                let missing = format!("{what}: it has {has}, {least} are needed");
                return Err(FrameError::Unsupported { device: name, missing });
            }
        }
        let timestamps = offered.contains(timers);
        let optional = Self::OPTIONAL & offered;
        let required_features =
            needed | optional | if timestamps { timers } else { wgpu::Features::empty() };
        let opened = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("niwaki"),
            required_features,
            required_limits: limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        }));
        let (device, queue) = opened.map_err(|e| FrameError::Open(e.to_string()))?;
        let fault = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note(
                &seen,
                match error {
                    wgpu::Error::OutOfMemory { source } => {
                        FrameError::OutOfMemory(source.to_string())
                    }
                    wgpu::Error::Validation { description, .. }
                    | wgpu::Error::Internal { description, .. } => FrameError::Gpu(description),
                },
            );
        }));
        let seen = Arc::clone(&fault);
        device.set_device_lost_callback(move |reason, message| {
            // A device that is dropped is "lost" too, but then nobody asks.
            note(&seen, FrameError::DeviceLost(format!("{reason:?} {message}")));
        });
        let compiled = Arc::default();
        Ok(Self { device, queue, limits, adapter, name, timestamps, fault, compiled })
    }

    /// What the device is, and what it offers.
    #[must_use]
    pub const fn adapter(&self) -> &wgpu::Adapter {
        &self.adapter
    }

    /// The device, for passes of one's own.
    #[must_use]
    pub const fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The queue to which frames are submitted.
    #[must_use]
    pub const fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// The device's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What kind of device it is, as its driver says.
    #[must_use]
    pub fn kind(&self) -> DeviceKind {
        match self.adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => DeviceKind::Discrete,
            wgpu::DeviceType::IntegratedGpu => DeviceKind::Integrated,
            wgpu::DeviceType::Cpu => DeviceKind::Software,
            wgpu::DeviceType::VirtualGpu | wgpu::DeviceType::Other => DeviceKind::Other,
        }
    }

    /// The device's limits.
    #[must_use]
    pub const fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// True if passes can be timed.
    #[must_use]
    pub const fn has_timestamps(&self) -> bool {
        self.timestamps
    }

    /// Gives the device up, as if it had been removed: what uses it returns
    /// [`FrameError::DeviceLost`] from then on.
    pub fn destroy(&self) {
        note(&self.fault, FrameError::DeviceLost("it was given up".into()));
        self.device.destroy();
    }

    /// What every user of the device shares of a type, made by the first that asks for it:
    /// modules and pipelines, mostly.
    ///
    /// # Errors
    /// What `make` returns; then nothing is kept.
    pub fn shared<T: Any + Send + Sync>(
        &self,
        make: impl FnOnce(&Self) -> Result<T, FrameError>,
    ) -> Result<Arc<T>, FrameError> {
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        let there = compiled.0.get(&TypeId::of::<T>()).cloned();
        if let Some(Ok(there)) = there.map(Arc::downcast::<T>) {
            return Ok(there);
        }
        let made = Arc::new(make(self)?);
        compiled.0.insert(TypeId::of::<T>(), made.clone());
        Ok(made)
    }

    /// Refuses devices without these features; `what` says for what they are needed.
    ///
    /// # Errors
    /// [`FrameError::Unsupported`].
    pub fn require(&self, features: wgpu::Features, what: &str) -> Result<(), FrameError> {
        if self.device.features().contains(features) {
            return Ok(());
        }
        let missing = format!("{what} ({:?})", features - self.device.features());
        Err(FrameError::Unsupported { device: self.name.clone(), missing })
    }

    /// The first fault since the device was opened. A lost device stays lost; other faults are
    /// reported once.
    ///
    /// # Errors
    /// The fault.
    pub fn check(&self) -> Result<(), FrameError> {
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match &*fault {
            None => Ok(()),
            Some(lost @ FrameError::DeviceLost(_)) => Err(lost.clone()),
            Some(_) => fault.take().map_or(Ok(()), Err),
        }
    }

    /// Waits for all work that was submitted.
    ///
    /// # Errors
    /// [`FrameError::DeviceLost`], and faults of the work.
    pub fn wait(&self) -> Result<(), FrameError> {
        let polled = self.device.poll(wgpu::PollType::Wait {
            submission_index: None,
            // A frame on a software driver may take minutes; a stuck device takes for ever.
            timeout: Some(std::time::Duration::from_secs(600)),
        });
        self.check()?;
        polled.map(|_| ()).map_err(|e| FrameError::DeviceLost(e.to_string()))
    }
}

/// Keeps the first fault, but lets the loss of the device replace any other.
fn note(fault: &Mutex<Option<FrameError>>, error: FrameError) {
    let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
    if fault.is_none() || matches!(error, FrameError::DeviceLost(_)) {
        *fault = Some(error);
    }
}

fn choose(
    instance: &wgpu::Instance,
    surface: Option<&wgpu::Surface<'_>>,
) -> Result<wgpu::Adapter, FrameError> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    if adapters.is_empty() {
        return Err(FrameError::NoAdapter("the Vulkan loader lists none".into()));
    }
    adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
    if adapters.is_empty() {
        return Err(FrameError::NoAdapter("none can draw on this window".into()));
    }
    let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
    let position = match std::env::var(DEVICE_VARIABLE) {
        Ok(wanted) if !wanted.is_empty() => {
            let by_number = wanted.parse().ok().filter(|&i: &usize| i < adapters.len());
            let low = wanted.to_lowercase();
            let by_name = || names.iter().position(|name| name.to_lowercase().contains(&low));
            by_number
                .or_else(by_name)
                .ok_or_else(|| FrameError::UnknownAdapter { wanted, available: names.join(", ") })?
        }
        _ => {
            let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
                wgpu::DeviceType::DiscreteGpu => 0,
                wgpu::DeviceType::IntegratedGpu => 1,
                wgpu::DeviceType::VirtualGpu => 2,
                wgpu::DeviceType::Other => 3,
                wgpu::DeviceType::Cpu => 4,
            };
            (0..adapters.len()).min_by_key(|&i| rank(&adapters[i])).unwrap_or(0)
        }
    };
    let chosen = adapters.into_iter().nth(position);
    chosen.ok_or_else(|| FrameError::NoAdapter("the list changed".into()))
}
