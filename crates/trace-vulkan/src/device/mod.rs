//! Opening a device, and its end.

mod info;
mod options;
mod ray_tracing;
mod validation;

pub use info::{DeviceInfo, DeviceKind};
pub use options::DeviceOptions;
pub(crate) use ray_tracing::RayTracing;

use crate::GpuError;
use ash::vk;
use info::{Candidate, candidates};
use options::CHOICE;
use ray_tracing::{Features, Offer};
use std::{
    mem::ManuallyDrop,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};
use validation::{LAYER, Messages};

/// A GPU, or a driver that acts as one.
///
/// Clones share the device. Buffers, kernels and batches keep it open; when the last of them is
/// dropped, everything is freed.
#[derive(Clone)]
pub struct Device {
    pub(crate) inner: Arc<DeviceInner>,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("info", &self.inner.info).finish_non_exhaustive()
    }
}

/// The instance, freed after the device and whatever is said while it is freed.
struct Instance {
    /// Not dropped while a driver may still run in it.
    entry: ManuallyDrop<ash::Entry>,
    handle: ash::Instance,
    messages: Option<Messages>,
    is_hung: AtomicBool,
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.is_hung.load(Ordering::Acquire) {
            if let Some(messages) = self.messages.take() {
                messages.leak();
            }
            return;
        }
        if let Some(messages) = &self.messages {
            messages.destroy();
        }
        // SAFETY: all children of the instance are gone: the device is dropped before it, and the
        // messenger was just destroyed.
        unsafe { self.handle.destroy_instance(None) };
        // SAFETY: nothing of the library is used any more, and this runs once.
        unsafe { ManuallyDrop::drop(&mut self.entry) };
    }
}

/// What all objects of a device share.
pub(crate) struct DeviceInner {
    pub(crate) handle: ash::Device,
    pub(crate) info: DeviceInfo,
    pub(crate) timeout: Duration,
    pub(crate) queue_family: u32,
    pub(crate) memory: vk::PhysicalDeviceMemoryProperties,
    pub(crate) pipeline_cache: vk::PipelineCache,
    /// The driver's own, where it is enabled.
    pub(crate) ray_tracing: Option<RayTracing>,
    /// What tells what compilers made, where it is enabled.
    pub(crate) executables: Option<ash::khr::pipeline_executable_properties::Device>,
    timestamp_mask: u64,
    queue: Mutex<vk::Queue>,
    is_lost: AtomicBool,
    instance: Instance,
}

impl DeviceInner {
    /// The queue, which one thread at a time may use.
    pub(crate) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An error once the device is lost.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        if self.is_lost.load(Ordering::Acquire) {
            return Err(GpuError::DeviceLost { why: "in an earlier call".to_owned() });
        }
        Ok(())
    }

    /// Remembers that the device is lost, if that is the error.
    pub(crate) fn note(&self, error: GpuError) -> GpuError {
        if matches!(error, GpuError::DeviceLost { .. }) {
            self.is_lost.store(true, Ordering::Release);
        }
        error
    }

    /// The error of a Vulkan function, which is remembered if the device is lost.
    pub(crate) fn error(&self, call: &'static str, code: vk::Result) -> GpuError {
        self.note(GpuError::of(call, code))
    }

    /// The device does not answer: what it may still use must never be freed.
    pub(crate) fn hang(&self) -> GpuError {
        self.instance.is_hung.store(true, Ordering::Release);
        self.note(GpuError::timeout(self.timeout))
    }

    /// True if nothing may be freed, because the device may still use it.
    pub(crate) fn is_hung(&self) -> bool {
        self.instance.is_hung.load(Ordering::Acquire)
    }

    /// The bits of a timestamp that count.
    pub(crate) const fn timestamp_mask(&self) -> u64 {
        self.timestamp_mask
    }
}

impl Drop for DeviceInner {
    fn drop(&mut self) {
        if self.is_hung() {
            return;
        }
        // SAFETY: all objects of the device hold an `Arc` of this, so they are gone, and every
        // submission was waited for.
        unsafe {
            self.handle.destroy_pipeline_cache(self.pipeline_cache, None);
            self.handle.destroy_device(None);
        }
    }
}

