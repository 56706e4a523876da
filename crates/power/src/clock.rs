//! The clock that recorders and renderers share.

use serde::{Deserialize, Serialize};

/// What the times of a trace or a frame log count from.
///
/// Two recordings with [`Clock::Monotonic`] of the same machine since its last start need no
/// synchronisation; all others do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The monotonic clock of this machine: nanoseconds since an unspecified start that all its
    /// processes share (`CLOCK_MONOTONIC`).
    Monotonic,
    /// Nanoseconds since 1970. It may be set or slewed while a recording runs.
    Unix,
    /// A clock of the instrument, or an unknown one.
    #[default]
    Device,
}

/// What [`now_ns`] counts on this system: monotonic where the system tells it across processes, else
/// the time since 1970.
pub const CLOCK: Clock = if cfg!(unix) { Clock::Monotonic } else { Clock::Unix };

/// The time now, in nanoseconds of [`CLOCK`].
///
/// Renderers stamp frames with it and recorders stamp samples, in processes of their own, so that both
/// are on one time axis. It takes some tens of nanoseconds.
///
/// ```
/// let before = niwaki_power::now_ns();
/// assert!(niwaki_power::now_ns() >= before);
/// ```
#[must_use]
pub fn now_ns() -> i64 {
    #[cfg(unix)]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        // Widening casts on every system that rustix knows; seconds since start times 10^9 fit.
        #[allow(clippy::unnecessary_cast, reason = "the type of the fields differs by system")]
        {
            now.tv_sec as i64 * 1_000_000_000 + now.tv_nsec as i64
        }
    }
    #[cfg(not(unix))]
    {
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        since.map_or(0, |d| i64::try_from(d.as_nanos()).unwrap_or(i64::MAX))
    }
}
