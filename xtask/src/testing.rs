//! What tests of several commands share.

/// True if a device that a test needs was opened. Otherwise says that the test is skipped, or fails if
/// `NIWAKI_REQUIRE_VULKAN` asks for devices.
pub(crate) fn is_there<T, E: std::fmt::Display>(device: Result<T, E>) -> bool {
    let Err(error) = device else { return true };
    let required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|value| value != "0");
    assert!(!required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
    eprintln!("skipped: {error}");
    false
}
