//! Traces: rows of samples with their times, whatever they come from.
//!
//! A [`TraceReader`] hands out [`Block`]s of rows in the order in which they were recorded, good or bad;
//! repair is the task of [`crate::Cleaner`]. Files of every format, the [generator](crate::generator)
//! and [meters that are being read](crate::Recorder) are such readers.

mod binary;
mod chunks;
mod csv;
mod number;
mod powersensor;
mod write;

pub use binary::BINARY_MAGIC;
pub use chunks::ReadOptions;
pub use write::{TraceFormat, TraceWriter};

use crate::{Clock, PowerError};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// A current, in amperes.
    Amperes,
    /// A voltage, in volts.
    Volts,
    /// A power, in watts.
    Watts,
    /// Energy since some start, in joules: a counter that only grows.
    Joules,
}

impl Unit {
    /// The ending of a column's name that says so: `_a`, `_v`, `_w` or `_j`.
    #[must_use]
    pub const fn suffix(self) -> &'static str {
        match self {
            Self::Amperes => "_a",
            Self::Volts => "_v",
            Self::Watts => "_w",
            Self::Joules => "_j",
        }
    }

    /// The unit that a column's name ends with.
    #[must_use]
    pub fn of_column(name: &str) -> Option<Self> {
        let all = [Self::Amperes, Self::Volts, Self::Watts, Self::Joules];
        all.into_iter().find(|unit| name.to_ascii_lowercase().ends_with(unit.suffix()))
    }
}

/// A column of samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name; by convention that of the rail, with [`Unit::suffix`].
    pub name: String,
    /// What it holds.
    pub unit: Unit,
}

impl Column {
    /// A column of this name and unit.
    pub fn new(name: impl Into<String>, unit: Unit) -> Self {
        Self { name: name.into(), unit }
    }
}

/// What is known of the instrument besides its samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SensorNote {
    /// Name of the instrument.
    pub name: String,
    /// Time between updates in seconds, if it is known beforehand. (It is measured too.)
    pub refresh_s: Option<f64>,
    /// Share of the time that the instrument sees, if less than all: 0.25 for 25 ms of every 100.
    pub coverage: Option<f64>,
    /// Where those numbers come from.
    pub source: String,
}

/// What a trace says about itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TraceInfo {
    /// The columns of samples, in order.
    pub columns: Vec<Column>,
    /// Samples a second as declared; none if only the times tell.
    pub rate_hz: Option<f64>,
    /// What times count from.
    pub clock: Clock,
    /// The instrument.
    pub sensor: SensorNote,
}

/// A mark that the instrument put into the trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowMark {
    /// Row of the block.
    pub row: usize,
    /// The character of the mark.
    pub label: u8,
}

/// Rows of samples, as recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// Time of each row in nanoseconds of the trace's clock; not necessarily in order.
    pub times_ns: Vec<i64>,
    /// The samples of each column, in its unit; as many as times. What is missing is NaN.
    pub channels: Vec<Vec<f64>>,
    /// Marks, in order of rows.
    pub marks: Vec<RowMark>,
}

impl Block {
    /// An empty block with so many columns.
    #[must_use]
    pub fn with_columns(columns: usize) -> Self {
        Self { times_ns: Vec::new(), channels: vec![Vec::new(); columns], marks: Vec::new() }
    }

    /// Number of rows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.times_ns.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.times_ns.is_empty()
    }

    /// Adds the rows of another block with the same columns.
    pub fn append(&mut self, other: &Self) {
        let base = self.len();
        self.times_ns.extend_from_slice(&other.times_ns);
        for (to, from) in self.channels.iter_mut().zip(&other.channels) {
            to.extend_from_slice(from);
        }
        self.marks.extend(other.marks.iter().map(|m| RowMark { row: m.row + base, ..*m }));
    }
}

/// A source of rows.
///
/// Implementations need not repair anything, and must end: a live source ends when it is stopped.
pub trait TraceReader: Send {
    /// What is known before the first row.
    fn info(&self) -> &TraceInfo;

    /// The next rows, at least one; none after the last.
    ///
    /// # Errors
    /// What keeps the rows from being read. The reader is then at its end.
    fn next_block(&mut self) -> Result<Option<Block>, PowerError>;

    /// Lines or blocks so far that could not be read and were passed over.
    fn broken_lines(&self) -> u64 {
        0
    }
}

impl TraceReader for Box<dyn TraceReader> {
    fn info(&self) -> &TraceInfo {
        (**self).info()
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        (**self).next_block()
    }

    fn broken_lines(&self) -> u64 {
        (**self).broken_lines()
    }
}

/// Opens a trace file of any format: the compact binary form, a PowerSensor3 dump, or CSV with columns
/// that are named by their units.
///
/// **CSV**: one column of time, `time_s`, `time_ms`, `time_us` or `time_ns`; columns of samples whose
/// names end with `_a` (amperes), `_v` (volts), `_w` (watts) or `_j` (joules since some start); and at
/// most one column `mark`, whose cells are empty, `0`, `S` or `.` for ordinary rows and a character or
/// number for marks. A mark that stands in several rows on end counts once. Other columns are passed
/// over. Separators are commas, semicolons, tabs or spaces. Lines `# rate_hz: 40000` and
/// `# clock: monotonic` before the header are understood.
///
/// **PowerSensor3 dumps**: the header is `marker time dt_micro device_timestamp` and
/// `currentN voltageN powerN` for each pair of sensors, then `power_total`; a row begins with `S`, or with
/// the character of a mark, or is an older version's separate line `M c`. Power is computed from current
/// and voltage. Times come from the device's timestamp, which wraps around after 1024 µs, because the
/// host prints its own with six digits only: after 100 s with a resolution of a millisecond.
///
/// # Errors
/// [`PowerError::File`] if the file cannot be opened, [`PowerError::Header`] if it is none of these.
pub fn open_trace(path: &Path, options: &ReadOptions) -> Result<Box<dyn TraceReader>, PowerError> {
    let file = File::open(path).map_err(PowerError::file(path))?;
    read_trace(Box::new(file), options)
}

/// Reads a trace of any format from a stream; see [`open_trace`].
///
/// # Errors
/// [`PowerError::Header`] if it is no format that is known, [`PowerError::Stream`] from the stream.
pub fn read_trace(
    mut input: Box<dyn Read + Send>,
    options: &ReadOptions,
) -> Result<Box<dyn TraceReader>, PowerError> {
    let mut start = Vec::new();
    input.by_ref().take(8).read_to_end(&mut start)?;
    if start == BINARY_MAGIC {
        return binary::open(input, options);
    }
    let is_dump = start.starts_with(b"marker ");
    let whole: Box<dyn Read + Send> = Box::new(std::io::Cursor::new(start).chain(input));
    if is_dump { powersensor::open(whole, options) } else { csv::open(whole, options) }
}
