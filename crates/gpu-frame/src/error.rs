//! Why a frame was not rendered.

/// Why a frame was not rendered. A scene without triangles or an image without pixels is no error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// There is no Vulkan device. Remedy: install a driver (Mesa's lavapipe runs on any CPU), or
    /// render with the integrators of `niwaki-render`.
    #[error(
        "no Vulkan device was found ({0}): install a driver, Mesa's lavapipe for one, or use the \
         CPU integrators of niwaki-render"
    )]
    NoAdapter(String),
    /// `NIWAKI_VULKAN_DEVICE` names a device that is not there. Remedy: unset it, or use one of
    /// the listed names or their numbers.
    #[error("NIWAKI_VULKAN_DEVICE is `{wanted}`, but the devices are: {available}")]
    UnknownAdapter {
        /// What the variable holds.
        wanted: String,
        /// What there is.
        available: String,
    },
    /// The device lacks something that the renderer cannot do without. Remedy: use another device
    /// or a newer driver.
    #[error("the device {device} lacks {missing}: use another device or a newer driver")]
    Unsupported {
        /// The device.
        device: String,
        /// What it lacks.
        missing: String,
    },
    /// The device could not be opened. Remedy: as the driver's message says.
    #[error("the device could not be opened: {0}")]
    Open(String),
    /// The device is gone: reset by the driver, removed, or stuck. Remedy: make a new
    /// [`Gpu`](crate::Gpu) and a new renderer on it.
    #[error("the device was lost ({0}): make a new one and a new renderer on it")]
    DeviceLost(String),
    /// The device's memory is full. Remedy: a smaller image, scene, cube map or shadow map.
    #[error("the device is out of memory ({0}): use smaller images, maps or scenes")]
    OutOfMemory(String),
    /// Something is larger than the device allows. Remedy: as the message says.
    #[error("{what} needs {wanted}, but the device allows {limit}: {remedy}")]
    TooLarge {
        /// What.
        what: String,
        /// Its size in bytes or pixels a side.
        wanted: u64,
        /// The largest allowed.
        limit: u64,
        /// What to do about it.
        remedy: &'static str,
    },
    /// The camera's position or directions are not finite. Remedy: make it by
    /// [`Camera::look_at`](niwaki_scene::Camera::look_at), from finite points.
    #[error("the camera is not finite: {0}")]
    BadCamera(String),
    /// A shader did not compile. Remedy: report a bug.
    #[error("the shader {module} does not compile: {message}")]
    Shader {
        /// Which.
        module: String,
        /// What the compiler says.
        message: String,
    },
    /// The graphics library refused a command. Remedy: report a bug.
    #[error("the graphics library refused a command: {0}")]
    Gpu(String),
}
