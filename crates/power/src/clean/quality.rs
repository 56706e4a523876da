//! What was found wrong in a trace, and what was done about it.

use serde::{Deserialize, Serialize};

/// A class of faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// Rows are missing, few enough to be interpolated.
    Gap,
    /// Rows are missing or unusable, too many to be interpolated: the trace is cut there, and no energy
    /// is made up.
    Hole,
    /// A row has the time of the row before it; it was dropped.
    Duplicate,
    /// A row is out of order: it was put in its place if that was near, dropped otherwise.
    OutOfOrder,
    /// The clock went back for good; rows after it were moved on to follow those before it.
    ClockStep,
    /// A sample is not a number; it was interpolated if few are in a row.
    NotANumber,
    /// A sample is at the end of its sensor's range. It is kept: energy there is a lower bound.
    Clipped,
}

impl Fault {
    /// All classes.
    pub const ALL: [Self; 7] = [
        Self::Gap,
        Self::Hole,
        Self::Duplicate,
        Self::OutOfOrder,
        Self::ClockStep,
        Self::NotANumber,
        Self::Clipped,
    ];

    /// A name for tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gap => "gaps, bridged",
            Self::Hole => "holes",
            Self::Duplicate => "duplicated timestamps",
            Self::OutOfOrder => "rows out of order",
            Self::ClockStep => "clock steps back",
            Self::NotANumber => "samples not a number",
            Self::Clipped => "samples clipped",
        }
    }
}

/// A stretch of time in which samples are not what the sensor said, or not what was there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flag {
    /// What it is.
    pub fault: Fault,
    /// First time it concerns, in nanoseconds of the trace.
    pub from_ns: i64,
    /// Last time it concerns.
    pub to_ns: i64,
}

/// How often a class of faults occurred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultCount {
    /// Occurrences: stretches of rows for gaps and holes, samples for the last two classes, rows for
    /// the others.
    pub count: u64,
    /// Rows that were interpolated, moved or dropped because of it.
    pub repaired: u64,
    /// Time that is lost in nanoseconds (holes).
    pub lost_ns: i64,
}

/// The share of a rail.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RailTotal {
    /// Name of the rail.
    pub name: String,
    /// Its mean power over all good samples, in watts.
    pub mean_w: f64,
    /// Samples at the end of the range that the rail declares.
    pub clipped: u64,
    /// The longest run of equal samples at the largest reading, if it is so long that the sensor may
    /// have been clipped without a declared range.
    pub suspected_run: Option<u64>,
}

/// How good a trace is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Rows that were read.
    pub rows: u64,
    /// Samples in them.
    pub samples: u64,
    /// Lines or blocks that could not be read.
    pub broken_lines: u64,
    /// First and last time, in nanoseconds.
    pub span_ns: (i64, i64),
    /// The usual time between rows, in nanoseconds.
    pub period_ns: f64,
    /// Standard deviation of the times between rows, in nanoseconds, without gaps.
    pub jitter_ns: f64,
    /// Median time between changes of the samples, in nanoseconds: the sensor's own period, if it is
    /// asked more often than it measures.
    pub refresh_ns: f64,
    /// Faults by class, in the order of [`Fault::ALL`].
    pub faults: [FaultCount; 7],
    /// Stretches of time with faults, in order; no more than the first [`Quality::MAX_FLAGS`].
    pub flags: Vec<Flag>,
    /// Rails.
    pub rails: Vec<RailTotal>,
}

impl Quality {
    /// Flags that are kept for the report; counts go on.
    pub const MAX_FLAGS: usize = 1000;

    /// How often a class occurred.
    #[must_use]
    pub const fn count(&self, fault: Fault) -> FaultCount {
        self.faults[fault as usize]
    }

    pub(crate) const fn at(&mut self, fault: Fault) -> &mut FaultCount {
        &mut self.faults[fault as usize]
    }

    /// Length of the trace in seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        (self.span_ns.1 - self.span_ns.0) as f64 * 1e-9
    }
}
