//! What can go wrong between us and a GPU.

use ash::vk;
use niwaki_shaders::ShaderError;
use niwaki_trace::SceneError;
use std::time::Duration;

/// Why something could not be done on the GPU.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The system has no Vulkan loader. Remedy: install it (`libvulkan1` on Debian), or trace on
    /// the CPU with `niwaki-trace`.
    #[error("no Vulkan loader: {0}; install libvulkan (Debian: libvulkan1) or use the CPU kernels")]
    NoLoader(String),
    /// There is no Vulkan driver, or none of its devices can compute. Remedy: install a driver;
    /// `mesa-vulkan-drivers` on Debian has one that runs on the CPU.
    #[error(
        "no Vulkan device: {0}; install a driver (Debian: mesa-vulkan-drivers has a software one)"
    )]
    NoDevice(String),
    /// No device has the name or number that was asked for. Remedy: one of those that are listed.
    #[error("no Vulkan device matches {wanted:?}; there are: {known}")]
    NoSuchDevice {
        /// What `NIWAKI_VULKAN_DEVICE` or [`crate::DeviceOptions::device`] says.
        wanted: String,
        /// The devices with their numbers.
        known: String,
    },
    /// The device stopped working, or work took longer than the timeout. Everything on it is lost
    /// and all later calls on this [`crate::Device`] fail alike. Remedy: open the device anew and
    /// upload again; if it was the timeout ([`crate::DeviceOptions::timeout`]), give the GPU less
    /// at once or more time.
    #[error(
        "the Vulkan device was lost ({why}); open it anew and upload again, with less work at once"
    )]
    DeviceLost {
        /// What happened.
        why: String,
    },
    /// The device or the system has not enough memory. Remedy: free buffers, or trace a smaller
    /// scene or fewer rays at once.
    #[error(
        "out of memory on the Vulkan device while asking for {wanted} bytes for {what}; free buffers or use a smaller scene"
    )]
    OutOfMemory {
        /// What the memory was for.
        what: String,
        /// How many bytes it was.
        wanted: u64,
    },
    /// Something is larger than the device allows. Remedy: as it says.
    #[error("{what} is {wanted}, but the device allows {limit}; {remedy}")]
    TooLarge {
        /// What is too large.
        what: String,
        /// Its size.
        wanted: u64,
        /// The largest size that is allowed.
        limit: u64,
        /// What to do.
        remedy: &'static str,
    },
    /// The device or its driver lacks something. Remedy: as it says.
    #[error("the device offers no {what}; {remedy}")]
    NotOffered {
        /// What it lacks.
        what: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// A kernel was given other buffers or constants than its shader declares. Remedy: as the
    /// message says.
    #[error("{kernel}: {message}")]
    Mismatch {
        /// The kernel.
        kernel: String,
        /// What does not fit.
        message: String,
    },
    /// A part of a buffer was named that is not there. Remedy: stay inside, at multiples of four
    /// bytes.
    #[error(
        "bytes {start}..{end} of a buffer of {size} bytes were asked for; parts lie inside, at multiples of 4"
    )]
    OutOfRange {
        /// The first byte.
        start: u64,
        /// The byte after the last.
        end: u64,
        /// The buffer's size.
        size: u64,
    },
    /// The tree is not one, or not of the mesh. Remedy: as the cause says.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A shader is wrong. Remedy: as the cause says.
    #[error(transparent)]
    Shader(#[from] ShaderError),
    /// Another error of a Vulkan function; a fault of the driver or of this crate. Remedy: open the
    /// device with validation and report what it says.
    #[error("{call} failed: {code}")]
    Vulkan {
        /// The function.
        call: &'static str,
        /// Its result.
        code: vk::Result,
    },
}

impl GpuError {
    /// The error of a Vulkan function that asks for no memory worth naming.
    pub(crate) fn of(call: &'static str, code: vk::Result) -> Self {
        Self::of_memory(call, code, call, 0)
    }

    /// The error of a Vulkan function that asked for memory.
    pub(crate) fn of_memory(call: &'static str, code: vk::Result, what: &str, wanted: u64) -> Self {
        match code {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
            | vk::Result::ERROR_OUT_OF_HOST_MEMORY
            | vk::Result::ERROR_TOO_MANY_OBJECTS => {
                Self::OutOfMemory { what: what.to_owned(), wanted }
            }
            vk::Result::ERROR_DEVICE_LOST => Self::DeviceLost { why: format!("in {call}") },
            code => Self::Vulkan { call, code },
        }
    }

    /// Work did not end in time.
    pub(crate) fn timeout(after: Duration) -> Self {
        Self::DeviceLost { why: format!("no answer within {} s", after.as_secs_f64()) }
    }
}
