//! Parameters of the device at hand, measured by small compute kernels with timestamps: what Hong
//! and Kim 2009, section 5.2, and the thesis's Paper I, section 3.1, take from micro-benchmarks.
//!
//! Each number is the slope of a line through the times of runs of growing length, so that what a
//! launch costs by itself does not count. The [`Fit`] tells how well the line fits; where its
//! residual is more than a twentieth, something else used the device, and longer runs are tried, up to five
//! times; the best line counts.

mod fit;
mod runs;

pub use fit::Fit;

use crate::{Device, DeviceError};
use niwaki_trace_vulkan::{DeviceKind, GpuError};
use runs::Runs;

/// How a device is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Memory that is read, bytes: more than the caches hold, and rounded up to a power of two; no
    /// more than the device can bind. Default 64 MiB, 256 MiB on discrete GPUs.
    pub working_set_bytes: Option<u64>,
    /// How often each length is run; the shortest time counts, as everything else that a machine
    /// does makes runs longer. At least 1. Default 5.
    pub repeats: u32,
    /// Lengths of each measurement. At least 3. Default 4.
    pub lengths: u32,
    /// The clock of the cores in GHz, if it is known. Vulkan does not tell. Default `None`: from
    /// [`Settings::alu_latency_cycles`].
    pub clock_ghz: Option<f64>,
    /// Cycles from an integer sum to one that needs it, from which the clock is derived. Default
    /// `None`: 1 for drivers that run on the CPU, 4 for GPUs (NVIDIA's since Volta, and AMD's).
    ///
    /// A wrong one does little harm: seconds depend on cycles and clock only by their ratio.
    pub alu_latency_cycles: Option<f64>,
    /// Cores, if the number is known. Default `None`: what the driver tells, or else the rate of
    /// arithmetic of all workgroups over that of one.
    pub cores: Option<u32>,
    /// Blocks and warps that a core has at once. Default `None`: what the driver tells; 1 block for
    /// drivers that run on the CPU; else 16 blocks and 32 warps, which most GPUs have.
    pub residency: Option<[u32; 2]>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            working_set_bytes: None,
            repeats: 5,
            lengths: 4,
            clock_ghz: None,
            alu_latency_cycles: None,
            cores: None,
            residency: None,
        }
    }
}

/// Where a number is from that Vulkan may not tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Origin {
    /// The caller's settings.
    Given,
    /// The driver.
    Driver,
    /// A measurement.
    Measured,
    /// A guess from the kind of device.
    Assumed,
}

/// A device with the measurements that its parameters are from.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// The parameters.
    pub device: Device,
    /// A load that needs the one before, in seconds (pointer chasing).
    pub latency: Fit,
    /// An integer operation that needs the one before, in seconds. The clock is from this unless it
    /// is given.
    pub chain: Fit,
    /// A multiply-add of a warp with all cores busy, in seconds.
    pub issue: Fit,
    /// The same with one workgroup alone.
    pub issue_alone: Fit,
    /// A coalesced load of a warp on one core, in seconds.
    pub coalesced: Fit,
    /// An uncoalesced load of a warp on one core, in seconds.
    pub uncoalesced: Fit,
    /// A byte with all cores reading, in seconds.
    pub bandwidth: Fit,
    /// Where the clock is from.
    pub clock_from: Origin,
    /// Where the number of cores is from.
    pub cores_from: Origin,
    /// Where the blocks and warps of a core are from.
    pub residency_from: Origin,
    /// Bytes of memory that were read.
    pub working_set_bytes: u64,
}

/// Why a device cannot be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MicrobenchError {
    /// The device has no clock that kernels can be timed by. Remedy: another device, or a table
    /// from its maker's data.
    #[error(
        "{device} has no timestamps, so kernels cannot be timed on it; use another device, or write its table by hand"
    )]
    NoTimestamps {
        /// The device.
        device: String,
    },
    /// Longer runs took no longer. Remedy: measure on a machine that is idle, with more repeats.
    #[error(
        "{what}: longer runs took no longer ({slope_s} s each); measure again on an idle machine, with more repeats"
    )]
    NoSlope {
        /// What was measured.
        what: &'static str,
        /// The slope that came out, in seconds.
        slope_s: f64,
    },
    /// The device failed. Remedy: as the cause says.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// What came out is no device. Remedy: give settings that are possible.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// Measures a device. Takes a second or two, some more where others use it.
