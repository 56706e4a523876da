//! What a kernel does and how it is launched: the left half of the models' input.

use crate::{Device, DeviceError};

/// More of anything than a launch has: instructions of a thread, blocks, bytes of a load.
const MOST: f64 = 1e15;

/// A kernel and its launch: "Program" of the thesis's Paper I, Table 1, and the program-dependent
/// rows of Hong and Kim 2009, Table 1.
///
/// Instruction counts are averages over threads, so they need not be whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Program {
    /// Instructions of a thread that touch no memory (`i_c`, `#Comp_insts`). At least 0.
    pub compute_instructions: f64,
    /// Memory instructions of a thread whose warp is served by one transaction (`i_mc`,
    /// `#Coal_Mem_insts`). At least 0.
    pub coalesced_loads: f64,
    /// Memory instructions of a thread whose warp needs
    /// [`Device::transactions_per_uncoalesced_load`] transactions (`i_mu`, `#Uncoal_Mem_insts`). At
    /// least 0.
    pub uncoalesced_loads: f64,
    /// Barriers of a thread (`#Synch_insts`). At least 0.
    pub synchronizations: f64,
    /// Bytes that a warp loads by a memory instruction (`Load_bytes_per_warp`): as a rule the bytes
    /// of a thread times the threads of a warp. Above 0.
    pub bytes_per_warp_load: f64,
    /// Threads of a block (`t_b`), a workgroup. At least 1.
    pub threads_per_block: u32,
    /// Blocks of the launch (`b_t`, `#Blocks`). At least 0.
    pub blocks: u64,
    /// Blocks that a core has at once, as far as its resources go (`b_o`, occupancy,
    /// `#Active_blocks_per_SM`). At least 1. [`Device::blocks_per_core`] is the device's bound.
    pub blocks_per_core: u32,
}

/// Why there is no prediction.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A quantity of a program, a workload or a setting is not a number, or out of range. Remedy:
    /// as it says.
    #[error("{field} is {value}, which has to be {range}; see where it was counted or measured")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// The device's parameters are none. Remedy: as the cause says.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// An error unless `value` is finite and within the limits.
pub(crate) fn check(
    field: &'static str,
    value: f64,
    least: f64,
    most: f64,
    range: &'static str,
) -> Result<(), ModelError> {
    // Not `value < least || …`, which a NaN would pass.
    if value >= least && value <= most {
        Ok(())
    } else {
        Err(ModelError::OutOfRange { field, value, range })
    }
}

pub(crate) const COUNT: &str = "between 0 and 1e15";

impl Program {
    /// A program that does nothing: one block of a warp of 32 threads, 128 bytes a load.
    #[must_use]
    pub const fn empty() -> Self {
        Self {
            compute_instructions: 0.0,
            coalesced_loads: 0.0,
            uncoalesced_loads: 0.0,
            synchronizations: 0.0,
            bytes_per_warp_load: 128.0,
            threads_per_block: 32,
            blocks: 1,
            blocks_per_core: 1,
        }
    }

    /// Memory instructions of a thread, of both kinds (`i_m`, `#Mem_insts`).
    #[must_use]
    pub const fn memory_instructions(&self) -> f64 {
        self.coalesced_loads + self.uncoalesced_loads
    }

    /// All instructions of a thread but barriers (`#Total_insts`).
    #[must_use]
    pub const fn total_instructions(&self) -> f64 {
        self.compute_instructions + self.memory_instructions()
    }

    /// Numbers that a model can use.
    ///
    /// # Errors
    /// [`ModelError::OutOfRange`] names the first that is not one.
    pub fn check(&self) -> Result<(), ModelError> {
        check("compute_instructions", self.compute_instructions, 0.0, MOST, COUNT)?;
        check("coalesced_loads", self.coalesced_loads, 0.0, MOST, COUNT)?;
        check("uncoalesced_loads", self.uncoalesced_loads, 0.0, MOST, COUNT)?;
        check("synchronizations", self.synchronizations, 0.0, MOST, COUNT)?;
        check("bytes_per_warp_load", self.bytes_per_warp_load, 1e-3, MOST, "from 0.001 to 1e15")?;
        check("blocks", self.blocks as f64, 0.0, MOST, COUNT)?;
        let one = "at least 1";
        check("threads_per_block", f64::from(self.threads_per_block), 1.0, MOST, one)?;
        check("blocks_per_core", f64::from(self.blocks_per_core), 1.0, MOST, one)
    }
}

/// How a launch fills a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occupancy {
    /// Cores that have a block (`#Active_SMs`).
    pub active_cores: f64,
    /// Blocks that a core has at once: no more than there are (`#Active_blocks_per_SM`).
    pub active_blocks: f64,
    /// Warps that a core has at once (`N`, `#Active_warps_per_SM`, `W_d`).
    pub warps: f64,
    /// How often a core is filled anew (`#Rep`): at least 1, and not rounded, as published; 0
    /// without blocks.
    pub repetitions: f64,
}

impl Occupancy {
    /// Of a launch on a device, which both were checked.
    pub(crate) fn of(device: &Device, program: &Program) -> Self {
        let blocks = program.blocks as f64;
        let active_cores = blocks.min(f64::from(device.cores)).max(1.0);
        // A launch with fewer blocks than fit leaves cores partly empty, which is no shorter
        // repetition: without this bound, half a wave would take half a memory latency.
        let share = (blocks / active_cores).ceil().max(1.0);
        let active_blocks = f64::from(program.blocks_per_core).min(share);
        let warps = (program.threads_per_block.div_ceil(device.warp_size)).max(1);
        let repetitions = if program.blocks == 0 {
            0.0
        } else {
            (blocks / (active_blocks * active_cores)).max(1.0)
        };
        Self { active_cores, active_blocks, warps: active_blocks * f64::from(warps), repetitions }
    }
}