impl Device {
    /// The best device, or the one that `NIWAKI_VULKAN_DEVICE` names.
    ///
    /// # Errors
    /// As [`Device::open`].
    pub fn new() -> Result<Self, GpuError> {
        Self::open(&DeviceOptions::default())
    }

    /// All devices that can compute, in the order of their numbers.
    ///
    /// # Errors
    /// [`GpuError::NoLoader`], and [`GpuError::NoDevice`] if there is no driver.
    pub fn list() -> Result<Vec<DeviceInfo>, GpuError> {
        let instance = open_instance(false)?;
        let found = candidates(&instance.handle);
        let found = found.map_err(|code| GpuError::NoDevice(code.to_string()))?;
        Ok(found.into_iter().map(|candidate| candidate.info).collect())
    }

    /// Opens a device.
    ///
    /// # Errors
    /// [`GpuError::NoLoader`], [`GpuError::NoDevice`], [`GpuError::NoSuchDevice`], or what the
    /// driver says.
    pub fn open(options: &DeviceOptions) -> Result<Self, GpuError> {
        let instance = open_instance(options.validation)?;
        let found = candidates(&instance.handle);
        let found = found.map_err(|code| GpuError::NoDevice(code.to_string()))?;
        let wanted = options.device.clone().or_else(|| std::env::var(CHOICE).ok());
        let Candidate { physical, queue_family, mut info, mut offer } =
            choose(found, wanted.as_deref())?;
        if !options.ray_tracing {
            offer = Offer::default();
            info.has_ray_query = false;
            info.has_ray_pipeline = false;
        }
        if !options.timestamps {
            info.timestamp_ns = 0.0;
        }
        info.has_statistics &= options.statistics;
        if let Some(limit) = options.max_binding_bytes {
            info.max_binding_bytes = info.max_binding_bytes.min(limit);
        }
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(queue_family)
            .queue_priorities(&priorities)];
        let features = vk::PhysicalDeviceFeatures::default()
            .shader_int64(info.has_int64)
            .shader_float64(info.has_float64)
            .geometry_shader(offer.has_pipeline)
            .robust_buffer_access(options.robust);
        let mut atomics = vk::PhysicalDeviceShaderAtomicInt64Features::default()
            .shader_buffer_int64_atomics(info.has_int64_atomics);
        let mut extensions = offer.extensions();
        let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        if info.has_statistics {
            extensions.push(ash::khr::pipeline_executable_properties::NAME.as_ptr());
        }
        let mut of_rays = Features::new();
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .enabled_extension_names(&extensions);
        create = of_rays.ask(&offer, create);
        if info.has_int64_atomics {
            create = create.push_next(&mut atomics);
        }
        if info.has_statistics {
            create = create.push_next(&mut statistics);
        }
        // SAFETY: the device is of this instance, and all features and extensions were found to be
        // there; robust buffer access always is.
        let handle = unsafe { instance.handle.create_device(physical, &create, None) }
            .map_err(|code| GpuError::of("vkCreateDevice", code))?;
        // SAFETY: the family has at least one queue, which was asked for.
        let queue = unsafe { handle.get_device_queue(queue_family, 0) };
        let cache = vk::PipelineCacheCreateInfo::default();
        // SAFETY: no initial data. A null handle, which is what a failure leaves, is a valid cache:
        // none.
        let pipeline_cache =
            unsafe { handle.create_pipeline_cache(&cache, None) }.unwrap_or_default();
        // SAFETY: the device is of this instance.
        let (memory, families) = unsafe {
            (
                instance.handle.get_physical_device_memory_properties(physical),
                instance.handle.get_physical_device_queue_family_properties(physical),
            )
        };
        let bits = families[queue_family as usize].timestamp_valid_bits;
        let ray_tracing = RayTracing::new(&instance.handle, &handle, &offer);
        let executables = info.has_statistics.then(|| {
            ash::khr::pipeline_executable_properties::Device::new(&instance.handle, &handle)
        });
        let inner = DeviceInner {
            handle,
            executables,
            info,
            timeout: options.timeout,
            queue_family,
            memory,
            pipeline_cache,
            ray_tracing,
            timestamp_mask: u64::MAX.checked_shr(64 - bits.min(64)).unwrap_or_default(),
            queue: Mutex::new(queue),
            is_lost: AtomicBool::new(false),
            instance,
        };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// What the device is and can do.
    #[must_use]
    pub fn info(&self) -> &DeviceInfo {
        &self.inner.info
    }

