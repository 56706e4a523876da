//! What each step of a build took.

use std::time::{Duration, Instant};

/// Wall-clock time of the steps of one build (thesis paper IV, figure 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Midpoints and scene bounds; nothing with [`crate::Bonsai::split`].
    pub midpoints: Duration,
    /// Splitting the midpoints into groups. With [`crate::Bonsai::split`] also the midpoints
    /// themselves, the list of references, and splitting triangles.
    pub selection: Duration,
    /// Sweep trees over the groups.
    pub mini_trees: Duration,
    /// Choosing the roots that the top tree is built over.
    pub pruning: Duration,
    /// The sweep tree over mini trees.
    pub top_tree: Duration,
    /// Copying all nodes into one array.
    pub assembly: Duration,
}

impl Timings {
    /// The whole build.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.steps().iter().map(|(_, time)| *time).sum()
    }

    /// Names and times in order.
    #[must_use]
    pub const fn steps(&self) -> [(&'static str, Duration); 6] {
        [
            ("midpoints", self.midpoints),
            ("selection", self.selection),
            ("mini trees", self.mini_trees),
            ("pruning", self.pruning),
            ("top tree", self.top_tree),
            ("assembly", self.assembly),
        ]
    }
}

pub(crate) struct Clock(Instant);

impl Clock {
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Time since the start or the last lap.
    pub(crate) fn lap(&mut self) -> Duration {
        let now = Instant::now();
        let time = now - self.0;
        self.0 = now;
        time
    }
}
