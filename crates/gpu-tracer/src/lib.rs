//! A ray tracer for interactive frames on the GPU (Ganestam and Doggett 2012): primary rays, Phong shading, shadow rays and
//! ambient occlusion within a radius, each of which can be turned down to keep a frame time.
//!
//! ```
//! use niwaki_build_binned::Binned;
//! use niwaki_core::Builder;
//! use niwaki_gpu_tracer::{FrameSettings, FrameTracer, TracedScene};
//! use niwaki_trace_vulkan::{Device, GpuError};
//!
//! let scene = niwaki_scene::generate::generate("fairy", 2_000, 1).ok_or("no such scene")?;
//! let bvh = Binned::default().build(&scene.mesh.prim_refs())?;
//! let device = match Device::new() {
//!     Ok(device) => device,
//!     Err(GpuError::NoLoader(_) | GpuError::NoDevice(_)) => return Ok(()), // no Vulkan here
//!     Err(other) => return Err(other.into()),
//! };
//! let mut tracer = FrameTracer::new(&device)?;
//! let traced = TracedScene::upload(&device, &bvh, &scene)?;
//! let settings = FrameSettings { width: 64, height: 48, ..FrameSettings::default() };
//! let times = tracer.draw(&traced, &scene.camera_path().frame(0), &settings)?;
//! println!("{:.2} ms, {:?}", 1e3 * times.total(), tracer.image()?.get(32, 24));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A frame is two kernels: the nearest hit of each pixel, and its shading, in which all rays end at
//! their first hit. [`mod@reference`] does the same on the CPU.

mod layout;
mod model;
pub mod reference;
mod scene;
mod settings;
mod tracer;

pub use model::{TracerCountError, TracerCounts, TracerModel};
pub use scene::TracedScene;
pub use settings::{FrameSettings, Kernel};
pub use tracer::{FrameCounts, FrameTimes, FrameTracer};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
