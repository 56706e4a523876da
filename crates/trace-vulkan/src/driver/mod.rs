//! The driver's own ray tracing, as a peer of ours: its acceleration structures, and its two ways to
//! trace rays through them.

mod pipeline;
mod scene;
mod structure;
mod tracer;

pub use scene::{DriverBuild, DriverScene, DriverTimes};
pub use tracer::{DriverTrace, DriverTracer};

use crate::{DeviceInfo, GpuError};

/// The two ways that Vulkan has for tracing rays through a driver's acceleration structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DriverMethod {
    /// A pipeline of ray generation, miss and closest-hit shaders (`VK_KHR_ray_tracing_pipeline`).
    Pipeline,
    /// Queries in a compute shader (`VK_KHR_ray_query`).
    Query,
}

impl DriverMethod {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Pipeline, Self::Query];

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pipeline => "ray pipeline",
            Self::Query => "ray query",
        }
    }

    /// Whether a device offers it.
    #[must_use]
    pub const fn is_offered(self, info: &DeviceInfo) -> bool {
        match self {
            Self::Pipeline => info.has_ray_pipeline,
            Self::Query => info.has_ray_query,
        }
    }

    /// An error unless a device offers it.
    pub(crate) const fn check(self, info: &DeviceInfo) -> Result<(), GpuError> {
        if self.is_offered(info) {
            return Ok(());
        }
        Err(match self {
            Self::Pipeline => GpuError::NotOffered {
                what: "ray-tracing pipelines (VK_KHR_ray_tracing_pipeline)",
                remedy: "use ray queries (DriverMethod::Query) where there are any, a driver that has pipelines, or our own traversal (Tracer)",
            },
            Self::Query => GpuError::NotOffered {
                what: "ray queries (VK_KHR_ray_query)",
                remedy: "use pipelines (DriverMethod::Pipeline) where there are any, a driver that has queries, or our own traversal (Tracer)",
            },
        })
    }
}
