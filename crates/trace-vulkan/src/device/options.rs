//! Which device is opened and how.

use std::time::Duration;

/// The environment variable that chooses a device.
pub(crate) const CHOICE: &str = "NIWAKI_VULKAN_DEVICE";

/// Which device [`crate::Device::open`] takes, and how.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceOptions {
    /// The number of a device in [`crate::Device::list`], or a part of its name, in any case.
    /// Default `None`: what the environment variable `NIWAKI_VULKAN_DEVICE` says, or else the first
    /// of the best kind (discrete, integrated, virtual, CPU).
    pub device: Option<String>,
    /// Asks for the Khronos validation layer with synchronisation checks, which report wrong use of
    /// Vulkan and missing barriers ([`crate::Device::messages`]) and cost much time. Without the
    /// layer installed there are no messages and no error. Default false.
    pub validation: bool,
    /// Makes reads and writes past the end of a binding harmless, at some cost. Default false, as
    /// whatever is uploaded is checked.
    pub robust: bool,
    /// How long a submission may take until the device counts as lost. Default 60 s.
    pub timeout: Duration,
    /// Enables the driver's own ray tracing where there is any, for [`crate::DriverScene`]. Default
    /// true.
    pub ray_tracing: bool,
    /// Pretends that bindings are limited to this many bytes, if that is less than the device
    /// allows: for tests of what happens beyond. Default `None`.
    pub max_binding_bytes: Option<u64>,
    /// Uses the device's timestamps. Without them nothing can be timed, as on devices that have
    /// none. Default true.
    pub timestamps: bool,
    /// Has the driver tell what its compiler made of a kernel ([`crate::Kernel::statistics`]), where
    /// it can. Costs memory and time when kernels are made. Default false.
    pub statistics: bool,
}

impl Default for DeviceOptions {
    fn default() -> Self {
        Self {
            device: None,
            validation: false,
            robust: false,
            timeout: Duration::from_secs(60),
            ray_tracing: true,
            max_binding_bytes: None,
            timestamps: true,
            statistics: false,
        }
    }
}

impl DeviceOptions {
    /// With validation and bounds checks: for tests.
    #[must_use]
    pub fn checked() -> Self {
        Self { validation: true, robust: true, ..Self::default() }
    }
}
