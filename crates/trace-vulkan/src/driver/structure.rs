//! An acceleration structure, and the commands that build it.

use crate::{
    Batch, Buffer, Device, GpuError,
    device::{DeviceInner, RayTracing},
};
use ash::vk;
use std::sync::Arc;

/// Without acceleration structures there is nothing to build.
pub(super) fn functions(device: &DeviceInner) -> Result<&RayTracing, GpuError> {
    device.ray_tracing.as_ref().ok_or(GpuError::NotOffered {
        what: "acceleration structures (VK_KHR_acceleration_structure)",
        remedy: "use a driver that has them, or our own traversal (Tracer)",
    })
}

/// A structure in memory of its own.
pub(super) struct Structure {
    device: Arc<DeviceInner>,
    pub(super) handle: vk::AccelerationStructureKHR,
    memory: Buffer,
}

impl std::fmt::Debug for Structure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Structure").field("memory", &self.memory).finish_non_exhaustive()
    }
}

impl Drop for Structure {
    fn drop(&mut self) {
        if self.device.is_hung() {
            return;
        }
        if let Ok(ray_tracing) = functions(&self.device) {
            // SAFETY: batches hold the structures that they use until the device has answered.
            unsafe { ray_tracing.structures.destroy_acceleration_structure(self.handle, None) };
        }
    }
}

/// What a structure is built from.
#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    /// Triangles: three numbers a vertex, three vertices a triangle.
    Triangles { positions: &'a Buffer, vertices: u32, indices: &'a Buffer },
    /// Instances of 64 bytes.
    Instances(&'a Buffer),
}

impl Input<'_> {
    fn geometry(self) -> vk::AccelerationStructureGeometryKHR<'static> {
        let address =
            |buffer: &Buffer| vk::DeviceOrHostAddressConstKHR { device_address: buffer.address() };
        let (kind, data) = match self {
            Self::Triangles { positions, vertices, indices } => {
                let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                    .vertex_format(vk::Format::R32G32B32_SFLOAT)
                    .vertex_data(address(positions))
                    .vertex_stride(12)
                    .max_vertex(vertices.saturating_sub(1))
                    .index_type(vk::IndexType::UINT32)
                    .index_data(address(indices));
                let data = vk::AccelerationStructureGeometryDataKHR { triangles };
                (vk::GeometryTypeKHR::TRIANGLES, data)
            }
            Self::Instances(instances) => {
                let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default()
                    .data(address(instances));
                let data = vk::AccelerationStructureGeometryDataKHR { instances };
                (vk::GeometryTypeKHR::INSTANCES, data)
            }
        };
        vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(kind)
            .geometry(data)
            .flags(vk::GeometryFlagsKHR::OPAQUE)
    }

    const fn level(self) -> vk::AccelerationStructureTypeKHR {
        match self {
            Self::Triangles { .. } => vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL,
            Self::Instances(_) => vk::AccelerationStructureTypeKHR::TOP_LEVEL,
        }
    }
}

/// A build: of what, into what.
pub(super) struct Build<'a> {
    pub(super) input: Input<'a>,
    /// Triangles or instances.
    pub(super) count: u32,
    pub(super) flags: vk::BuildAccelerationStructureFlagsKHR,
}

impl Build<'_> {
    fn info<'b>(
        &self,
        geometry: &'b [vk::AccelerationStructureGeometryKHR<'b>],
    ) -> vk::AccelerationStructureBuildGeometryInfoKHR<'b> {
        vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(self.input.level())
            .flags(self.flags)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(geometry)
    }

    /// Memory for the structure, and how many bytes of scratch memory its build takes.
    pub(super) fn allocate(&self, device: &Device) -> Result<(Structure, u64), GpuError> {
        let ray_tracing = functions(&device.inner)?;
        let geometry = [self.input.geometry()];
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        // SAFETY: the geometry and its count are of the info.
        unsafe {
            ray_tracing.structures.get_acceleration_structure_build_sizes(
                vk::AccelerationStructureBuildTypeKHR::DEVICE,
                &self.info(&geometry),
                &[self.count],
                &mut sizes,
            );
        }
        let size = sizes.acceleration_structure_size;
        let memory =
            device.addressed(size, vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR)?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(memory.allocation.buffer)
            .size(size)
            .ty(self.input.level());
        // SAFETY: the buffer is new, as large as asked for, and begins where it has to: at 0.
        let made = unsafe { ray_tracing.structures.create_acceleration_structure(&create, None) };
        let handle = made.map_err(|code| {
            let call = "vkCreateAccelerationStructureKHR";
            let what = "an acceleration structure";
            device.inner.note(GpuError::of_memory(call, code, what, size))
        })?;
        let structure = Structure { device: device.inner.clone(), handle, memory };
        Ok((structure, sizes.build_scratch_size))
    }

    /// Records the build. Scratch memory has to be as large as [`Build::allocate`] says and lie at a
    /// multiple of the device's alignment.
    pub(super) fn record(
        &self,
        batch: &mut Batch,
        target: &Arc<Structure>,
        (scratch, scratch_address): (&Buffer, u64),
    ) -> Result<(), GpuError> {
        let device = batch.device.inner.clone();
        let ray_tracing = functions(&device)?;
        let geometry = [self.input.geometry()];
        let info = self
            .info(&geometry)
            .dst_acceleration_structure(target.handle)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch_address });
        let range =
            [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(self.count)];
        batch.barrier();
        // SAFETY: commands are being recorded; the structure is of the size that this build asks
        // for, as is the scratch memory, and everything is kept until the device has answered.
        unsafe {
            ray_tracing.structures.cmd_build_acceleration_structures(
                batch.commands,
                &[info],
                &[&range],
            );
        }
        batch.note_stage(vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR);
        batch.keep(&scratch.allocation);
        match self.input {
            Input::Triangles { positions, indices, .. } => {
                batch.keep(&positions.allocation);
                batch.keep(&indices.allocation);
            }
            Input::Instances(instances) => batch.keep(&instances.allocation),
        }
        batch.keep_other(target.clone());
        Ok(())
    }
}

impl Structure {
    /// What instances refer to it by.
    pub(super) fn address(&self) -> Result<u64, GpuError> {
        let ray_tracing = functions(&self.device)?;
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default()
            .acceleration_structure(self.handle);
        // SAFETY: the structure lives.
        Ok(unsafe { ray_tracing.structures.get_acceleration_structure_device_address(&info) })
    }

    /// Bytes of its memory.
    pub(super) const fn bytes(&self) -> u64 {
        self.memory.size()
    }
}
