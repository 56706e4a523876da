//! The raster case studies of "Power efficiency for software algorithms running on graphics
//! processors" (Johnsson, Ganestam, Doggett and Akenine-Möller 2012, §3): forward, Z-prepass and
//! deferred rendering; shadow volumes, shadow maps and variance shadow maps; every pass timed.
//!
//! ```
//! use niwaki_raster::{Algorithm, FrameError, Gpu, Renderer, Settings, study};
//!
//! let gpu = match Gpu::new() {
//!     Ok(gpu) => gpu,
//!     Err(FrameError::NoAdapter(_)) => return Ok(()), // no Vulkan here
//!     Err(error) => return Err(error),
//! };
//! let study = study::tessellated(2_000, 1);
//! let settings = Settings::new(Algorithm::Deferred, 64, 36);
//! let mut renderer = Renderer::new(&gpu, study.scene.clone(), study.lights.clone(), settings)?;
//! let report = renderer.draw(&study.path.frame(0), 64, 36)?;
//! assert_eq!(renderer.picture()?.pixels.len(), 64 * 36);
//! println!("{:?} ms on the GPU", report.gpu_ms());
//! # Ok::<(), FrameError>(())
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`Algorithm`], [`Settings`] | the six, and their knobs |
//! | [`Renderer`], [`FrameReport`] | frames, and what their passes took |
//! | [`study`] | the paper's scenes, lights and camera paths |
//! | [`Animation`] | a camera path, logged for the analysis of power |
//! | [`ExactShadows`], [`ShadowError`] | shadows by rays in double precision, and how far frames are from them |
//! | [`Edges`] | edges of any mesh with their triangles, from which silhouettes are extracted |
//! | [`Solids`] | closed parts of any mesh, which cast from one side only |
//!
//! The WGSL is in `niwaki-shaders`, folders `raster` and `frame`. There are no feature flags.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod animation;
mod edges;
mod exact;
mod layout;
mod light;
mod picture;
mod pipelines;
mod renderer;
mod report;
mod settings;
mod solids;
pub mod study;
mod targets;
mod volumes;

pub use animation::Animation;
pub use edges::{Edge, Edges};
pub use exact::{Exact, ExactShadows, Judged, ShadowError};
pub use light::SpotLight;
pub use niwaki_gpu_frame::{DeviceKind, FrameError, Gpu};
pub use picture::{Picture, Shares};
pub use renderer::Renderer;
pub use report::{FrameReport, Pass, PassReport};
pub use settings::{
    Algorithm, Bias, Filter, Settings, UnknownAlgorithm, Variance, shadow_resolution,
};
pub use solids::Solids;
