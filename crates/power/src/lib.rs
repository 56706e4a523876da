//! Power traces of graphics devices: from samples to joules per pixel.
//!
//! Per Ganestam's thesis, paper II (Johnsson, Ganestam, Doggett and Akenine-Möller, "Power Efficiency for
//! Software Algorithms running on Graphics Processors", HPG 2012), asks what a frame costs in energy, and
//! answers with currents sampled at 40 kHz. This crate reads such traces (or those of whatever meter there
//! is), repairs them within bounds, brings them together with the log of the renderer, and measures frames.
//!
//! ```
//! use niwaki_power::generator::{Recording, RecordingOptions};
//! use niwaki_power::{AnalysisOptions, analyze};
//!
//! // Two seconds at 40 kHz whose truth is known; a meter's clock that runs 50 ppm fast.
//! let recording = Recording::new(&RecordingOptions::quick(1))?;
//! let options = AnalysisOptions { rails: Some(recording.rails()), ..AnalysisOptions::default() };
//! let analysis = analyze(|| Ok(Box::new(recording.reader())), Some(&recording.log()), &options)?;
//! for (group, truth) in analysis.groups.iter().zip(&recording.truth().nj_per_pixel) {
//!     assert!((group.energy.mean_nj_per_pixel / truth - 1.0).abs() < 0.005);
//! }
//! assert!((analysis.clock.unwrap().drift_ppm - 50.0).abs() < 5.0);
//! # Ok::<(), niwaki_power::PowerError>(())
//! ```
//!
//! | step | here |
//! |---|---|
//! | read | [`open_trace`]: CSV, PowerSensor3 dumps, a compact binary form; [`Recorder`]: a [`Meter`] such as [`RaplMeter`] or `NvmlMeter`, on a thread of its own; all are [`TraceReader`]s |
//! | repair, P = Σ U·I | [`Cleaner`] with [`Rail`]s; [`Quality`] counts every fault |
//! | filter | [`Butterworth`], [`ZeroPhase`] on a stream, [`Decimator`] |
//! | synchronise | [`SyncMethod`], [`ClockMap`] |
//! | measure | [`analyze`], [`Analysis`] |
//! | test | [`generator`] |
//!
//! Features: `analysis` (on by default) is all of that; without it, [`FrameLog`] and [`now_ns`] are left,
//! which is what a renderer needs to write its log. `nvml` adds `NvmlMeter`, whose library is loaded when it
//! is opened.

#![cfg_attr(
    not(feature = "analysis"),
    allow(rustdoc::broken_intra_doc_links, reason = "the documentation is that of all features")
)]

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

/// The README's examples, as tests.
#[cfg(all(doctest, feature = "analysis"))]
#[doc = include_str!("../README.md")]
pub struct Readme;
