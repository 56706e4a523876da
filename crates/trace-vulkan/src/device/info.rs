//! What a device is and can do.

use super::ray_tracing::Offer;
use ash::vk;
use std::ffi::CStr;

/// The kinds of devices, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the CPU's memory.
    Integrated,
    /// A part of a GPU in a virtual machine.
    Virtual,
    /// A driver that runs on the CPU.
    Cpu,
    /// Something else.
    Other,
}

/// What a device is and can do.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInfo {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: DeviceKind,
    /// The driver and its version; empty if it does not say.
    pub driver: String,
    /// Version of Vulkan: major, minor, patch.
    pub api: [u32; 3],
    /// Invocations that run in lockstep.
    pub subgroup_size: u32,
    /// The largest part of a buffer that a kernel can read as one binding, in bytes.
    pub max_binding_bytes: u64,
    /// The largest buffer, in bytes.
    pub max_buffer_bytes: u64,
    /// Multiples at which parts of buffers begin that are bound, in bytes.
    pub binding_alignment: u64,
    /// Most workgroups of a dispatch, along x, y and z.
    pub max_groups: [u32; 3],
    /// Most invocations of a workgroup.
    pub max_group_invocations: u32,
    /// Workgroup memory, in bytes.
    pub max_group_bytes: u32,
    /// Memory of the device, in bytes.
    pub memory_bytes: u64,
    /// Multiprocessors and the subgroups that each has at once, where the driver tells
    /// (`VK_NV_shader_sm_builtins`).
    pub multiprocessors: Option<[u32; 2]>,
    /// Nanoseconds of a timestamp's unit; 0 if the device has no timestamps.
    pub timestamp_ns: f64,
    /// 64-bit integers in shaders.
    pub has_int64: bool,
    /// 64-bit atomics on buffers.
    pub has_int64_atomics: bool,
    /// 64-bit floating-point numbers in shaders.
    pub has_float64: bool,
    /// How often a shader's loops may turn, all together, before the driver ends them without a
    /// word: 65,535 in Mesa's software driver. `None` for no limit.
    pub max_loop_turns: Option<u32>,
    /// Statistics of compiled kernels ([`crate::Kernel::statistics`]).
    pub has_statistics: bool,
    /// The driver's own ray tracing by ray queries ([`crate::DriverMethod::Query`]).
    pub has_ray_query: bool,
    /// The same by ray-tracing pipelines ([`crate::DriverMethod::Pipeline`]).
    pub has_ray_pipeline: bool,
}

impl DeviceInfo {
    /// Workgroups along x and y for `items` invocations at `size` a workgroup, as many along x as
    /// the device allows. Kernels compute their number from both (`linear_id` in `common.wgsl`) and
    /// have to check it, as the last row may be longer than needed.
    #[must_use]
    pub fn groups_for(&self, items: u64, size: u32) -> [u32; 3] {
        let groups = items.div_ceil(u64::from(size.max(1)));
        let x = groups.clamp(1, u64::from(self.max_groups[0].max(1)));
        let y = groups.div_ceil(x);
        let word = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        [word(x), word(y), 1]
    }
}

/// A device that can be opened, with what opening needs.
pub(crate) struct Candidate {
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) queue_family: u32,
    pub(crate) info: DeviceInfo,
    pub(crate) offer: Offer,
}

/// All devices that can compute.
pub(crate) fn candidates(instance: &ash::Instance) -> Result<Vec<Candidate>, vk::Result> {
    // SAFETY: the instance lives, as the caller holds it.
    let devices = unsafe { instance.enumerate_physical_devices()? };
    Ok(devices.into_iter().filter_map(|physical| candidate(instance, physical)).collect())
}

