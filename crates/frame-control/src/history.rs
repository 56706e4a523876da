//! Frames that wait for their time.

use std::collections::VecDeque;

/// Frames that are remembered while their times are on the way; older ones are given up.
pub const MAX_DELAY: usize = 256;

/// What was known of each frame when it was decided, until its time comes.
#[derive(Clone, Debug)]
pub(crate) struct History<T> {
    /// Number of the frame in front.
    first: u64,
    frames: VecDeque<Option<T>>,
}

impl<T> History<T> {
    pub(crate) fn new() -> Self {
        Self { first: 0, frames: VecDeque::with_capacity(MAX_DELAY) }
    }

    /// Number of the next frame.
    pub(crate) fn next(&self) -> u64 {
        self.first + self.frames.len() as u64
    }

    /// Remembers a frame, or that nothing is known of it, and gives its number.
    pub(crate) fn push(&mut self, known: Option<T>) -> u64 {
        let frame = self.next();
        if self.frames.len() == MAX_DELAY {
            self.frames.pop_front();
            self.first += 1;
        }
        self.frames.push_back(known);
        frame
    }

    /// What is known of a frame, once.
    pub(crate) fn take(&mut self, frame: u64) -> Option<T> {
        let index = usize::try_from(frame.checked_sub(self.first)?).ok()?;
        self.frames.get_mut(index)?.take()
    }

    /// Gives up all frames that wait, and goes on counting.
    pub(crate) fn forget(&mut self) {
        self.first = self.next();
        self.frames.clear();
    }
}
