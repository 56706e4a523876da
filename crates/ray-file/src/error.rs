//! Why a file has no rays.

use crate::binary_file::RECORD;

/// Why rays cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RayFileError {
    /// The system could not open or read the file. Remedy: as the cause says.
    #[error("it cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// A line is not CSV: it has another number of fields than the first, or is not UTF-8. The cause
    /// names the line. Remedy: mend that line.
    #[error("it is not CSV: {0}")]
    Csv(#[from] csv::Error),
    /// The first line lacks a column without which there is no ray. Remedy: name all of them there.
    #[error(
        "line 1 must name the columns {}; {column} is missing in `{found}`",
        crate::csv_file::names()
    )]
    MissingColumn {
        /// The column.
        column: &'static str,
        /// The first line.
        found: String,
    },
    /// Two columns have the same meaning. Remedy: rename or remove one.
    #[error("line 1: {column} is there twice")]
    ColumnTwice {
        /// The column.
        column: &'static str,
    },
    /// A field is not a number. Remedy: write it as a decimal fraction, with an exponent if need be, or
    /// as `inf`.
    #[error("line {line}: {column} is `{text}`, not a number")]
    NotANumber {
        /// The line, from 1.
        line: u64,
        /// The column.
        column: &'static str,
        /// What stands there.
        text: String,
    },
    /// A binary file ends within a record. Remedy: write whole records, or call a CSV file `.csv`.
    #[error(
        "it has {bytes} bytes, which is {} records of {RECORD} bytes and {} more; a record is origin \
         x, y, z, t_min, direction x, y, z, t_max as little-endian 32-bit floats (CSV files must be \
         called .csv)",
        bytes / RECORD,
        bytes % RECORD
    )]
    PartialRecord {
        /// Bytes of the file.
        bytes: usize,
    },
}
