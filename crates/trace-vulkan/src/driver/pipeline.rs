//! A ray-tracing pipeline with its shader binding table.

use super::structure::functions;
use crate::{Batch, Buffer, Device, GpuError, batch::Resource, pipeline::Pipeline};
use ash::vk;
use niwaki_shaders::{Options, Shader};
use std::{ffi::CString, sync::Arc};

/// The shader groups, in the order of the table: ray generation, miss, hit.
const GROUPS: u32 = 3;

/// A pipeline of ray generation, miss and closest hit.
pub(super) struct RayPipeline {
    pub(super) pipeline: Pipeline,
    /// Memory of the table.
    table: Buffer,
    /// Of ray generation, miss and hit.
    regions: [vk::StridedDeviceAddressRegionKHR; 3],
}

impl std::fmt::Debug for RayPipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RayPipeline").field("label", &self.pipeline.label).finish_non_exhaustive()
    }
}

impl RayPipeline {
    /// The pipeline of `driver/pipeline.wgsl` with values for its constants.
    pub(super) fn new(device: &Device, constants: &[(&str, f64)]) -> Result<Self, GpuError> {
        let inner = &device.inner;
        inner.check()?;
        let ray_tracing = functions(inner)?;
        let Some(functions) = &ray_tracing.pipelines else {
            return Err(super::DriverMethod::Pipeline.check(device.info()).err().unwrap_or(
                GpuError::NotOffered { what: "ray-tracing pipelines", remedy: "use ray queries" },
            ));
        };
        let options = Options { constants, ..Options::default() };
        let compile = |entry| niwaki_shaders::compile("driver/pipeline", entry, &options);
        let shaders = [compile("generate")?, compile("missed")?, compile("nearest")?];
        let [generate, missed, nearest] = &shaders;
        let mut pipeline = Pipeline::new(
            inner,
            &[generate, missed, nearest],
            vk::PipelineBindPoint::RAY_TRACING_KHR,
            vk::ShaderStageFlags::RAYGEN_KHR,
        )?;
        let names = shaders.each_ref().map(entry_name);
        let kinds = [
            vk::ShaderStageFlags::RAYGEN_KHR,
            vk::ShaderStageFlags::MISS_KHR,
            vk::ShaderStageFlags::CLOSEST_HIT_KHR,
        ];
        let stages: Vec<_> = pipeline
            .modules
            .iter()
            .zip(kinds)
            .zip(&names)
            .map(|((&module, kind), name)| {
                vk::PipelineShaderStageCreateInfo::default().stage(kind).module(module).name(name)
            })
            .collect();
        let group = |kind| {
            vk::RayTracingShaderGroupCreateInfoKHR::default()
                .ty(kind)
                .general_shader(vk::SHADER_UNUSED_KHR)
                .closest_hit_shader(vk::SHADER_UNUSED_KHR)
                .any_hit_shader(vk::SHADER_UNUSED_KHR)
                .intersection_shader(vk::SHADER_UNUSED_KHR)
        };
        let general = vk::RayTracingShaderGroupTypeKHR::GENERAL;
        let groups = [
            group(general).general_shader(0),
            group(general).general_shader(1),
            group(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP).closest_hit_shader(2),
        ];
        let create = [vk::RayTracingPipelineCreateInfoKHR::default()
            .stages(&stages)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(1)
            .layout(pipeline.layout)];
        // SAFETY: modules, entry points, groups and layout belong together.
        let made = unsafe {
            let deferred = vk::DeferredOperationKHR::null();
            functions.create_ray_tracing_pipelines(deferred, inner.pipeline_cache, &create, None)
        };
        let made = made.map_err(|(_, code)| inner.error("vkCreateRayTracingPipelinesKHR", code))?;
        pipeline.pipeline = made.first().copied().unwrap_or_default();

        let limits = ray_tracing.limits;
        let bytes = limits.handle_bytes as usize;
        // SAFETY: the pipeline has as many groups.
        let handles = unsafe {
            let size = bytes * GROUPS as usize;
            functions.get_ray_tracing_shader_group_handles(pipeline.pipeline, 0, GROUPS, size)
        };
        let handles =
            handles.map_err(|code| inner.error("vkGetRayTracingShaderGroupHandlesKHR", code))?;
        // A table for each, of one record. The address, not the place in the buffer, has to be a
        // multiple.
        let (stride, apart) =
            strides(limits.handle_bytes, limits.handle_alignment, limits.table_alignment);
        let uses = vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR;
        let table = device.addressed(apart * u64::from(GROUPS + 1), uses)?;
        let address = table.address();
        let first = address.next_multiple_of(limits.table_alignment.into());
        let mut regions = [vk::StridedDeviceAddressRegionKHR::default(); 3];
        let places = (0..).map(|i| first + i * apart);
        for ((region, place), handle) in regions.iter_mut().zip(places).zip(handles.chunks(bytes)) {
            table.write(place - address, handle)?;
            *region = vk::StridedDeviceAddressRegionKHR::default()
                .device_address(place)
                .stride(stride)
                .size(stride);
        }
        Ok(Self { pipeline, table, regions })
    }

    /// Records a launch of `width` by `height` rays.
    pub(super) fn record(
        self: &Arc<Self>,
        batch: &mut Batch,
        resources: &[Resource<'_>],
        immediates: &[u8],
        [width, height]: [u32; 2],
    ) -> Result<(), GpuError> {
        batch.bind(&self.pipeline, resources, immediates)?;
        let device = batch.device.inner.clone();
        let [generate, miss, hit] = &self.regions;
        let none = vk::StridedDeviceAddressRegionKHR::default();
        if let Some(functions) = &functions(&device)?.pipelines {
            // SAFETY: commands are being recorded, everything is bound, the tables are of this
            // pipeline and kept with it, and callers keep to the limits of a launch.
            unsafe {
                functions.cmd_trace_rays(
                    batch.commands,
                    generate,
                    miss,
                    hit,
                    &none,
                    width,
                    height,
                    1,
                );
            }
        }
        batch.note_stage(vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR);
        batch.keep(&self.table.allocation);
        batch.keep_other(self.clone());
        Ok(())
    }
}

fn entry_name(shader: &Shader) -> CString {
    CString::new(shader.entry.as_str()).unwrap_or_default()
}

/// Bytes of a record, and bytes from one table of a single record to the next.
fn strides(handle: u32, handle_alignment: u32, table_alignment: u32) -> (u64, u64) {
    let stride = u64::from(handle).next_multiple_of(handle_alignment.into());
    (stride, stride.next_multiple_of(table_alignment.into()))
}

#[cfg(test)]
mod tests {
    use super::strides;

    #[test]
    fn records_and_tables_are_aligned() {
        // NVIDIA, Mesa's software driver, and something odd.
        assert_eq!(strides(32, 32, 64), (32, 64));
        assert_eq!(strides(32, 1, 32), (32, 32));
        assert_eq!(strides(20, 16, 64), (32, 64));
    }
}
