//! The power sensor of NVIDIA devices.

use super::Meter;
use crate::{Column, PowerError, SensorNote, TraceInfo, Unit};
use nvml_wrapper::Nvml;
use nvml_wrapper::enums::device::DeviceArchitecture;

/// NVIDIA's management library: power now, and energy since the driver was loaded.
///
/// The library belongs to the driver and is loaded when the meter is opened, so that programs run where
/// there is none. Power is a mean over some time and energy is refreshed every 20 to 100 ms, so frames
/// cannot be told apart; on some architectures the sensor sees only a part of the time (Yang et al.,
/// "Part-time Power Measurements: nvidia-smi's Lack of Attention", arXiv 2312.02741): see
/// [`SensorNote::coverage`].
#[derive(Debug)]
pub struct NvmlMeter {
    nvml: Nvml,
    index: u32,
    name: String,
    sensor: SensorNote,
    has_energy: bool,
    first_mj: Option<u64>,
}

impl NvmlMeter {
    /// Opens a device by its number.
    ///
    /// # Errors
    /// [`PowerError::Meter`] if the library is not there, the device is not there, or it does not tell
    /// its power.
    pub fn open(index: u32) -> Result<Self, PowerError> {
        let failed = |what: &str, error: &dyn std::fmt::Display| PowerError::Meter {
            meter: "NVML".into(),
            reason: format!("{what}: {error}"),
        };
        let nvml = Nvml::init()
            .map_err(|e| failed("the library of NVIDIA's driver cannot be loaded", &e))?;
        let device =
            nvml.device_by_index(index).map_err(|e| failed(&format!("device {index}"), &e))?;
        device.power_usage().map_err(|e| failed("the device does not tell its power", &e))?;
        let has_energy = device.total_energy_consumption().is_ok();
        let title = device.name().unwrap_or_else(|_| "NVIDIA device".into());
        // Table 2 of the paper above: of every 100 ms, 25 are measured on data-centre devices of these
        // architectures.
        let is_part_time = matches!(
            device.architecture(),
            Ok(DeviceArchitecture::Ampere | DeviceArchitecture::Hopper)
        ) && ["A100", "H100", "H200", "GH200"].iter().any(|m| title.contains(m));
        let sensor = SensorNote {
            name: format!("NVML: {title}"),
            refresh_s: None,
            coverage: is_part_time.then_some(0.25),
            source: "arXiv 2312.02741".into(),
        };
        Ok(Self { index, name: format!("gpu{index}"), sensor, has_energy, first_mj: None, nvml })
    }
}

impl Meter for NvmlMeter {
    fn info(&self) -> TraceInfo {
        let mut columns = vec![Column::new(format!("{}_w", self.name), Unit::Watts)];
        if self.has_energy {
            columns.push(Column::new(format!("{}_j", self.name), Unit::Joules));
        }
        TraceInfo { columns, sensor: self.sensor.clone(), ..TraceInfo::default() }
    }

    fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError> {
        let device = self.nvml.device_by_index(self.index).map_err(|error| PowerError::Meter {
            meter: "NVML".into(),
            reason: error.to_string(),
        })?;
        // A reading that fails now and then is a missing sample.
        values[0] = device.power_usage().map_or(f64::NAN, |mw| f64::from(mw) * 1e-3);
        if self.has_energy {
            values[1] = device.total_energy_consumption().map_or(f64::NAN, |mj| {
                let first = *self.first_mj.get_or_insert(mj);
                mj.saturating_sub(first) as f64 * 1e-3
            });
        }
        Ok(())
    }
}
