//! Frames in a trace: their spans, their energy, and what the power does within and between them.

mod gaps;
mod meter;
mod signature;
mod spans;

pub use gaps::{GapPlace, IdleGap};
pub use meter::FrameEnergy;
pub use signature::{Signature, Waveform};
pub use spans::{Segmentation, SensorVerdict};

pub(crate) use gaps::GapFinder;
pub(crate) use meter::Meter;
pub(crate) use signature::{Captures, Signatures};
pub(crate) use spans::{Spans, judge_sensor, window_ns};
