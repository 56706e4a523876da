//! Low-pass filters without delay, and decimation.

mod butterworth;
mod decimate;
mod zero_phase;

pub use butterworth::{Butterworth, Section};
pub use decimate::{Decimated, Decimator};
pub use zero_phase::ZeroPhase;
