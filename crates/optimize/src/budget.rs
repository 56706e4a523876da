//! How long a pass may work, and what it reports.

use std::time::{Duration, Instant};

/// What a pass may spend. It ends when either bound is reached, or when there is nothing more to
/// gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// The most iterations; what one iteration is, each pass says. 0 leaves the tree as it is.
    pub iterations: u32,
    /// No work is begun after this time; what is under way is completed, which each pass bounds
    /// by a small batch. `None`, the default of all passes, makes the result depend on the input
    /// and settings alone; with a time bound it depends on the machine as well.
    pub time: Option<Duration>,
}

impl Budget {
    /// A number of iterations, however long they take.
    #[must_use]
    pub const fn iterations(iterations: u32) -> Self {
        Self { iterations, time: None }
    }

    /// As many iterations as end within a time, or until nothing more is gained.
    #[must_use]
    pub const fn time(time: Duration) -> Self {
        Self { iterations: u32::MAX, time: Some(time) }
    }

    pub(crate) fn start(self) -> Clock {
        Clock { start: Instant::now(), time: self.time }
    }
}

/// Runs from the start of a pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    start: Instant,
    time: Option<Duration>,
}

impl Clock {
    pub(crate) fn is_over(&self) -> bool {
        self.time.is_some_and(|time| self.start.elapsed() >= time)
    }
}

/// What a pass did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// SAH cost of the tree that was given ([`niwaki_metrics::sah`] with the pass's constants).
    pub before: f64,
    /// SAH cost of the tree that came out; never more than [`Report::before`], except for
    /// [`crate::refit`], whose tree bounds other geometry.
    pub after: f64,
    /// Iterations that were begun.
    pub iterations: u32,
    /// Changes that were kept: moved subtrees, rotations, rearranged treelets, merged or split
    /// leaves, roots below a new top. 0 if the tree was left as it was.
    pub changes: u64,
    /// From the call to the return.
    pub time: Duration,
}

impl Report {
    /// [`Report::after`] as a share of [`Report::before`]; 1 for trees that cost nothing.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        if self.before > 0.0 { self.after / self.before } else { 1.0 }
    }
}
