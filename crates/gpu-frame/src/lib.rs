//! What renderers on wgpu share: the device, a scene's buffers, the G-buffer pass, the views of
//! cameras and lights, and stages that are timed on the GPU.
//!
//! ```
//! use niwaki_gpu_frame::{FrameError, Gpu, Recorder};
//!
//! let gpu = match Gpu::new() {
//!     Ok(gpu) => gpu,
//!     Err(FrameError::NoAdapter(_)) => return Ok(()), // no Vulkan here
//!     Err(error) => return Err(error),
//! };
//! let mut recorder = Recorder::new(&gpu, 8);
//! recorder.stage("nothing", |_encoder| [0, 0]);
//! for timed in recorder.finish()? {
//!     println!("{}: {:?}", timed.stage, timed.gpu_time());
//! }
//! # Ok::<(), FrameError>(())
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`Gpu`] | the device: its choice, its faults, short ways to buffers, textures, pipelines |
//! | [`Surfaces`] | a scene's triangles, materials and textures as `frame/surfaces.wgsl` binds them |
//! | [`RasterPipeline`] | the passes that draw those triangles (`frame/gbuffer.wgsl`) |
//! | [`camera_view`], [`spot_view`] | matrices with reversed depth and no far plane |
//! | [`Recorder`] | commands stage by stage, with their times |
//!
//! The WGSL is in `niwaki-shaders`, folder `frame`. There are no feature flags.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod atlas;
mod error;
mod gpu;
mod layout;
mod raster;
mod recorder;
mod slot;
mod surfaces;
mod views;

pub use error::FrameError;
pub use gpu::{DEVICE_VARIABLE, DeviceKind, Gpu};
pub use layout::{GpuMaterial, Vertex, ViewMatrix};
pub use raster::{DEPTH, RasterPipeline, SURFACE, TRIANGLE, depth_state, opaque};
pub use recorder::{Recorder, Timed};
pub use slot::Slot;
pub use surfaces::{Surfaces, diagonal};
pub use views::{camera_view, check_camera, clip_matrix, may_show, spot_view};
pub use wgpu;
