//! Frame logs and traces on one time axis.
//!
//! A renderer's clock and a meter's clock have an offset, and quartz drifts by tens of parts per million.
//! [`ClockMap`] is the line between them, with its uncertainty.

mod align;
mod fit;
mod methods;

pub(crate) use methods::synchronize;

use serde::{Deserialize, Serialize};

/// How a log and a trace are brought together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SyncMethod {
    /// The first of the others that the data allow, in the order below.
    #[default]
    Auto,
    /// Both were stamped by the same clock.
    SharedClock,
    /// Marks that the renderer gave to the meter.
    Marker,
    /// The frames' pattern of busy and idle, found again in the power by cross-correlation; then edges
    /// of the power, matched to starts and ends of frames.
    Correlation,
    /// Idle time before the first and after the last frame: two edges.
    Idle,
}

impl SyncMethod {
    /// A name for reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::SharedClock => "shared clock",
            Self::Marker => "marker",
            Self::Correlation => "correlation",
            Self::Idle => "idle before and after",
        }
    }
}

/// The line from times of a log to times of a trace:
/// `trace = log + offset + drift · (log − reference)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockMap {
    /// How it was found.
    pub method: SyncMethod,
    /// The time of the log at which the offset holds, in nanoseconds.
    pub reference_ns: i64,
    /// Trace minus log there, in nanoseconds.
    pub offset_ns: f64,
    /// Standard error of the offset. What delays every edge alike, such as capacitors of a supply, is
    /// not in it: no method can tell it from an offset.
    pub offset_error_ns: f64,
    /// How much faster the trace's clock runs, in parts per million.
    pub drift_ppm: f64,
    /// Standard error of the drift.
    pub drift_error_ppm: f64,
    /// Deviation of what was matched from the line, in nanoseconds.
    pub residual_ns: f64,
    /// Marks or edges that were matched.
    pub matched: usize,
    /// How much of the log's pattern the power shows: correlation from −1 to 1; none where no pattern
    /// was looked for.
    pub similarity: Option<f64>,
    /// The similarity of the best other position, by at least half a frame apart. Close to
    /// `similarity`, it means that frames look too much alike to be told apart.
    pub runner_up: Option<f64>,
}

impl ClockMap {
    /// The time of the trace at a time of the log.
    #[must_use]
    pub fn to_trace(&self, log_ns: i64) -> f64 {
        let since = (log_ns - self.reference_ns) as f64;
        log_ns as f64 + self.offset_ns + self.drift_ppm * 1e-6 * since
    }

    /// Standard error of [`ClockMap::to_trace`] from offset and drift, in nanoseconds.
    #[must_use]
    pub fn error_ns(&self, log_ns: i64) -> f64 {
        let since = (log_ns - self.reference_ns) as f64;
        self.offset_error_ns.hypot(self.drift_error_ppm * 1e-6 * since)
    }

    /// Whether another position fits nearly as well.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        matches!((self.similarity, self.runner_up), (Some(best), Some(next)) if next > 0.97 * best)
    }
}
