//! What a driver's compiler made of a kernel.

use crate::{GpuError, Kernel};
use ash::vk;
use std::{ffi::CStr, fmt};

/// A number that a driver tells about a compiled kernel: registers, spills, instructions. Names
/// and meanings are the driver's.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistic {
    /// Its name.
    pub name: String,
    /// What the driver says it is.
    pub description: String,
    /// The number.
    pub value: StatisticValue,
}

/// The value of a [`Statistic`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StatisticValue {
    /// Yes or no.
    Flag(bool),
    /// A whole number.
    Signed(i64),
    /// A count.
    Unsigned(u64),
    /// Any number.
    Real(f64),
}

impl fmt::Display for StatisticValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(x) => x.fmt(f),
            Self::Signed(x) => x.fmt(f),
            Self::Unsigned(x) => x.fmt(f),
            Self::Real(x) => x.fmt(f),
        }
    }
}

/// The text of a fixed array, up to its first zero.
fn text(words: Result<&CStr, impl fmt::Debug>) -> String {
    words.map(|words| words.to_string_lossy().into_owned()).unwrap_or_default()
}

impl Kernel {
    /// What the driver tells about the compiled kernel, which depends on the driver and may be
    /// nothing. The device has to be opened with [`crate::DeviceOptions::statistics`].
    ///
    /// # Errors
    /// [`GpuError::NotOffered`] if the driver tells nothing, or was not asked to;
    /// [`GpuError::OutOfMemory`].
    pub fn statistics(&self) -> Result<Vec<Statistic>, GpuError> {
        let pipeline = &self.inner.pipeline;
        let device = &pipeline.device;
        let Some(tell) = &device.executables else {
            return Err(GpuError::NotOffered {
                what: "statistics of compiled kernels (VK_KHR_pipeline_executable_properties)",
                remedy: "open the device with DeviceOptions::statistics, on a driver that has them",
            });
        };
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline.pipeline);
        // SAFETY: the pipeline lives as long as this kernel, and was made to keep statistics.
        let executables = unsafe { tell.get_pipeline_executable_properties(&info) }
            .map_err(|code| device.error("vkGetPipelineExecutablePropertiesKHR", code))?;
        let mut found = Vec::new();
        for index in 0..niwaki_core::to_u32(executables.len()) {
            let info = vk::PipelineExecutableInfoKHR::default()
                .pipeline(pipeline.pipeline)
                .executable_index(index);
            // SAFETY: as above, and the index is one of those that were listed.
            let statistics = unsafe { tell.get_pipeline_executable_statistics(&info) }
                .map_err(|code| device.error("vkGetPipelineExecutableStatisticsKHR", code))?;
            for one in statistics {
                use vk::PipelineExecutableStatisticFormatKHR as Format;
                // SAFETY: the format says which field of the union the driver wrote.
                let value = unsafe {
                    match one.format {
                        Format::BOOL32 => StatisticValue::Flag(one.value.b32 != vk::FALSE),
                        Format::INT64 => StatisticValue::Signed(one.value.i64),
                        Format::FLOAT64 => StatisticValue::Real(one.value.f64),
                        _ => StatisticValue::Unsigned(one.value.u64),
                    }
                };
                found.push(Statistic {
                    name: text(one.name_as_c_str()),
                    description: text(one.description_as_c_str()),
                    value,
                });
            }
        }
        Ok(found)
    }
}
