//! Pipelines and what they read and write, put together for a dispatch.

use super::{Batch, Resource};
use crate::{
    GpuError, Kernel,
    pipeline::{Pipeline, descriptor_type},
};
use ash::vk;
use bytemuck::NoUninit;
use niwaki_shaders::BindingKind;

/// Dispatches that share a descriptor pool.
const SETS: u32 = 32;

/// Bindings that a dispatch has on average; a pool that runs out is followed by another.
const BINDINGS: u32 = 8;

impl Batch {
    /// Binds a kernel with what its bindings name.
    pub(super) fn bind_kernel<T: NoUninit>(
        &mut self,
        kernel: &Kernel,
        resources: &[Resource<'_>],
        immediates: &T,
    ) -> Result<(), GpuError> {
        self.bind(&kernel.inner.pipeline, resources, bytemuck::bytes_of(immediates))?;
        self.kept.kernels.push(kernel.clone());
        Ok(())
    }

    /// Binds a pipeline, which the caller keeps, with what its bindings name.
    pub(crate) fn bind(
        &mut self,
        pipeline: &Pipeline,
        resources: &[Resource<'_>],
        immediates: &[u8],
    ) -> Result<(), GpuError> {
        let mismatch =
            |message: String| GpuError::Mismatch { kernel: pipeline.label.clone(), message };
        if immediates.len() != pipeline.immediate_bytes as usize {
            return Err(mismatch(format!(
                "{} bytes of immediates were given, the shader has {}",
                immediates.len(),
                pipeline.immediate_bytes
            )));
        }
        if resources.len() != pipeline.bindings.len() {
            let names: Vec<_> = pipeline.bindings.iter().map(|b| b.name.as_str()).collect();
            return Err(mismatch(format!(
                "{} buffers were given, the shader has {}: {}",
                resources.len(),
                names.len(),
                names.join(", ")
            )));
        }
        let info = self.device.info();
        let (limit, alignment) = (info.max_binding_bytes, info.binding_alignment);
        let mut parts = Vec::with_capacity(resources.len());
        let mut structures = Vec::with_capacity(resources.len());
        for (resource, binding) in resources.iter().zip(&pipeline.bindings) {
            let is_structure = binding.kind == BindingKind::AccelerationStructure;
            match resource {
                Resource::Buffer(_) if is_structure => {
                    let name = &binding.name;
                    return Err(mismatch(format!("{name} is an acceleration structure")));
                }
                Resource::Structure(_) if !is_structure => {
                    return Err(mismatch(format!("{} is a buffer", binding.name)));
                }
                Resource::Buffer(buffer) => {
                    if buffer.bound() > limit {
                        return Err(GpuError::TooLarge {
                            what: format!(
                                "the buffer {} of {}, in bytes,",
                                binding.name, pipeline.label
                            ),
                            wanted: buffer.bound(),
                            limit,
                            remedy: "bind a part of it (Buffer::view), or use a device that allows more",
                        });
                    }
                    if !buffer.start.is_multiple_of(alignment) {
                        return Err(mismatch(format!(
                            "{} begins at byte {}, which is no multiple of {alignment}",
                            binding.name, buffer.start
                        )));
                    }
                    parts.push([vk::DescriptorBufferInfo::default()
                        .buffer(buffer.allocation.buffer)
                        .offset(buffer.start)
                        .range(buffer.bound())]);
                    structures.push([vk::AccelerationStructureKHR::null()]);
                }
                Resource::Structure(structure) => {
                    parts.push([vk::DescriptorBufferInfo::default()]);
                    structures.push([*structure]);
                }
            }
        }
        let set = self.descriptor_set(pipeline)?;
        let mut of_structures: Vec<_> = structures
            .iter()
            .map(|structures| {
                vk::WriteDescriptorSetAccelerationStructureKHR::default()
                    .acceleration_structures(structures)
            })
            .collect();
        let all = pipeline.bindings.iter().zip(&parts).zip(&mut of_structures);
        let writes = all.map(|((binding, part), structure)| {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.binding)
                .descriptor_type(descriptor_type(binding.kind).unwrap_or_default());
            if binding.kind == BindingKind::AccelerationStructure {
                write.descriptor_count(1).push_next(structure)
            } else {
                write.buffer_info(part)
            }
        });
        let writes: Vec<_> = writes.collect();
        self.barrier();
        let device = &self.device.inner.handle;
        // SAFETY: the set is new and of the pipeline's layout, buffers and structures are kept until
        // the device has answered, and the immediates are as long as the layout says.
        unsafe {
            device.update_descriptor_sets(&writes, &[]);
            let (point, layout) = (pipeline.point, pipeline.layout);
            device.cmd_bind_pipeline(self.commands, point, pipeline.pipeline);
            device.cmd_bind_descriptor_sets(self.commands, point, layout, 0, &[set], &[]);
            if !immediates.is_empty() {
                let stages = pipeline.stages;
                device.cmd_push_constants(self.commands, layout, stages, 0, immediates);
            }
        }
        for resource in resources {
            if let Resource::Buffer(buffer) = resource {
                self.keep(&buffer.allocation);
            }
        }
        Ok(())
    }

    /// A new set of a pipeline's layout.
    fn descriptor_set(&mut self, pipeline: &Pipeline) -> Result<vk::DescriptorSet, GpuError> {
        let device = self.device.inner.clone();
        let layouts = [pipeline.set_layout];
        if let Some(&pool) = self.descriptors.last() {
            let allocate = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(pool)
                .set_layouts(&layouts);
            // SAFETY: the pool is of this batch.
            if let Ok(sets) = unsafe { device.handle.allocate_descriptor_sets(&allocate) }
                && let Some(&set) = sets.first()
            {
                return Ok(set);
            }
            // Empty, presumably: a new one tells.
        }
        let own = niwaki_core::to_u32(pipeline.bindings.len());
        let size = |kind, count| vk::DescriptorPoolSize::default().ty(kind).descriptor_count(count);
        let mut sizes = vec![
            size(vk::DescriptorType::STORAGE_BUFFER, SETS * BINDINGS + own),
            size(vk::DescriptorType::UNIFORM_BUFFER, SETS + own),
        ];
        if device.ray_tracing.is_some() {
            sizes.push(size(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR, SETS + own));
        }
        let create = vk::DescriptorPoolCreateInfo::default().max_sets(SETS).pool_sizes(&sizes);
        // SAFETY: plain sizes.
        let pool = unsafe { device.handle.create_descriptor_pool(&create, None) }
            .map_err(|code| device.error("vkCreateDescriptorPool", code))?;
        self.descriptors.push(pool);
        let allocate =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool is new and has room.
        let sets = unsafe { device.handle.allocate_descriptor_sets(&allocate) }
            .map_err(|code| device.error("vkAllocateDescriptorSets", code))?;
        Ok(sets.first().copied().unwrap_or_default())
    }
}
