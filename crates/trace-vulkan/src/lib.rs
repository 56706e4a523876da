//! Ray tracing on the GPU through Vulkan.
//!
//! ```
//! use niwaki_trace_vulkan::{Device, GpuError};
//!
//! match Device::new() {
//!     Ok(device) => println!("{}: {:?}", device.name(), device.info().kind),
//!     Err(GpuError::NoLoader(_) | GpuError::NoDevice(_)) => println!("no Vulkan here"),
//!     Err(other) => return Err(other),
//! }
//! # Ok::<(), GpuError>(())
//! ```

mod batch;
mod buffer;
mod device;
mod driver;
mod error;
mod kernel;
mod layout;
mod lbvh;
mod memory;
mod pipeline;
mod scene;
mod statistics;
mod timing;
mod tracer;

pub use batch::Batch;
pub use buffer::Buffer;
pub use device::{Device, DeviceInfo, DeviceKind, DeviceOptions};
pub use driver::{DriverBuild, DriverMethod, DriverScene, DriverTimes, DriverTrace, DriverTracer};
pub use error::GpuError;
pub use kernel::Kernel;
pub use lbvh::{GpuLbvh, LbvhConfig, LbvhError, LbvhTimes, LbvhWorkspace};
pub use scene::{DeviceTree, GpuScene, TreeLayout};
pub use statistics::{Statistic, StatisticValue};
pub use timing::Timings;
pub use tracer::{Query, Schedule, Trace, Tracer};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
