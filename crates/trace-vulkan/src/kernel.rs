//! Compute pipelines.

use crate::{Device, GpuError, pipeline::Pipeline};
use ash::vk;
use niwaki_shaders::{Binding, Options, Shader, Stage};
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
        f.debug_struct("Kernel").field("label", &self.inner.pipeline.label).finish_non_exhaustive()
    }
}

pub(crate) struct KernelInner {
    pub(crate) pipeline: Pipeline,
    pub(crate) workgroup_size: [u32; 3],
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

    /// The pipeline of a compiled compute shader. Its bindings have to be buffers of group 0.
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
        if shader.stage != Stage::Compute {
            let message = "it is no compute shader".to_owned();
            return Err(GpuError::Mismatch { kernel: shader.label.clone(), message });
        }
        let entry = CString::new(shader.entry.as_str()).unwrap_or_default();
        let (point, stages) = (vk::PipelineBindPoint::COMPUTE, vk::ShaderStageFlags::COMPUTE);
        let mut pipeline = Pipeline::new(&self.inner, &[shader], point, stages)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(pipeline.modules.first().copied().unwrap_or_default())
            .name(&entry);
        let flags = if self.inner.executables.is_some() {
            vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR
        } else {
            vk::PipelineCreateFlags::empty()
        };
        let create = [vk::ComputePipelineCreateInfo::default()
            .flags(flags)
            .stage(stage)
            .layout(pipeline.layout)];
        // SAFETY: module, entry point and layout belong together.
        let made = unsafe {
            let cache = self.inner.pipeline_cache;
            self.inner.handle.create_compute_pipelines(cache, &create, None)
        };
        let made = made.map_err(|(_, code)| self.inner.error("vkCreateComputePipelines", code))?;
        pipeline.pipeline = made.first().copied().unwrap_or_default();
        let workgroup_size = shader.workgroup_size;
        Ok(Kernel { inner: Arc::new(KernelInner { pipeline, workgroup_size }) })
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
        &self.inner.pipeline.bindings
    }
}
