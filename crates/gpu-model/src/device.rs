//! Parameters of devices, as TOML tables.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A device as the models see it: "Device" and "Benchmarked" of the thesis's Paper I, Table 1, and
/// the machine-dependent rows of Hong and Kim 2009, Tables 1 and 2.
///
/// Cycles are those of the cores' clock. Only their ratios to it matter: with the clock and every
/// number of cycles multiplied by the same factor, predictions are the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// The name in tables.
    pub name: String,
    /// Where the numbers are from.
    pub source: String,
    /// Clock of the cores, GHz (`F`, `Freq`). Above 0.
    pub clock_ghz: f64,
    /// Bandwidth of the memory, 10⁹ bytes a second (`M_d`, `Mem_Bandwidth`). Above 0.
    pub bandwidth_gb_s: f64,
    /// Cores: multiprocessors, compute units (`D_c`, `#SMs`). At least 1.
    pub cores: u32,
    /// Threads of a warp (`D_tw`): a subgroup, a wavefront. At least 1.
    pub warp_size: u32,
    /// Cycles in which a core issues an instruction of a warp (`C_i`, `#Issue_cycles`). Above 0.
    pub issue_cycles: f64,
    /// Cycles from a load to its data (`c_l`, `Mem_LD`). Above 0.
    pub memory_latency_cycles: f64,
    /// Cycles from one warp's coalesced load to the next's (`c_dc`, `Departure_del_coal`). Above 0.
    pub departure_delay_coalesced_cycles: f64,
    /// Cycles from one transaction of an uncoalesced load to the next (`c_du`,
    /// `Departure_del_uncoal`). Above 0.
    pub departure_delay_uncoalesced_cycles: f64,
    /// Transactions of a warp's uncoalesced load (`#Uncoal_per_mw`). At least 1.
    pub transactions_per_uncoalesced_load: f64,
    /// Most blocks that a core has at once (`Max b_o`). At least 1.
    pub max_blocks_per_core: u32,
    /// Most warps that a core has at once. At least 1.
    pub max_warps_per_core: u32,
}

/// Why a device's parameters cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// No device that comes with this crate has the name, and no such file exists. Remedy: one of
    /// those that are listed, or the path of a TOML file.
    #[error("no device {name:?}; there are {known}, or give the path of a TOML file")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The names of [`Device::builtin_names`].
        known: String,
    },
    /// The file cannot be read, or written. Remedy: as the system says.
    #[error("{file}: {message}")]
    File {
        /// The file.
        file: PathBuf,
        /// What the system says.
        message: String,
    },
    /// The file is no table of a device. Remedy: give the key that is named the kind of value that
    /// the documentation of [`Device`] says.
    #[error("{file} is no table of a device: {message}")]
    Syntax {
        /// The file, or the name of the device.
        file: String,
        /// Line, key and what is wrong.
        message: String,
    },
    /// A value is not one that a device can have. Remedy: as it says.
    #[error("{file}: {key} is {value}, which has to be {range}; {remedy}")]
    Value {
        /// The file, or the name of the device.
        file: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        range: &'static str,
        /// What to do.
        remedy: &'static str,
    },
}

/// The tables of this crate: name and text.
macro_rules! builtin {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../assets/devices/", $name, ".toml")))),*]
    };
}

const BUILTIN: &[(&str, &str)] =
    builtin!["geforce-580", "geforce-8800", "gtx-280", "quadro-fx-5600", "radeon-5870"];

