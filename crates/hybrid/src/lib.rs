//! Hybrid renderer: rasterised views and cube map, ray-traced near region.

pub mod plan;
pub mod region;
pub mod settings;

pub use plan::{Decision, Effect, EffectPlan, FrameFacts, Kept, ObjectFacts, PlannedPass, Quality};
pub use region::{Face, Region, Side};
pub use settings::{Behind, DebugView, March, NearRegion, SampleRule, Settings, Shadows};
