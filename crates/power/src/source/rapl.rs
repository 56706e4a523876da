//! Energy counters of processors: Linux's powercap interface to RAPL.

use super::Meter;
use crate::{Column, PowerError, SensorNote, TraceInfo, Unit};
use std::path::{Path, PathBuf};

const ROOT: &str = "/sys/class/powercap";

/// The energy counters that Linux shows below `/sys/class/powercap`: packages, cores, graphics, memory.
///
/// Zones contain each other (a package its cores and its graphics), so only the outermost ones become
/// rails by default; others are columns whose names end with `_sub`, for those who declare rails
/// themselves. Counters wrap around at `max_energy_range_uj`, after an hour or so under load; what this
/// meter returns does not. They are refreshed about every millisecond.
#[derive(Debug)]
pub struct RaplMeter {
    zones: Vec<Zone>,
}

#[derive(Debug)]
struct Zone {
    name: String,
    file: PathBuf,
    /// Where the counter starts again at 0, in microjoules.
    range: u64,
    last: Option<u64>,
    total: u64,
}

impl RaplMeter {
    /// Opens all counters of this machine.
    ///
    /// # Errors
    /// [`PowerError::Meter`] where the system has none, or does not let this process read them.
    pub fn open() -> Result<Self, PowerError> {
        Self::open_at(Path::new(ROOT))
    }

    /// Opens the counters below another folder of the same layout.
    ///
    /// # Errors
    /// As [`RaplMeter::open`].
    pub fn open_at(root: &Path) -> Result<Self, PowerError> {
        let failed = |reason: String| PowerError::Meter { meter: "RAPL".into(), reason };
        let Ok(entries) = std::fs::read_dir(root) else {
            return Err(failed(format!(
                "there is no {}: no Linux on a processor with energy counters, or a virtual machine or \
                 container that hides them",
                root.display()
            )));
        };
        let mut names: Vec<_> = entries
            .flatten()
            .filter_map(|entry| entry.file_name().into_string().ok())
            // intel-rapl-mmio counts the same package a second time.
            .filter(|name| name.starts_with("intel-rapl:") || name.starts_with("amd_energy:"))
            .collect();
        names.sort_unstable();
        let mut zones: Vec<Zone> = Vec::new();
        for name in names {
            let folder = root.join(&name);
            let text = |file: &str| std::fs::read_to_string(folder.join(file));
            let Ok(title) = text("name") else { continue };
            let range = text("max_energy_range_uj").ok().and_then(|t| t.trim().parse().ok());
            let file = folder.join("energy_uj");
            if let Err(error) = std::fs::read_to_string(&file) {
                return Err(failed(format!(
                    "{}: {error}; run as root, or let all read it: chmod a+r {}/*/energy_uj",
                    file.display(),
                    root.display()
                )));
            }
            // intel-rapl:0 is a package, intel-rapl:0:1 a part of it.
            let part = if name.matches(':').count() > 1 { "_sub" } else { "" };
            let mut label = format!("{}{part}", title.trim().replace([' ', ',', '"'], "_"));
            if zones.iter().any(|z| z.name == label) {
                label = format!("{label}_{}", name.replace([':', ' '], "_"));
            }
            zones.push(Zone { name: label, file, range: range.unwrap_or(0), last: None, total: 0 });
        }
        if zones.is_empty() {
            return Err(failed(format!("{} has no energy counters", root.display())));
        }
        Ok(Self { zones })
    }
}

impl Zone {
    /// Joules since the first reading.
    fn advance(&mut self, now: u64) -> f64 {
        if let Some(last) = self.last {
            self.total +=
                if now >= last { now - last } else { (self.range + now).saturating_sub(last) };
        }
        self.last = Some(now);
        self.total as f64 * 1e-6
    }
}

impl Meter for RaplMeter {
    fn info(&self) -> TraceInfo {
        let column = |zone: &Zone| Column::new(format!("{}_j", zone.name), Unit::Joules);
        TraceInfo {
            columns: self.zones.iter().map(column).collect(),
            sensor: SensorNote {
                name: "RAPL".into(),
                refresh_s: Some(1e-3),
                coverage: None,
                source: "Intel SDM, volume 3, 16.10".into(),
            },
            ..TraceInfo::default()
        }
    }

    fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError> {
        for (zone, value) in self.zones.iter_mut().zip(values) {
            let text = std::fs::read_to_string(&zone.file).map_err(PowerError::file(&zone.file))?;
            *value = match text.trim().parse() {
                Ok(now) => zone.advance(now),
                Err(_) => f64::NAN,
            };
        }
        Ok(())
    }
}
