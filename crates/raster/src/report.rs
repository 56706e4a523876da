//! What a frame took.

use crate::Algorithm;
use serde::{Deserialize, Serialize};

/// A part of a frame that is timed as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Pass {
    /// Depth alone.
    DepthPrepass,
    /// Triangles, shaded with all lights.
    Forward,
    /// The environment, where nothing was drawn.
    Sky,
    /// Surfaces and depth.
    GBuffer,
    /// What there is without lights.
    Base,
    /// The volumes of all lights, without shadows.
    Lights,
    /// Which triangles face a light, and the outlines between them.
    Silhouettes(u32),
    /// Caps and walls into the stencil buffer.
    Volumes(u32),
    /// Depth from a light.
    ShadowMap(u32),
    /// Depth from a light and its square, and the levels of both.
    Moments(u32),
    /// A light's volume, with its shadows.
    Light(u32),
    /// The picture for the display.
    Resolve,
}

impl Pass {
    /// The light that it is for, by its place in the list.
    #[must_use]
    pub const fn light(self) -> Option<u32> {
        match self {
            Self::Silhouettes(light)
            | Self::Volumes(light)
            | Self::ShadowMap(light)
            | Self::Moments(light)
            | Self::Light(light) => Some(light),
            _ => None,
        }
    }

    /// What it is, whichever light it is for.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::DepthPrepass => "depth prepass",
            Self::Forward => "forward",
            Self::Sky => "sky",
            Self::GBuffer => "G-buffer",
            Self::Base => "base",
            Self::Lights => "lights",
            Self::Silhouettes(_) => "silhouettes",
            Self::Volumes(_) => "volumes",
            Self::ShadowMap(_) => "shadow map",
            Self::Moments(_) => "moments",
            Self::Light(_) => "light",
            Self::Resolve => "resolve",
        }
    }
}

impl std::fmt::Display for Pass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.light() {
            Some(light) => write!(f, "{} {light}", self.name()),
            None => f.pad(self.name()),
        }
    }
}

/// What a pass was given to do, and when the GPU did it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassReport {
    /// Which.
    pub pass: Pass,
    /// Draw commands.
    pub draws: u32,
    /// Dispatches of kernels.
    pub dispatches: u32,
    /// When the GPU began and ended it, in nanoseconds of the GPU's clock, whose zero means
    /// nothing; `None` on devices without timestamps.
    pub span: Option<[f64; 2]>,
}

impl PassReport {
    /// Time on the GPU in milliseconds.
    #[must_use]
    pub fn ms(&self) -> Option<f64> {
        self.span.map(|[begin, end]| (end - begin).max(0.0) * 1e-6)
    }
}

/// What a frame took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// What was drawn how.
    pub algorithm: Algorithm,
    /// Lights.
    pub lights: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Its passes, in order.
    pub passes: Vec<PassReport>,
    /// From the call to the end of the GPU's work, in milliseconds.
    pub total_ms: f64,
}

impl FrameReport {
    /// Time on the GPU in milliseconds: the sum of the passes; `None` on devices without
    /// timestamps.
    #[must_use]
    pub fn gpu_ms(&self) -> Option<f64> {
        self.passes.iter().map(PassReport::ms).sum()
    }
}
