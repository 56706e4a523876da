//! Meters of this machine, read on a thread of their own.

#[cfg(feature = "nvml")]
mod nvml;
mod rapl;
mod recorder;

#[cfg(feature = "nvml")]
pub use nvml::NvmlMeter;
pub use rapl::RaplMeter;
pub use recorder::{Recorder, RecorderOptions, RecorderStopper};

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

/// Several meters read together: their columns side by side.
pub struct JoinedMeter(pub Vec<Box<dyn Meter>>);

impl Meter for JoinedMeter {
    /// Names, origins and refresh times of all; the least coverage.
    fn info(&self) -> TraceInfo {
        let mut all = TraceInfo::default();
        for info in self.0.iter().map(Meter::info) {
            all.columns.extend(info.columns);
            for (to, from) in [
                (&mut all.sensor.name, info.sensor.name),
                (&mut all.sensor.source, info.sensor.source),
            ] {
                if !to.is_empty() && !from.is_empty() {
                    to.push_str(" + ");
                }
                to.push_str(&from);
            }
            let both = |a: Option<f64>, b: Option<f64>| [a, b].into_iter().flatten();
            all.sensor.refresh_s =
                both(all.sensor.refresh_s, info.sensor.refresh_s).reduce(f64::max);
            all.sensor.coverage = both(all.sensor.coverage, info.sensor.coverage).reduce(f64::min);
        }
        all
    }

    fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError> {
        let mut rest = values;
        for meter in &mut self.0 {
            let (own, others) = rest.split_at_mut(meter.info().columns.len().min(rest.len()));
            meter.read(own)?;
            rest = others;
        }
        Ok(())
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
