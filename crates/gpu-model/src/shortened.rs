//! The thesis's shortened form of the model: Paper I, section 3, equations 1 to 4 and Tables 1 to 3.
//!
//! It is [`crate::hong_kim`] without barriers, with the cases told apart by MWP and CWP alone, and
//! with one sum for all of them: `c_t = b_t/(b_o·D_c)·(C_i·w_t·(i_c + i_m) + c_b)`.

use crate::{
    Device,
    hong_kim::{Case, Parallelism},
    program::{ModelError, Occupancy, Program},
};

/// A prediction by the shortened form, with all that led to it. Symbols are the paper's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// `w_c`, equation 1: warps that could compute while one waits; 1 without loads.
    pub warps_computing: f64,
    /// `w_md`, equation 2: warps whose loads leave during one latency; ∞ without loads.
    pub warps_by_departure: f64,
    /// `w_mb`, equation 3: warps of a core that the bandwidth feeds; ∞ without loads.
    pub warps_by_bandwidth: f64,
    /// `W_d`: warps that a core has at once.
    pub warps: f64,
    /// MWP: the least of `w_md`, `w_mb` and `W_d`.
    pub mwp: f64,
    /// CWP: the lesser of `w_c` and `W_d`.
    pub cwp: f64,
    /// What bounds the kernel: "arithmetic" is [`Case::Compute`].
    pub case: Case,
    /// `w_t` of Table 3.
    pub compute_warps: f64,
    /// `c_b` of Table 3, cycles.
    pub memory_cycles_per_block: f64,
    /// `c_t`, equation 4: cycles.
    pub cycles: f64,
    /// Seconds, by the device's clock.
    pub seconds: f64,
}

/// How long a launch takes. Barriers are free.
///
/// # Errors
/// [`ModelError`] if a number of either is not one that a launch or a device can have.
pub fn predict(device: &Device, program: &Program) -> Result<Prediction, ModelError> {
    let shared = Parallelism::of(device, program)?;
    let Occupancy { warps, repetitions, .. } = shared.occupancy;
    let (mwp, cwp) = (shared.mwp, shared.cwp);
    let i_m = program.memory_instructions();
    let c_m = shared.memory_cycles;
    let others = (mwp - 1.0).max(0.0);
    let (case, compute_warps, memory_cycles_per_block) = if i_m <= 0.0 {
        (Case::Compute, warps, 0.0)
    } else if mwp >= warps && cwp >= warps {
        (Case::Balanced, others / i_m + 1.0, c_m)
    } else if cwp >= mwp {
        (Case::Memory, others / i_m, warps * c_m / mwp)
    } else {
        (Case::Compute, warps, shared.latency)
    };
    let issued = device.issue_cycles * compute_warps * program.total_instructions();
    let cycles = repetitions * (issued + memory_cycles_per_block);
    Ok(Prediction {
        warps_computing: shared.cwp_full,
        warps_by_departure: shared.mwp_departure,
        warps_by_bandwidth: shared.mwp_bandwidth,
        warps,
        mwp,
        cwp,
        case,
        compute_warps,
        memory_cycles_per_block,
        cycles,
        seconds: cycles / (device.clock_ghz * 1e9),
    })
}
