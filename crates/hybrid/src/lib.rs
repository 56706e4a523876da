//! Hybrid renderer: rasterised views and cube map, ray-traced near region.

mod atlas;
mod error;
mod gpu;
mod layout;
mod pipelines;
pub mod plan;
pub mod region;
mod renderer;
mod report;
pub mod settings;
mod targets;
mod tree;
mod upload;
mod views;

pub use error::HybridError;
pub use gpu::{DEVICE_VARIABLE, Gpu};
pub use plan::{Decision, Effect, EffectPlan, FrameFacts, Kept, ObjectFacts, PlannedPass, Quality};
pub use region::{Face, Region, Side};
pub use renderer::HybridRenderer;
pub use report::{Counters, Frame, FrameReport, Stage, StageReport};
pub use settings::{Behind, DebugView, March, NearRegion, SampleRule, Settings, Shadows};