    /// The device's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.inner.info.name
    }

    /// True if the validation layer was asked for and is installed.
    #[must_use]
    pub fn is_validated(&self) -> bool {
        self.inner.instance.messages.is_some()
    }

    /// What the validation layer and the driver have complained about so far.
    #[must_use]
    pub fn messages(&self) -> Vec<String> {
        self.inner.instance.messages.as_ref().map(Messages::texts).unwrap_or_default()
    }

    /// True once the device was lost; everything fails from then on.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.inner.is_lost.load(Ordering::Acquire)
    }
}

fn open_instance(validation: bool) -> Result<Instance, GpuError> {
    // SAFETY: loading the system's Vulkan loader runs its initialisers, which are sound unless the
    // installation is broken.
    let entry =
        unsafe { ash::Entry::load() }.map_err(|error| GpuError::NoLoader(error.to_string()))?;
    // SAFETY: plain enumerations. A loader of Vulkan 1.0 has no version to tell.
    let (version, layers, extensions) = unsafe {
        (
            entry.try_enumerate_instance_version().ok().flatten(),
            entry.enumerate_instance_layer_properties().unwrap_or_default(),
            entry.enumerate_instance_extension_properties(None).unwrap_or_default(),
        )
    };
    let version = version.unwrap_or(vk::API_VERSION_1_0).min(vk::API_VERSION_1_3);
    let has_layer = layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(LAYER));
    let has_messages =
        extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::debug_utils::NAME));
    let validation = validation && has_layer && has_messages;
    let application = vk::ApplicationInfo::default()
        .application_name(c"niwaki")
        .engine_name(c"niwaki")
        .api_version(version);
    let layers = [LAYER.as_ptr()];
    let names =
        [ash::ext::debug_utils::NAME.as_ptr(), ash::ext::validation_features::NAME.as_ptr()];
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let mut create = vk::InstanceCreateInfo::default().application_info(&application);
    if validation {
        create = create.enabled_layer_names(&layers).enabled_extension_names(&names);
        create = create.push_next(&mut features);
    }
    // SAFETY: layers and extensions were found to be there (the last comes with the layer), and all
    // strings outlive the call.
    let handle = unsafe { entry.create_instance(&create, None) }.map_err(|code| match code {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
            GpuError::NoDevice("no driver is installed".into())
        }
        code => GpuError::of("vkCreateInstance", code),
    })?;
    let messages = if validation { Messages::new(&entry, &handle) } else { None };
    let entry = ManuallyDrop::new(entry);
    Ok(Instance { entry, handle, messages, is_hung: AtomicBool::new(false) })
}

/// The device that is wanted, or the first of the best kind.
fn choose(mut found: Vec<Candidate>, wanted: Option<&str>) -> Result<Candidate, GpuError> {
    if found.is_empty() {
        return Err(GpuError::NoDevice("no device has Vulkan 1.1 and computes".to_owned()));
    }
    let index = match wanted {
        None => (0..found.len()).min_by_key(|&i| found[i].info.kind),
        Some(wanted) => {
            let number = wanted.trim().parse::<usize>().ok().filter(|&i| i < found.len());
            let part = wanted.trim().to_lowercase();
            let named = || found.iter().position(|c| c.info.name.to_lowercase().contains(&part));
            number.or_else(named)
        }
    };
    let Some(index) = index else {
        let known = found.iter().enumerate().map(|(i, c)| format!("{i} {:?}", c.info.name));
        return Err(GpuError::NoSuchDevice {
            wanted: wanted.unwrap_or_default().to_owned(),
            known: known.collect::<Vec<_>>().join(", "),
        });
    };
    Ok(found.swap_remove(index))
}
