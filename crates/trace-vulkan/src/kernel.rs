//! Compute pipelines.

use crate::{Device, GpuError, device::DeviceInner};
use ash::vk;
use niwaki_shaders::{Binding, BindingKind, Options, Shader};
use std::{ffi::CString, sync::Arc};

/// A compute pipeline: a shader, ready to be dispatched.
///
/// Clones share it.
#[derive(Clone)]
pub struct Kernel {
    pub(crate) inner: Arc<KernelInner>,
}

impl std::fmt::Debug for Kernel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Kernel").field("label", &self.inner.label).finish_non_exhaustive()
    }
}

pub(crate) struct KernelInner {
    device: Arc<DeviceInner>,
    pub(crate) label: String,
    pub(crate) bindings: Vec<Binding>,
    pub(crate) immediate_bytes: u32,
    pub(crate) workgroup_size: [u32; 3],
    module: vk::ShaderModule,
    pub(crate) set_layout: vk::DescriptorSetLayout,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) pipeline: vk::Pipeline,
}

impl Drop for KernelInner {
    fn drop(&mut self) {
        if self.device.is_hung() {
            return;
        }
        let device = &self.device.handle;
        // SAFETY: batches hold the kernels that they use until the device has answered. Null
        // handles are ignored.
        unsafe {
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
            device.destroy_shader_module(self.module, None);
        }
    }
}

pub(crate) const fn descriptor_type(kind: BindingKind) -> Option<vk::DescriptorType> {
    match kind {
        BindingKind::Uniform => Some(vk::DescriptorType::UNIFORM_BUFFER),
        BindingKind::Storage { .. } => Some(vk::DescriptorType::STORAGE_BUFFER),
        _ => None,
    }
}

impl Device {
    /// The pipeline of a compute entry point of `niwaki-shaders`, with values for its constants.
    ///
    /// # Errors
    /// As [`Device::kernel_of`], and what `niwaki_shaders::compile` says.
    pub fn kernel(
        &self,
        module: &str,
        entry: &str,
        constants: &[(&str, f64)],
    ) -> Result<Kernel, GpuError> {
        let options = Options { constants, ..Options::default() };
        self.kernel_of(&niwaki_shaders::compile(module, entry, &options)?)
    }

    /// The pipeline of a compiled shader. Its bindings have to be buffers of group 0.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] for a workgroup that the device does not allow,
    /// [`GpuError::Mismatch`] for other bindings, and [`GpuError::OutOfMemory`].
    pub fn kernel_of(&self, shader: &Shader) -> Result<Kernel, GpuError> {
        self.inner.check()?;
        let info = &self.inner.info;
        let invocations = shader.workgroup_size.iter().map(|&n| u64::from(n)).product::<u64>();
        let limit = u64::from(info.max_group_invocations);
        if invocations > limit {
            return Err(GpuError::TooLarge {
                what: format!("the workgroup of {}", shader.label),
                wanted: invocations,
                limit,
                remedy: "choose a smaller one",
            });
        }
        let mut slots = Vec::new();
        for binding in &shader.bindings {
            let kind = descriptor_type(binding.kind).filter(|_| binding.group == 0);
            let Some(kind) = kind else {
                let message = format!("{} is no buffer of group 0", binding.name);
                return Err(GpuError::Mismatch { kernel: shader.label.clone(), message });
            };
            slots.push(
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE),
            );
        }
        let entry = CString::new(shader.entry.as_str()).unwrap_or_default();
        // What is made is freed by its drop, also if the next step fails.
        let mut kernel = KernelInner {
            device: self.inner.clone(),
            label: shader.label.clone(),
            bindings: shader.bindings.clone(),
            immediate_bytes: shader.immediate_bytes,
            workgroup_size: shader.workgroup_size,
            module: vk::ShaderModule::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            pipeline: vk::Pipeline::null(),
        };
        let device = &self.inner.handle;
        let create = vk::ShaderModuleCreateInfo::default().code(&shader.words);
        // SAFETY: the words are valid SPIR-V, as naga wrote them from a validated module.
        kernel.module = unsafe { device.create_shader_module(&create, None) }
            .map_err(|code| self.inner.error("vkCreateShaderModule", code))?;
        let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
        // SAFETY: numbers of bindings are distinct, as naga checked.
        kernel.set_layout = unsafe { device.create_descriptor_set_layout(&create, None) }
            .map_err(|code| self.inner.error("vkCreateDescriptorSetLayout", code))?;
        let ranges = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(shader.immediate_bytes.next_multiple_of(4))];
        let ranges = if shader.immediate_bytes == 0 { &[] } else { &ranges[..] };
        let layouts = [kernel.set_layout];
        let create = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&layouts)
            .push_constant_ranges(ranges);
        // SAFETY: the set's layout was just made.
        kernel.layout = unsafe { device.create_pipeline_layout(&create, None) }
            .map_err(|code| self.inner.error("vkCreatePipelineLayout", code))?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(kernel.module)
            .name(&entry);
        let create = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(kernel.layout)];
        // SAFETY: module, entry point and layout belong together.
        let made =
            unsafe { device.create_compute_pipelines(self.inner.pipeline_cache, &create, None) };
        let made = made.map_err(|(_, code)| self.inner.error("vkCreateComputePipelines", code))?;
        kernel.pipeline = made.first().copied().unwrap_or_default();
        Ok(Kernel { inner: Arc::new(kernel) })
    }
}

impl Kernel {
    /// Invocations of a workgroup along x, y and z.
    #[must_use]
    pub fn workgroup_size(&self) -> [u32; 3] {
        self.inner.workgroup_size
    }

    /// What has to be bound, in the order of a dispatch's buffers.
    #[must_use]
    pub fn bindings(&self) -> &[Binding] {
        &self.inner.bindings
    }
}