///
/// ```no_run
/// use niwaki_gpu_model::microbench::{Settings, measure};
///
/// let device = niwaki_trace_vulkan::Device::new()?;
/// let measured = measure(&device, &Settings::default())?;
/// measured.device.save("my-device.toml")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`MicrobenchError`].
pub fn measure(
    gpu: &niwaki_trace_vulkan::Device,
    settings: &Settings,
) -> Result<Measured, MicrobenchError> {
    let info = gpu.info();
    if info.timestamp_ns == 0.0 {
        return Err(MicrobenchError::NoTimestamps { device: info.name.clone() });
    }
    let is_cpu = info.kind == DeviceKind::Cpu;
    let warp = info.subgroup_size.max(1);
    let mut runs = Runs::new(gpu, settings)?;
    let chain = runs.chain()?;
    let issue_alone = runs.issue(1)?;
    // Enough workgroups for any device; as many waves of them as it takes.
    let groups = if is_cpu { 64 } else { 4096 };
    let issue = runs.issue(groups)?;
    let latency = runs.latency()?;
    let coalesced = runs.loads("coalesced")?;
    let uncoalesced = runs.loads("uncoalesced")?;
    let bandwidth = runs.bandwidth(groups)?;

    let (clock_ghz, clock_from) = match settings.clock_ghz {
        Some(clock) => (clock, Origin::Given),
        None => {
            let cycles = settings.alu_latency_cycles.unwrap_or(if is_cpu { 1.0 } else { 4.0 });
            (cycles / chain.slope_s * 1e-9, Origin::Measured)
        }
    };
    // An instruction of a warp, by one workgroup and by all.
    let rates = issue_alone.slope_s / issue.slope_s;
    let (cores, cores_from) = match (settings.cores, info.multiprocessors) {
        (Some(cores), _) => (cores, Origin::Given),
        (None, Some([cores, _])) => (cores, Origin::Driver),
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, and is at least 1"
        )]
        (None, None) => (rates.round().max(1.0) as u32, Origin::Measured),
    };
    let warps_of_largest = info.max_group_invocations.div_ceil(warp).max(1);
    let ([blocks, warps], residency_from) = match (settings.residency, info.multiprocessors) {
        (Some(residency), _) => (residency, Origin::Given),
        // A core has at least a workgroup of half as many blocks as warps.
        (None, Some([_, warps])) => ([(warps / 2).max(1), warps], Origin::Driver),
        (None, None) if is_cpu => ([1, warps_of_largest], Origin::Assumed),
        (None, None) => ([16, 32], Origin::Assumed),
    };
    let cycles = |seconds: f64| seconds * clock_ghz * 1e9;
    let device = Device {
        name: info.name.clone(),
        source: format!(
            "micro-benchmarks of niwaki-gpu-model {}; driver {}, Vulkan {}.{}.{}; {} MiB read; residuals: latency {:.3}, chain {:.3}, issue {:.3}, coalesced {:.3}, uncoalesced {:.3}, bandwidth {:.3}",
            env!("CARGO_PKG_VERSION"),
            info.driver,
            info.api[0],
            info.api[1],
            info.api[2],
            runs.bytes() >> 20,
            latency.residual,
            chain.residual,
            issue.residual,
            coalesced.residual,
            uncoalesced.residual,
            bandwidth.residual,
        ),
        clock_ghz,
        bandwidth_gb_s: 1e-9 / bandwidth.slope_s,
        cores,
        warp_size: warp,
        // All cores issue at once, so each has as many times longer for an instruction.
        issue_cycles: cycles(issue.slope_s) * f64::from(cores),
        memory_latency_cycles: cycles(latency.slope_s),
        departure_delay_coalesced_cycles: cycles(coalesced.slope_s),
        departure_delay_uncoalesced_cycles: cycles(uncoalesced.slope_s) / f64::from(warp),
        transactions_per_uncoalesced_load: f64::from(warp),
        max_blocks_per_core: blocks,
        max_warps_per_core: warps,
    };
    device.check()?;
    Ok(Measured {
        device,
        latency,
        chain,
        issue,
        issue_alone,
        coalesced,
        uncoalesced,
        bandwidth,
        clock_from,
        cores_from,
        residency_from,
        working_set_bytes: runs.bytes(),
    })
}
