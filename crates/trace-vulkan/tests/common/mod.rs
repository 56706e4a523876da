//! The device of the tests.

use niwaki_trace_vulkan::{Device, DeviceOptions, GpuError};

/// A device with validation, or `None` where there is no Vulkan and none is required.
///
/// # Panics
/// If `NIWAKI_REQUIRE_VULKAN` is set and there is no device, and for every error but a missing one.
pub(crate) fn device() -> Option<Device> {
    device_with(&DeviceOptions::checked())
}

/// As [`device`], opened in a certain way.
pub(crate) fn device_with(options: &DeviceOptions) -> Option<Device> {
    match Device::open(options) {
        Ok(device) => Some(device),
        Err(error @ (GpuError::NoLoader(_) | GpuError::NoDevice(_))) => {
            let is_required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!is_required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Nothing was used in a wrong way.
pub(crate) fn assert_silent(device: &Device) {
    assert_eq!(device.messages(), Vec::<String>::new());
}
