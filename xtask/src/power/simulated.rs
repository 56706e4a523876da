//! Meters for tests, whose power is known.

use niwaki_power::now_ns;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Their watts.
pub(crate) const WATTS: f64 = 80.0;

/// A folder that goes with the test.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("niwaki-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A thread that does something every half a millisecond until it is dropped.
pub(crate) struct Ticker(Arc<AtomicBool>, Option<JoinHandle<()>>);

impl Ticker {
    pub(crate) fn new(mut tick: impl FnMut() + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = stop.clone();
        let thread = std::thread::spawn(move || {
            while !seen.load(Ordering::Relaxed) {
                tick();
                std::thread::sleep(Duration::from_micros(500));
            }
        });
        Self(stop, Some(thread))
    }
}

impl Drop for Ticker {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        if let Some(thread) = self.1.take() {
            thread.join().unwrap();
        }
    }
}

/// A processor's counter of energy below a folder, as Linux shows it, which gains [`WATTS`] whenever it is
/// called.
pub(crate) fn counter(root: &Path) -> impl FnMut() + Send + use<> {
    let zone = root.join("intel-rapl:0");
    std::fs::create_dir_all(&zone).unwrap();
    std::fs::write(zone.join("name"), "package-0\n").unwrap();
    std::fs::write(zone.join("max_energy_range_uj"), "262143328850\n").unwrap();
    let start = now_ns();
    move || {
        let joules = WATTS * 1e-9 * (now_ns() - start) as f64;
        // Renamed, as a reader must not see half a number.
        std::fs::write(zone.join("next"), format!("{:.0}\n", 1e6 * joules)).unwrap();
        std::fs::rename(zone.join("next"), zone.join("energy_uj")).unwrap();
    }
}
