//! What a frame does.

use niwaki_trace_vulkan::TreeLayout;

/// What a frame does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameSettings {
    /// Width of the image in pixels; 0 gives an empty one.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Whether a ray goes to each light; without, all lights shine everywhere.
    pub shadows: bool,
    /// Directions of ambient occlusion a pixel; 0 for none. Noise falls with its square root.
    pub ao_rays: u32,
    /// How far occluders count, in units of the scene. ∞ counts all; what is not positive, none.
    pub ao_radius: f32,
    /// Seed of the directions.
    pub seed: u32,
}

impl Default for FrameSettings {
    /// 640 × 360 pixels with shadows and eight directions of ambient occlusion within a unit.
    fn default() -> Self {
        Self { width: 640, height: 360, shadows: true, ao_rays: 8, ao_radius: 1.0, seed: 0 }
    }
}

impl FrameSettings {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// The radius as rays use it.
    pub(crate) fn reach(&self) -> f32 {
        if self.ao_radius > 0.0 { self.ao_radius.min(f32::MAX) } else { 0.0 }
    }

    /// The directions that are traced.
    pub(crate) fn directions(&self) -> u32 {
        if self.reach() > 0.0 { self.ao_rays } else { 0 }
    }
}

/// The kernels of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// The nearest hit of each pixel.
    Primary,
    /// Shading, shadow rays and ambient occlusion.
    Shade,
}

impl Kernel {
    /// Both, in order.
    pub const ALL: [Self; 2] = [Self::Primary, Self::Shade];

    /// The entry point of the modules `tracer/binary` and `tracer/wide` of `niwaki-shaders`.
    #[must_use]
    pub const fn entry(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shade => "shade",
        }
    }
}

/// The module of `niwaki-shaders` that has the kernels over a layout of trees.
pub(crate) const fn module(layout: TreeLayout) -> &'static str {
    match layout {
        TreeLayout::Binary => "tracer/binary",
        TreeLayout::Wide => "tracer/wide",
    }
}
