//! Forward and backward on a stream.

use super::Butterworth;
use crate::PowerError;

/// More than a filter may take to settle: 64 MiB of samples.
const MAX_SETTLE: usize = 1 << 23;

/// A [`Butterworth`] filter that runs forward and backward over a stream of any length.
///
/// The forward pass keeps its state and is exact. The backward pass needs the future: it starts a number
/// of samples ahead, from the state that the sample there would have left if it had been there for ever,
/// and throws away what it gives until that guess no longer matters. How far ahead follows from the
/// filter: what a wrong state contributes to the output decays, and [`ZeroPhase::error_bound`] is the sum
/// of the largest such contributions after so many samples. So memory is bounded by the filter, not by
/// the stream.
#[derive(Clone, Debug)]
pub struct ZeroPhase {
    filter: Butterworth,
    settle: usize,
    block: usize,
    bound: f64,
    states: Option<Vec<[f64; 2]>>,
    /// Output of the forward pass that still waits for the backward pass.
    waiting: Vec<f64>,
    scratch: Vec<f64>,
}

impl ZeroPhase {
    /// A filter whose output differs from that of the whole signal at once by no more than `tolerance`
    /// times the range (largest minus smallest sample) of its input.
    ///
    /// # Errors
    /// [`PowerError::Setting`] if the tolerance is not between 1e-12 and 0.1, or the cutoff is so low
    /// against the rate that the filter takes over eight million samples to settle; decimate first.
    pub fn new(filter: Butterworth, tolerance: f64) -> Result<Self, PowerError> {
        if !(1e-12..=0.1).contains(&tolerance) {
            return Err(PowerError::Setting(format!("a tolerance of {tolerance}: 1e-12 to 0.1")));
        }
        let (settle, bound) = settle(&filter, tolerance).ok_or_else(|| {
            PowerError::Setting("the cutoff is too low for this rate; decimate first".into())
        })?;
        Ok(Self {
            filter,
            settle,
            block: (4 * settle).max(4096),
            bound,
            states: None,
            waiting: Vec::new(),
            scratch: Vec::new(),
        })
    }

    /// The bound on the difference from [`Butterworth::filter_both_ways`] over the whole signal, as a
    /// share of the range of the input.
    #[must_use]
    pub const fn error_bound(&self) -> f64 {
        self.bound
    }

    /// Samples that the backward pass looks ahead.
    #[must_use]
    pub const fn look_ahead(&self) -> usize {
        self.settle
    }

    /// Takes samples; appends those that are done to `out`, in order.
    pub fn push(&mut self, samples: &[f64], out: &mut Vec<f64>) {
        let Some(&first) = samples.first() else { return };
        let states = self.states.get_or_insert_with(|| self.filter.states_at(first));
        // Whole sections over the block keep coefficients in registers.
        let start = self.waiting.len();
        self.waiting.extend_from_slice(samples);
        for (section, state) in self.filter.sections().iter().zip(states) {
            for x in &mut self.waiting[start..] {
                *x = section.step(state, *x);
            }
        }
        while self.waiting.len() >= self.block + self.settle {
            self.backward(self.block, self.block + self.settle, out);
        }
    }

    /// Ends the signal: appends all that is left, and is ready for another.
    pub fn finish(&mut self, out: &mut Vec<f64>) {
        let rest = self.waiting.len();
        if rest > 0 {
            self.backward(rest, rest, out);
        }
        self.states = None;
    }

    /// Filters `waiting[..ahead]` backward and hands out the first `done` samples.
    fn backward(&mut self, done: usize, ahead: usize, out: &mut Vec<f64>) {
        self.scratch.clear();
        self.scratch.extend_from_slice(&self.waiting[..ahead]);
        let mut states = self.filter.states_at(self.scratch[ahead - 1]);
        for (section, state) in self.filter.sections().iter().zip(&mut states) {
            for x in self.scratch.iter_mut().rev() {
                *x = section.step(state, *x);
            }
        }
        out.extend_from_slice(&self.scratch[..done]);
        self.waiting.drain(..done);
    }
}

/// After how many samples a wrong state matters less than the tolerance, and how much it does then.
fn settle(filter: &Butterworth, tolerance: f64) -> Option<(usize, f64)> {
    let sections = filter.sections().len();
    // Largest value of each state for inputs within ±1: the sum of |state| over an impulse; and of the
    // output.
    let mut reach = vec![[0.0; 2]; sections];
    let mut gain = 0.0;
    let mut states = vec![[0.0; 2]; sections];
    let (mut calm, mut peak) = (0, 0.0f64);
    for at in 0..MAX_SETTLE {
        let y = filter.step(&mut states, f64::from(u8::from(at == 0)));
        gain += y.abs();
        let mut largest = 0.0f64;
        for (reach, state) in reach.iter_mut().zip(&states) {
            for (reach, state) in reach.iter_mut().zip(state) {
                *reach += state.abs();
                largest = largest.max(state.abs());
            }
        }
        // Oscillating states pass through zero, so wait for many small ones.
        peak = peak.max(largest);
        calm = if largest < 1e-16 * peak { calm + 1 } else { 0 };
        if calm == 64 {
            break;
        }
    }
    if calm < 64 {
        return None;
    }
    // The true state and the guess are both within `reach` times half the range of the forward output,
    // about its middle; so they differ by no more than `reach` times that range, and the range is at most
    // `gain` times that of the input. Responses to each state by itself are added up.
    let mut responses: Vec<(Vec<[f64; 2]>, f64)> = Vec::new();
    for section in 0..sections {
        for which in 0..2 {
            let mut states = vec![[0.0; 2]; sections];
            states[section][which] = 1.0;
            responses.push((states, reach[section][which] * gain));
        }
    }
    let mut last_above = 0;
    let mut after = 0.0f64;
    let mut calm = 0;
    for at in 0..MAX_SETTLE {
        let share: f64 = responses
            .iter_mut()
            .map(|(states, weight)| filter.step(states, 0.0).abs() * *weight)
            .sum();
        if share > tolerance {
            last_above = at + 1;
            after = 0.0;
        } else {
            after = after.max(share);
        }
        calm = if share < 1e-3 * tolerance { calm + 1 } else { 0 };
        if calm == 64 {
            return Some((last_above.max(1), after));
        }
    }
    None
}
