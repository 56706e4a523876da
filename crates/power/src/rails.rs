//! Rails: how columns of a trace become power.

use crate::{Column, PowerError, Unit};
use serde::{Deserialize, Serialize};

/// A linear correction of a sensor: `value = gain · raw + offset`.
///
/// In JSON it is `{"gain": 1.02, "offset": -0.05}`, or `{"points": [[raw, true], …]}`, through which a
/// line is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "CalibrationText")]
pub struct Calibration {
    /// Factor.
    pub gain: f64,
    /// What is added, in the unit of the column.
    pub offset: f64,
}

impl Default for Calibration {
    /// Takes samples as they are.
    fn default() -> Self {
        Self { gain: 1.0, offset: 0.0 }
    }
}

#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum CalibrationText {
    Points { points: Vec<(f64, f64)> },
    Line { gain: Option<f64>, offset: Option<f64> },
}

impl TryFrom<CalibrationText> for Calibration {
    type Error = PowerError;

    fn try_from(text: CalibrationText) -> Result<Self, PowerError> {
        match text {
            CalibrationText::Points { points } => Self::through(&points),
            CalibrationText::Line { gain, offset } => {
                Ok(Self { gain: gain.unwrap_or(1.0), offset: offset.unwrap_or(0.0) })
            }
        }
    }
}

impl Calibration {
    /// The least-squares line through pairs of what the sensor said and what was true.
    ///
    /// # Errors
    /// [`PowerError::Rails`] for fewer than two different readings or numbers that are not finite.
    pub fn through(points: &[(f64, f64)]) -> Result<Self, PowerError> {
        let n = points.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
        let (raw, truth) = (mean(|p| p.0), mean(|p| p.1));
        let spread: f64 = points.iter().map(|p| (p.0 - raw).powi(2)).sum();
        let common: f64 = points.iter().map(|p| (p.0 - raw) * (p.1 - truth)).sum();
        let gain = common / spread;
        let line = Self { gain, offset: truth - gain * raw };
        if points.len() < 2 || !gain.is_finite() || !line.offset.is_finite() {
            return Err(PowerError::Rails("a calibration needs two different readings".into()));
        }
        Ok(line)
    }

    /// The corrected value.
    #[must_use]
    pub fn apply(self, raw: f64) -> f64 {
        self.gain * raw + self.offset
    }

    fn is_valid(self) -> bool {
        self.gain.is_finite() && self.offset.is_finite() && self.gain != 0.0
    }
}

/// The voltage of a rail.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Voltage {
    /// The same all the time, in volts, as in the paper.
    Volts(f64),
    /// Measured: the name of the column.
    Column(String),
}

/// What is measured of a rail.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum RailKind {
    /// P = U · I (eq. 1).
    Current {
        /// The column of the current.
        current: String,
        /// The voltage.
        voltage: Voltage,
        /// Correction of a measured voltage.
        #[serde(default)]
        voltage_calibration: Calibration,
    },
    /// Power as it is.
    Power {
        /// The column.
        power: String,
    },
    /// A counter of energy, whose slope is the power.
    Energy {
        /// The column.
        energy: String,
    },
}

/// One supply of the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rail {
    /// Its name.
    pub name: String,
    /// What is measured of it.
    #[serde(flatten)]
    pub kind: RailKind,
    /// Correction of the current, the power or the energy.
    #[serde(default)]
    pub calibration: Calibration,
    /// Least and largest raw reading (of the current or power) that the sensor can give. Samples there
    /// or beyond are clipped.
    #[serde(default)]
    pub range: Option<(f64, f64)>,
}

