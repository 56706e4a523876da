//! Meters of this machine, read on a thread of their own.

#[cfg(feature = "nvml")]
mod nvml;
mod rapl;
mod recorder;

#[cfg(feature = "nvml")]
pub use nvml::NvmlMeter;
pub use rapl::RaplMeter;
pub use recorder::{Recorder, RecorderOptions};

use crate::{PowerError, TraceInfo};

/// An instrument that answers when it is asked.
///
/// [`Recorder`] asks it at even times and makes a trace of the answers, which is then read like any
/// other, file or live, through [`crate::TraceReader`].
pub trait Meter: Send {
    /// Its columns, and what is known of it.
    fn info(&self) -> TraceInfo;

    /// Reads one value for each column. Values that are missing this time are NaN.
    ///
    /// # Errors
    /// [`PowerError::Meter`] if the instrument does not answer any more.
    fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError>;
}

impl Meter for Box<dyn Meter> {
    fn info(&self) -> TraceInfo {
        (**self).info()
    }

    fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError> {
        (**self).read(values)
    }
}

/// Every meter that this machine has and this process may read, and why the others are not among them.
#[must_use]
pub fn find_meters() -> (Vec<Box<dyn Meter>>, Vec<PowerError>) {
    let mut found: Vec<Box<dyn Meter>> = Vec::new();
    let mut missing = Vec::new();
    #[cfg(feature = "nvml")]
    match NvmlMeter::open(0) {
        Ok(meter) => found.push(Box::new(meter)),
        Err(error) => missing.push(error),
    }
    match RaplMeter::open() {
        Ok(meter) => found.push(Box::new(meter)),
        Err(error) => missing.push(error),
    }
    (found, missing)
}
