//! Fewer samples of a stream, without aliases.

use super::{Butterworth, ZeroPhase};
use crate::{PowerBlock, PowerError};

/// The largest factor of one stage.
const STAGE: usize = 8;

/// Samples that are left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decimated {
    /// Times in nanoseconds of the trace.
    pub times_ns: Vec<i64>,
    /// Filtered power in watts.
    pub watts: Vec<f64>,
    /// Places in both that follow a hole.
    pub holes: Vec<usize>,
}

/// Keeps one of `factor` samples, after a zero-phase low-pass filter in stages of at most eight.
///
/// Each stage is a Butterworth filter of fourth order whose cutoff is half of the Nyquist frequency that
/// is left; forward and backward it lets less than 0.4 % of an alias through. Filters start anew after
/// holes, and never look across them.
#[derive(Clone, Debug)]
pub struct Decimator {
    stages: Vec<Stage>,
}

#[derive(Clone, Debug)]
struct Stage {
    factor: usize,
    filter: ZeroPhase,
    /// Times of samples that the filter still has.
    times: Vec<i64>,
    /// Samples until the next that is kept.
    skip: usize,
    scratch: Vec<f64>,
}

impl Decimator {
    /// A decimator by about `factor`; see [`Decimator::factor`].
    ///
    /// # Errors
    /// [`PowerError::Setting`] for a factor of 0.
    pub fn new(factor: usize) -> Result<Self, PowerError> {
        if factor == 0 {
            return Err(PowerError::Setting("one of 0 samples cannot be kept".into()));
        }
        let mut stages = Vec::new();
        let mut left = factor;
        while left > 1 {
            let factor = left.min(STAGE);
            // Relative to the rate before the stage, half of the Nyquist frequency after it.
            let filter = Butterworth::low_pass(4, 0.25 / factor as f64, 1.0)?;
            stages.push(Stage {
                factor,
                filter: ZeroPhase::new(filter, 1e-6)?,
                times: Vec::new(),
                skip: 0,
                scratch: Vec::new(),
            });
            left /= factor;
        }
        Ok(Self { stages })
    }

    /// The factor: the one that was asked for, rounded down to a product of stages.
    #[must_use]
    pub fn factor(&self) -> usize {
        self.stages.iter().map(|s| s.factor).product()
    }

    /// Takes a stretch of power and appends what is ready.
    pub fn push(&mut self, block: &PowerBlock, out: &mut Decimated) {
        if block.follows_hole {
            self.flush(out);
            out.holes.push(out.times_ns.len());
        }
        let watts: Vec<_> = block.watts.iter().map(|w| f64::from(*w)).collect();
        self.advance(&block.times_ns, &watts, false, out);
    }

    /// Ends the signal: appends all that is left, and is ready for another.
    pub fn flush(&mut self, out: &mut Decimated) {
        self.advance(&[], &[], true, out);
    }

    fn advance(&mut self, times: &[i64], watts: &[f64], is_last: bool, out: &mut Decimated) {
        let (mut times, mut watts) = (times.to_vec(), watts.to_vec());
        for stage in &mut self.stages {
            stage.times.extend_from_slice(&times);
            stage.scratch.clear();
            stage.filter.push(&watts, &mut stage.scratch);
            if is_last {
                stage.filter.finish(&mut stage.scratch);
            }
            times.clear();
            watts.clear();
            let done = stage.scratch.len();
            let mut at = stage.skip;
            while at < done {
                times.push(stage.times[at]);
                watts.push(stage.scratch[at]);
                at += stage.factor;
            }
            stage.skip = if is_last { 0 } else { at - done };
            stage.times.drain(..done);
        }
        out.times_ns.extend_from_slice(&times);
        out.watts.extend_from_slice(&watts);
    }
}
