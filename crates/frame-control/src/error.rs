//! What can be wrong with settings. Measurements and predictions never raise errors: see
//! [`crate::Verdict`] and [`crate::Status`].

/// A setting that no controller can work with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The target is zero, negative, not a number or outside the range of a frame.
    ///
    /// Give a time within [`crate::MIN_TARGET_MS`] and [`crate::MAX_TARGET_MS`].
    #[error(
        "a target of {milliseconds} ms is no frame time: give one within 0.01 ms and 600,000 ms"
    )]
    Target {
        /// The target as given.
        milliseconds: f64,
    },
    /// A ladder without rungs leaves nothing to choose. Give at least one.
    #[error("the ladder has no rungs: give at least one")]
    EmptyLadder,
    /// A rung that the ladder does not have.
    #[error("rung {rung} does not exist: the ladder has {rungs}, counted from 0")]
    Rung {
        /// The rung as given.
        rung: usize,
        /// Number of rungs.
        rungs: usize,
    },
    /// A number outside its range.
    #[error("{name} is {value}: it has to be {range}")]
    OutOfRange {
        /// The field.
        name: &'static str,
        /// The value as given.
        value: f64,
        /// The range that it has to be in, in words.
        range: &'static str,
    },
    /// The gain would make the outer loop oscillate: stay below the bound, or promise a shorter
    /// delay or a smaller sensitivity (see [`crate::admissible_gain`]).
    #[error(
        "a gain of {gain} is unstable with measurements {delay} frames late and a sensitivity of \
         {sensitivity}: stay below {bound:.4}"
    )]
    UnstableGain {
        /// The gain as given.
        gain: f64,
        /// Frames from a frame's decision to the first decision that knows its time.
        delay: u32,
        /// Assumed bound on how strongly the ratio of measured to predicted time follows the
        /// choice of settings.
        sensitivity: f64,
        /// The gain to stay below.
        bound: f64,
    },
    /// Settings that a ladder should be ordered by are not ordered.
    #[error("rung {rung} asks for less than the rung below it: order the ladder by quality")]
    Unordered {
        /// The rung that is out of order.
        rung: usize,
    },
}

/// Checks that `value` lies within `low..=high` (so NaN fails).
pub(crate) fn within(
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), Error> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(Error::OutOfRange { name, value, range })
    }
}
