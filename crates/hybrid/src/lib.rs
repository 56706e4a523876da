//! Hybrid renderer: what the camera sees is rasterised, what is near is ray traced, what is far is
//! marched through in a cube map of G-buffers, and only the effects that a scene calls for are
//! simulated (Ganestam and Doggett 2014, "Real-time multiply recursive reflections and refractions
//! using hybrid rendering").
//!
//! ```
//! use niwaki_hybrid::{Gpu, HybridError, HybridRenderer, Settings};
//! use std::sync::Arc;
//!
//! let gpu = match Gpu::new() {
//!     Ok(gpu) => gpu,
//!     Err(HybridError::NoAdapter(_)) => return Ok(()), // no Vulkan here: use niwaki-render
//!     Err(error) => return Err(error.into()),
//! };
//! let scene = Arc::new(niwaki_scene::Scene::default());
//! let mut renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), Settings::default())?;
//! let frame = renderer.render(&scene.cameras[0], 64, 36, 0.0)?;
//! println!("{}", frame.plan); // what ran, what was skipped, and why
//! assert_eq!(frame.report.counters.tree_traversals, 0, "nothing reflects in an empty scene");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | the effect plan: which passes run, at which quality, and why |
//! | [`settings`] | what to simulate and how finely, with presets |
//! | [`region`] | the near region, the faces of the cube map and their matrices |
//! | [`Gpu`], [`HybridRenderer`] | the device, and the frames rendered on it |
//! | [`FrameReport`], [`Counters`] | what a frame took: times on the GPU, draws, dispatches, rays |
//!
//! The shading model is that of [`niwaki_render::shading`], and with [`Settings::exact`] the image
//! is that of [`niwaki_render::Whitted`]. Kernels are the WGSL files of `niwaki-shaders`, folder
//! `hybrid`. There are no feature flags.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod layout;
mod pipelines;
pub mod plan;
mod pyramid;
pub mod region;
mod renderer;
mod report;
pub mod settings;
mod targets;
mod tree;
mod upload;
mod views;

pub use niwaki_gpu_frame::{DEVICE_VARIABLE, DeviceKind, FrameError as HybridError, Gpu};
pub use plan::{Decision, Effect, EffectPlan, FrameFacts, Kept, ObjectFacts, PlannedPass, Quality};
pub use region::{Face, Region, Side};
pub use renderer::HybridRenderer;
pub use report::{Counters, Frame, FrameReport, Stage, StageReport};
pub use settings::{Behind, DebugView, March, NearRegion, SampleRule, Settings, Shadows};