fn candidate(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Option<Candidate> {
    // SAFETY: the handle was just enumerated from this instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let can_compute =
        |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let family = families.iter().position(can_compute)?;
    // SAFETY: as above.
    let basic = unsafe { instance.get_physical_device_properties(physical) };
    // SPIR-V 1.3 and subgroups.
    if basic.api_version < vk::API_VERSION_1_1 {
        return None;
    }
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut maintenance4 = vk::PhysicalDeviceMaintenance4Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default()
        .push_next(&mut subgroup)
        .push_next(&mut maintenance3);
    if basic.api_version >= vk::API_VERSION_1_2 {
        properties = properties.push_next(&mut driver);
    }
    if basic.api_version >= vk::API_VERSION_1_3 {
        properties = properties.push_next(&mut maintenance4);
    }
    // SAFETY: the structures are those that the device's version knows.
    unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
    let mut atomics = vk::PhysicalDeviceShaderAtomicInt64Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default();
    if basic.api_version >= vk::API_VERSION_1_2 {
        features = features.push_next(&mut atomics);
    }
    // SAFETY: as above.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    let features = features.features;
    // SAFETY: as above. A driver that cannot list extensions has none.
    let extensions =
        unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    // SAFETY: as above.
    let memory = unsafe { instance.get_physical_device_memory_properties(physical) };
    let local = memory.memory_heaps_as_slice().iter();
    let local = local.filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    let memory_bytes = local.map(|heap| heap.size).max().unwrap_or_default();
    let mut cores = vk::PhysicalDeviceShaderSMBuiltinsPropertiesNV::default();
    if has(ash::nv::shader_sm_builtins::NAME) {
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut cores);
        // SAFETY: the device has the extension that the structure belongs to.
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
    }
    let limits = basic.limits;
    let max_binding_bytes = u64::from(limits.max_storage_buffer_range);
    let largest = maintenance3.max_memory_allocation_size;
    let version = basic.api_version;
    let text = |words: Result<&CStr, _>| {
        words.map(|words: &CStr| words.to_string_lossy().into_owned()).unwrap_or_default()
    };
    let offer = Offer::of(instance, physical, &basic, has);
    let info = DeviceInfo {
        name: text(basic.device_name_as_c_str()),
        kind: match basic.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        driver: [text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())]
            .join(" ")
            .trim()
            .to_owned(),
        api: [
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version),
        ],
        subgroup_size: subgroup.subgroup_size,
        max_binding_bytes,
        max_buffer_bytes: match maintenance4.max_buffer_size {
            0 => largest,
            size => largest.min(size),
        },
        binding_alignment: limits.min_storage_buffer_offset_alignment.max(4),
        max_groups: limits.max_compute_work_group_count,
        max_group_invocations: limits.max_compute_work_group_invocations,
        max_group_bytes: limits.max_compute_shared_memory_size,
        memory_bytes,
        multiprocessors: (cores.shader_sm_count > 0)
            .then_some([cores.shader_sm_count, cores.shader_warps_per_sm]),
        timestamp_ns: if families[family].timestamp_valid_bits > 0 {
            f64::from(limits.timestamp_period)
        } else {
            0.0
        },
        has_int64: features.shader_int64 == vk::TRUE,
        has_int64_atomics: atomics.shader_buffer_int64_atomics == vk::TRUE,
        has_float64: features.shader_float64 == vk::TRUE,
        // LP_MAX_TGSI_LOOP_ITERATIONS of gallivm.
        max_loop_turns: (driver.driver_id == vk::DriverId::MESA_LLVMPIPE).then_some(65_535),
        has_statistics: has(ash::khr::pipeline_executable_properties::NAME)
            && tells_statistics(instance, physical),
        has_ray_query: offer.has_query,
        has_ray_pipeline: offer.has_pipeline,
    };
    Some(Candidate { physical, queue_family: niwaki_core::to_u32(family), info, offer })
}

/// The feature of `VK_KHR_pipeline_executable_properties`, which the device has.
fn tells_statistics(instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
    let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut executables);
    // SAFETY: the handle is of this instance, and the device has the structure's extension.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    executables.pipeline_executable_info == vk::TRUE
}
