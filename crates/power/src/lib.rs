//! Power traces of graphics devices: from samples to joules per pixel.
#[cfg(feature = "analysis")]
mod analysis;
#[cfg(feature = "analysis")]
mod clean;
#[cfg(feature = "analysis")]
mod edges;
#[cfg(feature = "analysis")]
mod filter;
#[cfg(feature = "analysis")]
mod frames;
#[cfg(feature = "analysis")]
pub mod generator;
#[cfg(feature = "analysis")]
mod rails;
#[cfg(feature = "analysis")]
mod source;
#[cfg(feature = "analysis")]
mod stats;
#[cfg(feature = "analysis")]
mod survey;
#[cfg(feature = "analysis")]
mod sync;
#[cfg(feature = "analysis")]
mod trace;

mod clock;
mod error;
mod frame_log;

#[cfg(feature = "analysis")]
pub use analysis::{
    Analysis, AnalysisOptions, Eq2, GroupResult, IdlePolicy, IdleResult, PowerState, Spike, analyze,
};
#[cfg(feature = "analysis")]
pub use clean::{
    CleanOptions, CleanStream, Cleaner, Fault, FaultCount, Flag, Mark, PowerBlock, PowerStream,
    Quality, RailTotal,
};
pub use clock::{CLOCK, Clock, now_ns};
#[cfg(feature = "analysis")]
pub use edges::Edge;
pub use error::PowerError;
#[cfg(feature = "analysis")]
pub use filter::{Butterworth, Decimated, Decimator, Section, ZeroPhase};
pub use frame_log::{FRAME_LOG_VERSION, FrameLog, FrameLogHeader, FrameRecord, PassTime};
#[cfg(feature = "analysis")]
pub use frames::{
    FrameEnergy, GapPlace, IdleGap, Segmentation, SensorVerdict, Signature, Waveform,
};
#[cfg(feature = "analysis")]
pub use rails::{Calibration, Rail, RailKind, Voltage, rails_by_name};
#[cfg(feature = "nvml")]
pub use source::NvmlMeter;
#[cfg(feature = "analysis")]
pub use source::{
    JoinedMeter, Meter, RaplMeter, Recorder, RecorderOptions, RecorderStopper, find_meters,
};
#[cfg(feature = "analysis")]
pub use stats::{Statistic, statistic, student};
#[cfg(feature = "analysis")]
pub use survey::{Bins, Levels};
#[cfg(feature = "analysis")]
pub use sync::{ClockMap, SyncMethod};
#[cfg(feature = "analysis")]
pub use trace::{
    BINARY_MAGIC, Block, Column, ReadOptions, RowMark, SensorNote, TraceFormat, TraceInfo,
    TraceReader, TraceWriter, Unit, open_trace, read_trace,
};
