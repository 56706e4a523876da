use std::path::PathBuf;
use thiserror::Error;

/// What can go wrong with traces, logs and meters.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PowerError {
    /// A file could not be opened, read or written. Check its path, permissions and free space.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Reading or writing stopped in the middle of a stream. The medium is at fault, not the contents.
    #[error("cannot read or write a trace: {0}")]
    Stream(#[from] std::io::Error),
    /// The head of a trace does not say what this crate needs: name its columns as the message asks.
    #[error("not a trace that can be read: {0}")]
    Header(String),
    /// More lines of a trace are broken than a truncated or disturbed recording explains; it is likely
    /// in another format.
    #[error("{bad} of {lines} lines are broken; the first, line {first}: {reason}")]
    Lines {
        /// Broken lines.
        bad: u64,
        /// All lines so far.
        lines: u64,
        /// Number of the first broken line, from 1.
        first: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// A block of a binary trace is damaged. What came before can be read with a copy of the file that
    /// ends there.
    #[error("damaged binary trace: block {block}: {reason}")]
    Damaged {
        /// Number of the block, from 0.
        block: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// Rails and columns do not fit: a rail names a column that is not there, or nothing says how
    /// columns become power. Declare rails, for instance in a file.
    #[error("rails: {0}")]
    Rails(String),
    /// A frame log has a line that cannot be read.
    #[error("frame log, line {line}: {reason}")]
    Log {
        /// Number of the line, from 1.
        line: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// A setting is outside of what makes sense; the message says which and what does.
    #[error("{0}")]
    Setting(String),
    /// The log and the trace could not be brought together; the message says what was tried and what
    /// would help.
    #[error("no synchronisation: {0}")]
    NoSync(String),
    /// There is nothing to analyse: no samples, or none outside holes.
    #[error("the trace holds no usable samples")]
    Empty,
    /// A meter is not here or may not be read; the message names the remedy.
    #[error("{meter}: {reason}")]
    Meter {
        /// Which meter.
        meter: String,
        /// Why it cannot be read, and what to do.
        reason: String,
    },
}

#[cfg(feature = "analysis")]
impl PowerError {
    /// Names the file in an error of the system.
    pub(crate) fn file(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }
}