impl Device {
    /// The names of the devices that come with this crate, sorted.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|&(name, _)| name)
    }

    /// A device that comes with this crate.
    ///
    /// # Errors
    /// [`DeviceError::Unknown`].
    pub fn builtin(name: &str) -> Result<Self, DeviceError> {
        match BUILTIN.iter().find(|(known, _)| *known == name) {
            Some((name, text)) => Self::parse(text, name),
            None => Err(Self::unknown(name)),
        }
    }

    /// The device of a TOML file, or the one that comes with this crate by that name.
    ///
    /// # Errors
    /// [`DeviceError`] names the file, the key, and what to do.
    pub fn load(name_or_path: impl AsRef<Path>) -> Result<Self, DeviceError> {
        let path = name_or_path.as_ref();
        if let Some(name) = path.to_str().filter(|name| Self::builtin_names().any(|n| n == *name)) {
            return Self::builtin(name);
        }
        let looks_like_a_file = path.extension().is_some() || path.components().count() > 1;
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, &path.display().to_string()),
            Err(error) if looks_like_a_file || path.exists() => {
                Err(DeviceError::File { file: path.to_owned(), message: error.to_string() })
            }
            Err(_) => Err(Self::unknown(&path.display().to_string())),
        }
    }

    /// The device of a table; `file` is for messages.
    ///
    /// # Errors
    /// As [`Device::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, DeviceError> {
        let device: Self = toml::from_str(text).map_err(|error| DeviceError::Syntax {
            file: file.to_owned(),
            message: error.to_string().trim().to_owned(),
        })?;
        device.check_as(file)?;
        Ok(device)
    }

    /// The table.
    #[must_use]
    pub fn to_toml(&self) -> String {
        // A flat table of strings and numbers always has a text.
        toml::to_string(self).unwrap_or_default()
    }

    /// Writes the table to a file.
    ///
    /// # Errors
    /// [`DeviceError::Value`] for parameters that [`Device::load`] would refuse, and
    /// [`DeviceError::File`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), DeviceError> {
        self.check()?;
        let path = path.as_ref();
        std::fs::write(path, self.to_toml()).map_err(|error| DeviceError::File {
            file: path.to_owned(),
            message: error.to_string(),
        })
    }

    /// Parameters that a device can have.
    ///
    /// # Errors
    /// [`DeviceError::Value`] names the first that is none.
    pub fn check(&self) -> Result<(), DeviceError> {
        self.check_as(&self.name)
    }

    /// Blocks of so many threads that a core has at once, by the limits of blocks and warps: at
    /// least 1. Registers and workgroup memory may allow fewer.
    #[must_use]
    pub fn blocks_per_core(&self, threads_per_block: u32) -> u32 {
        let warps = threads_per_block.div_ceil(self.warp_size.max(1)).max(1);
        (self.max_warps_per_core / warps).min(self.max_blocks_per_core).max(1)
    }

    fn check_as(&self, file: &str) -> Result<(), DeviceError> {
        let error = |key, value: String, range, remedy| {
            Err(DeviceError::Value { file: file.to_owned(), key, value, range, remedy })
        };
        let positive = [
            ("clock_ghz", self.clock_ghz, "give the clock of the cores in GHz"),
            ("bandwidth_gb_s", self.bandwidth_gb_s, "give the memory's bandwidth in GB/s"),
            ("issue_cycles", self.issue_cycles, "give the cycles an instruction of a warp takes"),
            ("memory_latency_cycles", self.memory_latency_cycles, "measure it (measure_device)"),
            (
                "departure_delay_coalesced_cycles",
                self.departure_delay_coalesced_cycles,
                "measure it (measure_device); for a device that never waits give 0.01",
            ),
            (
                "departure_delay_uncoalesced_cycles",
                self.departure_delay_uncoalesced_cycles,
                "measure it (measure_device); for a device that never waits give 0.01",
            ),
        ];
        for (key, value, remedy) in positive {
            if !(1e-9..=1e9).contains(&value) {
                return error(key, value.to_string(), "between 1e-9 and 1e9", remedy);
            }
        }
        let transactions = self.transactions_per_uncoalesced_load;
        if !(1.0..=1e6).contains(&transactions) {
            return error(
                "transactions_per_uncoalesced_load",
                transactions.to_string(),
                "between 1 and 1e6",
                "at most one for each thread of a warp is usual",
            );
        }
        let whole = [
            ("cores", self.cores, "count multiprocessors or compute units"),
            ("warp_size", self.warp_size, "give the threads of a warp, wavefront or subgroup"),
            ("max_blocks_per_core", self.max_blocks_per_core, "see the maker's tables"),
            ("max_warps_per_core", self.max_warps_per_core, "see the maker's tables"),
        ];
        for (key, value, remedy) in whole {
            if value == 0 {
                return error(key, value.to_string(), "at least 1", remedy);
            }
        }
        Ok(())
    }

    fn unknown(name: &str) -> DeviceError {
        let known = Self::builtin_names().collect::<Vec<_>>().join(", ");
        DeviceError::Unknown { name: name.to_owned(), known }
    }
}
