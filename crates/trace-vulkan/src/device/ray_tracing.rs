//! The driver's own ray tracing: whether it is there, and how it is enabled.

use ash::{khr, vk};
use std::ffi::CStr;

/// What a device offers, and its limits; nothing without acceleration structures.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Offer {
    /// Acceleration structures with ray queries.
    pub(crate) has_query: bool,
    /// Acceleration structures with ray-tracing pipelines.
    pub(crate) has_pipeline: bool,
    pub(crate) limits: Limits,
}

/// Limits of acceleration structures and ray-tracing pipelines.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limits {
    /// Most triangles of a structure.
    pub(crate) max_triangles: u64,
    /// Multiples at which the address of scratch memory has to lie.
    pub(crate) scratch_alignment: u64,
    /// Bytes of the handle of a shader group.
    pub(crate) handle_bytes: u32,
    /// Multiples at which handles have to lie in a table.
    pub(crate) handle_alignment: u32,
    /// Multiples at which tables have to begin.
    pub(crate) table_alignment: u32,
    /// Most invocations of a launch.
    pub(crate) max_invocations: u32,
    /// Most invocations along x.
    pub(crate) max_width: u32,
}

/// The functions of the extensions, on a device where they are enabled.
pub(crate) struct RayTracing {
    pub(crate) structures: khr::acceleration_structure::Device,
    pub(crate) pipelines: Option<khr::ray_tracing_pipeline::Device>,
    pub(crate) limits: Limits,
}

impl Offer {
    /// What a device says about itself.
    pub(crate) fn of(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        basic: &vk::PhysicalDeviceProperties,
        has: impl Fn(&CStr) -> bool,
    ) -> Self {
        // Version 1.2 has what the extensions build upon.
        let is_possible = basic.api_version >= vk::API_VERSION_1_2
            && has(khr::acceleration_structure::NAME)
            && has(khr::deferred_host_operations::NAME);
        if !is_possible {
            return Self::default();
        }
        let (named_query, named_pipeline) =
            (has(khr::ray_query::NAME), has(khr::ray_tracing_pipeline::NAME));
        let mut addresses = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
        let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
        let mut queries = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
        let mut pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
        let mut features = vk::PhysicalDeviceFeatures2::default()
            .push_next(&mut addresses)
            .push_next(&mut structures);
        if named_query {
            features = features.push_next(&mut queries);
        }
        if named_pipeline {
            features = features.push_next(&mut pipelines);
        }
        // SAFETY: the structures are those of the device's version and extensions.
        unsafe { instance.get_physical_device_features2(physical, &mut features) };
        // The translator asks for it where a shader reads the number of a triangle.
        let has_geometry = features.features.geometry_shader == vk::TRUE;
        let has_structures = structures.acceleration_structure == vk::TRUE
            && addresses.buffer_device_address == vk::TRUE;
        let mut of_structures = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut of_pipelines = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut of_structures);
        if named_pipeline {
            properties = properties.push_next(&mut of_pipelines);
        }
        // SAFETY: as above.
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
        let limits = basic.limits;
        let [count, _, _] = limits.max_compute_work_group_count;
        let [size, _, _] = limits.max_compute_work_group_size;
        Self {
            has_query: has_structures && queries.ray_query == vk::TRUE,
            has_pipeline: has_structures
                && has_geometry
                && pipelines.ray_tracing_pipeline == vk::TRUE,
            limits: Limits {
                max_triangles: of_structures.max_primitive_count,
                scratch_alignment: of_structures
                    .min_acceleration_structure_scratch_offset_alignment
                    .max(1)
                    .into(),
                handle_bytes: of_pipelines.shader_group_handle_size,
                handle_alignment: of_pipelines.shader_group_handle_alignment.max(1),
                table_alignment: of_pipelines.shader_group_base_alignment.max(1),
                max_invocations: of_pipelines.max_ray_dispatch_invocation_count,
                max_width: count.saturating_mul(size),
            },
        }
    }

    /// Whether there is anything to enable.
    pub(crate) const fn is_any(&self) -> bool {
        self.has_query || self.has_pipeline
    }

    /// The extensions to enable.
    pub(crate) fn extensions(&self) -> Vec<*const std::ffi::c_char> {
        let mut names = Vec::new();
        if self.is_any() {
            names.extend([
                khr::acceleration_structure::NAME.as_ptr(),
                khr::deferred_host_operations::NAME.as_ptr(),
            ]);
        }
        if self.has_query {
            names.push(khr::ray_query::NAME.as_ptr());
        }
        if self.has_pipeline {
            names.push(khr::ray_tracing_pipeline::NAME.as_ptr());
        }
        names
    }
}

impl RayTracing {
    /// The functions of what was enabled.
    pub(crate) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        offer: &Offer,
    ) -> Option<Self> {
        offer.is_any().then(|| Self {
            structures: khr::acceleration_structure::Device::new(instance, device),
            pipelines: offer
                .has_pipeline
                .then(|| khr::ray_tracing_pipeline::Device::new(instance, device)),
            limits: offer.limits,
        })
    }
}

/// The features of the extensions, switched on.
pub(crate) struct Features<'a> {
    addresses: vk::PhysicalDeviceBufferDeviceAddressFeatures<'a>,
    structures: vk::PhysicalDeviceAccelerationStructureFeaturesKHR<'a>,
    queries: vk::PhysicalDeviceRayQueryFeaturesKHR<'a>,
    pipelines: vk::PhysicalDeviceRayTracingPipelineFeaturesKHR<'a>,
}

impl Features<'_> {
    pub(crate) fn new() -> Self {
        Self {
            addresses: vk::PhysicalDeviceBufferDeviceAddressFeatures::default()
                .buffer_device_address(true),
            structures: vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default()
                .acceleration_structure(true),
            queries: vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true),
            pipelines: vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default()
                .ray_tracing_pipeline(true),
        }
    }

    /// Asks for those that are offered.
    pub(crate) fn ask<'b>(
        &'b mut self,
        offer: &Offer,
        mut create: vk::DeviceCreateInfo<'b>,
    ) -> vk::DeviceCreateInfo<'b> {
        if offer.is_any() {
            create = create.push_next(&mut self.addresses).push_next(&mut self.structures);
        }
        if offer.has_query {
            create = create.push_next(&mut self.queries);
        }
        if offer.has_pipeline {
            create = create.push_next(&mut self.pipelines);
        }
        create
    }
}
