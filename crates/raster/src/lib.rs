//! The raster case studies of "Power efficiency for software algorithms running on graphics
//! processors" (Johnsson, Ganestam, Doggett and Akenine-Möller 2012, §3).

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
pub mod study;
mod targets;
mod volumes;

pub use animation::Animation;
pub use edges::{Edge, Edges};
pub use exact::{Exact, ExactShadows, Judged, ShadowError};
pub use light::SpotLight;
pub use niwaki_gpu_frame::{FrameError, Gpu};
pub use picture::{Picture, Shares};
pub use renderer::Renderer;
pub use report::{FrameReport, Pass, PassReport};
pub use settings::{
    Algorithm, Bias, Filter, Settings, UnknownAlgorithm, Variance, shadow_resolution,
};