/// A rail with its columns found.
#[derive(Clone, Debug)]
pub(crate) struct Wired {
    pub(crate) main: usize,
    pub(crate) kind: WiredKind,
    pub(crate) calibration: Calibration,
    pub(crate) range: Option<(f64, f64)>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum WiredKind {
    Power,
    Energy,
    /// Constant voltage.
    Volts(f64),
    /// Column of the voltage, and its calibration.
    Voltage(usize, Calibration),
}

/// The rails that columns spell by their names: `NAME_w`, else `NAME_a` with `NAME_v`, else `NAME_a`
/// with the constant voltage that `volts` gives for `NAME`, else `NAME_j`.
///
/// A rail that has power and energy (as NVML gives both) counts once, by its energy if
/// `prefers_energy`, which misses nothing between two readings. Columns whose names contain `_sub` are
/// parts of other rails (as [`crate::RaplMeter`] names them) and are left out.
///
/// # Errors
/// [`PowerError::Rails`] names the current whose voltage nobody knows.
///
/// ```
/// use niwaki_power::{Column, Unit, rails_by_name};
///
/// let columns = ["pcie_a", "pcie_v", "aux_a"].map(|n| Column::new(n, Unit::of_column(n).unwrap()));
/// let rails = rails_by_name(&columns, &[("aux".into(), 12.0)], false)?;
/// assert_eq!(rails.len(), 2);
/// # Ok::<(), niwaki_power::PowerError>(())
/// ```
pub fn rails_by_name(
    columns: &[Column],
    volts: &[(String, f64)],
    prefers_energy: bool,
) -> Result<Vec<Rail>, PowerError> {
    let mut rails: Vec<Rail> = Vec::new();
    let stem = |column: &Column| -> String {
        let has = Unit::of_column(&column.name) == Some(column.unit);
        column.name[..column.name.len() - if has { 2 } else { 0 }].to_owned()
    };
    for first in columns {
        let name = stem(first);
        // A part of another rail: counting it would count twice.
        if name.contains("_sub") {
            continue;
        }
        if rails.iter().any(|r| r.name == name) {
            continue;
        }
        let of = |unit| {
            let mut all = columns.iter().filter(|c| c.unit == unit && stem(c) == name);
            all.next().map(|c| c.name.clone())
        };
        let (power, energy) = (of(Unit::Watts), of(Unit::Joules));
        let kind = match (power, energy, of(Unit::Amperes)) {
            (None, Some(energy), None) => RailKind::Energy { energy },
            (Some(_), Some(energy), _) if prefers_energy => RailKind::Energy { energy },
            (Some(power), ..) => RailKind::Power { power },
            (None, _, Some(current)) => {
                let constant = volts.iter().find(|(rail, _)| *rail == name);
                let voltage = match (of(Unit::Volts), constant) {
                    (_, Some((_, volts))) => Voltage::Volts(*volts),
                    (Some(column), None) => Voltage::Column(column),
                    (None, None) => {
                        return Err(PowerError::Rails(format!(
                            "nothing says the voltage of {name}: give a column {name}_v or a \
                             constant (--volts {name}=12)"
                        )));
                    }
                };
                RailKind::Current { current, voltage, voltage_calibration: Calibration::default() }
            }
            (None, None, None) => continue,
        };
        rails.push(Rail { name, kind, calibration: Calibration::default(), range: None });
    }
    if rails.is_empty() {
        return Err(PowerError::Rails("no column holds a current, a power or an energy".into()));
    }
    Ok(rails)
}

/// Finds the columns of rails.
pub(crate) fn wire(rails: &[Rail], columns: &[Column]) -> Result<Vec<Wired>, PowerError> {
    let find = |rail: &Rail, name: &str, unit: Unit| {
        let at = columns.iter().position(|c| c.name == name);
        match at {
            Some(at) if columns[at].unit == unit => Ok(at),
            Some(_) => Err(PowerError::Rails(format!("{}: {name} is not in {unit:?}", rail.name))),
            None => Err(PowerError::Rails(format!("{}: there is no column {name}", rail.name))),
        }
    };
    if rails.is_empty() {
        return Err(PowerError::Rails("there are none".into()));
    }
    rails
        .iter()
        .map(|rail| {
            let is_valid =
                rail.calibration.is_valid() && rail.range.is_none_or(|(low, high)| low < high);
            let (main, kind, is_also) = match &rail.kind {
                RailKind::Power { power } => {
                    (find(rail, power, Unit::Watts)?, WiredKind::Power, true)
                }
                RailKind::Energy { energy } => {
                    (find(rail, energy, Unit::Joules)?, WiredKind::Energy, true)
                }
                RailKind::Current { current, voltage, voltage_calibration } => {
                    let (kind, is_finite) = match voltage {
                        Voltage::Volts(volts) => (WiredKind::Volts(*volts), volts.is_finite()),
                        Voltage::Column(column) => {
                            let at = find(rail, column, Unit::Volts)?;
                            (WiredKind::Voltage(at, *voltage_calibration), true)
                        }
                    };
                    let is_also = is_finite && voltage_calibration.is_valid();
                    (find(rail, current, Unit::Amperes)?, kind, is_also)
                }
            };
            if !is_valid || !is_also {
                let name = &rail.name;
                return Err(PowerError::Rails(format!(
                    "{name}: calibrations need finite numbers and a gain other than 0, ranges the \
                     smaller number first"
                )));
            }
            Ok(Wired { main, kind, calibration: rail.calibration, range: rail.range })
        })
        .collect()
}
