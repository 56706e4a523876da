//! Hybrid renderer: rasterised views and cube map, ray-traced near region.

mod error;
mod gpu;
pub mod plan;
pub mod region;
pub mod settings;

pub use error::HybridError;
pub use gpu::{DEVICE_VARIABLE, Gpu};
pub use plan::{Decision, Effect, EffectPlan, FrameFacts, Kept, ObjectFacts, PlannedPass, Quality};
pub use region::{Face, Region, Side};
pub use settings::{Behind, DebugView, March, NearRegion, SampleRule, Settings, Shadows};
