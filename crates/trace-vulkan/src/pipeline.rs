//! What compute and ray-tracing pipelines have in common: modules, layouts and bindings.

use crate::{GpuError, device::DeviceInner};
use ash::vk;
use niwaki_shaders::{Binding, BindingKind, Shader};
use std::sync::Arc;

/// A pipeline with its modules and layouts, freed together.
pub(crate) struct Pipeline {
    pub(crate) device: Arc<DeviceInner>,
    pub(crate) label: String,
    /// What has to be bound, in the order of a dispatch's resources.
    pub(crate) bindings: Vec<Binding>,
    pub(crate) immediate_bytes: u32,
    /// The stages that read bindings and immediates.
    pub(crate) stages: vk::ShaderStageFlags,
    pub(crate) point: vk::PipelineBindPoint,
    /// One a shader.
    pub(crate) modules: Vec<vk::ShaderModule>,
    pub(crate) set_layout: vk::DescriptorSetLayout,
    pub(crate) layout: vk::PipelineLayout,
    /// Null until its maker has made it.
    pub(crate) pipeline: vk::Pipeline,
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        if self.device.is_hung() {
            return;
        }
        let device = &self.device.handle;
        // SAFETY: batches hold the pipelines that they use until the device has answered. Null
        // handles are ignored.
        unsafe {
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
            for &module in &self.modules {
                device.destroy_shader_module(module, None);
            }
        }
    }
}

pub(crate) const fn descriptor_type(kind: BindingKind) -> Option<vk::DescriptorType> {
    match kind {
        BindingKind::Uniform => Some(vk::DescriptorType::UNIFORM_BUFFER),
        BindingKind::Storage { .. } => Some(vk::DescriptorType::STORAGE_BUFFER),
        BindingKind::AccelerationStructure => Some(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR),
        BindingKind::Handle => None,
    }
}

impl Pipeline {
    /// Modules and layouts of shaders of which the first alone has bindings and immediates; the
    /// pipeline itself is still missing.
    ///
    /// Bindings have to be buffers or acceleration structures of group 0.
    pub(crate) fn new(
        device: &Arc<DeviceInner>,
        shaders: &[&Shader],
        point: vk::PipelineBindPoint,
        stages: vk::ShaderStageFlags,
    ) -> Result<Self, GpuError> {
        let Some(first) = shaders.first() else {
            let message = "a pipeline has no shaders".to_owned();
            return Err(GpuError::Mismatch { kernel: String::new(), message });
        };
        let mut slots = Vec::new();
        for binding in &first.bindings {
            let kind = descriptor_type(binding.kind).filter(|_| binding.group == 0);
            let Some(kind) = kind else {
                let message = format!("{} is no buffer of group 0", binding.name);
                return Err(GpuError::Mismatch { kernel: first.label.clone(), message });
            };
            if binding.kind == BindingKind::AccelerationStructure && device.ray_tracing.is_none() {
                return Err(GpuError::NotOffered {
                    what: "acceleration structures",
                    remedy: "use a driver that has them, or our own traversal (Tracer)",
                });
            }
            slots.push(
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(stages),
            );
        }
        // What is made is freed by its drop, also if the next step fails.
        let mut made = Self {
            device: device.clone(),
            label: first.label.clone(),
            bindings: first.bindings.clone(),
            immediate_bytes: first.immediate_bytes,
            stages,
            point,
            modules: Vec::new(),
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            pipeline: vk::Pipeline::null(),
        };
        for shader in shaders {
            let create = vk::ShaderModuleCreateInfo::default().code(&shader.words);
            // SAFETY: the words are valid SPIR-V, as naga wrote them from a validated module.
            let module = unsafe { device.handle.create_shader_module(&create, None) };
            made.modules.push(module.map_err(|code| device.error("vkCreateShaderModule", code))?);
        }
        let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
        // SAFETY: numbers of bindings are distinct, as naga checked.
        made.set_layout = unsafe { device.handle.create_descriptor_set_layout(&create, None) }
            .map_err(|code| device.error("vkCreateDescriptorSetLayout", code))?;
        let ranges = [vk::PushConstantRange::default()
            .stage_flags(stages)
            .size(first.immediate_bytes.next_multiple_of(4))];
        let ranges = if first.immediate_bytes == 0 { &[] } else { &ranges[..] };
        let layouts = [made.set_layout];
        let create = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&layouts)
            .push_constant_ranges(ranges);
        // SAFETY: the set's layout was just made.
        made.layout = unsafe { device.handle.create_pipeline_layout(&create, None) }
            .map_err(|code| device.error("vkCreatePipelineLayout", code))?;
        Ok(made)
    }
}
